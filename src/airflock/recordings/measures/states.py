"""Positions, velocities and headings of a recording as arrays, nan where an individual is absent."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings import dataset
from airflock.recordings.attributes import scenario_document
from airflock.recordings.dataset import check_recording
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.support import ParameterError, RecordingError, is_number

Array = NDArray[Any]


class TrackArrays(NamedTuple):
    """Arrays: time (frame,) s, position m and velocity m/s (frame, axis, individual); placed and present (frame,
    individual).

    placed: its position is known; present: its velocity, too. What needs no motion counts all who
    are placed. box: sides of the periodic world that a simulation flew in, m; else None.
    """

    time: Array
    position: Array
    velocity: Array
    placed: Array
    present: Array
    names: list[str]
    box: Array | None = None

    def offsets(self, positions: Array) -> Array:
        """Return offsets (axis, from, to), m, between all of some places (axis, individual), to the nearest images."""
        return dataset.nearest_image(positions[:, None, :] - positions[:, :, None], self.box)

    @property
    def period(self) -> float:
        """Return the time between frames, s; 1 where there is one frame."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else 1.0


def track_arrays(recording: xr.Dataset) -> TrackArrays:
    """Return the arrays of a recording; missing velocities are differentiated, and unknown in a single frame."""
    check_recording(recording)
    names = [str(name) for name in recording["keypoint"].values]
    if len(names) > 1:
        raise RecordingError(f"recording: has {len(names)} keypoints; choose one of {', '.join(names)}")
    time, position, known = dataset.motion_arrays(recording, float)
    velocity = np.full_like(position, np.nan) if known is None else known
    placed = np.asarray(np.isfinite(position).all(axis=1))
    present = np.asarray(placed & np.isfinite(velocity).all(axis=1))
    nowhere, unknown = ~placed[:, None, :], ~present[:, None, :]
    individuals = [str(name) for name in recording["individual"].values]
    position, velocity = np.where(nowhere, np.nan, position), np.where(unknown, np.nan, velocity)
    world = scenario_of_recording(recording).world if scenario_document(recording) is not None else None
    box = dataset.box_sides(world, position.shape[1]) if world is not None else None
    return TrackArrays(time, position, velocity, placed, present, individuals, box)


def check_numbers(**values: Any) -> None:
    """Refuse values that are not numbers, all at once. Raise ParameterError."""
    errors = [f"{name} = {value!r} is not a number" for name, value in values.items() if not is_number(value)]
    if errors:
        raise ParameterError("\n".join(errors))


def headings(velocity: Array, slowest: float = 0.0) -> Array:
    """Return unit vectors along velocities (frame, axis, individual); nan at speeds of `slowest` (m/s) or less."""
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    found: Array = velocity / np.where(speed > slowest, speed, np.nan)
    return found
