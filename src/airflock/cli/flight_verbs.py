"""Verbs run, score, sweep, plot, video, replay, display and watch: fly a scenario, and look at flights."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

from airflock import displays, engine, recordings, runs, scenarios, studio, support, view
from airflock.cli import options, terminal
from airflock.cli.command import verb
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
    format_cell,
    result_table,
    value_or_default,
)

PANEL = "Fly, measure, look"


ScoreValues = Mapping[str, Any]  # order parameters, or keys with their values, by name


FOR_RECORDINGS = "scenario_or_recording aero groups body_length"


@verb(PANEL, "airflock.score", "SCENARIO SEEDS FLYING json save plot", without=FOR_RECORDINGS)
def run(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Fly a scenario and print its order parameters, next to those of the paper if it gives any.

    --plot draws the trajectories of the first flight.

    Example: airflock run vasarhelyi_2018/4ms --seeds 20 --set radio.delay=0.5 --plot flight.png
    """
    errors.read(options.check_writable, (o.save, RECORDINGS), (o.plot, PICTURES))
    changed = options.collect_settings(errors, o)
    scenario = options.collect_scenario(errors, o.scenario, changed, o.law, trust=o.trust)
    numbers = errors.read(options.seeds_from, o.first_seed, o.seeds)
    errors.read(options.check_flight_options, o.device, o.precision, o.scheduler)
    errors.raise_errors()
    terminal.print_notes(scenario.notes)
    flights = [scenario] * o.seeds
    if o.scheduler is None:
        o.device = engine.pick_device(flights, o.device, precision=o.precision, notify=terminal.print_message)
        options.announce_run_time(flights, o.threads, o.device)
        options.compile_before_bar(scenario, o.precision, o.device)
    with counting_parts(f"{scenario.name}: flights", o.seeds, quiet=o.json) as done:
        rows = runs.score_scenarios(flights, numbers, on_done=done, **options.flying(o))
    _print_scores(scenario, numbers, rows, changed, o.json)
    if o.save or o.plot:  # after the scores, which a full disk does not take away
        _record(scenario, numbers, o)


def _print_scores(
    scenario: Any, numbers: Sequence[int], rows: Sequence[ScoreValues], changed_keys: ScoreValues, as_json: bool
) -> None:
    """Print the scores of flights, beside the paper's; changed : keys that are not as in the file."""
    from airflock.parts.metrics import reported_values

    seeds = len(numbers)
    if as_json:
        runs = [{"seed": seed, **row} for seed, row in zip(numbers, rows, strict=True)]
        bound = recordings.upper_probability_bound(sum(row.get("n_coll", 0.0) > 0.0 for row in rows), seeds)
        bounds = {"collision_bound": bound} if seeds > 1 and "n_coll" in rows[0] else {}
        result = {
            "scenario": {"name": scenario.name, **recordings.to_plain_values(scenario.document)},
            "seeds": seeds,
            "runs": runs,
        }
        terminal.print_json({**result, **terminal.column_statistics(rows), **bounds})
        return
    count = f"{seeds} flights" if seeds > 1 else f"seed {numbers[0]}"
    title = f"{scenario.name}: {scenario.agents} agents, {scenario.flight.duration:g} s, {count}"
    published = {} if changed_keys else scenario.published
    terminal.print_score_table(title, rows, published, reported_values(scenario.metrics.rule))
    for remark in recordings.rare_event_notes(rows, numbers):
        terminal.print_message(remark)


def _record(scenario: Any, numbers: Sequence[int], o: SimpleNamespace) -> None:
    """Fly again with the trajectories kept (the same bits), and write the requested files."""
    for seed in numbers if o.save else numbers[:1]:
        recording = recordings.simulate(scenario, seed, precision=o.precision, device=o.device)
        if o.save:
            terminal.print_message(f"saved {recordings.save(recording, options.file_of_seed(o.save, seed, numbers))}")
        if o.plot and seed == numbers[0]:
            terminal.save_picture(view.trajectories(recording), o.plot)


FOR_SCENARIOS = "scenario_or_recording seeds threads precision device scheduler"


