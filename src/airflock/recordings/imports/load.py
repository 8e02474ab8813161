"""The door: files, tables and arrays of others become a recording, or one line for everything that is wrong."""

import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from airflock.errors import RecordingError
from airflock.numeric import is_number
from airflock.recordings.imports import (
    absent,
    arrays,
    checks,
    clocks,
    geodesy,
    grid,
    headers,
    motion,
    movement,
    registry,
    tables,
)
from airflock.recordings.imports.track import (
    ACCEPTED,
    COMMAND,
    GEODETIC,
    POSITION,
    VELOCITY,
    Findings,
    Options,
    Track,
    nothing,
)
from airflock.untrusted import own_path


def load_tracks(
    what: Any,
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
    say: Callable[[str], None] | None = None,
    done: Callable[[float], None] = nothing,
) -> xr.Dataset:
    """Recording made of tracks of others: flight logs and animals.

    Parameters
    ----------
    what : path, list of paths, pandas.DataFrame, mapping of columns, xarray.Dataset or array
        A file or several (.csv, .parquet, .ulg, .bin, .tlog, .nc, .h5, .npy), a table, such as {"t": [...], "id":
        [...], "x": [...]}, a Dataset of `movement`, or an array (frame, individual, 2 or 3).
    map : mapping, optional
        Target → expression of columns, e.g. {"t": "time_us*1e-6", "x": "pos_e", "id": "file"}; targets are t, x, y, z
        (m), vx, vy, vz, cx, cy, cz (velocity and its command, m/s), lat, lon (degrees), alt (m), utc (s since 1970),
        air (1 in flight) and id. Headers with units need none: `x [mm]`, `time_us`.
    unit : str
        Of lengths that bring none: m, cm, mm, km, ft or px.
    scale : float, optional
        Metres per pixel, with px.
    time_unit : str
        Of times that bring none: s, ms, us, ns, min or frames.
    fps : float, optional
        Frames per second, with frames.
    keypoint : str
        Which one, where there are several.
    axes : str
        enu, or ned where x is north and z down; by default enu, but ned of a table with the fields of PX4.
    origin : tuple of float, optional
        Latitude, longitude (degrees) and height (m) of the local frame; by default the first fix.
    rate : float, optional
        Frames per second of the recording; by default the tracks' own.
    bridge : float
        Longest gap that is bridged, s (confidence 0.5); where a gap is longer, an individual is absent (nan).
    begin, end : float, optional
        Window of time, s.
    same_clock : bool
        The clocks of several files agree.
    accept : str or iterable of str
        Kinds of faults that are meant so: absent, axes, down, duplicates, height, jumps, time.
    decimal, delimiter : str
        Of a text file: its decimal point, and what stands between columns, which is found out by default.
    precision : int
        Bits per number, 32 or 64; far from the origin, where 32 do not tell a centimetre, 64.
    say, done : callable, optional
        Called with each note, and with the share that has been read.

    Returns
    -------
    xarray.Dataset
        (time, space, keypoint, individual): position (m, east-north-up), velocity (m/s; differentiated where it is
        not logged: central differences, one-sided at both ends of a track and of gaps), command (m/s) where
        logged, confidence.

    Raises
    ------
    RecordingError
        With one line per fault: file, column, first row, and what to write instead.

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
    options = Options(
        map={} if map is None else map, unit=unit, scale=scale, time_unit=time_unit, fps=fps, keypoint=keypoint,
        axes=axes, decimal=decimal, delimiter=delimiter, done=done,
    )  # fmt: skip
    numbers = {"rate": rate, "bridge": bridge, "begin": begin, "end": end}
    findings = Findings()
    _sound(options, findings, numbers, precision, accept, origin)
    findings.accept = frozenset([accept] if isinstance(accept, str) else accept)
    tracks, comparable = read_tracks(
        what, options, findings, origin=origin, same_clock=same_clock, begin=begin, end=end
    )
    checks.check_presence(tracks, findings)
    findings.refuse()
    if not all(track.has(VELOCITY) for track in tracks):
        findings.notes.append(
            "no velocity: differentiated from positions, one-sided at both ends of a track and of gaps; axes and units "
            "could not be checked against them"
        )
    times, period = grid.grid_of(tracks, rate, begin, end)
    sources = sorted({track.source for track in tracks})
    kept, step = grid.bits(tracks, precision)
    if kept != precision:
        findings.notes.append(
            f"far from the origin: kept with 64 bits; 32 bits resolve positions there only to {step:.2g} m"
        )
    found, shares = grid.recording(tracks, times, period, bridge, kept)
    gone = 1.0 - shares["present"]
    findings.notes.append(
        f"{found.sizes['individual']} individuals, {times[-1] - times[0]:.4g} s at {1 / period:.4g} Hz; "
        f"{gone:.1%} absent, {shares['bridged']:.1%} bridged (gaps up to {bridge:g} s)"
    )
    if found.sizes["individual"] > 1 and period > 0.05:
        findings.notes.append(f"nearest distances between frames {period:.3g} s apart are upper bounds")
    found.attrs |= {
        "source_software": "airflock import", "source_file": ", ".join(sources), "airflock_comparable": int(comparable),
        "airflock_import": json.dumps({"notes": findings.notes}),
    }  # fmt: skip
    if say is not None:
        for note in findings.notes:
            say(note)
    return found


def read_tracks(
    what: Any,
    options: Options,
    findings: Findings,
    *,
    origin: tuple[float, float, float] | None = None,
    same_clock: bool = False,
    begin: float | None = None,
    end: float | None = None,
) -> tuple[list[Track], bool]:
    """Checked tracks at their own times, and whether their clocks agree; raises RecordingError with every fault.

    begin, end : window of time, s; what lies outside is not checked for jumps
    """
    tracks = _read(what, options, findings)
    findings.refuse()
    tracks = absent.leave_out(tracks, findings)
    checks.check_columns(tracks, findings)
    absent.tell_speeds(tracks, findings)
    checks.check_times(tracks, findings)
    checks.check_names(tracks, findings)
    checks.check_heights(tracks, options.axes, findings)
    _to_metres(tracks, origin, findings)
    findings.refuse()
    motion.check_axes(tracks, findings)
    findings.refuse()
    comparable = clocks.align(tracks, same_clock, findings)
    if begin is not None or end is not None:
        tracks = cut(tracks, begin, end)
    for track in tracks:
        motion.check_jumps(track, findings)
        checks.note_steps(track, findings)
    findings.refuse()
    return tracks, comparable


def cut(tracks: list[Track], begin: float | None, end: float | None) -> list[Track]:
    """Tracks between two times, s; those that have none of it are left out."""
    low, high = -np.inf if begin is None else begin, np.inf if end is None else end
    for track in tracks:
        late = grid.slack(checks.period_of(track), *track.time[[0, -1]])
        track.keep((track.time >= low - late) & (track.time <= high + late))
    there = [track for track in tracks if len(track.time)]
    if not there:
        raise RecordingError(f"no rows between {low:g} and {high:g} s")
    return there


def _read(what: Any, options: Options, findings: Findings) -> list[Track]:
    if isinstance(what, xr.Dataset):  # which is a mapping, too
        return movement.read_dataset(what, options)
    if isinstance(what, Mapping):
        what = tables.table_of(what)
    if isinstance(what, pd.DataFrame):
        return tables.read_frame(what, options, findings)
    if isinstance(what, np.ndarray):
        return arrays.read_array(what, options)
    if isinstance(what, (str, os.PathLike)):
        what = [what]
    try:
        files = [own_path(name) for name in what]
    except TypeError as fault:
        raise RecordingError(
            f"{type(what).__name__} holds no tracks; give files, a DataFrame, a Dataset or an array"
        ) from fault
    if not files:
        raise RecordingError("no files to import")
    tracks = []
    for path in files:
        try:
            tracks += _placed(path, registry.read(path, options, findings))
        except RecordingError as fault:
            findings.faults += str(fault).splitlines()
        options.done(1.0)
    return tracks


def _placed(path: Path, tracks: list[Track]) -> list[Track]:
    """Tracks that have a place at every time; raises RecordingError for one without."""
    for track in tracks:
        if not any(set(names) <= set(track.columns) for names in (POSITION[:2], GEODETIC[:2])):
            raise RecordingError(f"{path}: {track.name} has no positions")
    return tracks


def _sound(
    options: Options, findings: Findings, numbers: Mapping[str, Any], precision: Any, accept: Any, origin: Any
) -> None:
    """Refuse options that cannot be meant, all at once."""
    faults = findings.faults
    known = {"unit": ("", *headers.LENGTHS, *headers.PIXELS), "time_unit": ("", *headers.TIMES, "frames")}
    for name, allowed in {**known, "axes": ("", "enu", "ned"), "decimal": (".", ",")}.items():
        value = getattr(options, name)
        if not isinstance(value, str) or value not in allowed:
            faults.append(f"{name} = {value!r} is none of {', '.join(text for text in allowed if text)}")
    given = {name: getattr(options, name) for name in ("keypoint", "delimiter")}
    faults += [f"{name} = {value!r} is no text" for name, value in given.items() if not isinstance(value, str)]
    if not isinstance(options.map, Mapping):
        faults.append(f'map = {options.map!r}: give targets with expressions, such as {{"t": "time_us*1e-6"}}')
    else:
        said = [(key, text) for key, text in options.map.items() if not isinstance(text, str)]
        faults += [f"map: {key} = {text!r} is no text; an expression is one" for key, text in said]
    for name, number in {"scale": options.scale, "fps": options.fps, "rate": numbers["rate"]}.items():
        if number is not None and not (is_number(number) and 0.0 < number < 1e9):
            faults.append(f"{name} = {_shown(number)} must be a number above 0")
    if not (is_number(numbers["bridge"]) and 0.0 <= numbers["bridge"] < 1e9):
        faults.append(f"bridge = {_shown(numbers['bridge'])} s must be a number, 0 or more")
    for name in ("begin", "end"):
        if numbers[name] is not None and not (is_number(numbers[name]) and np.isfinite(numbers[name])):
            faults.append(f"{name} = {_shown(numbers[name])} is not a time in s")
    if not is_number(precision) or precision not in (32, 64):
        faults.append(f"precision = {precision} is none of 32, 64")
    if origin is not None and not _is_origin(origin):
        faults.append(f"origin = {origin!r} is not (latitude, longitude, height) in degrees, degrees and m")
    kinds = [accept] if isinstance(accept, str) or not isinstance(accept, Iterable) else list(accept)
    faults += [f"accept = {kind} is none of {', '.join(ACCEPTED)}" for kind in kinds if str(kind) not in ACCEPTED]
    findings.refuse()


def _shown(value: Any) -> str:
    return f"{value:g}" if is_number(value) else repr(value)


def _is_origin(given: Any) -> bool:
    """Whether something is a latitude, a longitude and a height."""
    numbers = list(given) if isinstance(given, Iterable) else []
    sound = len(numbers) == 3 and all(is_number(number) and np.isfinite(number) for number in numbers)
    return sound and abs(numbers[0]) <= 90.0 and abs(numbers[1]) <= 360.0


def _to_metres(tracks: list[Track], origin: tuple[float, float, float] | None, findings: Findings) -> None:
    """Rule 3: latitude and longitude to local metres, and all frames about one origin."""
    geodetic = [t for t in tracks if "x" not in t.columns]
    placed = [t for t in tracks if "x" in t.columns and t.origin is not None]
    free = [t for t in tracks if "x" in t.columns and t.origin is None]
    if free and (geodetic or placed):
        findings.fault(
            f"{free[0].source}: has no origin, while {(geodetic or placed)[0].source} has one; import them separately"
        )
        return
    if origin is None and placed:
        origin = placed[0].origin
    for track in geodetic:
        fault = _degrees_fault(track)
        if fault:
            findings.fault(fault)
        elif len(track.columns["lat"]):
            if origin is None:
                origin = _first_fix(track)
                findings.notes.append(f"origin of the local frame: {origin[0]:.7f}, {origin[1]:.7f}, {origin[2]:.2f} m")
            _project(track, origin)
    for track in placed:
        assert origin is not None
        _move(track, origin)


def _degrees_fault(track: Track) -> str:
    """The first row that is no latitude and longitude, and what to write; empty if all are."""
    lat, lon = track.columns["lat"], track.columns["lon"]
    bad = np.flatnonzero((np.abs(lat) > 90.0) | (np.abs(lon) > 360.0))
    if not bad.size:
        return ""
    name = track.label("lat" if abs(lat[bad[0]]) > 90.0 else "lon")
    return (
        f"{track.source}: column {name}, row {track.rows[bad[0]]}: {lat[bad[0]]:g}, {lon[bad[0]]:g} is no "
        f"latitude and longitude; if it is in 1e-7 degrees, write --map 'lat:={track.label('lat')}*1e-7'"
    )


def _first_fix(track: Track) -> tuple[float, float, float]:
    """Latitude, longitude (degrees) and height (m) of a track's first row; 0 m where no height is logged."""
    height = track.columns["alt"][0] if "alt" in track.columns else 0.0
    return float(track.columns["lat"][0]), float(track.columns["lon"][0]), float(height)


def _project(track: Track, origin: tuple[float, float, float]) -> None:
    """Put local metres about an origin in the place of a track's latitude, longitude and height."""
    lat, lon = track.columns["lat"], track.columns["lon"]
    local = geodesy.enu(lat, lon, track.columns.get("alt", np.zeros(len(lat))), origin)
    axes = 3 if "alt" in track.columns else 2
    track.columns = {k: v for k, v in track.columns.items() if k not in GEODETIC}
    track.columns |= {axis: local[:, c] for c, axis in enumerate(POSITION[:axes])}
    track.labels |= {"x": track.label("lon"), "y": track.label("lat"), "z": track.label("alt")}
    track.origin = origin


def _move(track: Track, origin: tuple[float, float, float]) -> None:
    """Carry a track in local metres over to the frame about another origin."""
    assert track.origin is not None
    if track.origin == origin:
        return
    for names, change in ((POSITION, geodesy.moved), (VELOCITY, geodesy.turned), (COMMAND, geodesy.turned)):
        if track.has(names):
            moved = change(track.stack(names, 3), track.origin, origin)
            track.columns |= {name: moved[:, c] for c, name in enumerate(names) if name in track.columns}
    track.origin = origin
