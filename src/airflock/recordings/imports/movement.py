"""Datasets of `movement` (and Airflock's own): netCDF files or xarray, dimension names of both generations."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from airflock.recordings.imports import headers
from airflock.recordings.imports.arrays import read_idtracker
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportOptions,
    ImportReport,
)
from airflock.recordings.isolated import ReaderProcess, read_hdf5_arrays, read_netcdf_arrays
from airflock.support import RecordingError, collect_errors

OLD = {"keypoints": "keypoint", "individuals": "individual"}  # until movement 0.16


def read_netcdf(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Tracks of a netCDF file of `movement`, or of trajectories.h5 of idtracker.ai."""
    if path.suffix.lower() in (".h5", ".hdf5"):
        plain = ReaderProcess(path, read_hdf5_arrays, "a HDF5 file").answer()
        if "position" not in plain:
            return read_idtracker(plain, path, options, findings)
    return read_dataset(ReaderProcess(path, read_netcdf_arrays, "a netCDF file").answer(), options, str(path))


def read_dataset(dataset: xr.Dataset, options: ImportOptions, where: str = "dataset") -> list[ImportedTrack]:
    """Tracks of a dataset with a variable position (time, space, [keypoint,] individual), either generation's names."""
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
    faults: list[str] = []
    seconds, scale = np.empty(0), np.nan
    with collect_errors(faults):
        seconds = _seconds(found, options, where)
    with collect_errors(faults):
        scale = headers.unit_in_metres(str(found["position"].attrs.get("units", "")), where, "position", options)
    if faults:
        raise RecordingError("\n".join(faults))
    rows = np.arange(len(seconds))
    tracks = []
    for number, name in enumerate(found["individual"].values):
        own = found.isel(individual=number)
        position = own["position"].transpose("time", "space").values.astype(float) * scale
        columns = {axis: position[:, c] for c, axis in enumerate(axes)}
        for variable, names in (("velocity", VELOCITY_TARGETS), ("command", COMMAND_TARGETS)):
            if variable in own and {"time", "space"} == set(own[variable].dims):
                told = str(own[variable].attrs.get("units", ""))
                if told not in headers.SPEED_UNITS:
                    continue  # of unknown unit (frames, pixels) or no velocity: differentiated instead
                values = own[variable].transpose("time", "space").values.astype(float) * headers.SPEED_UNITS[told]
                columns |= {names[c]: values[:, c] for c in range(len(axes))}
        tracks.append(ImportedTrack(str(name), where, seconds, columns, rows))
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
    factors = {**headers.TIME_UNITS, "seconds": 1.0, "second": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6}
    if unit not in factors:
        raise RecordingError(f"{where}: {unit}: unknown unit of time; known: {', '.join(headers.TIME_UNITS)}, frames")
    return times * factors[unit]
