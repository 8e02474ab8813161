"""Verbs import, export, identify and infer: recordings of others, and the numbers and laws behind them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

from airflock import estimate, recordings, runs, scenarios, view
from airflock.cli import options, terminal
from airflock.cli.command import verb
from airflock.cli.terminal import counting_parts, progress_line
from airflock.support import (
    PICTURES,
    RECORDINGS,
    SCENARIOS,
    AirflockError,
    ErrorCollector,
    RecordingError,
    interval_lines,
    result_group,
)

PANEL = "Recordings of others"


def parse_mapping(pairs: list[str] | None) -> dict[str, str]:
    """Parse the targets and expressions of --map; := and = mean the same."""
    columns: dict[str, str] = {}
    errors = []
    for pair in pairs or []:
        target, sign, text = pair.partition(":=") if ":=" in pair else pair.partition("=")
        if not sign or not target.strip() or not text.strip():
            errors.append(f"--map {pair}: write TARGET:=COLUMNS, for instance --map x:=pos_e")
        elif target.strip() in columns:
            errors.append(f"--map {pair}: {target.strip()} is mapped twice")
        columns[target.strip()] = text.strip()
    if errors:
        raise RecordingError("\n".join(errors))
    return columns


@verb(PANEL, "airflock.load_tracks", "save json", name="import")
def import_tracks(o: SimpleNamespace, errors: ErrorCollector) -> None:
    r"""Turn flight logs and animal tracks into a recording that every other verb takes.

    Columns are recognised by their headers (x \[mm], time_us, vel_e, location-lat, ...), or mapped. Positions, signs,
    units, clocks, duplicates, jumps and gaps are checked; each fault is one line, which says what to write instead.

    Example: airflock import drone*.csv --map t:=time_us*1e-6 --map x:=pos_e --map y:=pos_n --map id:=file --same-clock
    """
    errors.read(options.check_writable, (o.save, RECORDINGS), reads=o.source)
    columns = errors.read(parse_mapping, o.map)
    place = errors.read(_origin, o.origin)
    errors.raise_errors()
    notes: list[str] = []
    how = {key: value for key, value in vars(o).items() if key not in ("source", "save", "json")}
    how |= {"map": columns, "origin": place, "accept": o.accept or ()}
    with reading_progress(len(o.source), o.json) as done:
        recording = recordings.load_tracks(o.source, **how, say=notes.append, done=done)
    recordings.save(recording, o.save)
    if o.json:
        sizes = {str(name): int(size) for name, size in recording.sizes.items()}
        about = {"saved": str(o.save), "sizes": sizes, "fps": recording.attrs["fps"], "notes": notes}
        return terminal.print_json(about)
    for note in notes:
        terminal.print_message(f"note: {note}")
    return terminal.print_message(f"saved {o.save}")


@contextmanager
def reading_progress(files: int, quiet: bool) -> Iterator[Callable[[float], None]]:
    """Show the share of files that has been read; yields what takes the share of the file under way."""
    with progress_line(quiet) as line:
        read = 0

        def done(share: float) -> None:
            nonlocal read
            line.update("reading", read + min(1.0, share), files)
            read += share >= 1.0

        yield done


def _origin(text: str | None) -> tuple[float, float, float] | None:
    if not text:
        return None
    numbers = options.parse_numbers(text)
    if len(numbers) not in (2, 3) or not (abs(numbers[0]) <= 90.0 and abs(numbers[1]) <= 360.0):
        raise RecordingError(
            f"--origin {text}: write latitude,longitude[,height] in degrees and m, such as 47.48,19.06"
        )
    return numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else 0.0


@verb(PANEL, "airflock.export", "out", without="path")
def export(o: SimpleNamespace) -> None:
    """Write a recording for other tools: a long table with units in its headers, or a dataset of movement.

    Example: airflock export flight.nc --out flight.csv
    """
    options.check_writable((o.out, recordings.SUFFIXES), reads=[o.recording])
    recordings.export(recordings.load_recording(o.recording), o.out, layout=o.layout)
    ned = "; x is north, as in PX4: airflock import --axes ned reads it" if o.layout == "px4" else ""
    terminal.print_message(f"saved {o.out}{ned}")


@verb(PANEL, "airflock.identify", "settings out plot json")
def identify(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Find the lag, limits, noise, sensor error and radio of a fleet in its own logs, with 95 % intervals.

    What the logs cannot show is listed with the reason, and stays as in --like. Logs need commands and raw velocities.
    --out writes the scenario; --plot draws what was found, in six panels.

    Example: airflock identify logs/*.ulg --heard heard.csv --like vasarhelyi_2018/real_6ms --out mine.toml
    """
    errors.read(options.check_writable, (o.out, SCENARIOS), (o.plot, PICTURES), reads=[o.like, o.heard, *o.flight_logs])
    scenario = errors.read(lambda: scenarios.load(o.like, options.parse_settings(o.settings)))
    columns = errors.read(parse_mapping, o.map)
    ground = errors.read(_span, o.standing)
    packets = None if o.heard is None else errors.read(estimate.read_heard, o.heard)
    if o.conservative is not None and not 0.0 < o.conservative < 1.0:
        errors.add(f"--conservative {o.conservative:g} lies outside (0, 1); 0.95 is usual")
    errors.raise_errors()
    with reading_progress(len(o.flight_logs), o.json) as done:
        how = {name: getattr(o, name) for name in options.READ_OPTIONS.split()}
        result = estimate.identify(
            o.flight_logs, scenario, heard=packets, standing=ground, same_clock=o.same_clock,
            options=recordings.ImportOptions(**how | {"map": columns}, done=done), accept=o.accept or (),
            begin=o.begin, end=o.end,
        )  # fmt: skip
    if o.out is not None and not result.settings():
        raise AirflockError(
            "\n".join([f"{o.out}: not written: no number can be identified from these logs", *result.reasons()])
        )
    check = _checked(result, o.flights, o.json)
    if o.out is not None:
        runs.write_toml_file(o.out, result.document(o.conservative, uncertain=o.uncertain))
        terminal.print_message(f"saved {o.out}")
    if o.plot is not None:
        terminal.save_picture(view.plot_identified(result, check), o.plot)
    if o.json:
        return terminal.print_json(_identified_json(result, check))
    for note in result.notes:
        terminal.print_message(f"note: {note}")
    checked = _check_parts(check, result, o.flights) if check is not None else []
    return terminal.print_result(result_group(result, *checked, *(_card_parts(result) if o.plan else [])))


