"""Read arrays and datasets: files of NumPy and MATLAB, of idtracker.ai and SLEAP, and datasets of `movement`."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.imports import table_columns
from airflock.recordings.imports.read_tables import choose_keypoint, read_frame
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportOptions,
    ImportReport,
)
from airflock.recordings.reader_process import ReaderProcess, read_hdf5_arrays, read_mat_arrays, read_netcdf_arrays
from airflock.support import RecordingError, collect_errors

# NumPy arrays are never unpickled: a pickle runs code when it is read.
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
    findings.raise_errors()
    rate, scale = options.use("fps") or fps, math.nan
    options.used.update({"time_unit"} if options.time_unit == "frames" else ())
    errors = [] if rate else [f"{where}: counts frames; say how many a second: --fps 25"]
    with collect_errors(errors):
        scale = table_columns.unit_in_metres("", where, "array", options)
    if errors or rate is None:
        raise RecordingError("\n".join(errors))
    frames = np.arange(len(values))
    found = []
    for number in range(values.shape[1]):
        own = values[:, number].astype(float) * scale
        columns = {axis: own[:, c] for c, axis in enumerate(POSITION_TARGETS[: own.shape[1]])}
        name = names[number] if names else str(number + 1)
        found.append(ImportedTrack(name, where, frames / rate, columns, frames))
    return found


def _step(values: Any, axis: int) -> float:
    """Return the median step along an axis; 0 where there is none."""
    step = np.abs(np.diff(values.astype(float), axis=axis))
    return float(np.median(step[np.isfinite(step)])) if np.isfinite(step).any() else 0.0


def _roughness(values: Any, axis: int) -> float:
    """Return by how much steps along an axis change, relative to the steps: little along time, if it is one."""
    if values.shape[axis] < 3:
        return math.inf
    step = np.diff(values.astype(float), axis=axis)
    turn = np.diff(step, axis=axis)
    if not np.isfinite(turn).any():
        return math.inf
    return float(np.nanmedian(np.abs(turn)) / (np.nanmedian(np.abs(step)) + 1e-300))


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


def read_npy(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Read tracks of a .npy or .npz file of plain numbers."""
    refuse_pickled_arrays(path)
    with path.open("rb") as file:
        start = file.read(6)
    if start != b"\x93NUMPY" and start[:2] != b"PK":
        raise RecordingError(f"{path}: is not an array that NumPy wrote")
    try:
        with open(path, "rb") as file:
            loaded = np.load(file, allow_pickle=False)
            if isinstance(loaded, np.lib.npyio.NpzFile):
                if not loaded.files:
                    raise RecordingError(f"{path}: is an archive without an array")
                members = {name: _member(loaded, name) for name in loaded.files}
                strange = [name for name, member in members.items() if isinstance(member, bytes)]
                if strange:
                    raise RecordingError(f"{path}: is an archive of {strange[0]}, which is no array; unpack it first")
                return read_members(members, path, options, findings)
    except (ValueError, OSError, EOFError) as error:
        text = str(error).splitlines()[0]
        if "allow_pickle" in text or "pickle" in text.lower():
            raise RecordingError(_pickled(path)) from error
        raise RecordingError(f"{path}: is not an array of numbers: {text}") from error
    return read_array(loaded, options, str(path), findings=findings)


def _member(archive: Any, name: str) -> Any:
    """Return an array of an archive; an empty one in the place of pickled objects that nobody needs."""
    try:
        return archive[name]
    except ValueError:
        if name.lower() in POSITION_MEMBERS or len(archive.files) == 1:
            raise
        return np.empty((0, 0))


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


