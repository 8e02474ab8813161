"""Verbs run and score: fly a scenario, or measure a recording."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from airflock.cli import options, tables
from airflock.cli.progress import counted
from airflock.support.suffixes import PICTURES, RECORDINGS, TABLES

Scores = Mapping[str, Any]  # order parameters, or keys with their values, by name


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
    from airflock.engine import picked
    from airflock.runs.executors.scores import scores

    asked = options.asked(ctx)
    asked.read(options.writable, (save, RECORDINGS), (plot, PICTURES))
    changed = options.changed(asked, changes, agents, duration)
    found = options.loaded(asked, scenario, changed, law, trust=trust)
    numbers = asked.read(options.seeds_of, first_seed, seeds)
    asked.read(options.sound_flying, device, precision, scheduler)
    asked.refuse()
    tables.say_notes(found.notes)
    flights = [found] * seeds
    if scheduler is None:
        device = picked(flights, device, precision=precision, say=tables.say)
        options.tell_time(flights, threads, device)
        options.compile_first(found, precision, device)
    chosen: dict[str, Any] = {"scheduler": scheduler, "threads": threads, "precision": precision, "device": device}
    with counted(f"{found.name}: flights", seeds, quiet=as_json) as done:
        rows = scores(flights, numbers, **chosen, done=done)
    _tell(found, numbers, rows, changed, as_json)
    if save or plot:  # after the scores, which a full disk does not take away
        _record(found, numbers, precision, device, save, plot)


def _tell(scenario: Any, numbers: Sequence[int], rows: Sequence[Scores], changed: Scores, as_json: bool) -> None:
    """Print what flights came to, beside the paper's figures; changed : keys that are not as in the file."""
    from airflock.parts.metrics.registry import reports
    from airflock.recordings.rare import remarks, upper_bound

    seeds = len(numbers)
    if as_json:
        from airflock.recordings.flights import plain

        runs = [{"seed": seed, **row} for seed, row in zip(numbers, rows, strict=True)]
        bound = upper_bound(sum(row.get("n_coll", 0.0) > 0.0 for row in rows), seeds)
        bounds = {"collision_bound": bound} if seeds > 1 and "n_coll" in rows[0] else {}
        result = {"scenario": {"name": scenario.name, **plain(scenario.document)}, "seeds": seeds, "runs": runs}
        tables.emit_json({**result, **tables.statistics(rows), **bounds})
        return
    count = f"{seeds} flights" if seeds > 1 else f"seed {numbers[0]}"
    title = f"{scenario.name}: {scenario.agents} agents, {scenario.flight.duration:g} s, {count}"
    published = {} if changed else scenario.published
    tables.score_table(title, rows, published, reports(scenario.measures))
    for remark in remarks(rows, numbers):
        tables.say(remark)


def _record(
    scenario: Any, numbers: Sequence[int], precision: int, device: str, save: Path | None, plot: Path | None
) -> None:
    """Fly again with the trajectories kept (the same bits), and write what was asked for."""
    from airflock.recordings.files import save as save_recording
    from airflock.recordings.flights import simulate

    for seed in numbers if save else numbers[:1]:
        recording = simulate(scenario, seed, precision=precision, device=device)
        if save:
            many = len(numbers) > 1
            path = save.with_name(f"{save.stem}-seed{seed}{save.suffix}") if many else save
            tables.say(f"saved {save_recording(recording, path)}")
        if plot and seed == numbers[0]:
            from airflock.view.plots.save import save_figure
            from airflock.view.plots.trajectories import trajectories

            save_figure(trajectories(recording), plot)
            tables.say(f"saved {plot}")


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
    from airflock.recordings.isolated import Opening

    options.writable((series, TABLES))
    changed = options.settings(changes)
    if body_length is not None:
        from airflock.recordings.lengths import in_bodies

        changed = in_bodies(body_length) | changed
    with Opening(files[0]) as first:  # another process opens it while this one imports
        if groups:
            _tell_groups([first, *files[1:]], files, changed, trust, as_json)
            return
        measured = [
            _measured(source, path, changed, trust, aero)
            for source, path in zip([first, *files[1:]], files, strict=True)
        ]
        if series is not None:
            _save_series(measured, series)
        _tell_measured(measured, as_json)


