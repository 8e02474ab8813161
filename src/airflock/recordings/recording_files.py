"""Recordings on disk: netCDF that other tools open. A file is complete, or is not there."""

import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from airflock.recordings import attributes
from airflock.recordings.dataset import check_recording
from airflock.recordings.flown_scenario import require_user_files, with_user_files
from airflock.recordings.reader_process import ReaderProcess
from airflock.recordings.simulation import provenance, simulate
from airflock.scenarios import CallerParts, Scenario, build_scenario, law_from_caller, law_hash
from airflock.support import RECORDINGS, RecordingError, as_error, atomic, processor_name, suffix_error, to_path


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
    target = to_path(path)
    check_recording(recording, str(target))
    wrong = suffix_error(target, RECORDINGS)
    if wrong:
        raise RecordingError(wrong)
    if target.is_dir():
        raise RecordingError(f"{target}: is a folder; give a file name ending in .nc")
    if "airflock_scenario" in recording.attrs:  # a log of someone else's is no recording of ours
        recording = recording.assign_attrs({attributes.FORMAT_ATTRIBUTE: attributes.RECORDING_FORMAT})
        recording = recording.assign_attrs({attributes.CHECKSUM_ATTRIBUTE: attributes.recording_checksum(recording)})
    try:
        packed = {str(name): {"zlib": True, "complevel": 1} for name in recording.data_vars}
        content = recording.to_netcdf(None, engine="h5netcdf", encoding=packed)
        atomic.write_file(target, content)
    except OSError as error:
        raise RecordingError(f"{target}: cannot be written: {error.strerror or error}; nothing was saved") from error
    return target


def load_recording(path: str | os.PathLike[str] | ReaderProcess) -> xr.Dataset:
    """Read a recording, in a process of its own.

    Parameters
    ----------
    path : str, path or Opening (FILE.nc...)
        A recording: a netCDF file with position (time, space, keypoint, individual), m, and the time in s; or an
        Opening that has begun to read one.

    Returns
    -------
    xarray.Dataset
        As `airflock.simulate` returns it.

    Raises
    ------
    RecordingError
        With everything that the file lacks.

    Warns
    -----
    UserWarning
        Where a recording of Airflock's was changed since it was written.

    Examples
    --------
    >>> import airflock
    >>> airflock.load_recording("nowhere.nc")
    Traceback (most recent call last):
    airflock.support.errors.RecordingError: nowhere.nc: no such file
    """
    opening = path if isinstance(path, ReaderProcess) else ReaderProcess(path)
    recording: xr.Dataset = opening.answer()
    where = str(opening.path)
    with as_error(where, RecordingError):
        check_recording(recording, where)
        attributes.check_format(recording, where)
        # A changed recording is still readable; it only can no longer be trusted to be the flight
        # of its attributes.
        noted = recording.attrs.get(attributes.CHECKSUM_ATTRIBUTE)
        if noted is not None and noted != attributes.recording_checksum(recording):
            warnings.warn(f"{where}: was changed since Airflock wrote it", stacklevel=2)
    return recording


def replay_recording(
    recording: xr.Dataset, law: Any = None, settings: Mapping[str, Any] | None = None, *, trust: bool = False
) -> tuple[bool, list[str]]:
    """Fly a simulated recording again from its attributes.

    law, settings, trust : as of `scenario_to_fly_again`
    Returns whether all positions have the same bits, and what differs between then and now that
    could explain it.
    """
    scenario = scenario_to_fly_again(recording, law, settings, trust=trust)
    seed = attributes.read_integer(recording, "airflock_seed")
    precision = attributes.read_integer(recording, "airflock_precision", 32)
    again = simulate(
        scenario,
        seed,
        precision=precision,
        device=str(recording.attrs.get("airflock_device", "cpu")),
        events=attributes.recorded_events(recording),
    )
    same = again["position"].shape == recording["position"].shape and bool(
        np.array_equal(again["position"].values, recording["position"].values, equal_nan=True)
    )
    return same, _differences(recording, scenario, provenance(scenario, seed, precision))


def scenario_to_fly_again(
    recording: xr.Dataset, law: Any = None, settings: Mapping[str, Any] | None = None, *, trust: bool = False
) -> Scenario:
    """Return the scenario that a simulated recording was flown with, or raise RecordingError for what it lacks.

    law      : where it was flown with a law of the user's own, that law (a module, a mapping, a
               Model, or its file)
    settings : where it was flown with a body, metrics, ... of the user's own, their files:
               {"metrics.kind": "mine.py"}
    trust    : whether these files may run
    """
    document = attributes.scenario_document(recording)
    if document is None or not attributes.read_integer(recording, "random_start", 1):
        raise RecordingError("recording: was not flown from a scenario and a seed, so it cannot be flown again")
    own = law_from_caller(law) if law is not None else None
    _refuse_missing_laws(recording, document, own)
    # A flight is replayed exactly or not at all, so stand-ins for missing code are refused here.
    require_user_files(document, settings or {})
    document, _ = with_user_files(document, settings or {})
    name = str(recording.attrs.get("airflock_name", "recording"))
    return build_scenario(document, name, caller_parts=CallerParts(law=own), trust=trust)


def _refuse_missing_laws(recording: xr.Dataset, document: Mapping[str, Any], own: Any) -> None:
    """Raise a RecordingError for a law of the user's own that the recording names, and nobody gives."""
    if own is None and attributes.uses_user_law(recording):
        name = document.get("model", {}).get("kind")
        raise RecordingError(
            f"recording: was flown with a law of its own, {name!r}, which is not in the file; give it with "
            "--law FILE.py (in Python: law=...)"
        )
    for name in attributes.user_group_laws(document):
        raise RecordingError(
            f"recording: a group was flown with a law of its own, {name!r}, which is not in the file; it can be "
            "scored and drawn, but not flown again"
        )


def _differences(recording: xr.Dataset, scenario: Scenario, now: Mapping[str, Any]) -> list[str]:
    """Return the differences that could explain other bits; now : provenance of the flight that is compared."""
    words = {
        "airflock_version": "version of Airflock",
        "airflock_sources": "rules and driver",
        "airflock_toolchain": "compiler",
        "airflock_processor": "processor",
    }
    then, now = recording.attrs, {**now, "airflock_processor": processor_name()}
    found = [
        f"{text}: {then.get(key)} then, {now[key]} now" for key, text in words.items() if then.get(key) != now[key]
    ]
    noted, flown = then.get(attributes.LAW_ATTRIBUTE), law_hash(scenario.model)
    if noted is not None and noted != flown:
        found.insert(0, f"law: {noted} then, {flown} now")
    return found
