"""Read arrays and datasets: files of NumPy and MATLAB, of idtracker.ai and SLEAP, and datasets of `movement`."""

import math
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.imports import reader, table_columns
from airflock.recordings.imports.read_tables import choose_keypoint, read_frame
from airflock.recordings.imports.table_columns import SPEED_UNITS
from airflock.recordings.imports.track import (
    COMPONENTS,
    POSITION_TARGETS,
    ImportedTrack,
    ImportOptions,
    ImportReport,
)
from airflock.recordings.reader_process import ReaderProcess, read_hdf5_arrays, read_mat_arrays, read_netcdf_arrays
from airflock.support import RecordingError, collect_errors

PICKLED = "holds pickled Python objects, which could run code when read; "
PLAIN = "idtrackerai_format SESSION --formats h5 writes plain numbers; or, if you trust the file, python -c "
COMMAND = "\"import numpy as np; np.save('plain.npy', np.load('FILE', allow_pickle=True).item()['trajectories'])\""


def read_array(
    array: Any, options: ImportOptions, where: str = "array", names: list[str] | None = None, fps: float | None = None,
    findings: ImportReport | None = None,
) -> list[ImportedTrack]:  # fmt: skip
    """Read tracks of an array (frame, individual, 2 or 3); nan where an individual is absent."""
    values = _numbers(array, where)
    if values.ndim == 2 and values.shape[1] in (2, 3):
        values = values[:, None, :]
    if values.ndim != 3 or values.shape[2] not in (2, 3):
        raise RecordingError(f"{where}: has shape {values.shape}; give (frame, individual, 2 or 3)")
    findings = ImportReport() if findings is None else findings
    even = np.diff(values[:, 0, 0]) if np.ndim(array) == 2 and values.shape[2] == 3 else np.empty(0)
    if len(even) > 3 and 0.0 <= np.ptp(even) < 1e-6 * even[0]:
        findings.add_error(
            f"{where}: column 1, row 1 on: grows by one step, as times do, and would be read as x; give a table with "
            'names, such as {"t": a[:, 0], "x": a[:, 1], "y": a[:, 2]}',
            "axes",
        )
    # Individuals on a grid are as even as frames; but frames outnumber them, and lie nearer to each other.
    grid = len(values) < values.shape[1] and _step(values, 0) > 5.0 * _step(values, 1)
    if _roughness(values, 1) < 0.5 and (_roughness(values, 0) > 1.0 or len(values) < 3 or grid):
        findings.add_error(
            f"{where}: {values.shape} are {len(values)} frames of {values.shape[1]} individuals, row 1 on, but places "
            "go more smoothly along the second axis than along the first: individuals first? Exchange the axes: "
            "python -c \"import numpy as np; np.save('frames.npy', ARRAY.swapaxes(0, 1))\"",
            "axes",
        )
    if values.shape[2] == 3 and _is_heading(values.astype(float)):
        findings.add_error(
            f"{where}: the third number of each place, row 1 on, goes as headings do, and would be read as a height: "
            "python -c \"import numpy as np; np.save('places.npy', ARRAY[..., :2])\"",
            "axes",
        )
    findings.raise_errors()
    rate, scale = options.use("fps") or fps, math.nan
    options.used.update({"time_unit"} if options.time_unit == "frames" else ())
    errors = [] if rate else [f"{where}: counts frames; say how many a second: --fps 25"]
    with collect_errors(errors):
        scale = table_columns.unit_in_metres("", where, "array", options)
    if errors or rate is None:
        raise RecordingError("\n".join(errors))
    if not names or len(names) != values.shape[1]:
        names = [str(number + 1) for number in range(values.shape[1])]
    return _tracks(where, names, np.arange(len(values)) / rate, {"position": (values, scale)})


def _tracks(where: str, names: list[str], time: Any, arrays: dict[str, tuple[Any, float]]) -> list[ImportedTrack]:
    """Return a track of each individual; arrays : variable → values (frame, individual, axis), and their factor to SI.

    Columns are copies, each for itself, so that memory is given back individual by individual.
    """
    return [
        ImportedTrack(name, where, time, {
            target: values[:, number, c].astype(float) * factor
            for variable, (values, factor) in arrays.items()
            for c, target in enumerate(COMPONENTS[variable][: values.shape[2]])
        }, np.arange(len(time)))
        for number, name in enumerate(names)
    ]  # fmt: skip


