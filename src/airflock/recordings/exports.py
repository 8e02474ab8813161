"""Write recordings for other tools: long CSV and Parquet tables, and netCDF in both layouts of `movement`."""

import os
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.dataset import DIMENSIONS, check_recording
from airflock.recordings.imports.track import COMPONENTS
from airflock.support import RecordingError, atomic, suffix_error, to_path

SUFFIXES = (".csv", ".parquet", ".nc")
LAYOUTS = ("movement", "movement-0.16", "px4")


def export(recording: xr.Dataset, path: str | os.PathLike[str], *, layout: str = "movement") -> Path:
    """Write a recording for other tools: a long table with units in its headers, or a dataset of `movement`.

    Parameters
    ----------
    recording : xarray.Dataset (FILE.nc)
        A recording (time, space, keypoint, individual), simulated, flown, imported or loaded.
    path : str or path
        File to write; its ending decides: .csv, .parquet or .nc.
    layout : {"movement", "movement-0.16", "px4"}
        Names of the dimensions of .nc: movement, or movement-0.16 for releases up to 0.16. Of .csv px4: microseconds
        and north-east-down, with the fields of a PX4 log.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    RecordingError
        If the ending or the layout is none of these, or the recording lacks positions; then nothing is written.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> airflock.export(airflock.simulate(short), "flight.csv").name
    'flight.csv'
    """
    target = to_path(path)
    wrong = suffix_error(target, SUFFIXES)
    if wrong:
        raise RecordingError(wrong)
    if layout not in LAYOUTS:
        raise RecordingError(f"layout = {layout!r} is none of {', '.join(LAYOUTS)}")
    ending = target.suffix.lower()
    if layout == "px4" and ending != ".csv":
        raise RecordingError(f"layout = 'px4' is a table; {target.name} ends in {target.suffix}: write .csv")
    if ending == ".nc":
        found = to_movement(recording, plural_dimensions=layout == "movement-0.16")
        atomic.write_file(target, found.to_netcdf(None, engine="h5netcdf"))
    elif ending == ".csv":
        table = (to_log_table if layout == "px4" else to_table)(recording)
        # A spreadsheet runs a cell that begins like a formula, and is no number; an apostrophe makes it a text.
        table["id"] = table["id"].where(~table["id"].str.match(r"\s*(?![+-]?[\d.]+$)[=+\-@]"), "'" + table["id"])
        atomic.write_file(target, table.to_csv(index=False))
    else:
        if find_spec("pyarrow") is None:
            raise RecordingError(f"{target}: Parquet needs pyarrow: pip install 'airflock[logs]'")
        with atomic.atomic_path(target) as temporary:
            to_table(recording).to_parquet(temporary, index=False, engine="pyarrow")
    return target


def to_table(recording: xr.Dataset) -> pd.DataFrame:
    """Make a long table: id, t [s], x [m], ..., vx [m/s], ..., cx [m/s], ...; absent individuals have no rows."""
    check_recording(recording)
    order = ("individual", "time", "space", "keypoint")
    count, times = recording.sizes["individual"], recording["time"].values.astype(float)
    columns: dict[str, object] = {
        "id": np.repeat(recording["individual"].values.astype(str), len(times)),
        "t [s]": np.tile(times, count),
    }
    for variable, names in COMPONENTS.items():
        if variable not in recording:
            continue
        values = recording[variable].transpose(*order).isel(keypoint=0).values
        unit = str(recording[variable].attrs.get("units", ""))
        for c in range(recording.sizes["space"]):
            header = f"{names[c]} [{unit}]" if unit else names[c]
            columns[header] = values[:, :, c].reshape(-1)
    table = pd.DataFrame(columns)
    there = np.isfinite(table[[name for name in table if str(name).split()[0] in COMPONENTS["position"]]]).all(axis=1)
    return table[there].reset_index(drop=True)


def to_log_table(recording: xr.Dataset) -> pd.DataFrame:
    """Make the table of a PX4 log: `timestamp` in whole microseconds, x north, y east, z down (a plane has z = 0).

    The fields are those of `vehicle_local_position`; commanded velocities are cx, cy, cz in the
    same axes.
    """
    table = to_table(recording)
    found: dict[str, object] = {
        "id": table["id"],
        "timestamp [us]": np.round(1e6 * table["t [s]"]).astype("int64"),
    }
    headers = {str(name).split()[0]: str(name) for name in table.columns}
    for x, y, z in COMPONENTS.values():
        if x not in headers:
            continue
        unit = headers[x].partition(" ")[2]
        up = table[headers[z]] if z in headers else 0.0 * table[headers[x]]
        # East-north-up to north-east-down: x and y change places, z its sign; 0.0 - up writes 0 and
        # not -0.
        for name, values in ((x, table[headers[y]]), (y, table[headers[x]]), (z, 0.0 - up)):
            found[f"{name} {unit}".strip()] = values
    return pd.DataFrame(found)


PLURAL = {"keypoint": "keypoints", "individual": "individuals"}


def to_movement(recording: xr.Dataset, *, plural_dimensions: bool = False) -> xr.Dataset:
    """Make a dataset of poses with position and confidence, and with velocity and command where there are any.

    plural_dimensions : the dimensions keypoints and individuals, as `movement` up to 0.16 asks for
    """
    check_recording(recording)
    found = recording[[name for name in COMPONENTS if name in recording]].transpose(*DIMENSIONS)
    if "confidence" in recording:
        found["confidence"] = recording["confidence"].transpose("time", "keypoint", "individual")
    else:
        found["confidence"] = found["position"].isel(space=0, drop=True).notnull().astype("float32")
    kept = ("fps", "source_file")
    found.attrs = {
        "ds_type": "poses", "source_software": "airflock", "time_unit": "seconds",
        **{name: recording.attrs[name] for name in kept if name in recording.attrs},
    }  # fmt: skip
    return found.rename(PLURAL) if plural_dimensions else found
