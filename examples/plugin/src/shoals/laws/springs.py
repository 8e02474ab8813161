"""Springs between neighbours, which bring them to a distance of rest, and damping, which makes them fly alike. Ours."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """Speed, springs and walls."""

    speed: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="preferred speed")
    rest: float = airflock.quantity(15.0, "m", low=1.0, high=100.0, meaning="length of a spring at rest")
    longest: float = airflock.quantity(30.0, "m", low=1.0, high=500.0, meaning="a longer spring has broken")
    stiffness: float = airflock.quantity(0.05, "1/s", low=0.0, high=5.0, meaning="speed for each metre of a spring")
    damping: float = airflock.quantity(0.05, "1", low=0.0, high=1.0, meaning="share taken of a neighbour's velocity")
    margin: float = airflock.quantity(20.0, "m", low=0.1, high=100.0, meaning="walls nearer than this push")


class Sums(NamedTuple):
    """Pull of all springs and dampers, m/s."""

    x: float
    y: float
    z: float


class Walls(NamedTuple):
    """Push of the walls, m/s."""

    x: float
    y: float
    z: float


def neighbour(dx, dy, dz, r, dvx, dvy, dvz, p):
    """Pull of one spring and its damper; none of a broken one."""
    whole = 1.0 if r < p.longest else 0.0
    k = whole * p.stiffness * (r - p.rest) / r
    c = whole * p.damping
    return Sums(k * dx + c * dvx, k * dy + c * dvy, k * dz + c * dvz)


def boundary(distance, nx, ny, nz, p):
    """Push inwards near a wall."""
    k = p.speed * max(1.0 - distance / p.margin, 0.0)
    return Walls(k * nx, k * ny, k * nz)


def decide(own, sums, walls, p):
    """Fly on at the preferred speed, corrected by springs and walls."""
    return (
        p.speed * own.hx + sums.x + walls.x,
        p.speed * own.hy + sums.y + walls.y,
        p.speed * own.hz + sums.z + walls.z,
    )


def preferred_speed(p):
    """Speed that the fitness asks for, m/s."""
    return p.speed
