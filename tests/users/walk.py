"""A position that wanders off."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One rate."""

    rate: float = airflock.quantity(0.1, "m", low=0.0, high=100.0, meaning="deviation of a step per axis")


class Memory(NamedTuple):
    """Error, m."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


def measure(x, y, z, vx, vy, vz, memory, g0, g1, g2, s):
    """Position and velocity, and the memory."""
    ex = memory.x + s.rate * g0
    ey = memory.y + s.rate * g1
    ez = memory.z + s.rate * g2
    return x + ex, y + ey, z + ez, vx, vy, vz, Memory(ex, ey, ez)