def _span(text: str | None) -> tuple[float, float] | None:
    if not text:
        return None
    span = options.parse_numbers(f"0{text}" if text.startswith(":") else text, ":")
    if len(span) != 2 or not 0.0 <= span[0] < span[1]:
        raise AirflockError(f"--standing {text}: write BEGIN:END in s, such as 0:60")
    return span[0], span[1]


def _checked(result: Any, flights: int, quiet: bool) -> Any:
    """Run the posterior check, if there is something to check."""
    if not flights or not result.settings():
        return None
    with counting_parts("check: flights", flights, quiet=quiet) as done:
        known = result.has_one_clock
        return estimate.check_against_logs(result.scenario(), result.logs, flights, done, comparable=known)


def _check_parts(check: Any, result: Any, flights: int) -> list[str]:
    """Return lines of the comparison with the log."""
    clocks = "  distances are left out: it is not known whether the clocks agree (--same-clock)"
    head = f"check: {flights} flights of the identified scenario against the log"
    return [head, *interval_lines(check.found), *([] if result.has_one_clock else [clocks])]


def _card_parts(result: Any) -> list[str]:
    """Return lines of the test flights, each with the numbers that it would show."""
    card = estimate.flight_card(result.like)
    lines = [f"test flights, {sum(part.seconds for part in card) / 60.0:.0f} min:"]
    for number, part in enumerate(card, 1):
        lacking = [key for key in part.keys if key not in result.numbers or not result.numbers[key].told]
        need = f"for {', '.join(lacking)}" if lacking else "all told already"
        lines += [f"{number}. {part.title}, {part.seconds:.0f} s ({need})", f"   {part.instructions}"]
    return lines


