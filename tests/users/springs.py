"""A law of accelerations: springs to all neighbours, damped."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "acceleration"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """A spring."""

    rate: float = airflock.quantity(0.02, "1/s^2", low=0.0, high=5.0, meaning="stiffness over mass")
    rest: float = airflock.quantity(10.0, "m", low=0.0, high=100.0, meaning="length at rest")
    damping: float = airflock.quantity(0.1, "1/s", low=0.0, high=5.0, meaning="damping")


class Sums(NamedTuple):
    """Acceleration, m/s²."""

    x: float
    y: float
    z: float


def neighbour(dx, dy, dz, r, p):
    """One spring."""
    k = p.rate * (r - p.rest) / r
    return Sums(k * dx, k * dy, k * dz)


def decide(own, sums, p):
    """Acceleration, m/s²."""
    return sums.x - p.damping * own.vx, sums.y - p.damping * own.vy, sums.z - p.damping * own.vz
