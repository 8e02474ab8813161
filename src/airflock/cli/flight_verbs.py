"""Verbs run, score, sweep, plot, video, replay, display and watch: fly a scenario, and look at flights."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from airflock.cli import options, terminal
from airflock.cli.terminal import counting_parts
from airflock.support import (
    INVALID,
    PAGES,
    PICTURES,
    RECORDINGS,
    TABLES,
    VIDEOS,
    ErrorCollector,
    ScenarioError,
    StudioError,
    collect_errors,
)

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

    errors = options.collect_option_errors(ctx)
    errors.read(options.check_writable, (save, RECORDINGS), (plot, PICTURES))
    changed = options.collect_settings(errors, changes, agents, duration)
    found = options.collect_scenario(errors, scenario, changed, law, trust=trust)
    numbers = errors.read(options.seeds_from, first_seed, seeds)
    errors.read(options.check_flight_options, device, precision, scheduler)
    errors.raise_errors()
    terminal.print_notes(found.notes)
    flights = [found] * seeds
    if scheduler is None:
        device = pick_device(flights, device, precision=precision, notify=terminal.print_message)
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
    """Print the scores of flights, beside the paper's; changed : keys that are not as in the file."""
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
        terminal.print_json({**result, **terminal.column_statistics(rows), **bounds})
        return
    count = f"{seeds} flights" if seeds > 1 else f"seed {numbers[0]}"
    title = f"{scenario.name}: {scenario.agents} agents, {scenario.flight.duration:g} s, {count}"
    published = {} if changed_keys else scenario.published
    terminal.print_score_table(title, rows, published, reported_values(scenario.metrics.rule))
    for remark in rare_event_notes(rows, numbers):
        terminal.print_message(remark)


def _record(
    scenario: Any, numbers: Sequence[int], precision: int, device: str, save: Path | None, plot: Path | None
) -> None:
    """Fly again with the trajectories kept (the same bits), and write the requested files."""
    from airflock.recordings import save as save_recording, simulate

    for seed in numbers if save else numbers[:1]:
        recording = simulate(scenario, seed, precision=precision, device=device)
        if save:
            many = len(numbers) > 1
            path = save.with_name(f"{save.stem}-seed{seed}{save.suffix}") if many else save
            terminal.print_message(f"saved {save_recording(recording, path)}")
        if plot and seed == numbers[0]:
            from airflock.view import save_figure, trajectories

            save_figure(trajectories(recording), plot)
            terminal.print_message(f"saved {plot}")


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
    """Measure the groups of recordings, and print the results."""
    from airflock.parts.metrics import reported_values
    from airflock.recordings import PAIR_METRICS, group_scores, load_recording, scenario_of_recording

    runs = []
    for source, path in zip(sources, files, strict=True):
        recording = load_recording(source)
        about = reported_values(scenario_of_recording(recording, changed, trust=trust).metrics.rule) | PAIR_METRICS
        table = group_scores(recording, changed, trust=trust)
        rows = {str(name): row.dropna().to_dict() for name, row in table.iterrows()}
        runs.append({"file": str(path), "groups": rows})
        if not as_json:
            for name, row in rows.items():
                terminal.print_score_table(f"{path}: {name}", [row], {}, about)
    if as_json:
        terminal.print_json({"runs": runs})


class MeasuredRecording(NamedTuple):
    """One recording, measured.

    values, course : order parameters, and a table of them over time; about : unit and meaning of each by name
    faults   : of its agents; not_told : order parameters for want of a length, with the keys that they need
    notes    : what decides who is near, and what a flight looks at between its frames; empty where nothing does
    """

    path: Path
    values: ScoreValues
    score_series: Any
    about: Mapping[str, tuple[str, str]]
    faults: Any
    unmeasured: Any
    notes: list[str]


