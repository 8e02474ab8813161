"""Recordings as files of other tools, by the ending of the name."""

import os
from pathlib import Path

import xarray as xr

from airflock.recordings.exports.movement import write_movement
from airflock.recordings.exports.tables import write_csv, write_parquet
from airflock.support import RecordingError, suffix_error, to_path

SUFFIXES = (".csv", ".parquet", ".nc")
LAYOUTS = ("movement", "movement-0.16", "px4")


def export(recording: xr.Dataset, path: str | os.PathLike[str], *, layout: str = "movement") -> Path:
    """Write a recording for other tools: a long table with units in its headers, or a dataset of `movement`.

    Parameters
    ----------
    recording : xarray.Dataset
        (time, space, keypoint, individual), simulated, flown, imported or loaded.
    path : str or path
        File to write; its ending decides: .csv, .parquet or .nc.
    layout : str
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
    if target.suffix.lower() == ".nc" and layout != "px4":
        return write_movement(recording, target, plural_dimensions=layout == "movement-0.16")
    if layout == "px4" and target.suffix.lower() != ".csv":
        raise RecordingError(f"layout = 'px4' is a table; {target.name} ends in {target.suffix}: write .csv")
    if target.suffix.lower() == ".csv":
        return write_csv(recording, target, px4_columns=layout == "px4")
    return write_parquet(recording, target)
