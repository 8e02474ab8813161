"""Load tracks of others: read files, tables and arrays, check them, and return a recording or all errors at once."""

import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.dataset import EAST_NORTH_UP, FRAME_ATTRIBUTE
from airflock.recordings.imports import (
    SNIFFED,
    array_readers,
    common_frame,
    format_words,
    formats,
    read_tables,
    resampling,
    table_columns,
    track_checks,
)
from airflock.recordings.imports.common_frame import to_local_frame
from airflock.recordings.imports.table_columns import TIME_UNITS, quote_column
from airflock.recordings.imports.track import (
    ACCEPTABLE_ERRORS,
    GEODETIC_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportOptions,
    ImportReport,
    ignore_progress,
)
from airflock.recordings.imports.track_checks import SINCE_1970, SLOW
from airflock.recordings.reader_process import refuse_archive
from airflock.support import RecordingError, as_error, expand_path, is_number, log


def load_tracks(
    source: Any,
    *,
    map: Mapping[str, str] | None = None,
    unit: str = "",
    scale: float | None = None,
    time_unit: str = "",
    fps: float | None = None,
    keypoint: str = "",
    axes: str = "",
    origin: tuple[float, float, float] | None = None,
    rate: float | None = None,
    bridge: float = 1.0,
    begin: float | None = None,
    end: float | None = None,
    same_clock: bool = False,
    accept: Iterable[str] = (),
    decimal: str = ".",
    delimiter: str = "",
    precision: int = 32,
    say: Callable[[str], None] | None = log,
    done: Callable[[float], None] = ignore_progress,
) -> xr.Dataset:
    """Make a recording of tracks from other programs and vehicles: flight logs and animals.

    Parameters
    ----------
    source : path, list of paths, pandas.DataFrame, mapping of columns, xarray.Dataset or array (FILE...)
        A file or several of the formats that airflock import --help lists, a table, such as
        {"t": [...], "id": [...], "x": [...]}, a Dataset of `movement`, or an array (frame, individual, 2 or 3).
    map : mapping (TARGET:=COLUMNS), optional
        Target → expression of columns, e.g. {"t": "time_us*1e-6", "x": "pos_e", "id": "file"}, for a command
        t:=time_us*1e-6, repeatable; targets are t, x, y, z (m), vx, vy, vz, cx, cy, cz (velocity and its command, m/s),
        lat, lon (degrees), alt (m), utc (s since 1970), air (1 in flight), id and receiver (of which one is read).
        Headers with units need none: `x [mm]`, `time_us`. Of files of several arrays `position` is the name of one.
    unit : str (UNIT)
        Unit of lengths that have none: m, cm, mm, km, ft or px.
    scale : float, optional
        Metres per pixel, with px.
    time_unit : str (UNIT)
        Unit of times that have none: s, ms, us, ns, min or frames; of dates that leave it open: dmy or mdy.
    fps : float, optional
        Frames per second, with frames.
    keypoint : str
        Keypoint to use, where there are several.
    axes : str
        enu, or ned where x is north and z down; by default enu, but ned of a table with the fields of PX4.
    origin : tuple of float (LAT,LON[,HEIGHT]), optional
        Latitude, longitude (degrees) and height (m) of the local frame; by default the first fix.
    rate : float, optional
        Frames per second of the recording; by default the tracks' own.
    bridge : float
        Longest gap that is bridged, s (confidence 0.5); where a gap is longer, an individual is absent (nan).
    begin : float, optional
        First instant to keep, s.
    end : float, optional
        Last instant to keep, s.
    same_clock : bool
        The clocks of several files agree.
    accept : iterable of str (KIND)
        Kinds of errors that are intended: absent, axes, down, duplicates, height, jumps, rows, time.
    decimal : str
        Decimal point of a text file: . or ,
    delimiter : str
        Separator between columns of a text file; by default detected.
    precision : int
        Bits per number, 32 or 64; far from the origin, where 32 do not tell a centimetre, 64.
    say, done : callable, optional
        Called with each note, by default the logger `airflock`, and with the share that has been read.

    Returns
    -------
    xarray.Dataset
        (time, space, keypoint, individual): position (m, east-north-up), velocity (m/s; differentiated where it is
        not logged: central differences, one-sided at both ends of a track and of gaps), command (m/s) where
        logged, confidence.

    Raises
    ------
    RecordingError
        With one line per error: file, column, first row, and what to write instead.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> tracks = np.zeros((20, 2, 2))  # two individuals in a plane, both going east at 1 m/s
    >>> tracks[:, :, 0] = 0.1 * np.arange(20)[:, None]
    >>> tracks[:, 1, 1] = 2.0
    >>> recording = airflock.load_tracks(tracks, fps=10.0, unit="m")
    >>> dict(recording.position.sizes)
    {'time': 20, 'space': 2, 'keypoint': 1, 'individual': 2}
    """
    options = ImportOptions(
        map={} if map is None else map, unit=unit, scale=scale, time_unit=time_unit, fps=fps, keypoint=keypoint,
        axes=axes, decimal=decimal, delimiter=delimiter, done=done,
    )  # fmt: skip
    numbers = {"rate": rate, "bridge": bridge, "begin": begin, "end": end}
    findings = ImportReport()
    check_options(options, findings, numbers, precision, accept, origin)
    findings.accepted_kinds = frozenset([accept] if isinstance(accept, str) else accept)
    tracks, comparable = read_tracks(
        source, options, findings, origin=origin, same_clock=same_clock, begin=begin, end=end
    )
    track_checks.check_presence(tracks, findings)
    findings.raise_errors()
    if not all(track.has(VELOCITY_TARGETS) for track in tracks):
        findings.notes.append(
            "no velocity: differentiated from positions, one-sided at both ends of a track and of gaps; axes and units "
            "could not be checked against them"
        )
    begin, end = (None if moment is None else moment + findings.since for moment in (begin, end))
    times, period = resampling.time_grid(tracks, rate, begin, end)
    sources = sorted({track.source for track in tracks})
    kept, step = resampling.needed_bits(tracks, precision)
    if kept != precision:
        findings.notes.append(
            f"far from the origin: kept with 64 bits; 32 bits resolve positions there only to {step:.2g} m"
        )
    found, shares = resampling.resample(tracks, times, period, bridge, kept)
    gone = 1.0 - shares["present"]
    findings.notes.append(
        f"{found.sizes['individual']} individuals, {times[-1] - times[0]:.4g} s at {1 / period:.4g} Hz; "
        f"{gone:.1%} absent, {shares['bridged']:.1%} bridged (gaps up to {bridge:g} s)"
    )
    if "lost" in shares:
        findings.notes.append(
            f"{shares['lost_at']} has rows alone between gaps, which are in no frame ({shares['lost']} in all); "
            f"to use them, write --bridge {np.ceil(shares['apart']):g}"
        )
    if found.sizes["individual"] > 1 and period > 0.05:
        findings.notes.append(f"nearest distances between frames {period:.3g} s apart are upper bounds")
    found.attrs |= {
        "source_software": "airflock import", "source_file": ", ".join(sources), "airflock_comparable": int(comparable),
        "airflock_import": json.dumps({"notes": findings.notes}),
    }  # fmt: skip
    if tracks[0].origin is not None or tracks[0].ground or options.axes:  # axes that point east and north
        found.attrs[FRAME_ATTRIBUTE] = EAST_NORTH_UP
    if say is not None:
        for note in findings.notes:
            say(note)
    return found