def _measured(source: Any, path: Path, changed: ScoreValues, trust: bool, aero: bool) -> MeasuredRecording:
    """Measure a recording; source : its path, or the Opening that reads it; changed : keys of how it is measured."""
    from airflock.parts.metrics import reported_values
    from airflock.recordings import (
        PRESENCE_METRICS,
        between_frames_note,
        load_recording,
        measure_recording,
        nearness_note,
        power_settings,
        recorded_faults,
        scenario_of_recording,
        undefined_metrics_of,
    )

    recording = load_recording(source)
    settings = power_settings(recording, changed) if aero else changed
    values, course = measure_recording(recording, settings, trust=trust)
    scenario = scenario_of_recording(recording, settings, trust=trust)
    untold = undefined_metrics_of(recording, scenario, settings)
    notes = [nearness_note(recording, scenario, values), between_frames_note(recording, scenario)]
    about = reported_values(scenario.metrics.rule) | PRESENCE_METRICS
    return MeasuredRecording(path, values, course, about, recorded_faults(recording), untold, notes)


def _save_series(measured: Sequence[MeasuredRecording], path: Path) -> None:
    """Write order parameters over time of all recordings as one table."""
    import io

    import pandas as pd

    from airflock.support import atomic

    text = io.StringIO()
    pd.concat([each.score_series.assign(file=str(each.path)) for each in measured]).to_csv(text)
    atomic.write_file(path, text.getvalue())
    terminal.print_message(f"saved {path}")


def _print_measured(measured: Sequence[MeasuredRecording], as_json: bool) -> None:
    """Print order parameters of recordings, faults of their agents, and order parameters that could not be
    measured.
    """
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
        terminal.print_json({"runs": runs, **terminal.column_statistics(rows)})
        return
    about = {name: entry for each in measured for name, entry in each.about.items()}
    terminal.print_score_table(", ".join(str(each.path) for each in measured), rows, {}, about)
    for each in measured:
        if each.faults:
            terminal.print_message(f"{each.path}: {faults_line(each.faults)}")
    for each in measured:
        if each.unmeasured:
            terminal.print_message(f"{each.path}: {told_unsaid(each.unmeasured)}")
        for note in filter(None, each.notes):
            terminal.print_message(f"{each.path}: {note}")


MAX_GRID_POINTS = 100_000  # of one key, and points of a whole grid


def sweep(
    ctx: typer.Context,
    scenario: Annotated[
        str | None,
        typer.Argument(
            metavar="PRESET|FILE", help="A preset or a scenario file; none to --resume a folder.", show_default=False
        ),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="KEY=VALUES",
            help="Values to fly, as a list a,b,c or a range low:high:count; repeat for a grid.",
            show_default=False,
        ),
    ] = None,
    seeds: options.Seeds = 5,
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
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder that keeps every flight as it lands.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the sweep in the folder.")] = False,
    table: Annotated[Path | None, typer.Option(metavar="FILE.csv", help="Write one row per flight.")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw a heat map (two keys) or a line (one key).")
    ] = None,
    show: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Order parameter to show.", show_default="fitness, quality or polarisation"),
    ] = None,
) -> None:
    """Fly a scenario over a grid of values and tabulate the order parameters.

    Example: airflock sweep vasarhelyi_2018/32ms --over radio.delay=0:2:5 --over radio.range=80,160,320 --plot map.png
    """
    from airflock.recordings import fly_sweep, make_sweep, metric_to_show, resumed_sweep

    errors = options.collect_option_errors(ctx)
    errors.read(options.check_writable, (table, TABLES), (plot, PICTURES))
    fixed = options.collect_settings(errors, changes, agents, duration)
    if scenario is None and (out is None or not resume):
        errors.note("sweep: give a scenario and --over, or --out DIR --resume")
    elif scenario is None:
        made = errors.read(resumed_sweep, out, trust=trust, over=over, settings=fixed, law=law)
    else:
        axes = _axes(over or [], plot, errors)
        numbers = errors.read(options.seeds_from, first_seed, seeds)
        made = errors.read(make_sweep, scenario, axes, numbers, fixed, law, precision, device, trust=trust)
    name = errors.read(lambda found: metric_to_show(show, found.scenarios), made) if scenario or resume else ""
    errors.read(options.check_flight_options, device, precision, scheduler)
    errors.raise_errors()
    terminal.print_notes(merge_similar_notes(dict.fromkeys(note for found in made.scenarios for note in found.notes)))
    if scheduler is None:
        options.announce_run_time([found for found in made.scenarios for _ in made.seeds], threads, device)
        options.compile_before_bar(made.scenarios[0], made.precision, device)
    with counting_parts(f"{made.scenario.name}: flights", len(made.points) * len(made.seeds), quiet=as_json) as done:
        tidy = fly_sweep(
            made, out=out, resume=resume, threads=threads, on_done=done, scheduler=scheduler,
            notify=terminal.print_message,
        )  # fmt: skip
    _keep(tidy, list(made.over), name, made.scenarios[0], table, plot)
    if as_json:
        terminal.print_json({"scenario": made.scenario.name, "seeds": len(made.seeds), "runs": tidy.to_dict("records")})
    else:
        _print_sweep(tidy, list(made.over), name)


