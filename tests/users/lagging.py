"""A law with a memory: the command follows the mean of the neighbours slowly."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One time."""

    lag: float = airflock.quantity(1.0, "s", low=0.01, high=100.0, meaning="time of the mean")


class Sums(NamedTuple):
    """Velocities, m/s, and how many."""

    x: float
    y: float
    z: float
    n: float


class Memory(NamedTuple):
    """The mean so far, m/s."""

    x: float = 1.0
    y: float = 0.0
    z: float = 0.0


def neighbour(dvx, dvy, dvz, vx, vy, vz):
    """Velocity of one neighbour."""
    return Sums(vx + dvx, vy + dvy, vz + dvz, 1.0)


def decide(sums, memory, period, p):
    """Velocity, m/s, and the memory."""
    keep = math.exp(-period / p.lag)
    n = max(sums.n, 1.0)
    x = keep * memory.x + (1.0 - keep) * sums.x / n
    y = keep * memory.y + (1.0 - keep) * sums.y / n
    z = keep * memory.z + (1.0 - keep) * sums.z / n
    return x, y, z, Memory(x, y, z)