def read_tracks(
    source: Any,
    options: ImportOptions,
    findings: ImportReport,
    *,
    origin: tuple[float, float, float] | None = None,
    same_clock: bool = False,
    begin: float | None = None,
    end: float | None = None,
) -> tuple[list[ImportedTrack], bool]:
    """Read and check tracks at their own times; return them, and True if their clocks agree. Raise RecordingError with
    all errors.

    begin, end : window of time, s; what lies outside is not checked for jumps
    """
    tracks = _read(source, options, findings)
    findings.raise_errors()
    _refuse_unused(tracks, options, findings)
    tracks = track_checks.drop_rejected_rows(tracks, findings)
    tracks = track_checks.drop_incomplete_rows(tracks, findings)
    track_checks.check_columns(tracks, findings)
    track_checks.note_missing_velocities(tracks, findings)
    for track in tracks:
        drop_corrupt_times(track, findings)
    track_checks.check_times(tracks, findings)
    track_checks.check_names(tracks, findings)
    track_checks.check_heights(tracks, options.axes, findings)
    to_local_frame(tracks, origin, findings)
    if origin is not None and not any(track.origin for track in tracks):
        findings.add_error("--origin: no file has latitudes and longitudes, nor an origin; leave it out")
    findings.raise_errors()
    track_checks.check_axes(tracks, findings)
    findings.raise_errors()
    # Axes first: jumps are judged by velocities, which must belong to the same axes as positions.
    comparable = common_frame.align_clocks(tracks, same_clock, findings)
    if begin is not None or end is not None:
        first = min(float(track.time[0]) for track in tracks)
        if first > SINCE_1970 and max(abs(moment) for moment in (begin, end) if moment is not None) < SINCE_1970:
            findings.since = first
            findings.notes.append("--begin and --end count from the first row, because times are seconds since 1970")
        tracks = cut_window(tracks, *(None if moment is None else moment + findings.since for moment in (begin, end)))
    track_checks.check_jumps(tracks, findings)
    for track in tracks:
        track_checks.note_resolution(track, findings)
    findings.raise_errors()
    for own in track_checks.tracks_by_source(tracks).values():
        _question_units(own, findings)
    findings.raise_errors()
    return tracks, comparable