def _axes(over: list[str], plot: Path | None, errors: ErrorCollector) -> dict[str, list[Any]]:
    """Return the swept keys with their values; unreadable ones are noted as errors."""
    axes = [found for text in over if (found := errors.read(parse_axis, text)) is not INVALID]
    errors.read(check_distinct_keys, [text.partition("=")[0].strip() for text in over], plot)
    return errors.read(_bounded, axes)


def _bounded(axes: list[tuple[str, list[Any]]]) -> dict[str, list[Any]]:
    """Return the axes of a grid that is not too large."""
    size = math.prod(len(values) for _, values in axes)
    if size > MAX_GRID_POINTS:
        raise ScenarioError([f"--over: a grid of {size} points is more than {MAX_GRID_POINTS}"])
    return dict(axes)


def _keep(tidy: Any, keys: list[str], show: str, scenario: Any, table: Path | None, plot: Path | None) -> None:
    """Write the requested table and picture."""
    if table is not None:
        from airflock.support import atomic

        atomic.write_file(table, tidy.to_csv(index=False))
        terminal.print_message(f"saved {table}")
    if plot is not None:
        from airflock.view import heatmap, save_figure

        save_figure(heatmap(tidy, keys, show, scenario=scenario), plot)
        terminal.print_message(f"saved {plot}")


def merge_similar_notes(notes: Iterable[str]) -> Iterator[str]:
    """Return the first of all notes that differ in numbers alone, and how many are similar."""
    kinds: dict[str, list[str]] = {}
    for note in notes:
        kinds.setdefault(re.sub(r"[-+]?\d[\d.e+-]*", "", note), []).append(note)
    for first, *more in kinds.values():
        yield f"{first} ({len(more)} more like it)" if more else first


def check_distinct_keys(keys: Sequence[str], plot: Path | None) -> None:
    """Refuse a key that is swept twice, and a picture of more keys than it has axes."""
    errors = [f"--over {key}: given {keys.count(key)} times; give all its values in one --over" for key in keys]
    errors = [error for error, key in zip(errors, keys, strict=True) if keys.count(key) > 1]
    if plot is not None and len(set(keys)) > 2:
        errors.append(f"--plot {plot}: a picture shows 1 or 2 keys, not {len(set(keys))}; leave it out, or sweep fewer")
    if errors:
        raise ScenarioError(list(dict.fromkeys(errors)))


