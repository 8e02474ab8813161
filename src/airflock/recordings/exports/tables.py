"""Recordings as long tables: one row per instant and individual that is there."""

import io
import os
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.layout import check_recording
from airflock.support import RecordingError, atomic

COLUMNS = {"position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz"), "command": ("cx", "cy", "cz")}


def to_table(recording: xr.Dataset) -> pd.DataFrame:
    """Long table: id, t [s], x [m], ..., vx [m/s], ..., cx [m/s], ...; no rows where one is absent."""
    check_recording(recording)
    order = ("individual", "time", "space", "keypoint")
    count, times = recording.sizes["individual"], recording["time"].values.astype(float)
    columns: dict[str, object] = {
        "id": np.repeat(recording["individual"].values.astype(str), len(times)),
        "t [s]": np.tile(times, count),
    }
    for variable, names in COLUMNS.items():
        if variable not in recording:
            continue
        values = recording[variable].transpose(*order).isel(keypoint=0).values
        unit = str(recording[variable].attrs.get("units", ""))
        for c in range(recording.sizes["space"]):
            header = f"{names[c]} [{unit}]" if unit else names[c]
            columns[header] = values[:, :, c].reshape(-1)
    table = pd.DataFrame(columns)
    there = np.isfinite(table[[name for name in table if str(name).split()[0] in COLUMNS["position"]]]).all(axis=1)
    return table[there].reset_index(drop=True)


def to_log_table(recording: xr.Dataset) -> pd.DataFrame:
    """The table as a log of PX4 has it: `timestamp` in whole microseconds, x north, y east, z down (a plane has z = 0).

    The fields are those of `vehicle_local_position`; commanded velocities are cx, cy, cz in the same axes.
    """
    table = to_table(recording)
    found: dict[str, object] = {
        "id": table["id"],
        "timestamp [us]": np.round(1e6 * table["t [s]"]).astype("int64"),
    }
    headers = {str(name).split()[0]: str(name) for name in table.columns}
    for x, y, z in COLUMNS.values():
        if x not in headers:
            continue
        unit = headers[x].partition(" ")[2]
        up = table[headers[z]] if z in headers else 0.0 * table[headers[x]]
        for name, values in ((x, table[headers[y]]), (y, table[headers[x]]), (z, 0.0 - up)):
            found[f"{name} {unit}".strip()] = values
    return pd.DataFrame(found)


def write_csv(recording: xr.Dataset, path: str | os.PathLike[str], *, px4_columns: bool = False) -> Path:
    """Write a long CSV table, with as many digits as the numbers have; `px4_columns` : as a log of PX4 has it."""
    text = io.StringIO()
    (to_log_table if px4_columns else to_table)(recording).to_csv(text, index=False)
    atomic.write_file(path, text.getvalue())
    return Path(path)


def write_parquet(recording: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a long Parquet table; needs pyarrow."""
    try:
        import pyarrow  # noqa: F401
    except ImportError as fault:
        raise RecordingError(f"{path}: Parquet needs pyarrow: pip install 'airflock[logs]'") from fault
    with atomic.atomic_path(path) as temporary:
        to_table(recording).to_parquet(temporary, index=False, engine="pyarrow")
    return Path(path)
