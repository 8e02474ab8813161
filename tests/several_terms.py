"""A law of a user whose repulsion is a sum of terms, each with a weight of its own: a vector parameter."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"
SIZE = 3


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """Weights of the terms, and the speed."""

    w: tuple[float, ...] = airflock.quantity(
        (0.5, 0.3, 0.1), "m/s", size=SIZE, low=0.0, high=5.0, meaning="weight of a term", source="our choice"
    )
    reach: float = airflock.quantity(20.0, "m", low=1.0, high=100.0, meaning="range", source="our choice")
    v_flock: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="speed", source="our choice")


class Sums(NamedTuple):
    """Push of all neighbours, m/s."""

    x: float
    y: float
    z: float


def reach(p):
    """Range, m."""
    return p.reach


def preferred_speed(p):
    """Speed, m/s."""
    return p.v_flock


def neighbour(dx, dy, dz, r, p):
    """Push of one neighbour: terms of growing power of how near it is."""
    near = max(1.0 - r / p.reach, 0.0)
    push, power = 0.0, near
    for k in range(len(p.w)):
        push += p.w[k] * power
        power *= near
    by = -push / max(r, 1e-6)
    return Sums(by * dx, by * dy, by * dz)


def decide(own, sums, p):
    """Wish: onwards, and away from who is near."""
    total = 0.0
    for weight in p.w:
        total += weight
    much = 1.0 + p.w[-1] / max(total, 1e-9)
    return (
        p.v_flock * own.hx + much * sums.x,
        p.v_flock * own.hy + much * sums.y,
        p.v_flock * own.hz + much * sums.z,
    )
