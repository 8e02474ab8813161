"""Verbs import and export: tracks of others in, recordings out."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import counting_parts
from airflock.support import RECORDINGS, RecordingError, collect_errors

Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE...", show_default=False,
        help=".csv, .parquet, .ulg (PX4), .bin and .tlog (ArduPilot), .log (our nodes), .nc and .h5 (movement, "
        "idtracker.ai), .npy, .npz",
    ),
]  # fmt: skip
Map = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="TARGET:=COLUMNS", help="For instance x:=pos_e or t:=time_us*1e-6; repeatable."),
]
Unit = Annotated[str, typer.Option(metavar="UNIT", help="Unit of lengths that have none: m, cm, mm, km, ft, px.")]
Scale = Annotated[float | None, typer.Option(help="Metres per pixel.", show_default=False)]
TimeUnit = Annotated[
    str, typer.Option(metavar="UNIT", help="Unit of times that have none: s, ms, us, ns, min, frames.")
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
    typer.Option(metavar="KIND", help="Keep what looks wrong: absent, axes, down, duplicates, height, jumps, time."),
]
Decimal = Annotated[str, typer.Option(help="Decimal point of a text file: . or ,")]
Delimiter = Annotated[str, typer.Option(help="Separator between columns of a text file.", show_default="detected")]


def parse_mapping(pairs: list[str] | None) -> dict[str, str]:
    """Targets and expressions of --map; := and = are the same."""
    columns: dict[str, str] = {}
    faults = []
    for pair in pairs or []:
        target, sign, text = pair.partition(":=") if ":=" in pair else pair.partition("=")
        if not sign or not target.strip() or not text.strip():
            faults.append(f"--map {pair}: write TARGET:=COLUMNS, for instance --map x:=pos_e")
        elif target.strip() in columns:
            faults.append(f"--map {pair}: {target.strip()} is mapped twice")
        columns[target.strip()] = text.strip()
    if faults:
        raise RecordingError("\n".join(faults))
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

    faults: list[str] = []
    with collect_errors(faults):
        options.check_writable((save, RECORDINGS), reads=files)
    with collect_errors(faults):
        how = parse_mapping(map)
    with collect_errors(faults):
        place = _origin(origin)
    options.raise_errors(faults)
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
        tables.print_json({"saved": str(save), "sizes": sizes, "fps": recording.attrs["fps"], "notes": notes})
        return
    for note in notes:
        tables.print_message(f"note: {note}")
    tables.print_message(f"saved {save}")


def reading_progress(files: int, quiet: bool) -> Any:
    """A bar that follows the share of each file that has been read."""
    from contextlib import contextmanager

    @contextmanager
    def shown() -> Any:
        with counting_parts("reading", 100 * files, quiet=quiet) as step:
            state = {"file": 0, "share": 0.0, "told": 0}

            def done(share: float) -> None:
                state["share"] = min(1.0, share)
                ahead = int(100 * (state["file"] + state["share"]))
                while state["told"] < ahead:
                    step()
                    state["told"] += 1
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
    tables.print_message(f"saved {out}{ned}")
