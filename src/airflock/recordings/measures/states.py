"""Positions, velocities and headings of a recording as arrays, nan where an individual is absent."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.errors import RecordingError
from airflock.recordings.layout import check

Array = NDArray[Any]


class States(NamedTuple):
    """time (frame,) s, position m and velocity m/s (frame, axis, individual), present (frame, individual)."""

    time: Array
    position: Array
    velocity: Array
    present: Array
    names: list[str]

    @property
    def period(self) -> float:
        """Time between frames, s."""
        return float(np.median(np.diff(self.time)))


def states(recording: xr.Dataset, keypoint: str | None = None) -> States:
    """Arrays of a recording; velocities are differentiated where it has none.

    keypoint : which one, where there are several
    """
    check(recording)
    names = [str(name) for name in recording["keypoint"].values]
    if keypoint is None and len(names) > 1:
        raise RecordingError(f"recording: has {len(names)} keypoints; choose one of {', '.join(names)}")
    if keypoint is not None and keypoint not in names:
        raise RecordingError(f"recording: no keypoint {keypoint}; it has {', '.join(names)}")
    own = recording.isel(keypoint=0 if keypoint is None else names.index(keypoint))
    order = ("time", "space", "individual")
    time = own["time"].values.astype(float)
    position = own["position"].transpose(*order).values.astype(float)
    if "velocity" in own:
        velocity = own["velocity"].transpose(*order).values.astype(float)
    elif len(time) > 1:
        velocity = np.gradient(position, time, axis=0)
    else:
        raise RecordingError("recording: one frame without velocity has no motion to measure")
    present = np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1)
    gone = ~present[:, None, :]
    individuals = [str(name) for name in own["individual"].values]
    return States(time, np.where(gone, np.nan, position), np.where(gone, np.nan, velocity), present, individuals)


def headings(velocity: Array, slowest: float = 0.0) -> Array:
    """Unit vectors along velocities (frame, axis, individual); nan at speeds of `slowest` (m/s) or less."""
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    found: Array = velocity / np.where(speed > slowest, speed, np.nan)
    return found
