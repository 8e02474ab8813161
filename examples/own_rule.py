"""A flocking law of your own: plain functions of floats in a file or in a notebook cell, flown at the speed of ours.

The argument names say what a rule wants to know (`airflock.core.vocabulary` lists them all).
"""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """Two gains, two ranges and a speed."""

    speed: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="preferred speed")
    spacing: float = airflock.quantity(15.0, "m", low=1.0, high=100.0, meaning="neighbours nearer than this repel")
    push: float = airflock.quantity(0.2, "1/s", low=0.0, high=5.0, meaning="repulsion gain")
    margin: float = airflock.quantity(20.0, "m", low=0.1, high=100.0, meaning="walls nearer than this push")
    align: float = airflock.quantity(0.02, "1", low=0.0, high=1.0, meaning="alignment gain")


class Sums(NamedTuple):
    """Repulsion and alignment, m/s."""

    x: float
    y: float
    z: float


class Walls(NamedTuple):
    """Push of the walls, m/s."""

    x: float
    y: float
    z: float


def neighbour(dx, dy, dz, r, dvx, dvy, dvz, p):
    """Push away from a near neighbour, pull towards its velocity."""
    away = -p.push * max(p.spacing - r, 0.0) / r
    return Sums(away * dx + p.align * dvx, away * dy + p.align * dvy, away * dz + p.align * dvz)


def boundary(distance, nx, ny, nz, p):
    """Push inwards near a wall."""
    k = p.speed * max(1.0 - distance / p.margin, 0.0)
    return Walls(k * nx, k * ny, k * nz)


def decide(own, sums, walls, p):
    """Keep flying at the preferred speed, corrected by neighbours and walls."""
    x = p.speed * own.hx + sums.x + walls.x
    y = p.speed * own.hy + sums.y + walls.y
    z = p.speed * own.hz + sums.z + walls.z
    return x, y, z


def preferred_speed(p):
    """Speed that the fitness asks for, m/s."""
    return p.speed


if __name__ == "__main__":
    scenario = airflock.load(
        "vasarhelyi_2018/4ms", {"duration": 60.0, "model.align": 0.05}, law=airflock.model(globals(), "mine")
    )
    print(airflock.score(scenario, seeds=4)[["phi_vel", "phi_corr", "r_min_mean", "n_coll"]].round(3))
