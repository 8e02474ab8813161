"""A law of velocities: pull towards neighbours, push off walls."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """A speed and two gains."""

    speed: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="preferred speed")
    pull: float = airflock.quantity(0.05, "1/s", low=0.0, high=5.0, meaning="gain of the pull")
    margin: float = airflock.quantity(20.0, "m", low=0.1, high=100.0, meaning="walls nearer than this push")


class Sums(NamedTuple):
    """Pull, m/s."""

    x: float
    y: float
    z: float


class Walls(NamedTuple):
    """Push, m/s."""

    x: float
    y: float
    z: float


def neighbour(dx, dy, dz, p):
    """One neighbour."""
    return Sums(p.pull * dx, p.pull * dy, p.pull * dz)


def boundary(distance, nx, ny, nz, p):
    """One wall."""
    k = p.speed * max(1.0 - distance / p.margin, 0.0)
    return Walls(k * nx, k * ny, k * nz)


def decide(own, sums, walls, p):
    """Velocity, m/s."""
    return (
        p.speed * own.hx + sums.x + walls.x,
        p.speed * own.hy + sums.y + walls.y,
        p.speed * own.hz + sums.z + walls.z,
    )


def preferred_speed(p):
    """Speed of a free agent, m/s."""
    return p.speed