def _identified_json(result: Any, check: Any) -> dict[str, Any]:
    numbers = {
        key: {"like": n.like, "from": n.origin, "reason": n.reason}
        | {name: getattr(n, name) if n.told else None for name in ("value", "low", "high")}
        for key, n in result.numbers.items()
    }  # fmt: skip
    checks = {} if check is None else {k: {"log": o, "low": lo, "high": hi} for k, (o, lo, hi) in check.found.items()}
    card = [part._asdict() for part in estimate.flight_card(result.like)]
    return {
        "like": result.like.name, "numbers": numbers, "noise_of_log": result.log_noise, "check": checks, "plan": card,
        "notes": result.notes,
    }  # fmt: skip


@verb(PANEL, "airflock.infer", "settings trust out plot json")
def infer(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Find which flocking law explains tracks best, with which numbers, and what it leaves unexplained.

    Each law is fitted by the likelihood of the next frame and judged on data that it has not seen: neighbouring spans
    of one recording, or whole recordings where there are several. --set gives what is known of the place, for all laws.
    --out writes a scenario with the law found; --plot draws force maps of the tracks and of each law.

    Example: airflock infer fish.nc --models couzin_2002,reynolds_1987,vicsek_1995 --out best.toml --plot forces.png
    """
    reads = [*o.models.split(","), *o.tracks]
    errors.read(options.check_writable, (o.out, SCENARIOS), (o.plot, PICTURES), reads=reads)
    settings = errors.read(options.parse_settings, o.settings)
    laws = [name.strip() for name in o.models.split(",") if name.strip()]
    if not laws:
        errors.add("--models names no law; write for instance --models couzin_2002,vicsek_1995")
    errors.add(*(f"{path}: no such file" for path in o.tracks if not path.exists()))
    errors.raise_errors()
    with _fit_progress(o.json) as done:
        result = estimate.infer(
            o.tracks, laws, settings=settings, topologies=[kind.strip() for kind in o.topologies.split(",")],
            check=o.check, seed=o.seed, trust=o.trust, done=done,
        )  # fmt: skip
    if o.plot is not None:
        terminal.save_picture(view.plot_inferred(result), o.plot)
    if o.out is not None and result.best is not None:
        runs.write_toml_file(o.out, result.document())
        terminal.print_message(f"saved {o.out}")
    if o.json:
        return terminal.print_json(_inferred_json(result))
    terminal.print_result(result)
    if result.best is not None and o.topologies == "metric":
        terminal.print_message("neighbours by distance were tried; others: --topologies metric,nearest,voronoi")
    if o.out is not None and result.best is None:
        raise AirflockError(f"{o.out}: not written: {result.verdict}")
    return None


@contextmanager
def _fit_progress(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Show which law is fitted, and how many steps that took so far."""
    with progress_line(quiet) as line:
        line.update("reading")
        steps: dict[str, int] = {}

        def show_step(name: str) -> None:
            steps[name] = steps.get(name, 0) + 1
            line.update(f"{name}, step {steps[name]}")

        yield show_step


def _inferred_json(result: Any) -> dict[str, Any]:
    """Return the result as plain values."""
    laws = [
        {name: getattr(law, name) for name in ("name", "gain", "error", "by_chance", "ahead", "inside", "missed")}
        | {"criterion": law.aic_difference, "numbers": {key: number.value for key, number in law.numbers.items()}}
        for law in result.laws
    ]
    best = None
    if result.best is not None:
        numbers = {
            key: {name: getattr(number, name) for name in ("value", "low", "high", "least", "most", "unit")}
            for key, number in result.best.numbers.items()
        }
        best = {"name": result.best.name, "numbers": numbers, "noise_of_tracks": result.noise.seen}
    check = {} if result.check is None else {
        name: {"tracks": own, "low": low, "high": high} for name, (own, low, high) in result.check.found.items()
    }  # fmt: skip
    frames = {"fitted": result.fitted[0], "all": result.fitted[1]}
    return {
        "verdict": result.verdict,
        "best": best,
        "laws": laws,
        "check": check,
        "frames": frames,
        "steps": result.steps,
    }
