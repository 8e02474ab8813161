"""Recordings on disk: netCDF that other tools open, complete or not there at all."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from airflock import atomic
from airflock.endings import RECORDINGS, ending_fault
from airflock.errors import RecordingError
from airflock.recordings.flights import processor, provenance, simulate
from airflock.recordings.layout import check
from airflock.recordings.scores import scenario_of

FOREIGN = (".csv", ".tsv", ".parquet", ".ulg", ".bin", ".tlog", ".npy", ".npz", ".h5")  # what airflock import reads


def save(recording: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a recording as .nc: to a temporary name first, then renamed; raises RecordingError and leaves nothing.

    The file is made in memory, because the HDF5 library crashes the process when the disk is full.
    """
    check(recording, str(path))
    target = Path(path)
    wrong = ending_fault(target, RECORDINGS)
    if wrong:
        raise RecordingError(wrong)
    if target.is_dir():
        raise RecordingError(f"{target}: is a folder; give a file name ending in .nc")
    try:
        packed = {str(name): {"zlib": True, "complevel": 1} for name in recording.data_vars}
        content = recording.to_netcdf(None, engine="h5netcdf", encoding=packed)
        atomic.write(target, content)
    except OSError as fault:
        raise RecordingError(f"{target}: cannot be written: {fault.strerror or fault}; nothing was saved") from fault
    return target


def load_recording(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a recording; raises RecordingError with everything that it lacks."""
    source = Path(path)
    if not source.is_file():
        raise RecordingError(f"{source}: no such file")
    if source.suffix.lower() in FOREIGN:
        raise RecordingError(
            f"{source}: holds tracks, but is no recording yet: airflock import {source.name} --save FILE.nc"
        )
    try:
        with xr.open_dataset(source, engine="h5netcdf") as opened:
            recording = opened.load()
    except (OSError, ValueError, KeyError, RuntimeError) as fault:
        raise RecordingError(f"{source}: is no netCDF recording: {str(fault).splitlines()[0]}") from fault
    check(recording, str(source))
    return recording


def fly_again(recording: xr.Dataset) -> tuple[bool, list[str]]:
    """Fly a simulated recording again from its attributes.

    Returns whether all positions have the same bits, and what differs between then and now that could explain it.
    """
    attributes: dict[str, Any] = dict(recording.attrs)
    if "airflock_scenario" not in attributes or not int(attributes.get("random_start", 1)):
        raise RecordingError("recording: was not flown from a scenario and a seed, so it cannot be flown again")
    scenario, flown = scenario_of(recording), json.loads(attributes["airflock_scenario"])
    for section, what in (("model", "law"), ("body", "body")):
        now, then = (document.get(section, {}).get("kind") for document in (scenario.document, flown))
        if now != then:
            raise RecordingError(f"recording: was flown with a {what} given directly, which is not in the file")
    seed, precision = int(attributes["airflock_seed"]), int(attributes["airflock_precision"])
    again = simulate(scenario, seed, precision=precision, device=str(attributes.get("airflock_device", "cpu")))
    now = provenance(scenario, seed, precision)
    words = {
        "airflock_version": "version of Airflock",
        "airflock_sources": "rules and driver",
        "airflock_toolchain": "compiler",
        "airflock_processor": "processor",
    }
    now["airflock_processor"] = processor()
    differences = [
        f"{text}: {attributes.get(key)} then, {now[key]} now"
        for key, text in words.items()
        if attributes.get(key) != now[key]
    ]
    same = again["position"].shape == recording["position"].shape and bool(
        np.array_equal(again["position"].values, recording["position"].values)
    )
    return same, differences
