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
    """Write a recording as netCDF: to a temporary name first, then renamed.

    Parameters
    ----------
    recording : xarray.Dataset
        position (time, space, keypoint, individual) in m, and whatever else there is.
    path : str or path
        Ends in .nc.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    RecordingError
        If it is no recording or cannot be written; then nothing is left behind.

    Notes
    -----
    The file is made in memory, because the HDF5 library crashes the process when the disk is full.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> airflock.save(airflock.simulate(short), "flight.nc").name
    'flight.nc'
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
    """Read a recording.

    Parameters
    ----------
    path : str or path
        A netCDF file with position (time, space, keypoint, individual), m, and the time in s.

    Returns
    -------
    xarray.Dataset
        As `airflock.simulate` returns it.

    Raises
    ------
    RecordingError
        With everything that the file lacks.

    Examples
    --------
    >>> import airflock
    >>> airflock.load_recording("nowhere.nc")
    Traceback (most recent call last):
    airflock.errors.RecordingError: nowhere.nc: no such file
    """
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
