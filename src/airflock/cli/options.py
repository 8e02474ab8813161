"""Options that several verbs share, and the functions that read them."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli.command import ERRORS_KEY
from airflock.support import (
    ErrorCollector,
    ScenarioError,
    as_error,
    collect_errors,
    invalid_if,
    is_file,
    parse_toml_value,
    suffix_error,
    value_or_default,
)

SECONDS_PER_UNIT = {"s": 1.0, "min": 60.0, "h": 3600.0}
Where = Annotated[
    str, typer.Argument(metavar="PRESET|FILE", help="A preset's name or a scenario file.", show_default=False)
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change any key, such as model.p_rep=0.14; repeatable."),
]
Seeds = Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of flights, with seeds 0, 1, 2, ...")]
FirstSeed = Annotated[int, typer.Option(min=0, help="Seed of the first flight.")]
Agents = Annotated[int | None, typer.Option(help="Number of agents.", show_default="the scenario's")]
Duration = Annotated[
    str | None,
    typer.Option(
        metavar="TIME", help="Length of a flight, such as 10min; a plain number is in s.", show_default="the scenario's"
    ),
]
Threads = Annotated[
    int | None, typer.Option(min=1, help="Number of flights flown at the same time.", show_default="one per core")
]
Precision = Annotated[int, typer.Option(help="Bits per number: 32 or 64.")]
Device = Annotated[str, typer.Option(help="auto, cpu, cuda (an NVIDIA GPU) or python (not compiled, for debugging).")]
Scheduler = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Fly on the workers of this dask scheduler.")]
Trust = Annotated[
    bool, typer.Option("--trust", help="Allow the Python code that a file names to run: a law, fitness functions.")
]
Law = Annotated[
    str | None,
    typer.Option(metavar="NAME|FILE.py", help="Fly this law instead of the scenario's.", show_default=False),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
PlotFile = Annotated[
    Path | None, typer.Option("--plot", metavar="FILE.png", help="Draw the trajectories of the first flight.")
]
SaveFile = Annotated[Path | None, typer.Option("--save", metavar="FILE.nc", help="Save the recordings as netCDF.")]


def collect_option_errors(context: typer.Context) -> ErrorCollector:
    """Return an ErrorCollector with the errors of the command line's numbers: unreadable or out of range."""
    return ErrorCollector(context.meta.get(ERRORS_KEY, ()))


def parse_settings(
    pairs: list[str] | None, agents: int | None = None, duration: str | None = None, option: str = "--set"
) -> dict[str, Any]:
    """Return keys and values of --set (or another option) and its short forms; values are read as TOML, or else as
    text.
    """
    values: dict[str, Any] = {}
    errors = []
    for pair in pairs or []:
        key, equals, text = pair.partition("=")
        if not equals or not key.strip():
            errors.append(f"{option} {pair}: write KEY=VALUE, for instance {option} model.p_rep=0.14")
            continue
        with collect_errors(errors):
            values[key.strip()] = parse_option_value(text, f"{option} {key.strip()}")
    short: dict[str, tuple[str, float]] = {}
    if agents is not None:
        short["agents"] = (str(agents), agents)
    if duration is not None:
        with collect_errors(errors):
            short["duration"] = (duration, parse_seconds(duration, "--duration"))
    errors += _range_errors(short)
    raise_errors(errors)
    return values | {key: number for key, (_, number) in short.items()}


def _range_errors(short_options: Mapping[str, tuple[str, float]]) -> list[str]:
    """Return range errors of --agents and --duration, each as it is written and as a number."""
    if not short_options:
        return []
    from airflock.core import Quantity, declarations, quantity_error
    from airflock.scenarios import Flight

    known = {name: declared for name, declared, _ in declarations(Flight) if isinstance(declared, Quantity)}
    return [
        f"--{key} {written} lies outside {known[key].span}"
        for key, (written, number) in short_options.items()
        if quantity_error(float(number), known[key])
    ]