def parse_axis(text: str, option: str = "--over") -> tuple[str, list[Any]]:
    """Parse KEY=a,b,c or KEY=low:high:count into key and values."""
    key, equals, values = text.partition("=")
    key = key.strip()
    parts = values.split(":")
    if equals and len(parts) == 3:
        try:
            low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
        except ValueError as error:
            raise ScenarioError([f"{option} {text}: write low:high:count, for instance radio.delay=0:2:5"]) from error
        if not 1 <= count <= MAX_GRID_POINTS:
            raise ScenarioError([f"{option} {text}: the count lies outside [1, {MAX_GRID_POINTS}]"])
        step = (high - low) / max(count - 1, 1)
        return key, [low + step * i for i in range(count)]
    if not equals or not values or len(parts) == 2:
        raise ScenarioError([f"{option} {text}: write KEY=a,b,c or KEY=low:high:count"])
    numbers = [options.parse_option_value(part, f"{option} {key}") for part in values.split(",")]
    if any(isinstance(value, (dict, list)) for value in numbers):
        raise ScenarioError([f"{option} {text}: a table or a list cannot be swept; give numbers or choices"])
    return key, numbers


def _print_sweep(tidy: Any, keys: list[str], show: str) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    grouped = tidy.groupby(keys, sort=False)[show].agg(["mean", "std", "median", "count"]).reset_index()
    table = Table(title=f"{show} (mean ± sd over seeds)", box=box.SIMPLE_HEAD, title_justify="left")
    for name in (*keys, show, "median", "flights"):
        table.add_column(name, justify="right")
    for row in grouped.to_dict("records"):
        spread = "" if row["count"] < 2 else f" ± {row['std']:.2g}"
        cells = [str(row[key]) if isinstance(row[key], str) else f"{row[key]:g}" for key in keys]
        table.add_row(*cells, f"{row['mean']:.4g}{spread}", f"{row['median']:.4g}", str(row["count"]))
    Console().print(table)


class PictureKind(StrEnum):
    """Kinds of picture."""

    TRAJECTORIES = "trajectories"
    SERIES = "series"
    RULES = "rules"
    TRANSFER = "transfer"
    SCENE = "scene"
    SPACE = "space"
    RAYS = "rays"
    FLOCKED = "flocked"
    WASH = "wash"
    RECEPTION = "reception"


Out = Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="File to write; its ending sets the format.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the flight, if a scenario is flown.")]
Begin = Annotated[float | None, typer.Option(help="First instant shown, s.", show_default="see the picture's title")]
End = Annotated[float | None, typer.Option(help="Last instant shown, s.", show_default="the end")]


def plot(
    what: Annotated[str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")],
    kind: Annotated[PictureKind, typer.Option(help="What to draw.")] = PictureKind.TRAJECTORIES,
    out: Out = Path("flight.png"),
    seed: Seed = 0,
    begin: Begin = None,
    end: End = None,
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
) -> None:
    """Draw trajectories coloured by speed, order parameters over time, or a model's rules.

    In a city, forest or mesh: paths through the scene from above or in space, one agent's rays, share flocked. Also
    the time since the last packet by distance: --kind reception.

    Example: airflock plot vasarhelyi_2018/real_8ms --kind series --out course.png
    """
    options.check_writable((out, PICTURES))
    from airflock.scenarios import load
    from airflock.view import plot as picture, save_figure

    settings = options.parse_settings(changes, agents, duration)
    window: dict[str, Any] = {"start": begin, "stop": end}
    if what.lower().endswith(".nc"):
        figure = picture(what, kind, settings=settings, law=law, trust=trust, **window)
    else:
        scenario = load(what, settings, law, trust=trust)
        terminal.print_notes(scenario.notes)
        figure = picture(scenario, kind, seed=seed, **window)
    save_figure(figure, out)
    terminal.print_message(f"saved {out}")


def video(
    source: Annotated[
        str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")
    ],
    out: Out = Path("flight.mp4"),
    seed: Seed = 0,
    begin: Begin = None,
    end: End = None,
    space: Annotated[
        bool | None,
        typer.Option("--space/--above", help="View at an angle, or from above.", show_default="as flown"),
    ] = None,
    chart: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Show this order parameter over time beside the picture.", show_default=False
        ),
    ] = "",
    fps: Annotated[int, typer.Option(min=1, max=120, help="Frames per second.")] = 25,
    speed: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Speed relative to real time.")] = 10.0,
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
) -> None:
    r"""Make an MP4 or GIF of a flight. Needs pip install 'airflock\[video]'.

    Example: airflock video kidger/city --duration 60 --speed 2 --space --chart flocked --out flight.mp4
    """
    options.check_writable((out, VIDEOS))
    from airflock.recordings import time_series_names
    from airflock.scenarios import load
    from airflock.view import (
        check_chart,
        frame_count,
        import_ffmpeg,
        naming_file,
        recording_or_flight,
        video as make_video,
    )

    settings = options.parse_settings(changes, agents, duration)
    import_ffmpeg()  # before anything flies, as all that can be refused
    if source.lower().endswith(".nc"):
        recording = recording_or_flight(source, seed, settings, law, trust=trust)
    else:
        scenario = load(source, settings, law, trust=trust)
        terminal.print_notes(scenario.notes)
        check_chart(chart, time_series_names(scenario) if chart else [], scenario.name)
        recording = recording_or_flight(scenario, seed)
    choice: dict[str, Any] = {"fps": fps, "speed": speed, "start": begin, "stop": end}
    with naming_file(source), counting_parts("pictures", frame_count(recording, **choice)) as done:
        make_video(recording, out, done=done, space=space, chart=chart, **choice)
    terminal.print_message(f"saved {out}")