@verb(PANEL, "airflock.score", "settings trust json", without=FOR_SCENARIOS)
def score(o: SimpleNamespace) -> None:
    """Measure recordings, simulated or flown, with the same order parameters; --series writes them over time.

    Tracks have no scenario: what depends on a length (collisions, clusters) is shown only if you give it.

    Example: airflock score fish.nc --body-length 0.04 --series course.csv
    """
    options.check_writable((o.series, TABLES))
    files, changed = o.path, options.parse_settings(o.settings)
    if o.body_length is not None:
        changed = recordings.body_length_settings(o.body_length) | changed
    with recordings.ReaderProcess(files[0]) as first:  # another process opens it while this one imports
        sources = [first, *files[1:]]
        if o.groups:
            return _print_group_scores(sources, files, changed, o.trust, o.json)
        measured = [_measured(*each, changed, o.trust, o.aero) for each in zip(sources, files, strict=True)]
        if o.series is not None:
            _save_series(measured, o.series)
        return _print_measured(measured, o.json)


def _print_group_scores(
    sources: Sequence[Any], files: Sequence[Path], changed: ScoreValues, trust: bool, as_json: bool
) -> None:
    """Measure the groups of recordings, and print the results."""
    from airflock.parts.metrics import reported_values

    runs = []
    for source, path in zip(sources, files, strict=True):
        recording = recordings.load_recording(source)
        rule = recordings.scenario_of_recording(recording, changed, trust=trust).metrics.rule
        about = reported_values(rule) | recordings.PAIR_METRICS
        table = recordings.group_scores(recording, changed, trust=trust)
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

    recording = recordings.load_recording(source)
    settings = recordings.power_settings(recording, changed) if aero else changed
    values, course = recordings.measure_recording(recording, settings, trust=trust)
    scenario = recordings.scenario_of_recording(recording, settings, trust=trust)
    untold = recordings.undefined_metrics_of(recording, scenario, settings)
    notes = [recordings.nearness_note(recording, scenario, values), recordings.between_frames_note(recording, scenario)]
    about = reported_values(scenario.metrics.rule) | recordings.PRESENCE_METRICS
    return MeasuredRecording(path, values, course, about, recordings.recorded_faults(recording), untold, notes)


def _save_series(measured: Sequence[MeasuredRecording], path: Path) -> None:
    """Write order parameters over time of all recordings as one table."""
    import io

    import pandas as pd

    text = io.StringIO()
    pd.concat([each.score_series.assign(file=str(each.path)) for each in measured]).to_csv(text)
    support.atomic.write_file(path, text.getvalue())
    terminal.print_message(f"saved {path}")


def _print_measured(measured: Sequence[MeasuredRecording], as_json: bool) -> None:
    """Print order parameters of recordings, faults of their agents, and order parameters that could not be
    measured.
    """
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
            terminal.print_message(f"{each.path}: {recordings.faults_line(each.faults)}")
    for each in measured:
        if each.unmeasured:
            terminal.print_message(f"{each.path}: {recordings.missing_lengths_note(each.unmeasured)}")
        for note in filter(None, each.notes):
            terminal.print_message(f"{each.path}: {note}")


MAX_GRID_POINTS = 100_000  # of one key


