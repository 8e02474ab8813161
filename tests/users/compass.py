"""A compass that is off by an angle."""

import math
from dataclasses import dataclass

import airflock


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One angle."""

    off: float = airflock.quantity(0.1, "rad", low=-3.2, high=3.2, meaning="angle, anticlockwise")


def measure(x, y, z, vx, vy, vz, s):
    """Position and velocity."""
    c = math.cos(s.off)
    d = math.sin(s.off)
    return x, y, z, c * vx - d * vy, d * vx + c * vy, vz
