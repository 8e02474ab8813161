"""Verbs run and score: fly a scenario, or measure a recording."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from airflock.cli import options, tables
from airflock.cli.progress import counting_parts
from airflock.support import PICTURES, RECORDINGS, TABLES

ScoreValues = Mapping[str, Any]  # order parameters, or keys with their values, by name


def run(
    ctx: typer.Context,
    scenario: options.Where,
    seeds: options.Seeds = 1,
    first_seed: options.FirstSeed = 0,
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
    threads: options.Threads = None,
    precision: options.Precision = 32,
    device: options.Device = "cpu",
    scheduler: options.Scheduler = None,
    as_json: options.Json = False,
    save: options.SaveFile = None,
    plot: options.PlotFile = None,
) -> None:
    """Fly a scenario and print its order parameters, next to those of the paper if it gives any.

    Example: airflock run vasarhelyi_2018/4ms --seeds 20 --set radio.delay=0.5 --plot flight.png
    """
    from airflock.engine import pick_device
    from airflock.runs import score_scenarios

    asked = options.collect_option_errors(ctx)
    asked.read(options.check_writable, (save, RECORDINGS), (plot, PICTURES))
    changed = options.collect_settings(asked, changes, agents, duration)
    found = options.collect_scenario(asked, scenario, changed, law, trust=trust)
    numbers = asked.read(options.seeds_from, first_seed, seeds)
    asked.read(options.check_flight_options, device, precision, scheduler)
    asked.raise_errors()
    tables.print_notes(found.notes)
    flights = [found] * seeds
    if scheduler is None:
        device = pick_device(flights, device, precision=precision, notify=tables.print_message)
        options.announce_run_time(flights, threads, device)
        options.compile_before_bar(found, precision, device)
    chosen: dict[str, Any] = {"scheduler": scheduler, "threads": threads, "precision": precision, "device": device}
    with counting_parts(f"{found.name}: flights", seeds, quiet=as_json) as done:
        rows = score_scenarios(flights, numbers, **chosen, on_done=done)
    _print_scores(found, numbers, rows, changed, as_json)
    if save or plot:  # after the scores, which a full disk does not take away
        _record(found, numbers, precision, device, save, plot)


def _print_scores(
    scenario: Any, numbers: Sequence[int], rows: Sequence[ScoreValues], changed_keys: ScoreValues, as_json: bool
) -> None:
    """Print what flights came to, beside the paper's figures; changed : keys that are not as in the file."""
    from airflock.parts.metrics import reported_values
    from airflock.recordings import rare_event_notes, upper_probability_bound

    seeds = len(numbers)
    if as_json:
        from airflock.recordings import to_plain_values

        runs = [{"seed": seed, **row} for seed, row in zip(numbers, rows, strict=True)]
        bound = upper_probability_bound(sum(row.get("n_coll", 0.0) > 0.0 for row in rows), seeds)
        bounds = {"collision_bound": bound} if seeds > 1 and "n_coll" in rows[0] else {}
        result = {
            "scenario": {"name": scenario.name, **to_plain_values(scenario.document)},
            "seeds": seeds,
            "runs": runs,
        }
        tables.print_json({**result, **tables.column_statistics(rows), **bounds})
        return
    count = f"{seeds} flights" if seeds > 1 else f"seed {numbers[0]}"
    title = f"{scenario.name}: {scenario.agents} agents, {scenario.flight.duration:g} s, {count}"
    published = {} if changed_keys else scenario.published
    tables.print_score_table(title, rows, published, reported_values(scenario.measures))
    for remark in rare_event_notes(rows, numbers):
        tables.print_message(remark)


def _record(
    scenario: Any, numbers: Sequence[int], precision: int, device: str, save: Path | None, plot: Path | None
) -> None:
    """Fly again with the trajectories kept (the same bits), and write what was asked for."""
    from airflock.recordings import save as save_recording, simulate

    for seed in numbers if save else numbers[:1]:
        recording = simulate(scenario, seed, precision=precision, device=device)
        if save:
            many = len(numbers) > 1
            path = save.with_name(f"{save.stem}-seed{seed}{save.suffix}") if many else save
            tables.print_message(f"saved {save_recording(recording, path)}")
        if plot and seed == numbers[0]:
            from airflock.view import save_figure, trajectories

            save_figure(trajectories(recording), plot)
            tables.print_message(f"saved {plot}")


