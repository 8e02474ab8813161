"""A law with a choice, which is a constant of its driver."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """A speed and what neighbours do."""

    speed: float = airflock.quantity(3.0, "m/s", low=0.1, high=30.0, meaning="speed")
    sign: str = airflock.choice("pull", ("pull", "push"), meaning="what neighbours do")


class Sums(NamedTuple):
    """Unit vectors towards neighbours."""

    x: float
    y: float
    z: float


def neighbour(dx, dy, dz, r):
    """Direction of one neighbour."""
    return Sums(dx / r, dy / r, dz / r)


def decide(own, sums, p):
    """Velocity, m/s."""
    k = 1.0 if p.sign == "pull" else -1.0
    return p.speed * own.hx + k * sums.x, p.speed * own.hy + k * sums.y, p.speed * own.hz + k * sums.z
