"""A body that the wind carries."""

import math
from dataclasses import dataclass

import airflock

ACCEPTS = "velocity"
INTEGRATION = "old"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One time."""

    lag: float = airflock.quantity(0.5, "s", low=0.01, high=100.0, meaning="lag")


def move(vx, vy, vz, cx, cy, cz, wx, wy, wz, dt, b):
    """Velocity after one step, m/s."""
    k = 1.0 - math.exp(-dt / b.lag)
    return vx + k * (cx + wx - vx), vy + k * (cy + wy - vy), vz + k * (cz + wz - vz)
