"""A body with a memory: it slows down by what it has flown."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import airflock

ACCEPTS = "velocity"
INTEGRATION = "new"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One length."""

    tires: float = airflock.quantity(50.0, "m", low=0.1, high=1e5, meaning="way after which it flies half as fast")


class Memory(NamedTuple):
    """Way so far, m."""

    way: float = 0.0


def move(cx, cy, cz, memory, dt, b):
    """Velocity after one step, m/s, and the memory."""
    k = 1.0 / (1.0 + memory.way / b.tires)
    way = memory.way + k * dt * math.sqrt(cx * cx + cy * cy + cz * cz)
    return k * cx, k * cy, k * cz, Memory(way)
