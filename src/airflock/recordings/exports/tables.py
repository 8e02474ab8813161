"""Recordings as long tables: one row per instant and individual that is there."""

import io
import os
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from airflock import atomic
from airflock.errors import RecordingError
from airflock.recordings.layout import check

COLUMNS = {"position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz"), "command": ("cx", "cy", "cz")}


def to_table(recording: xr.Dataset) -> pd.DataFrame:
    """Long table: id, t [s], x [m], ..., vx [m/s], ..., cx, ...; rows where an individual is absent are left out."""
    check(recording)
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
            header = f"{names[c]} [{unit}]" if unit and unit != "1" else names[c]
            columns[header] = values[:, :, c].reshape(-1)
    table = pd.DataFrame(columns)
    there = np.isfinite(table[[name for name in table if str(name).split()[0] in COLUMNS["position"]]]).all(axis=1)
    return table[there].reset_index(drop=True)


def write_csv(recording: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a long CSV table, with as many digits as the numbers have."""
    text = io.StringIO()
    to_table(recording).to_csv(text, index=False)
    atomic.write(path, text.getvalue())
    return Path(path)


def write_parquet(recording: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a long Parquet table; needs pyarrow."""
    try:
        import pyarrow  # noqa: F401
    except ImportError as fault:
        raise RecordingError(f"{path}: Parquet needs pyarrow: pip install 'airflock[logs]'") from fault
    with atomic.atomic(path) as temporary:
        to_table(recording).to_parquet(temporary, index=False, engine="pyarrow")
    return Path(path)