def read_mat(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Read tracks of a file of MATLAB: of its own format, or HDF5 since 7.3, whose axes are the other way round."""
    with path.open("rb") as file:
        new = b"MATLAB 7.3" in file.read(128)
    read = read_hdf5_arrays if new else read_mat_arrays
    plain = ReaderProcess(path, read, "a file of MATLAB").answer()
    arrays = {str(name): variable.values for name, variable in plain.variables.items()}
    return read_members({name: a.T if new else a for name, a in arrays.items()}, path, options, findings)


def refuse_pickled_arrays(path: Path) -> None:
    """Raise a RecordingError for a file of pickled objects."""
    with path.open("rb") as file:
        start = file.read(2)
    if start[:1] == b"\x80" and start[1:2] in b"\x02\x03\x04\x05":
        raise RecordingError(_pickled(path))


def _pickled(path: Path) -> str:
    return f"{path}: holds pickled Python objects, which could run code when read; {PLAIN}{COMMAND}".replace(
        "FILE", path.name
    )


def read_idtracker(file: xr.Dataset, path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Read trajectories.h5 of idtracker.ai (its documented keys), or any HDF5 file with such a dataset.

    file : its arrays and attributes, as `recordings.reader_process` hands them over
    """
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
    if "identities_labels" in file:
        entries["identities_labels"] = file["identities_labels"].values
    fps = float(entries["frames_per_second"]) if "frames_per_second" in entries else None
    body = entries.get("body_length")
    if body is not None and np.ndim(body) == 0:
        findings.notes.append(f"{path}: idtracker.ai gives a body length of {float(body):g} px")
    labels = entries.get("identities_labels")
    given = [] if labels is None else _texts(labels)
    names = given if len(given) == values.shape[1] else None
    return read_array(values, options, str(path), names, fps, findings)


def _texts(names: Any) -> list[str]:
    return [name.decode() if isinstance(name, bytes) else str(name) for name in np.atleast_1d(names).tolist()]


def _read_sleap(file: xr.Dataset, path: Path, options: ImportOptions) -> list[ImportedTrack]:
    """Read an analysis file of SLEAP: tracks (individual, axis, keypoint, frame) in pixels."""
    keypoints = _texts(file["node_names"].values)
    number = keypoints.index(choose_keypoint(keypoints, options, str(path)))
    values = file["tracks"].values[:, :, number].transpose(2, 0, 1)
    given = _texts(file["track_names"].values) if "track_names" in file else []
    return read_array(values, options, str(path), given if len(given) == values.shape[1] else None)


OLD = {"keypoints": "keypoint", "individuals": "individual"}  # until movement 0.16


def read_netcdf(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Read tracks of a netCDF file of `movement`, or of trajectories.h5 of idtracker.ai."""
    if path.suffix.lower() in (".h5", ".hdf5"):
        plain = ReaderProcess(path, read_hdf5_arrays, "a HDF5 file").answer()
        if "position" not in plain:
            return read_idtracker(plain, path, options, findings)
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
    rows = np.arange(len(seconds))
    tracks = []
    # Variables of unknown unit are ignored rather than guessed; velocities are then differentiated
    # from positions.
    for number, name in enumerate(found["individual"].values):
        own = found.isel(individual=number)
        position = own["position"].transpose("time", "space").values.astype(float) * scale
        columns = {axis: position[:, c] for c, axis in enumerate(axes)}
        for variable, names in (("velocity", VELOCITY_TARGETS), ("command", COMMAND_TARGETS)):
            if variable in own and {"time", "space"} == set(own[variable].dims):
                unit = str(own[variable].attrs.get("units", ""))
                if unit not in table_columns.SPEED_UNITS:
                    continue  # of unknown unit (frames, pixels) or no velocity: differentiated instead
                values = own[variable].transpose("time", "space").values.astype(float) * table_columns.SPEED_UNITS[unit]
                columns |= {names[c]: values[:, c] for c in range(len(axes))}
        track = ImportedTrack(str(name), where, seconds, columns, rows)
        # Airflock's own confidence says which frames were bridged, and no likelihood.
        if "confidence" in own and not str(found.attrs.get("source_software", "")).startswith("airflock"):
            track.flags = {"confidence": (table_columns.LIKELY, own["confidence"].values.astype(float))}
        tracks.append(track)
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