def replay(
    source: Annotated[
        str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")
    ],
    page: Annotated[Path, typer.Option("--html", "--out", "-o", metavar="FILE.html", help="File to write.")] = Path(
        "flight.html"
    ),
    seed: Seed = 0,
    rate: Annotated[float, typer.Option(min=0.1, max=100.0, help="Most frames kept per second.")] = 10.0,
    colour: Annotated[
        str, typer.Option(metavar="NAME", help="Colour by speed, heading, agent, cluster, group, fault or a variable.")
    ] = "speed",
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
) -> None:
    """Write a flight as one HTML file that plays in any browser, from disk and without a network.

    Example: airflock replay flight.nc --html show.html --colour cluster
    """
    options.check_writable((page, PAGES))
    from airflock.scenarios import load
    from airflock.view import check_colour, naming_file, recording_or_flight, replay as make_replay

    settings = options.parse_settings(changes, agents, duration)
    if source.lower().endswith(".nc"):
        recording = recording_or_flight(source, seed, settings, law, trust=trust)
    else:
        scenario = load(source, settings, law, trust=trust)
        terminal.print_notes(scenario.notes)
        check_colour(scenario, colour)
        recording = recording_or_flight(scenario, seed)
    with naming_file(source):
        replay_page = make_replay(recording, rate=rate, colour=colour)
    replay_page.save(page)
    terminal.print_message(f"saved {page} ({len(replay_page.text) / 1e6:.1f} MB)")