# Options that are of no use are refused: a rate that is ignored gives speeds that are wrong in silence.
UNUSED = {
    "unit": "no length lacks a unit, and expressions of --map give metres",
    "scale": "nothing is in pixels; write --unit px as well",
    "time_unit": "no time lacks a unit, and expressions of --map give seconds",
    "fps": "column {t} counts no frames; if it does, write --time-unit frames as well",
    "keypoint": "no file has keypoints",
    "axes": "arrays, fixes and logs that say which axes theirs are stay as they are",
    **dict.fromkeys(("decimal", "delimiter"), "no file is a text"),
}


def _refuse_unused(tracks: list[ImportedTrack], options: ImportOptions, findings: ImportReport) -> None:
    """Add an error for each option that no file makes use of."""
    own = {name: getattr(options, name) for name in UNUSED if name not in options.used}
    for name, value in own.items():
        if value not in ("", None, "enu") and (name, value) != ("decimal", "."):
            why = UNUSED[name].format(t=tracks[0].label("t"))
            findings.errors.append(f"--{name.replace('_', '-')} {value}: of no use: {why}, or leave it out")
    for target, text in options.map.items():
        if f"map {target}" not in options.used:
            findings.errors.append(f"--map {target}:={text}: of no use: no file is read by it; leave it out")
    findings.raise_errors()