def _is_heading(values: Any) -> bool:
    """Return True if the third number of places (frame, individual, 3) is the direction of motion in the plane.

    It is, in radians or degrees, from any axis and turning either way, if course and angle stay
    together while they change. An angle that nobody moves by, as of an animal that waits, jumps by
    a whole turn now and then.
    """
    moved, third = np.diff(values[..., :2], axis=0), values[:-1, :, 2]
    far = np.linalg.norm(moved, axis=2)
    there = np.isfinite(far + third) & (far > 0.0)
    if there.sum() < 10:
        return False
    course = np.arctan2(moved[there][:, 1], moved[there][:, 0])
    steps = np.abs(np.diff(values[..., 2], axis=0))
    for turn in (2.0 * np.pi, 360.0):
        angle = third[there] * (2.0 * np.pi / turn)
        together = max(abs(np.exp(1j * (angle - course)).mean()), abs(np.exp(1j * (angle + course)).mean()))
        vary = max(abs(np.exp(1j * angle).mean()), abs(np.exp(1j * course).mean())) < 0.95
        within = np.ptp(third[there]) <= 1.001 * turn
        wraps = within and (steps > 0.9 * turn).any() and np.nanmedian(steps) < 0.1 * turn
        if (together > 0.95 and vary) or wraps:
            return True
    return False


def _step(values: Any, axis: int, order: int = 1) -> float:
    """Return the median step along an axis, or the change of steps; 0 where there is none."""
    step = np.abs(np.diff(values.astype(float), order, axis))
    return float(np.median(step[np.isfinite(step)])) if np.isfinite(step).any() else 0.0


def _roughness(values: Any, axis: int) -> float:
    """Return by how much steps along an axis change, relative to the steps: little along time, if it is one."""
    if not np.isfinite(np.diff(values.astype(float), 2, axis)).any():
        return math.inf
    return _step(values, axis, 2) / (_step(values, axis) + 1e-300)


def _numbers(array: Any, where: str) -> Any:
    """Return an array of numbers; nan where it is masked."""
    hidden = np.ma.getmaskarray(array) if np.ma.isMaskedArray(array) else None
    values = np.asarray(array)
    if values.dtype.kind not in "fiuO":
        raise RecordingError(f"{where}: holds {values.dtype}, not numbers; give positions as floats")
    try:
        values = values.astype(float) if values.dtype == object else values
    except (TypeError, ValueError) as error:
        raise RecordingError(f"{where}: holds what is not a number: {str(error).splitlines()[0]}") from error
    return values if hidden is None else np.where(hidden, np.nan, values)