def display(
    shapes: Annotated[
        list[str],
        typer.Argument(metavar="SHAPE...", help="Images, meshes (stl, obj, glb) or texts, shown one after another."),
    ],
    drones: Annotated[int, typer.Option(min=2, max=2000, help="Number of drones.")] = 200,
    failing: Annotated[float, typer.Option(help="Share of the drones that fail on the way, 0 to 0.9.")] = 0.0,
    failure: Annotated[
        str, typer.Option(help="What a failing drone does: fall, hover, or both (taking turns).")
    ] = "both",
    points: Annotated[int | None, typer.Option(min=2, help="Points per shape.", show_default="one per drone")] = None,
    spacing: Annotated[float, typer.Option(min=2.5, max=100.0, help="Smallest distance between two points, m.")] = 3.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of failures and noise.")] = 0,
    changes: options.Set = None,
    as_json: options.Json = False,
    save: options.SaveFile = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw every shape as it was formed.")] = None,
) -> None:
    """Fly a drone display: assign points to drones, again when some fail, and print how well each shape was formed.

    Example: airflock display AIR FLOCK heart.png --failing 0.1 --plot show.png
    """
    from airflock.displays import fly_show, plan_shapes

    errors: list[str] = []
    with collect_errors(errors):
        options.check_writable((save, RECORDINGS), (plot, PICTURES), reads=shapes)
    settings: dict[str, Any] = {}
    with collect_errors(errors):
        settings = options.parse_settings(changes)
    layouts = []
    with collect_errors(errors):
        layouts = plan_shapes(shapes, drones, failing, failure, points, spacing, settings, "--")
    options.raise_errors(errors)
    show = fly_show(layouts, drones, failing, failure, seed, settings)
    rows = [{"shape": shape, **vars(formed)} for shape, formed in zip(shapes, show.shape_reports, strict=True)]
    if save is not None:
        from airflock.displays import recording_of
        from airflock.recordings import save as save_recording

        terminal.print_message(f"saved {save_recording(recording_of(show), save)}")
    if plot is not None:
        from airflock.view import save_figure, stood

        save_figure(stood(show, shapes), plot)
        terminal.print_message(f"saved {plot}")
    if as_json:
        terminal.print_json({"drones": drones, "failing": failing, "failure": failure, "seed": seed, "shapes": rows})
        return
    _print_display(rows)


def _print_display(rows: list[dict[str, Any]]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, collapse_padding=True)
    names = {
        "time": "formed\nafter (s)", "error": "error\n(m)", "worst": "worst\n(m)", "drones": "drones",
        "collisions": "hit\nflying", "hulls": "hit\nhovering", "struck": "hit by\nfalling",
        "reassigned": "points\nanew",
    }  # fmt: skip
    table.add_column("shape", overflow="fold")
    for title in names.values():
        table.add_column(title, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(row["shape"], *(terminal.format_number(float(row[key])) for key in names))
    Console().print(table)


def watch(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="PRESET|FILE",
            help="A preset, a scenario file, a recording (.nc) to fly again, or the flight card (.json) of a fleet.",
        ),
    ],
    changes: options.Set = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the flight.")] = 0,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    against: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PRESET|FILE|KEY=VALUE",
            help="Fly this beside it, with the same seed and noise; repeatable for keys.",
        ),
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen at; 0.0.0.0 lets other machines in.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen at; 0 picks a free one.")] = 8080,
    radio: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PORT",
            help="For a fleet: where to receive its packets; repeatable.",
            show_default="udp:127.0.0.1:14600, as airflock fleet --card uses",
        ),
    ] = None,
    key: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="For a fleet: the mission's key.", show_default="beside the card, .key"),
    ] = None,
) -> None:
    """Open a page that flies a scenario live: play it, turn its sliders, select agents, save what you found.

    With --against, two laws or sets of parameters fly side by side. Given a flight card, the page shows its fleet, in
    software or in the air, from the packets that a radio receives; it sends nothing.

    Example: airflock watch vasarhelyi_2018/4ms --agents 50 --against radio.delay=3

    Example: airflock watch mission.json --radio udp:0.0.0.0:14600
    """
    from airflock.studio import watch as open_page

    open_page(
        scenario, options.parse_settings(changes, agents), seed, law=law, trust=trust, host=host, port=port,
        against=_comparison(against or []), radios=radio or [], key=key, say=terminal.print_message,
    )  # fmt: skip


def _comparison(value: list[str]) -> str | dict[str, Any] | None:
    """Return the comparison beside the scenario: a name, or keys with values."""
    if any("=" not in each for each in value) and len(value) > 1:
        raise StudioError(f"--against {' '.join(value)}: give one preset or file, or only KEY=VALUE")
    if value and "=" not in value[0]:
        return value[0]
    return options.parse_settings(value, option="--against") if value else None