def score(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE.nc...", help="Recordings to measure.", show_default=False)
    ],
    changes: options.Set = None,
    trust: options.Trust = False,
    as_json: options.Json = False,
    series: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="Also write the order parameters over time.")
    ] = None,
    aero: Annotated[
        bool,
        typer.Option(
            "--aero",
            help="Measure the power saved by flying in each other's upwash; set the wing with --set wing.span=...",
        ),
    ] = False,
    groups: Annotated[
        bool, typer.Option("--groups", help="Measure each group of the scenario, and each pair of groups.")
    ] = False,
    body_length: Annotated[
        float | None,
        typer.Option(metavar="METRES", help="For tracks: length of a body, which sets what counts as near."),
    ] = None,
) -> None:
    """Measure recordings, simulated or flown, with the same order parameters.

    Tracks have no scenario: what depends on a length (collisions, clusters) is shown only if you give it.

    Example: airflock score fish.nc --body-length 0.04 --series course.csv
    """
    from airflock.recordings import ReaderProcess

    options.check_writable((series, TABLES))
    changed = options.parse_settings(changes)
    if body_length is not None:
        from airflock.recordings import body_length_settings

        changed = body_length_settings(body_length) | changed
    with ReaderProcess(files[0]) as first:  # another process opens it while this one imports
        if groups:
            _print_group_scores([first, *files[1:]], files, changed, trust, as_json)
            return
        measured = [
            _measured(source, path, changed, trust, aero)
            for source, path in zip([first, *files[1:]], files, strict=True)
        ]
        if series is not None:
            _save_series(measured, series)
        _print_measured(measured, as_json)


def _print_group_scores(
    sources: Sequence[Any], files: Sequence[Path], changed: ScoreValues, trust: bool, as_json: bool
) -> None:
    """Measure the groups of recordings, and print what was found."""
    from airflock.parts.metrics import reported_values
    from airflock.recordings import PAIR_METRICS, group_scores, load_recording, scenario_of_recording

    runs = []
    for source, path in zip(sources, files, strict=True):
        recording = load_recording(source)
        about = reported_values(scenario_of_recording(recording, changed, trust=trust).measures) | PAIR_METRICS
        table = group_scores(recording, changed, trust=trust)
        rows = {str(name): row.dropna().to_dict() for name, row in table.iterrows()}
        runs.append({"file": str(path), "groups": rows})
        if not as_json:
            for name, row in rows.items():
                tables.print_score_table(f"{path}: {name}", [row], {}, about)
    if as_json:
        tables.print_json({"runs": runs})


class MeasuredRecording(NamedTuple):
    """One recording, measured.

    values, course : order parameters, and a table of them over time; about : unit and meaning of each by name
    faults   : what befell its agents; not_told : order parameters for want of a length, with the keys that they need
    coarse   : what to know of order parameters that a flight looks at between its frames, if anything
    """

    path: Path
    values: ScoreValues
    score_series: Any
    about: Mapping[str, tuple[str, str]]
    faults: Any
    unmeasured: Any
    frame_note: str


def _measured(source: Any, path: Path, changed: ScoreValues, trust: bool, aero: bool) -> MeasuredRecording:
    """Measure a recording; source : its path, or the Opening that reads it; changed : keys of how it is measured."""
    from airflock.parts.metrics import reported_values
    from airflock.recordings import (
        between_frames_note,
        load_recording,
        measure_recording,
        power_settings,
        recorded_faults,
        scenario_of_recording,
        undefined_metrics_of,
    )

    recording = load_recording(source)
    settings = power_settings(recording, changed) if aero else changed
    values, course = measure_recording(recording, settings, trust=trust)
    scenario = scenario_of_recording(recording, settings, trust=trust)
    untold, coarse = undefined_metrics_of(recording, scenario, settings), between_frames_note(recording, scenario)
    return MeasuredRecording(
        path, values, course, reported_values(scenario.measures), recorded_faults(recording), untold, coarse
    )


def _save_series(measured: Sequence[MeasuredRecording], path: Path) -> None:
    """Write order parameters over time of all recordings as one table."""
    import io

    import pandas as pd

    from airflock.support import atomic

    text = io.StringIO()
    pd.concat([each.score_series.assign(file=str(each.path)) for each in measured]).to_csv(text)
    atomic.write_file(path, text.getvalue())
    tables.print_message(f"saved {path}")


def _print_measured(measured: Sequence[MeasuredRecording], as_json: bool) -> None:
    """Print order parameters of recordings, what befell their agents, and what could not be measured."""
    from airflock.recordings import faults_line, missing_lengths_note as told_unsaid

    rows = [each.values for each in measured]
    if as_json:
        runs = [
            {
                "file": str(each.path),
                **each.values,
                **({"faults": each.faults} if each.faults else {}),
                **({"not_told": each.unmeasured} if each.unmeasured else {}),
            }
            for each in measured
        ]
        tables.print_json({"runs": runs, **tables.column_statistics(rows)})
        return
    about = {name: entry for each in measured for name, entry in each.about.items()}
    tables.print_score_table(", ".join(str(each.path) for each in measured), rows, {}, about)
    for each in measured:
        if each.faults:
            tables.print_message(f"{each.path}: {faults_line(each.faults)}")
    for each in measured:
        if each.unmeasured:
            tables.print_message(f"{each.path}: {told_unsaid(each.unmeasured)}")
        if each.frame_note:
            tables.print_message(f"{each.path}: {each.frame_note}")
