"""Recordings as datasets of `movement`, in the layout of today and of until version 0.16."""

import os
from pathlib import Path

import xarray as xr

from airflock.recordings.layout import DIMENSIONS, check_recording
from airflock.support import atomic

STATES = ("position", "velocity", "command")
PLURAL = {"keypoint": "keypoints", "individual": "individuals"}


def to_movement(recording: xr.Dataset, *, plural_dimensions: bool = False) -> xr.Dataset:
    """Dataset with position, confidence and the attributes of poses; velocity and command beside, where there are any.

    plural_dimensions : the dimensions keypoints and individuals, as `movement` up to 0.16 asks for
    """
    check_recording(recording)
    found = recording[[name for name in STATES if name in recording]].transpose(*DIMENSIONS)
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


def write_movement(recording: xr.Dataset, path: str | os.PathLike[str], *, plural_dimensions: bool = False) -> Path:
    """Write such a dataset as netCDF."""
    atomic.write_file(
        path, to_movement(recording, plural_dimensions=plural_dimensions).to_netcdf(None, engine="h5netcdf")
    )
    return Path(path)
