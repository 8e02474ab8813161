"""Verbs import, export, identify and infer: recordings of others, and the numbers and laws behind them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, terminal
from airflock.cli.command import FORMATS
from airflock.cli.terminal import counting_parts, progress_line
from airflock.support import PICTURES, RECORDINGS, SCENARIOS, AirflockError, RecordingError, collect_errors

Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE...", show_default=False,
        help=f"One or several of {FORMATS}.",
    ),
]  # fmt: skip
Map = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="TARGET:=COLUMNS", help="For instance x:=pos_e or t:=time_us*1e-6; repeatable."),
]
Unit = Annotated[str, typer.Option(metavar="UNIT", help="Unit of lengths that have none: m, cm, mm, km, ft, px.")]
Scale = Annotated[float | None, typer.Option(help="Metres per pixel.", show_default=False)]
TimeUnit = Annotated[
    str,
    typer.Option(
        metavar="UNIT", help="Unit of times that have none: s, ms, us, ns, min, frames; order of dates: dmy, mdy."
    ),
]
Fps = Annotated[float | None, typer.Option(help="Frames per second, if the file counts frames.", show_default=False)]
Axes = Annotated[
    str, typer.Option(help="enu, or ned where x is north and z down.", show_default="enu; ned for fields of PX4")
]
SameClock = Annotated[bool, typer.Option("--same-clock", help="The clocks of all files agree.")]
Begin = Annotated[float | None, typer.Option(help="First instant to keep, s.", show_default=False)]
End = Annotated[float | None, typer.Option(help="Last instant to keep, s.", show_default=False)]
Accept = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KIND", help="Keep what looks wrong: absent, axes, down, duplicates, height, jumps, rows, time."
    ),
]
Decimal = Annotated[str, typer.Option(help="Decimal point of a text file: . or ,")]
Delimiter = Annotated[str, typer.Option(help="Separator between columns of a text file.", show_default="detected")]


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


def import_tracks(
    files: Files,
    map: Map = None,
    save: Annotated[Path, typer.Option("--save", "-o", metavar="FILE.nc", help="Recording to write.")] = Path(
        "tracks.nc"
    ),
    unit: Unit = "",
    scale: Scale = None,
    time_unit: TimeUnit = "",
    fps: Fps = None,
    keypoint: Annotated[str, typer.Option(help="Keypoint to use, if a file has several.")] = "",
    axes: Axes = "",
    origin: Annotated[
        str, typer.Option(metavar="LAT,LON[,HEIGHT]", help="Origin of the local frame.", show_default="the first fix")
    ] = "",
    rate: Annotated[
        float | None, typer.Option(help="Frames per second of the recording.", show_default="the tracks'")
    ] = None,
    bridge: Annotated[
        float, typer.Option(help="Longest gap to bridge, s; in longer gaps the individual counts as absent.")
    ] = 1.0,
    begin: Begin = None,
    end: End = None,
    same_clock: SameClock = False,
    accept: Accept = None,
    decimal: Decimal = ".",
    delimiter: Delimiter = "",
    precision: options.Precision = 32,
    as_json: options.Json = False,
) -> None:
    r"""Turn flight logs and animal tracks into a recording that every other verb takes.

    Columns are recognised by their headers (x \[mm], time_us, vel_e, location-lat, ...), or mapped. Positions, signs,
    units, clocks, duplicates, jumps and gaps are checked; each fault is one line, which says what to write instead.

    Example: airflock import drone*.csv --map t:=time_us*1e-6 --map x:=pos_e --map y:=pos_n --map id:=file --same-clock
    """
    from airflock.recordings import load_tracks, save as save_recording

    errors: list[str] = []
    with collect_errors(errors):
        options.check_writable((save, RECORDINGS), reads=files)
    with collect_errors(errors):
        how = parse_mapping(map)
    with collect_errors(errors):
        place = _origin(origin)
    options.raise_errors(errors)
    notes: list[str] = []
    with reading_progress(len(files), as_json) as done:
        recording = load_tracks(
            files, map=how, unit=unit, scale=scale, time_unit=time_unit, fps=fps, keypoint=keypoint, axes=axes,
            origin=place, rate=rate, bridge=bridge, begin=begin, end=end, same_clock=same_clock,
            accept=accept or (), decimal=decimal, delimiter=delimiter, precision=precision,
            say=notes.append, done=done,
        )  # fmt: skip
    save_recording(recording, save)
    if as_json:
        sizes = {str(name): int(size) for name, size in recording.sizes.items()}
        terminal.print_json({"saved": str(save), "sizes": sizes, "fps": recording.attrs["fps"], "notes": notes})
        return
    for note in notes:
        terminal.print_message(f"note: {note}")
    terminal.print_message(f"saved {save}")


def reading_progress(files: int, quiet: bool) -> Any:
    """Show a bar that follows the share of each file that has been read."""
    from contextlib import contextmanager

    @contextmanager
    def shown() -> Any:
        with counting_parts("reading", 100 * files, quiet=quiet) as step:
            state = {"file": 0, "share": 0.0, "reported": 0}

            def done(share: float) -> None:
                state["share"] = min(1.0, share)
                ahead = int(100 * (state["file"] + state["share"]))
                while state["reported"] < ahead:
                    step()
                    state["reported"] += 1
                if share >= 1.0:
                    state["file"], state["share"] = state["file"] + 1, 0.0

            yield done

    return shown()


def _origin(text: str) -> tuple[float, float, float] | None:
    if not text:
        return None
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not (abs(numbers[0]) <= 90.0 and abs(numbers[1]) <= 360.0):
        raise RecordingError(
            f"--origin {text}: write latitude,longitude[,height] in degrees and m, such as 47.48,19.06"
        )
    return numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else 0.0


class ExportLayout(StrEnum):
    """Names of the dimensions of netCDF, or fields of a table."""

    MOVEMENT = "movement"
    OLD = "movement-0.16"
    PX4 = "px4"


def export(
    recording: Annotated[Path, typer.Argument(metavar="FILE.nc", help="A recording.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help=".csv, .parquet or .nc (movement).")],
    layout: Annotated[
        ExportLayout, typer.Option(help="For .nc: for current movement, or up to 0.16; for .csv: as a PX4 log.")
    ] = ExportLayout.MOVEMENT,
) -> None:
    """Write a recording for other tools: a long table with units in its headers, or a dataset of movement.

    Example: airflock export flight.nc --out flight.csv
    """
    from airflock.recordings import SUFFIXES, export as write, load_recording

    options.check_writable((out, SUFFIXES), reads=[recording])
    write(load_recording(recording), out, layout=layout.value)
    ned = "; x is north, as in PX4: airflock import --axes ned reads it" if layout is ExportLayout.PX4 else ""
    terminal.print_message(f"saved {out}{ned}")


def identify(
    files: Files,
    like: Annotated[str, typer.Option(metavar="PRESET|FILE", help="Scenario whose law the logs flew.")],
    heard: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="Packets: receiver, sender, t, stamp (s), distance (m), got (0 or 1)."),
    ] = None,
    standing: Annotated[
        str,
        typer.Option(
            metavar="BEGIN:END", help="Time on the ground, s after each log begins.", show_default="as logged"
        ),
    ] = "",
    out: Annotated[Path | None, typer.Option("--out", "-o", metavar="FILE.toml", help="Scenario to write.")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw what was found, in six panels.")] = None,
    conservative: Annotated[
        float | None, typer.Option(help="Write the pessimistic end of each interval of this level, such as 0.95.")
    ] = None,
    uncertain: Annotated[bool, typer.Option("--uncertain", help="Also write the intervals into the scenario.")] = False,
    plan: Annotated[
        bool, typer.Option("--plan", help="Print the test flights that make every number identifiable.")
    ] = False,
    flights: Annotated[int, typer.Option("--check", min=0, help="Flights to compare with the log; 0: none.")] = 100,
    changes: options.Set = None,
    map: Map = None,
    unit: Unit = "",
    time_unit: TimeUnit = "",
    axes: Axes = "",
    begin: Begin = None,
    end: End = None,
    same_clock: SameClock = False,
    accept: Accept = None,
    decimal: Decimal = ".",
    delimiter: Delimiter = "",
    as_json: options.Json = False,
) -> None:
    """Find the lag, limits, noise, sensor error and radio of a fleet in its own logs, with 95 % intervals.

    What the logs cannot show is listed with the reason, and stays as in --like. Logs need commands and raw velocities.

    Example: airflock identify logs/*.ulg --heard heard.csv --like vasarhelyi_2018/real_6ms --out mine.toml
    """
    from airflock.estimate import identify as find, read_heard
    from airflock.recordings import ImportOptions
    from airflock.scenarios import load

    errors: list[str] = []
    with collect_errors(errors):
        options.check_writable((out, SCENARIOS), (plot, PICTURES), reads=[like, heard, *files])
    with collect_errors(errors):
        scenario = load(like, options.parse_settings(changes))
    with collect_errors(errors):
        how = parse_mapping(map)
    with collect_errors(errors):
        ground = _span(standing)
    with collect_errors(errors):
        packets = None if heard is None else read_heard(heard)
    if conservative is not None and not 0.0 < conservative < 1.0:
        errors.append(f"--conservative {conservative:g} lies outside (0, 1); 0.95 is usual")
    options.raise_errors(errors)
    with reading_progress(len(files), as_json) as done:
        reading = ImportOptions(
            map=how, unit=unit, time_unit=time_unit, axes=axes, decimal=decimal, delimiter=delimiter, done=done
        )
        result = find(
            files, scenario, heard=packets, standing=ground, same_clock=same_clock, options=reading,
            accept=accept or (), begin=begin, end=end,
        )  # fmt: skip
    if out is not None and not result.settings():
        raise AirflockError(
            "\n".join([f"{out}: not written: no number can be identified from these logs", *_reasons(result)])
        )
    check = _checked(result, flights, as_json)
    if out is not None:
        from airflock.runs import write_toml_file

        write_toml_file(out, result.document(conservative, uncertain=uncertain))
        terminal.print_message(f"saved {out}")
    if plot is not None:
        from airflock.view import plot_identified, save_figure

        save_figure(plot_identified(result, check), plot)
        terminal.print_message(f"saved {plot}")
    if as_json:
        terminal.print_json(_identified_json(result, check))
        return
    for note in result.notes:
        terminal.print_message(f"note: {note}")
    _parameter_table(result)
    if check is not None:
        _verdicts(check, result, flights)
    if plan:
        _card(result)


def _span(text: str) -> tuple[float, float] | None:
    if not text:
        return None
    begin, colon, end = text.partition(":")
    try:
        span = float(begin or 0.0), float(end)
    except ValueError as error:
        raise AirflockError(f"--standing {text}: write BEGIN:END in s, such as 0:60") from error
    if not colon or not 0.0 <= span[0] < span[1]:
        raise AirflockError(f"--standing {text}: write BEGIN:END in s, such as 0:60")
    return span


def _checked(result: Any, flights: int, quiet: bool) -> Any:
    """Run the posterior check, if there is something to check."""
    from airflock.estimate import check_against_logs

    if not flights or not result.settings():
        return None
    with counting_parts("check: flights", flights, quiet=quiet) as done:
        return check_against_logs(result.scenario(), result.logs, flights, done, comparable=result.has_one_clock)


def _parameter_table(result: Any) -> None:
    from rich.console import Console

    from airflock.estimate import UNIDENTIFIABLE

    console = Console()
    if result.settings():
        console.print(_numbers_table(result))
        if result.log_noise is not None:
            console.print(f"noise of logged velocities {result.log_noise:.3g} m/s per axis", highlight=False)
        console.print("not identified, kept from --like:")
    else:
        console.print(
            f"{result.logs.drones} drones: no number can be identified from these logs; all are kept from --like:"
        )
    for line in _reasons(result):
        console.print(f"  {line}", highlight=False, markup=False, soft_wrap=True)
    for key, reason in UNIDENTIFIABLE.items():
        console.print(f"  {key}: {reason}", highlight=False, markup=False, soft_wrap=True)


def _reasons(result: Any) -> list[str]:
    """Return why numbers cannot be identified, a line for each reason."""
    keys: dict[str, list[str]] = {}
    for key, number in result.numbers.items():
        if not number.told:
            keys.setdefault(number.reason, []).append(key)
    return [f"{', '.join(own)}: {reason}" for reason, own in keys.items()]


def _numbers_table(result: Any) -> Any:
    """Return the identified numbers, as a table."""
    from rich import box
    from rich.table import Table

    from airflock.estimate import KEY_UNITS

    table = Table(
        title=f"{result.logs.drones} drones, like {result.like.name}", box=box.SIMPLE_HEAD, title_justify="left"
    )
    columns = (("number", "left"), ("value", "right"), ("95 %", "right"), ("unit", "left"), ("like", "right"))
    for name, justify in columns:
        table.add_column(name, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    table.add_column("from")
    for key, number in result.numbers.items():
        if number.told:
            like = "" if number.like is None else terminal.format_number(number.like)
            span = f"{number.low:.3g} to {number.high:.3g}"
            unit = KEY_UNITS[key] if KEY_UNITS[key] != "1" else ""
            table.add_row(key, terminal.format_number(number.value), span, unit, like, number.origin)
    return table


def _verdicts(check: Any, result: Any, flights: int) -> None:
    from rich.console import Console

    console = Console()
    console.print(f"check: {flights} flights of the identified scenario against the log")
    for name, (own, low, high) in check.found.items():
        verdict = "ok" if low <= own <= high else "OUTSIDE: not explained"
        line = f"  {name} {terminal.format_number(own)} in [{low:.4g}, {high:.4g}] {verdict}"
        console.print(line, highlight=False, markup=False)
    if not result.has_one_clock:
        console.print("  distances are left out: it is not known whether the clocks agree (--same-clock)")


def _card(result: Any) -> None:
    from rich.console import Console

    from airflock.estimate import flight_card

    console = Console()
    card = flight_card(result.like)
    console.print(f"test flights, {sum(part.seconds for part in card) / 60.0:.0f} min:")
    for number, part in enumerate(card, 1):
        lacking = [key for key in part.keys if key not in result.numbers or not result.numbers[key].told]
        need = f"for {', '.join(lacking)}" if lacking else "all told already"
        console.print(f"{number}. {part.title}, {part.seconds:.0f} s ({need})", highlight=False, markup=False)
        console.print(f"   {part.instructions}", highlight=False, markup=False)


def _identified_json(result: Any, check: Any) -> dict[str, Any]:
    from airflock.estimate import flight_card

    numbers = {
        key: {"like": n.like, "from": n.origin, "reason": n.reason}
        | {name: getattr(n, name) if n.told else None for name in ("value", "low", "high")}
        for key, n in result.numbers.items()
    }  # fmt: skip
    checks = {} if check is None else {k: {"log": o, "low": lo, "high": hi} for k, (o, lo, hi) in check.found.items()}
    card = [part._asdict() for part in flight_card(result.like)]
    return {
        "like": result.like.name, "numbers": numbers, "noise_of_log": result.log_noise, "check": checks, "plan": card,
        "notes": result.notes,
    }  # fmt: skip


DEFAULT_LAWS = "couzin_2002,reynolds_1987,vicsek_1995,vasarhelyi_2018"
Tracks = Annotated[
    list[Path],
    typer.Argument(
        metavar="TRACKS...", show_default=False,
        help="Recordings (.nc, as airflock import saves them), or files that import reads without options.",
    ),
]  # fmt: skip


def infer(
    tracks: Tracks,
    models: Annotated[
        str,
        typer.Option(
            "--models",
            metavar="LAW,FILE,...",
            help="Laws by name, presets, scenario files, or files with laws of your own.",
        ),
    ] = DEFAULT_LAWS,
    topologies: Annotated[
        str,
        typer.Option(
            metavar="KIND,...",
            help="Neighbourhoods by which each law is tried: metric (its own), nearest (k is fitted), voronoi.",
        ),
    ] = "metric",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE.toml", help="Scenario to write, with the law found.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw force maps of the tracks and of each law.")
    ] = None,
    changes: options.Set = None,
    flights: Annotated[int, typer.Option("--check", min=0, help="Flights to compare with the tracks; 0: none.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search for the best fit.")] = 0,
    trust: options.Trust = False,
    as_json: options.Json = False,
) -> None:
    """Find which flocking law explains tracks best, with which numbers, and what it leaves unexplained.

    Each law is fitted by the likelihood of the next frame and judged on data that it has not seen: neighbouring spans
    of one recording, or whole recordings where there are several. --set gives what is known of the place, for all laws.

    Example: airflock infer fish.nc --models couzin_2002,reynolds_1987,vicsek_1995 --out best.toml --plot forces.png
    """
    from airflock.estimate import infer as find

    errors: list[str] = []
    with collect_errors(errors):
        options.check_writable((out, SCENARIOS), (plot, PICTURES), reads=[*models.split(","), *tracks])
    settings: dict[str, Any] = {}
    with collect_errors(errors):
        settings = options.parse_settings(changes)
    laws = [name.strip() for name in models.split(",") if name.strip()]
    if not laws:
        errors.append("--models names no law; write for instance --models couzin_2002,vicsek_1995")
    errors += [f"{path}: no such file" for path in tracks if not path.exists()]
    options.raise_errors(errors)
    with _fit_progress(as_json) as done:
        result = find(
            tracks, laws, settings=settings, topologies=[kind.strip() for kind in topologies.split(",")],
            check=flights, seed=seed, trust=trust, done=done,
        )  # fmt: skip
    if plot is not None:
        from airflock.view import plot_inferred, save_figure

        save_figure(plot_inferred(result), plot)
        terminal.print_message(f"saved {plot}")
    if out is not None and result.best is not None:
        from airflock.runs import write_toml_file

        write_toml_file(out, result.document())
        terminal.print_message(f"saved {out}")
    if as_json:
        terminal.print_json(_inferred_json(result))
        return
    _law_table(result)
    if result.best is not None:
        _numbers(result)
        _check(result)
    if out is not None and result.best is None:
        raise AirflockError(f"{out}: not written: {result.verdict}")


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


def _law_table(result: Any) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    fitted, every = result.fitted
    title = f"{result.individual_count} individuals, {result.steps} steps; fitted on {fitted} of {every} frames"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("law", "gain", "ahead", "AIC", "in 95 %", "left over", "numbers"):
        table.add_column(name, justify="left" if name == "law" else "right", no_wrap=True)
    for law in result.laws:
        table.add_row(
            law.name, f"{law.gain:.0f} ± {law.error:.0f}", f"{law.ahead:.0%}", f"{law.aic_difference:.0f}",
            f"{law.inside:.1%}", f"{law.missed:.1%}", str(len(law.numbers)),
        )  # fmt: skip
    console = Console()
    console.print(table)
    console.print(
        "compared with going straight on: gain in log-likelihood of held-out steps; AIC of the fit, negative is better",
        highlight=False,
    )
    console.print(result.verdict, style="bold", highlight=False, markup=False)


def _numbers(result: Any) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from airflock.estimate import ends_text

    table = Table(title=f"numbers of {result.best.name}", box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("number", "value", "unit", "95 % for it alone", "95 % for all together"):
        table.add_column(name, justify="right" if name == "value" else "left", no_wrap=True)
    for key, number in result.best.numbers.items():
        table.add_row(
            key, f"{number.value:.4g}", "" if number.unit == "1" else number.unit, ends_text(number.low, number.high),
            ends_text(number.least, number.most),
        )  # fmt: skip
    console = Console()
    console.print(table)
    console.print(f"noise of the tracks {result.noise.seen:.3g} m", highlight=False)


def _check(result: Any) -> None:
    from rich.console import Console

    if result.check is None:
        return
    console = Console()
    console.print("check: flocks of this law, flown freely from the first frame, against the tracks")
    for name, (own, low, high) in result.check.found.items():
        verdict = "ok" if low <= own <= high else "OUTSIDE: not explained"
        console.print(f"  {name} {own:.4g} in [{low:.4g}, {high:.4g}] {verdict}", highlight=False, markup=False)


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