def parse_seconds(text: str, option: str = "--budget") -> float:
    """Return the seconds of a time such as 90s, 10min or 2h; ScenarioError for anything else."""
    match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(s|min|h)?\s*", text)
    if match is None or not 0.0 < float(match[1]) < math.inf:
        raise ScenarioError([f"{option} {text}: write a time above 0 such as 90s, 10min or 2h"])
    return float(match[1]) * SECONDS_PER_UNIT[match[2] or "s"]


def parse_option_value(text: str, option: str) -> Any:
    """Return a TOML value, or the text itself if it is none; `where` names the option in errors."""
    with as_error(option):
        return parse_toml_value(text)


def raise_errors(errors: list[str]) -> None:
    """Raise all collected errors, if there are any."""
    if errors:
        raise ScenarioError(errors)


def check_writable(*outputs: tuple[Path | None, tuple[str, ...]], reads: Sequence[str | Path | None] = ()) -> None:
    """Refuse output files that cannot be written, each with its possible endings, before any work is done.

    reads : what the command reads, names of presets among it: none of these files is written over
    """
    import os

    errors = []
    for path, endings in outputs:
        if path is None:
            continue
        folder, error = path.parent, suffix_error(path, endings)
        if error:
            errors.append(error)
        if not folder.is_dir():
            errors.append(f"{path}: the folder {folder} does not exist")
        elif path.is_dir() or not os.access(folder, os.W_OK):
            errors.append(f"{path}: cannot be written")
        elif path.exists() and any(is_file(read) and path.samefile(read) for read in reads if read is not None):
            errors.append(f"{path}: is an input and would be overwritten; give another file to write")
    raise_errors(errors)


def announce_run_time(scenarios: Sequence[Any], threads: int | None, device: str) -> None:
    """Print how long flights on the processor will take, if that is more than a minute."""
    from airflock.cli.terminal import print_message
    from airflock.scenarios import run_time_note
    from airflock.support import available_cores

    note = run_time_note(scenarios, threads or available_cores()) if device == "cpu" else ""
    if note:
        print_message(f"note: {note} on {min(threads or available_cores(), available_cores())} cores")


def compile_before_bar(scenario: Any, precision: int, device: str) -> None:
    """Compile the driver of a scenario before a bar on the terminal begins, so that its rate is of flights."""
    import sys

    if device == "cpu" and sys.stderr.isatty():
        from airflock.engine import compile_for

        compile_for(scenario, precision=precision)


def collect_settings(
    errors: ErrorCollector, changes: list[str] | None, agents: int | None, duration: str | None
) -> dict[str, Any]:
    """Return the settings of these options; if the number of agents is invalid, still check the others."""
    return invalid_if(agents, errors.read(parse_settings, changes, value_or_default(agents, None), duration))


def collect_scenario(
    errors: ErrorCollector, name: str, settings: Mapping[str, Any], law: str | None = None, *, trust: bool
) -> Any:
    """Return the named scenario with its changes; if a change is invalid, still check the name and its file."""
    from airflock.scenarios import load

    return invalid_if(settings, errors.read(load, name, value_or_default(settings, {}), law, trust=trust))


def seeds_from(first: int, count: int) -> list[int]:
    """Return the seeds of --first-seed and --seeds."""
    from airflock.scenarios import check_seeds

    return check_seeds(range(first, first + count))


def check_flight_options(device: str, precision: int, scheduler: str | None = None) -> None:
    """Refuse an unknown device, a wrong number of bits, and workers on another device than a cpu."""
    from airflock.runs import check_worker_device
    from airflock.support import check_device, check_precision

    together = ErrorCollector()
    together.read(check_device, device)
    together.read(check_precision, precision)
    together.read(check_worker_device, scheduler, device)
    together.raise_errors()


def parse_position(option: str, text: str) -> tuple[float, float, float]:
    """Parse latitude and longitude (degrees) and altitude (m)."""
    try:
        latitude, longitude, altitude = (float(part) for part in text.split(","))
        if not math.isfinite(latitude + longitude + altitude):
            raise ValueError
    except ValueError as error:
        raise ScenarioError([f"{option} {text}: is not LAT,LON,ALT, for instance 47.50,19.04,120"]) from error
    return latitude, longitude, altitude