@reader("arrays of NumPy", suffixes=(".npy", ".npz"))
def read_npy(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """(frame, individual, 2 or 3), with `--fps` and `--unit`. Of several arrays that of `positions, position,
    trajectories, pos, xyz, xy,
    tracks` is read, or `x` and `y` together; a note says which. Otherwise write `--map
    position:=NAME`.
    """
    try:
        with path.open("rb") as file:
            loaded = np.load(file, allow_pickle=False)
            if not isinstance(loaded, np.lib.npyio.NpzFile):
                return read_array(loaded, options, str(path), findings=findings)
            needed = [name for name in loaded.files if name.lower() in POSITION_MEMBERS or len(loaded.files) == 1]
            members = {}
            for name in loaded.files:
                # Pickled objects that nobody needs are in nobody's way.
                with suppress(*() if name in needed else (ValueError,)):
                    members[name] = loaded[name]
    except (ValueError, OSError, EOFError) as error:
        text = str(error).splitlines()[0]
        if "pickle" in text.lower():
            # NumPy arrays are never unpickled: a pickle runs code when it is read.
            raise RecordingError(f"{path}: {PICKLED}{PLAIN}{COMMAND}".replace("FILE", path.name)) from error
        raise RecordingError(f"{path}: is not an array of numbers: {text}") from error
    strange = [name for name, member in members.items() if isinstance(member, bytes)]
    if strange:
        raise RecordingError(f"{path}: is an archive of {strange[0]}, which is no array; unpack it first")
    return read_members(members, path, options, findings)


# What a member of a file of several arrays is called if it holds positions, the likeliest first.
POSITION_MEMBERS = ("positions", "position", "trajectories", "pos", "xyz", "xy", "tracks", "coordinates", "coords")


def read_members(
    members: dict[str, Any], path: Path, options: ImportOptions, findings: ImportReport
) -> list[ImportedTrack]:
    """Read tracks of several arrays by name: that of positions, which is noted, or x and y, which may be columns."""
    arrays = {name: np.asarray(member) for name, member in members.items() if np.ndim(member)}
    shown = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "no array"
    lower = {name.lower(): array for name, array in arrays.items()}
    fit = [word for word in POSITION_MEMBERS if word in lower and lower[word].ndim in (2, 3)]
    columns = {name: array.ravel() for name, array in arrays.items() if array.size == max(array.shape)}
    meanings = {meaning.target: name for name in columns if (meaning := table_columns.header_meaning(name))}
    if not fit and {"x", "y"} <= set(meanings):  # as TRex writes an individual
        count = len(columns[meanings["x"]])
        table = pd.DataFrame({name: column for name, column in columns.items() if len(column) == count})
        return read_frame(table, options, findings, str(path), path.stem)
    axes = [axis for axis in POSITION_TARGETS if axis in lower and lower[axis].ndim == 2]
    if not fit and axes[:2] == ["x", "y"] and len({lower[axis].shape for axis in axes}) == 1:
        arrays["positions"], fit = np.stack([lower[axis] for axis in axes], axis=-1), ["positions"]
    alone = len(arrays) == 1 and not re.search("vel|speed|acc|head|angle|orient", "".join(lower))
    likely = [name for name in arrays if (name.lower() == fit[0] if fit else alone)]
    chosen = options.map.get("position") or "".join(likely[:1])
    options.used.update({"map position"} if "position" in options.map else ())
    if chosen not in arrays:
        why = f"has no array {chosen}" if chosen else "has several arrays, of which none is called positions"
        raise RecordingError(
            f"{path}: {why}; it has {shown}; write --map position:=NAME of (frame, individual, 2 or 3)"
        )
    if len(arrays) > 1:
        findings.notes.append(f"{path}: {chosen} is read as positions; it has {shown}; otherwise --map position:=NAME")
    return read_array(arrays[chosen], options, str(path), findings=findings)


@reader("arrays of MATLAB", suffixes=(".mat",))
def read_mat(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """As those of NumPy; also in the format since 7.3, which is HDF5 and has the axes the other way round."""
    with path.open("rb") as file:
        new = b"MATLAB 7.3" in file.read(128)
    read = read_hdf5_arrays if new else read_mat_arrays
    plain = ReaderProcess(path, read, "a file of MATLAB").answer()
    arrays = {str(name): variable.values for name, variable in plain.variables.items()}
    return read_members({name: a.T if new else a for name, a in arrays.items()}, path, options, findings)


def _texts(names: Any) -> list[str]:
    return [name.decode() if isinstance(name, bytes) else str(name) for name in np.atleast_1d(names).tolist()]


def _read_sleap(file: xr.Dataset, path: Path, options: ImportOptions) -> list[ImportedTrack]:
    """Read an analysis file of SLEAP: tracks (individual, axis, keypoint, frame) in pixels."""
    keypoints = _texts(file["node_names"].values)
    number = keypoints.index(choose_keypoint(keypoints, options, str(path)))
    values = file["tracks"].values[:, :, number].transpose(2, 0, 1)
    names = _texts(file["track_names"].values) if "track_names" in file else None
    return read_array(values, options, str(path), names)


OLD = {"keypoints": "keypoint", "individuals": "individual"}  # until movement 0.16


@reader("HDF5 of movement, idtracker.ai or SLEAP", suffixes=(".h5", ".hdf5"))
def read_hdf5(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """`trajectories` of idtracker.ai with its frame rate, `tracks` of an analysis file of SLEAP by `--keypoint`,
    datasets of `movement`; other arrays as those of NumPy.
    """
    file = ReaderProcess(path, read_hdf5_arrays, "a HDF5 file").answer()
    if "position" in file:
        return read_netcdf(path, options, findings)
    if "node_names" in file and "tracks" in file:
        return _read_sleap(file, path, options)
    if "groups" in file.attrs and not file.variables:
        raise RecordingError(
            f"{path}: holds tables of pandas ({file.attrs['groups']}), whose names are pickled; give the CSV that "
            f"DeepLabCut writes beside it ({path.stem}.csv)"
        )
    if "trajectories" not in file:
        arrays = {str(name): variable.values for name, variable in file.variables.items()}
        return read_members(arrays, path, options, findings)
    values = file["trajectories"].values
    entries = {**{str(k): v.values[()] for k, v in file.variables.items() if v.shape == ()}, **file.attrs}
    fps = float(entries["frames_per_second"]) if "frames_per_second" in entries else None
    body = entries.get("body_length")
    if body is not None and np.ndim(body) == 0:
        findings.notes.append(f"{path}: idtracker.ai gives a body length of {float(body):g} px")
    labels = file["identities_labels"].values if "identities_labels" in file else entries.get("identities_labels")
    return read_array(values, options, str(path), None if labels is None else _texts(labels), fps, findings)


@reader("netCDF of movement", suffixes=(".nc",))
def read_netcdf(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """`position` by current names of dimensions and those up to 0.16, poses and boxes; `--keypoint` picks one
    keypoint. An xarray Dataset is read in the same way.
    """
    return read_dataset(ReaderProcess(path, read_netcdf_arrays, "a netCDF file").answer(), options, str(path))


def read_dataset(dataset: xr.Dataset, options: ImportOptions, where: str = "dataset") -> list[ImportedTrack]:
    """Read a dataset with the variable position (time, space, [keypoint,] individual), old or new dimension names."""
    found = dataset.rename({old: new for old, new in OLD.items() if old in dataset.dims})
    if "position" not in found:
        raise RecordingError(f"{where}: has no variable position; it has {', '.join(map(str, found.data_vars))}")
    lacks = [name for name in ("time", "space", "individual") if name not in found["position"].dims]
    if lacks:
        raise RecordingError(f"{where}: position lacks the dimension{'s' * (len(lacks) > 1)} {', '.join(lacks)}")
    if "keypoint" in found.dims:
        keypoints = [str(name) for name in found["keypoint"].values]
        found = found.isel(keypoint=keypoints.index(choose_keypoint(keypoints, options, where)))
    axes = [str(axis) for axis in found["space"].values]
    if axes not in (["x", "y"], ["x", "y", "z"]):
        raise RecordingError(f"{where}: space has the axes {', '.join(axes)}, not x, y or x, y, z")
    errors: list[str] = []
    seconds, scale = np.empty(0), np.nan
    with collect_errors(errors):
        seconds = _seconds(found, options, where)
    with collect_errors(errors):
        scale = table_columns.unit_in_metres(str(found["position"].attrs.get("units", "")), where, "position", options)
    if errors:
        raise RecordingError("\n".join(errors))
    # Variables of unknown unit (frames, pixels) are ignored rather than guessed; velocities are then differentiated
    # from positions.
    order = ("time", "individual", "space")
    arrays = {"position": (found["position"].transpose(*order).values, scale)}
    for variable in ("velocity", "command"):
        factor = SPEED_UNITS.get(str(found[variable].attrs.get("units", ""))) if variable in found else None
        if factor is not None and set(order) == set(found[variable].dims):
            arrays[variable] = (found[variable].transpose(*order).values, factor)
    tracks = _tracks(where, [str(name) for name in found["individual"].values], seconds, arrays)
    # Airflock's own confidence says which frames were bridged, and no likelihood.
    if "confidence" in found and not str(found.attrs.get("source_software", "")).startswith("airflock"):
        for number, track in enumerate(tracks):
            likely = found.isel(individual=number)["confidence"].values.astype(float)
            track.flags = {"confidence": (table_columns.LIKELY, likely)}
    return tracks


def _seconds(found: xr.Dataset, options: ImportOptions, where: str) -> Any:
    times = found["time"].values
    if times.dtype.kind in "mM":  # dates and durations of NumPy say themselves what they count
        ticks = times.astype(f"{'timedelta64' if times.dtype.kind == 'm' else 'datetime64'}[us]").astype(np.int64)
        return np.where(np.isnat(times), np.nan, ticks * 1e-6)
    times = times.astype(float)
    unit = options.use("time_unit") or str(found.attrs.get("time_unit", found["time"].attrs.get("units", "")))
    if unit in ("frames", "frame", ""):
        rate = options.use("fps") or float(found.attrs.get("fps") or 0.0)
        if not rate > 0.0:
            raise RecordingError(f"{where}: counts frames; say how many a second: --fps 25")
        return times / rate
    unit, factors = table_columns.UNIT_WORDS.get(unit, unit), table_columns.TIME_UNITS
    if unit not in factors:
        raise RecordingError(
            f"{where}: {unit}: unknown unit of time; known: {', '.join(table_columns.TIME_UNITS)}, frames"
        )
    return times * factors[unit]
