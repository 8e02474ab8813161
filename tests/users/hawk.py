"""A hunter: towards those who are not of its kin."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One speed."""

    speed: float = airflock.quantity(6.0, "m/s", low=0.0, high=50.0, meaning="speed of the chase")


class Sums(NamedTuple):
    """Pull."""

    x: float
    y: float
    z: float


def neighbour(dx, dy, dz, r2, kin):
    """One neighbour."""
    pull = (1.0 - kin) / r2
    return Sums(pull * dx, pull * dy, pull * dz)


def decide(sums, p):
    """Velocity, m/s."""
    k = p.speed / math.sqrt(sums.x * sums.x + sums.y * sums.y + sums.z * sums.z + 1e-12)
    return k * sums.x, k * sums.y, k * sums.z
