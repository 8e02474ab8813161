"""A law that casts rays: straight on where the way is free, else a turn."""

import math
from dataclasses import dataclass

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """A speed and a distance."""

    speed: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="speed")
    look: float = airflock.quantity(20.0, "m", low=0.1, high=1e3, meaning="length of a ray")


def sight(p):
    """Length of the longest ray, m."""
    return p.look


def decide(own, percept, p):
    """Velocity, m/s."""
    free = percept.cast(own.hx, own.hy, own.hz, p.look, 0.5)
    turn = 0.0 if free >= p.look else 0.5
    c = math.cos(turn)
    s = math.sin(turn)
    return p.speed * (c * own.hx - s * own.hy), p.speed * (s * own.hx + c * own.hy), 0.0 * own.hz