def drop_corrupt_times(track: ImportedTrack, findings: ImportReport) -> None:
    """Leave out rows whose time lies far off both neighbours, which agree, or years off all others; note the rows."""
    time, steps = track.time, np.diff(track.time)
    usual = float(np.median(np.abs(steps))) if len(steps) > 3 else 0.0
    if not usual or (steps.min() >= 0.0 and steps.max() <= 20.0 * usual):
        return
    ahead, behind = time[1:-1] - time[:-2], time[2:] - time[1:-1]
    lone = (np.minimum(np.abs(ahead), np.abs(behind)) > 20.0 * usual) & (np.abs(ahead + behind) < 20.0 * usual)
    lone = np.r_[steps[0] < -20.0 * usual, lone & ((ahead < 0.0) | (behind < 0.0)), steps[-1] < -20.0 * usual]
    bad = np.zeros(len(time), bool)
    # A row that came late has its place in a hole of the others; a corrupt time has none.
    for row in np.flatnonzero(lone) if lone.mean() < 0.1 else ():
        others = np.sort(np.delete(time, row))
        at = int(np.searchsorted(others, time[row]))
        bad[row] = not 0 < at < len(others) or others[at] - others[at - 1] < 1.5 * usual
    # A clock that was not set yet says 1970 or 1980 in the first rows.
    off = np.abs(time - np.median(time))
    bad |= off > max(1e7, 1e3 * float(np.ptp(np.quantile(time, [0.1, 0.9]))))
    if bad.any() and bad.mean() < 0.1:
        findings.notes.append(
            f"{track.source}: column {track.label('t')}: {bad.sum()} rows of {track.name} with a corrupt time left "
            f"out, first row {track.rows[bad][0]} ({time[bad][0]:.10g} s among times about {np.median(time):.10g} s)"
        )
        track.keep(~bad)


