"""Velocities of recorded positions, where the recording has none."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def central_difference(position: Array, times: Array) -> Array:
    """Velocity (time, ...), m/s, from positions in m at times in s: central differences, one-sided at both ends.

    Exactly 0 where a position stays the same over the frames that it is taken from: `numpy.gradient` leaves a rounding
    error there, which is a velocity of 1e-15 m/s with a heading.
    """
    found: Array = np.asarray(np.gradient(position, times, axis=0))
    same = position[1:] == position[:-1]
    still = np.concatenate([same[:1], same[1:] & same[:-1], same[-1:]])
    return np.where(still, found.dtype.type(0.0), found)


def differentiated_velocity(position: Array, times: Array) -> Array:
    """Velocity (time, axis, individual), m/s, within the stretches in which each individual is there; else nan."""
    there = np.asarray(~np.isnan(position).any(axis=1))
    if there.all():
        return central_difference(position, times)
    velocity = np.full_like(position, np.nan)
    for agent in range(position.shape[2]):
        borders = np.flatnonzero(np.diff(there[:, agent], prepend=False, append=False))
        for first, last in zip(borders[::2].tolist(), borders[1::2].tolist(), strict=True):
            if last - first > 1:
                stretch = slice(first, last)
                velocity[stretch, :, agent] = central_difference(position[stretch, :, agent], times[stretch])
    return velocity