def _tell_groups(what: Sequence[Any], files: Sequence[Path], changed: Scores, trust: bool, as_json: bool) -> None:
    """Measure the groups of recordings, and print what was found."""
    from airflock.parts.metrics.registry import reports
    from airflock.recordings.files import load_recording
    from airflock.recordings.flown_scenario import scenario_of
    from airflock.recordings.groups import BETWEEN, group_scores

    runs = []
    for source, path in zip(what, files, strict=True):
        recording = load_recording(source)
        about = reports(scenario_of(recording, changed, trust=trust).measures) | BETWEEN
        table = group_scores(recording, changed, trust=trust)
        rows = {str(name): row.dropna().to_dict() for name, row in table.iterrows()}
        runs.append({"file": str(path), "groups": rows})
        if not as_json:
            for name, row in rows.items():
                tables.score_table(f"{path}: {name}", [row], {}, about)
    if as_json:
        tables.emit_json({"runs": runs})


class Measured(NamedTuple):
    """One recording, measured.

    values, course : order parameters, and a table of them over time; about : unit and meaning of each by name
    faults   : what befell its agents; not_told : order parameters for want of a length, with the keys that they need
    coarse   : what to know of order parameters that a flight looks at between its frames, if anything
    """

    path: Path
    values: Scores
    course: Any
    about: Mapping[str, tuple[str, str]]
    faults: Any
    not_told: Any
    coarse: str


def _measured(source: Any, path: Path, changed: Scores, trust: bool, aero: bool) -> Measured:
    """Measure a recording; source : its path, or the Opening that reads it; changed : keys of how it is measured."""
    from airflock.parts.metrics.registry import reports
    from airflock.recordings.attributes import faults
    from airflock.recordings.files import load_recording
    from airflock.recordings.flown_scenario import aero_settings, scenario_of
    from airflock.recordings.scores import between_frames, measure, not_told

    recording = load_recording(source)
    settings = aero_settings(recording, changed) if aero else changed
    values, course = measure(recording, settings, trust=trust)
    scenario = scenario_of(recording, settings, trust=trust)
    untold, coarse = not_told(recording, scenario, settings), between_frames(recording, scenario)
    return Measured(path, values, course, reports(scenario.measures), faults(recording), untold, coarse)


def _save_series(measured: Sequence[Measured], path: Path) -> None:
    """Write order parameters over time of all recordings as one table."""
    import io

    import pandas as pd

    from airflock.support import atomic

    text = io.StringIO()
    pd.concat([each.course.assign(file=str(each.path)) for each in measured]).to_csv(text)
    atomic.write(path, text.getvalue())
    tables.say(f"saved {path}")


def _tell_measured(measured: Sequence[Measured], as_json: bool) -> None:
    """Print order parameters of recordings, what befell their agents, and what could not be measured."""
    from airflock.recordings.attributes import told_faults
    from airflock.recordings.lengths import told as told_unsaid

    rows = [each.values for each in measured]
    if as_json:
        runs = [
            {
                "file": str(each.path),
                **each.values,
                **({"faults": each.faults} if each.faults else {}),
                **({"not_told": each.not_told} if each.not_told else {}),
            }
            for each in measured
        ]
        tables.emit_json({"runs": runs, **tables.statistics(rows)})
        return
    about = {name: entry for each in measured for name, entry in each.about.items()}
    tables.score_table(", ".join(str(each.path) for each in measured), rows, {}, about)
    for each in measured:
        if each.faults:
            tables.say(f"{each.path}: {told_faults(each.faults)}")
    for each in measured:
        if each.not_told:
            tables.say(f"{each.path}: {told_unsaid(each.not_told)}")
        if each.coarse:
            tables.say(f"{each.path}: {each.coarse}")
