"""Read arrays and datasets: NumPy files, trajectories of idtracker.ai, and netCDF or HDF5 files of `movement`."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from airflock.recordings.imports import table_columns
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportOptions,
    ImportReport,
)
from airflock.recordings.reader_process import ReaderProcess, read_hdf5_arrays, read_netcdf_arrays
from airflock.support import RecordingError, collect_errors

# NumPy arrays are never unpickled: a pickle runs code when it is read.
PLAIN = "idtrackerai_format SESSION --formats h5 writes plain numbers; or, if you trust the file, python -c "
COMMAND = "\"import numpy as np; np.save('plain.npy', np.load('FILE', allow_pickle=True).item()['trajectories'])\""


def read_array(
    array: Any, options: ImportOptions, where: str = "array", names: list[str] | None = None, fps: float | None = None
) -> list[ImportedTrack]:
    """Read tracks of an array (frame, individual, 2 or 3); nan where an individual is absent."""
    values = _numbers(array, where)
    if values.ndim == 2 and values.shape[1] in (2, 3):
        values = values[:, None, :]
    if values.ndim != 3 or values.shape[2] not in (2, 3):
        raise RecordingError(f"{where}: has shape {values.shape}; give (frame, individual, 2 or 3)")
    rate, scale = options.fps or fps, math.nan
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
                names = [n for n in loaded.files if n in ("trajectories", "position", "tracks")] or loaded.files[:1]
                if not names:
                    raise RecordingError(f"{path}: is an archive without an array")
                loaded = loaded[names[0]]
                if isinstance(loaded, bytes):
                    raise RecordingError(f"{path}: is an archive of {names[0]}, which is no array; unpack it first")
    except (ValueError, OSError, EOFError) as error:
        text = str(error).splitlines()[0]
        if "allow_pickle" in text or "pickle" in text.lower():
            raise RecordingError(_pickled(path)) from error
        raise RecordingError(f"{path}: is not an array of numbers: {text}") from error
    return read_array(loaded, options, str(path))


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
    if "trajectories" not in file:
        shown = ", ".join([str(name) for name in file.variables][:8]) or "nothing"
        raise RecordingError(f"{path}: has no dataset trajectories, as idtracker.ai writes; it has {shown}")
    values = file["trajectories"].values
    entries = {**{str(k): v.values[()] for k, v in file.variables.items() if v.shape == ()}, **file.attrs}
    if "identities_labels" in file:
        entries["identities_labels"] = file["identities_labels"].values
    fps = float(entries["frames_per_second"]) if "frames_per_second" in entries else None
    body = entries.get("body_length")
    if body is not None and np.ndim(body) == 0:
        findings.notes.append(f"{path}: idtracker.ai gives a body length of {float(body):g} px")
    labels = entries.get("identities_labels")
    given = [] if labels is None else [str(name) for name in np.atleast_1d(labels)]
    names = given if len(given) == values.shape[1] else None
    return read_array(values, options, str(path), names, fps)


# Datasets of `movement`, and Airflock's own.
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
        found = found.sel(keypoint=_keypoint(found, options, where))
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


def _keypoint(found: xr.Dataset, options: ImportOptions, where: str) -> Any:
    names = [str(name) for name in found["keypoint"].values]
    if options.keypoint:
        if options.keypoint not in names:
            raise RecordingError(f"{where}: no keypoint {options.keypoint}; it has {', '.join(names)}")
        return found["keypoint"].values[names.index(options.keypoint)]
    if len(names) > 1:
        raise RecordingError(f"{where}: has {len(names)} keypoints ({', '.join(names[:8])}); choose one: --keypoint")
    return found["keypoint"].values[0]


def _seconds(found: xr.Dataset, options: ImportOptions, where: str) -> Any:
    times = found["time"].values
    if times.dtype.kind in "mM":  # dates and durations of NumPy say themselves what they count
        ticks = times.astype(f"{'timedelta64' if times.dtype.kind == 'm' else 'datetime64'}[us]").astype(np.int64)
        return np.where(np.isnat(times), np.nan, ticks * 1e-6)
    times = times.astype(float)
    unit = options.time_unit or str(found.attrs.get("time_unit", found["time"].attrs.get("units", "")))
    if unit in ("frames", "frame", ""):
        rate = options.fps or float(found.attrs.get("fps") or 0.0)
        if not rate > 0.0:
            raise RecordingError(f"{where}: counts frames; say how many a second: --fps 25")
        return times / rate
    factors = {**table_columns.TIME_UNITS, "seconds": 1.0, "second": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6}
    if unit not in factors:
        raise RecordingError(
            f"{where}: {unit}: unknown unit of time; known: {', '.join(table_columns.TIME_UNITS)}, frames"
        )
    return times * factors[unit]