def _question_units(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Ask for units where nobody has named them and rows show others; of times note what was assumed.

    Rates and speeds judge all units by one measure: what no animal, robot or camera does is another
    unit.
    """
    some = [(track, slice(0, 10_000)) for track in tracks if len(track.time) > 1]
    if not some:
        return
    first, places = tracks[0], [track.stack(POSITION_TARGETS, 2)[rows] for track, rows in some]
    steps = [np.diff(track.time[rows]) for track, rows in some]
    speeds = [np.linalg.norm(np.diff(place, axis=0), axis=1) / step for place, step in zip(places, steps, strict=True)]
    moving = np.concatenate(speeds)
    moving = moving[moving > 0.0]
    usual = float(np.median(moving)) if len(moving) >= 5 else 0.0
    step = float(np.median(np.concatenate(steps)))
    t, x, y = (quote_column(first.label(name)) for name in ("t", "x", "y"))
    where, row = f"{first.source}: column", f"row {first.rows[0]}"
    logged = any(track.has(VELOCITY_TARGETS) for track in tracks)
    if "x" in first.unnamed and usual:
        line = f"{where} {first.label('x')}, {first.label('y')}, {row}: no unit, and rows move by {usual:.3g} a second"
        far = np.abs(every := np.concatenate(places)).max(axis=0)
        # A bird makes 1e-4 degrees a second; what moves as little in metres lies about the origin, or stands.
        if usual < SLOWEST and not logged and far.max() <= 180.0 and far.min() <= 90.0 and np.median(np.abs(every)) > 1:
            lon, lat = (y, x) if far[1] > 90.0 else (x, y)
            findings.add_error(
                f'{line}: degrees? Write --map "lon:={lon}" --map "lat:={lat}"; if they are metres, --unit m; if times '
                "are no seconds, for instance --time-unit ms or us"
            )
            return
        if usual > FASTEST:
            findings.add_error(f"{line}: cm or mm? Write --unit cm, or --unit mm; if they are metres, --unit m")
            return
    if logged or "t" not in first.user_labels or first.time[0] >= SINCE_1970:
        return
    bare = "t" in first.unnamed
    line = f"{where} {first.label('t')}, {row} on: {'no unit, and ' * bare}rows move by {usual:.3g} m/s"
    keep = "; if they are seconds, --time-unit s" if bare else ""
    if usual > (FASTEST if bare else MAX_SPEED) or (bare and step < QUICKEST):
        # The shortest unit in which a camera takes the rows, and something flies as fast.
        units = {"min": 60.0, "h": 3600.0} if bare else {}
        fit = [unit for unit, long in units.items() if step * long >= QUICKEST and usual <= long * FASTEST]
        findings.add_error(
            f"{line}, {1 / step:.4g} of them a second, faster than anything that flies or films: "
            f"{f'Write --time-unit {fit[0]}; or ' if fit else ''}if times are days, as in spreadsheets, write "
            f'--map "t:={t}*86400", if hours *3600, if minutes *60; or name the unit of lengths{keep}', "time",
        )  # fmt: skip
    elif bare and step >= SLOW and (usual <= 1e-3 * FASTEST or "x" in first.unnamed):
        unit = next((unit for unit in ("ms", "us") if step * TIME_UNITS[unit] < SLOW), "ns")
        findings.add_error(f"{line} and are {step:g} apart: {unit}? Write --time-unit {unit}{keep}", "time")
    elif bare:
        findings.notes.append(
            f"{where} {first.label('t')} without a unit: taken as s, so that rows are {step:.4g} s apart and move by "
            f"{usual:.3g} m/s; if not, write for instance --time-unit ms or min"
        )


def cut_window(tracks: list[ImportedTrack], begin: float | None, end: float | None) -> list[ImportedTrack]:
    """Cut tracks to a window of time, s; leave out those without a row in it."""
    low, high = -np.inf if begin is None else begin, np.inf if end is None else end
    first, last = min(track.time[0] for track in tracks), max(track.time[-1] for track in tracks)
    # The tolerance of the grid, so that a frame exactly on the border is not lost by rounding.
    for track in tracks:
        late = resampling.grid_tolerance(track_checks.median_period(track), *track.time[[0, -1]])
        track.keep((track.time >= low - late) & (track.time <= high + late))
    there = [track for track in tracks if len(track.time)]
    if not there:
        raise RecordingError(
            f"no rows between {low:g} and {high:g} s; --begin and --end must overlap {first:.10g} to {last:.10g} s"
        )
    return there


def _read(what: Any, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    if isinstance(what, xr.Dataset):  # which is a mapping, too
        return array_readers.read_dataset(what, options)
    if isinstance(what, Mapping):
        what = read_tables.table_from_columns(what)
    if isinstance(what, pd.DataFrame):
        return read_tables.read_frame(what, options, findings)
    if isinstance(what, np.ndarray):
        return array_readers.read_array(what, options, findings=findings)
    if isinstance(what, (str, os.PathLike)):
        what = [what]
    try:
        files = [expand_path(name) for name in what]
    except TypeError as error:
        raise RecordingError(
            f"{type(what).__name__} holds no tracks; give files, a DataFrame, a Dataset or an array"
        ) from error
    if not files:
        raise RecordingError("no files to import")
    tracks = []
    # A reader that has read all is not done yet: each file is reported as read once, below.
    reading = replace(options, done=lambda share: options.done(min(share, 0.999)))
    for path in files:
        try:
            tracks += _placed(path, read_file(path, reading, findings))
        except RecordingError as error:
            findings.errors += str(error).splitlines()
        options.done(1.0)
    return tracks


def _placed(path: Path, tracks: list[ImportedTrack]) -> list[ImportedTrack]:
    """Tracks that have a place at every time; raises RecordingError for one without."""
    for track in tracks:
        if not any(set(names) <= set(track.columns) for names in (POSITION_TARGETS[:2], GEODETIC_TARGETS[:2])):
            raise RecordingError(f"{path}: {track.name} has no positions")
    return tracks


SLOWEST, FASTEST = 2.5e-3, 100.0  # m/s: usual speeds beyond are in other units, where nobody has named them
MAX_SPEED = 1000.0  # m/s of usual motion; faster than an aircraft of any kind whose flock could be scored
QUICKEST = 1.0 / 300.0  # s between rows; only cameras of high speed are quicker, whose files count frames


# All options are checked together, so that a user corrects them in one go.
def check_options(
    options: ImportOptions, findings: ImportReport, numbers: Mapping[str, Any], precision: Any, accept: Any, origin: Any
) -> None:
    """Refuse options that cannot be meant, all at once. Raises RecordingError."""
    choices = {
        "unit": (*table_columns.LENGTH_UNITS, *table_columns.PIXEL_UNITS),
        "time_unit": (*TIME_UNITS, "frames", *table_columns.DATE_ORDERS), "axes": ("enu", "ned"),
    }  # fmt: skip

    def check(sound: Any, line: str) -> None:
        findings.errors += [] if sound else [line]

    for name, allowed in {**choices, "decimal": (".", ",")}.items():
        value = getattr(options, name)
        sound = isinstance(value, str) and (value in allowed or (name in choices and not value))
        check(sound, f"{name} = {value!r} is none of {', '.join(allowed)}")
    for name in ("keypoint", "delimiter"):
        check(isinstance(getattr(options, name), str), f"{name} = {getattr(options, name)!r} is no text")
    line = f'map = {options.map!r}: give targets with expressions, such as {{"t": "time_us*1e-6"}}'
    check(isinstance(options.map, Mapping), line)
    for key, text in options.map.items() if isinstance(options.map, Mapping) else ():
        check(isinstance(text, str), f"map: {key} = {text!r} is no text; an expression is one")
    for name, number in {"scale": options.scale, "fps": options.fps, "rate": numbers["rate"]}.items():
        sound = number is None or (is_number(number) and 0.0 < number < 1e9)
        check(sound, f"{name} = {_shown(number)} must be a number above 0")
    bridge = numbers["bridge"]
    check(is_number(bridge) and 0.0 <= bridge < 1e9, f"bridge = {_shown(bridge)} s must be a number, 0 or more")
    for name in ("begin", "end"):
        sound = numbers[name] is None or (is_number(numbers[name]) and np.isfinite(numbers[name]))
        check(sound, f"{name} = {_shown(numbers[name])} is not a time in s")
    check(is_number(precision) and precision in (32, 64), f"precision = {precision} is none of 32, 64")
    line = f"origin = {origin!r} is not (latitude, longitude, height) in degrees, degrees and m"
    check(origin is None or _is_origin(origin), line)
    for kind in [accept] if isinstance(accept, str) or not isinstance(accept, Iterable) else accept:
        check(str(kind) in ACCEPTABLE_ERRORS, f"accept = {kind} is none of {', '.join(ACCEPTABLE_ERRORS)}")
    findings.raise_errors()


def _shown(value: Any) -> str:
    return f"{value:g}" if is_number(value) else repr(value)


def _is_origin(given: Any) -> bool:
    """Return True for a latitude, a longitude and a height."""
    numbers = list(given) if isinstance(given, Iterable) else []
    sound = len(numbers) == 3 and all(is_number(number) and np.isfinite(number) for number in numbers)
    return sound and abs(numbers[0]) <= 90.0 and abs(numbers[1]) <= 360.0


def read_file(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Read the tracks of a file; raise RecordingError for an unknown format."""
    if path.is_dir():
        raise RecordingError(f"{path}: is a folder; name the files in it")
    if not path.is_file():
        raise RecordingError(f"{path}: no such file")
    refuse_archive(path)
    with as_error(path, RecordingError):  # libraries raise whatever they happen to where a file is damaged
        tracks: list[ImportedTrack] = _reader_of(path)(path, options, findings)
    return tracks


def _reader_of(path: Path) -> Callable[..., Any]:
    """Return the reader that the first bytes of a file name, else that of its ending; raise RecordingError."""
    with path.open("rb") as file:
        start = file.read(SNIFFED)
    ending, known = path.suffix.lower(), formats()
    own = [one for one in known if ending in one.suffixes]
    readers = [one.load() for one in own or known]
    fit = [read for read in readers if read.sniff is not None and read.sniff(start)]
    fit += [read for read in readers if own and read.sniff is None]
    if not fit:
        why = f"is no {own[0].name}, of which it has the ending" if own else f"{ending or 'no ending'}: unknown format"
        raise RecordingError(f"{path}: {why}; known: {format_words()}")
    read: Callable[..., Any] = fit[0]
    return read