@verb(PANEL, "airflock.sweep", "settings law trust agents duration SEEDS FLYING json table plot show")
def sweep(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Fly a scenario over a grid of values and tabulate the order parameters.

    --out keeps every flight as it lands. --plot draws a heat map of two keys, or a line of one.

    Example: airflock sweep vasarhelyi_2018/32ms --over radio.delay=0:2:5 --over radio.range=80,160,320 --plot map.png
    """
    errors.read(options.check_writable, (o.table, TABLES), (o.plot, PICTURES))
    fixed = options.collect_settings(errors, o)
    made: Any = None
    if o.scenario is None and (o.out is None or not o.resume):
        errors.add("sweep: give a scenario and --over, or --out DIR --resume")
    elif o.scenario is None:
        made = errors.read(recordings.resumed_sweep, o.out, trust=o.trust, over=o.over, settings=fixed, law=o.law)
    else:
        axes = _axes(o.over or [], o.plot, errors)
        numbers = errors.read(options.seeds_from, o.first_seed, o.seeds)
        seeds = value_or_default(numbers, [0])  # the rest of the sweep is checked although they are wrong
        # Where no axis could be read, that is said already; the rest is checked with a grid of one point.
        grid = axes or ({"duration": [1.0]} if o.over else {})
        how = fixed, o.law, o.precision, o.device
        made = errors.read(recordings.make_sweep, o.scenario, grid, seeds, *how, trust=o.trust)
    shown = errors.read(lambda found: recordings.metric_to_show(o.show, found.scenarios), made) if made else ""
    errors.read(options.check_flight_options, o.device, o.precision, o.scheduler)
    errors.raise_errors()
    terminal.print_notes(merge_similar_notes(dict.fromkeys(note for found in made.scenarios for note in found.notes)))
    if o.scheduler is None:
        options.announce_run_time([found for found in made.scenarios for _ in made.seeds], o.threads, o.device)
        options.compile_before_bar(made.scenarios[0], made.precision, o.device)
    with counting_parts(f"{made.scenario.name}: flights", len(made.points) * len(made.seeds), quiet=o.json) as done:
        tidy = recordings.fly_sweep(
            made, out=o.out, resume=o.resume, threads=o.threads, on_done=done, scheduler=o.scheduler,
            notify=terminal.print_message,
        )  # fmt: skip
    _keep(tidy, list(made.over), shown, made.scenarios[0], o)
    if o.json:
        about = {"scenario": made.scenario.name, "seeds": len(made.seeds)}
        terminal.print_json({**about, "runs": tidy.to_dict("records")})
    else:
        _print_sweep(tidy, list(made.over), shown)


def _axes(over: list[str], plot: Path | None, errors: ErrorCollector) -> dict[str, list[Any]]:
    """Return the swept keys with their values; unreadable ones are noted as errors."""
    axes = [found for text in over if (found := errors.read(parse_axis, text)) is not INVALID]
    errors.read(check_distinct_keys, [text.partition("=")[0].strip() for text in over], plot)
    return dict(axes)


def _keep(tidy: Any, keys: list[str], show: str, scenario: Any, o: SimpleNamespace) -> None:
    """Write the requested table and picture."""
    if o.table is not None:
        support.atomic.write_file(o.table, tidy.to_csv(index=False))
        terminal.print_message(f"saved {o.table}")
    if o.plot is not None:
        terminal.save_picture(view.heatmap(tidy, keys, show, scenario=scenario), o.plot)


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
    grouped = tidy.groupby(keys, sort=False)[show].agg(["mean", "std", "median", "count"]).reset_index()
    rows = []
    for row in grouped.to_dict("records"):
        spread = "" if row["count"] < 2 else f" ± {row['std']:.2g}"
        cells = [str(row[key]) if isinstance(row[key], str) else f"{row[key]:g}" for key in keys]
        rows.append((*cells, f"{row['mean']:.4g}{spread}", f"{row['median']:.4g}", str(row["count"])))
    heads = "; ".join(f">{name}" for name in (*keys, show, "median", "flights"))
    terminal.print_result(result_table(f"{show} (mean ± sd over seeds)", heads, rows))


@verb(PANEL, "airflock.plot", "settings law trust agents duration out")
def plot(o: SimpleNamespace) -> None:
    """Draw trajectories coloured by speed, order parameters over time, or a model's rules.

    In a city, forest or mesh: paths through the scene from above or in space, one agent's rays, share flocked. Also
    the time since the last packet by distance: --kind reception.

    Example: airflock plot vasarhelyi_2018/real_8ms --kind series --out course.png
    """
    options.check_writable((o.out, PICTURES))

    settings = options.parse_settings(o.settings, o.agents, o.duration)
    window: dict[str, Any] = {"start": o.start, "stop": o.stop}
    if o.source.lower().endswith(".nc"):
        figure = view.plot(o.source, o.kind, settings=settings, law=o.law, trust=o.trust, **window)
    else:
        scenario = scenarios.load(o.source, settings, o.law, trust=o.trust)
        terminal.print_notes(scenario.notes)
        figure = view.plot(scenario, o.kind, seed=o.seed, **window)
    terminal.save_picture(figure, o.out)


@verb(PANEL, "airflock.video", "settings law trust agents duration out", without="recording path")
def video(o: SimpleNamespace) -> None:
    r"""Make an MP4 or GIF of a flight. Needs pip install 'airflock\[video]'.

    Example: airflock video kidger/city --duration 60 --speed 2 --space --chart flocked --out flight.mp4
    """
    options.check_writable((o.out, VIDEOS))

    def check(scenario: Any) -> None:
        view.check_chart(o.chart, recordings.time_series_names(scenario) if o.chart else [], scenario.name)

    view.import_ffmpeg()  # before anything flies, as all that can be refused
    recording = _recording(o, check)
    names = ("fps", "speed", "start", "stop")
    choice = {name: getattr(o, name) for name in names}
    with view.naming_file(o.source), counting_parts("pictures", view.frame_count(recording, **choice)) as done:
        view.video(recording, o.out, done=done, space=o.space, chart=o.chart, tail=o.tail, height=o.height, **choice)
    terminal.print_message(f"saved {o.out}")


@verb(PANEL, "airflock.replay", "settings law trust agents duration out", without="recording")
def replay(o: SimpleNamespace) -> None:
    """Write a flight as one HTML file that plays in any browser, from disk and without a network.

    Example: airflock replay flight.nc --html show.html --colour cluster
    """
    options.check_writable((o.out, PAGES))

    recording = _recording(o, lambda scenario: view.check_colour(scenario, o.colour))
    with view.naming_file(o.source):
        page = view.replay(recording, rate=o.rate, colour=o.colour)
    page.save(o.out)
    terminal.print_message(f"saved {o.out} ({len(page.text) / 1e6:.1f} MB)")


def _recording(o: SimpleNamespace, check: Callable[[Any], None]) -> Any:
    """Return the recording of a file (.nc), or fly a scenario after a check of what is drawn of it."""
    settings = options.parse_settings(o.settings, o.agents, o.duration)
    if o.source.lower().endswith(".nc"):
        return view.recording_or_flight(o.source, o.seed, settings, o.law, trust=o.trust)
    scenario = scenarios.load(o.source, settings, o.law, trust=o.trust)
    terminal.print_notes(scenario.notes)
    check(scenario)
    return view.recording_or_flight(scenario, o.seed)


@verb(PANEL, "airflock.display", "settings json save plot")
def display(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Fly a drone display: assign points to drones, again when some fail, and print how well each shape was formed.

    --plot draws every shape as it was formed.

    Example: airflock display AIR FLOCK heart.png --failing 0.1 --plot show.png
    """
    errors.read(options.check_writable, (o.save, RECORDINGS), (o.plot, PICTURES), reads=o.shapes)
    settings = errors.read(options.parse_settings, o.settings)
    failure = value_or_default(o.failure, "both")
    wanted = (o.shapes, o.drones, o.failing, failure, o.points, o.spacing)
    layouts = errors.read(displays.plan_shapes, *wanted, value_or_default(settings, {}), "--")
    errors.raise_errors()
    show = displays.fly_show(layouts, o.drones, o.failing, o.failure, o.seed, settings)
    rows = [{"shape": shape, **vars(formed)} for shape, formed in zip(o.shapes, show.shape_reports, strict=True)]
    if o.save is not None:
        terminal.print_message(f"saved {recordings.save(displays.recording_of(show), o.save)}")
    if o.plot is not None:
        terminal.save_picture(view.stood(show, o.shapes), o.plot)
    if o.json:
        about = {name: getattr(o, name) for name in ("drones", "failing", "failure", "seed")}
        return terminal.print_json({**about, "shapes": rows})
    return _print_display(rows)


def _print_display(rows: list[dict[str, Any]]) -> None:
    names = {
        "time": "formed\nafter (s)", "error": "error\n(m)", "worst": "worst\n(m)", "drones": "drones",
        "collisions": "hit\nflying", "hulls": "hit\nhovering", "struck": "hit by\nfalling",
        "reassignment_count": "points\nanew",
    }  # fmt: skip
    lines = [(row["shape"], *(format_cell(float(row[key])) for key in names)) for row in rows]
    table = result_table("", "; ".join(["shape", *(f">|{head}" for head in names.values())]), lines, overflow="fold")
    table.show_edge, table.pad_edge, table.collapse_padding = False, False, True  # eighty columns take it
    terminal.print_result(table)


@verb(PANEL, "airflock.watch", "settings law trust agents")
def watch(o: SimpleNamespace) -> None:
    """Open a page that flies a scenario live: play it, turn its sliders, select agents, save what you found.

    With --against, two laws or sets of parameters fly side by side. Given a flight card, the page shows its fleet, in
    software or in the air, from the packets that a radio receives; it sends nothing.

    Example: airflock watch vasarhelyi_2018/4ms --agents 50 --against radio.delay=3

    Example: airflock watch mission.json --radio udp:0.0.0.0:14600
    """
    studio.watch(
        o.scenario, options.parse_settings(o.settings, o.agents), o.seed, law=o.law, trust=o.trust, host=o.host,
        port=o.port, against=_comparison(o.against or []), radios=o.radios or [], key=o.key,
        say=terminal.print_message,
    )  # fmt: skip


def _comparison(value: list[str]) -> str | dict[str, Any] | None:
    """Return the comparison beside the scenario: a name, or keys with values."""
    if any("=" not in each for each in value) and len(value) > 1:
        raise StudioError(f"--against {' '.join(value)}: give one preset or file, or only KEY=VALUE")
    if value and "=" not in value[0]:
        return value[0]
    return options.parse_settings(value, option="--against") if value else None
