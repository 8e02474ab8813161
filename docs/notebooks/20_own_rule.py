"""
A rule of your own
==================

A flocking law is a handful of plain functions of floats. Their argument names say what they want to know; a drone
that flies them needs nothing else.
"""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"  # what `decide` returns, m/s


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """Every number has a unit, a range and a meaning; help, validation and search use them."""

    speed: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="preferred speed")
    spacing: float = airflock.quantity(15.0, "m", low=1.0, high=100.0, meaning="nearer neighbours repel")
    push: float = airflock.quantity(0.2, "1/s", low=0.0, high=5.0, meaning="repulsion gain")
    align: float = airflock.quantity(0.02, "1", low=0.0, high=1.0, meaning="alignment gain")


# %%
# Neighbours
# ----------
# `neighbour` is asked for each neighbour that is heard; what it returns is summed up. Here `dx, dy, dz` is the offset
# to the neighbour, `r` its length, and `dvx, dvy, dvz` the velocity difference.


class Sums(NamedTuple):
    """Repulsion and alignment, m/s."""

    x: float
    y: float
    z: float


def neighbour(dx, dy, dz, r, dvx, dvy, dvz, p):
    """Push away from a near neighbour, pull towards its velocity."""
    away = -p.push * max(p.spacing - r, 0.0) / r
    return Sums(away * dx + p.align * dvx, away * dy + p.align * dvy, away * dz + p.align * dvz)


# %%
# It is a plain function, so it can be tried at once: a neighbour 5 m to the north, at rest.
neighbour(0.0, 5.0, 0.0, 5.0, 0.0, 0.0, 0.0, Parameters())

# %%
# Walls and the decision
# ----------------------


class Walls(NamedTuple):
    """Push of the walls, m/s."""

    x: float
    y: float
    z: float


def boundary(distance, nx, ny, nz, p):
    """Push inwards within 20 m of a wall."""
    k = p.speed * max(1.0 - distance / 20.0, 0.0)
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


# %%
# Fly it
# ------
# In the arena and with the robots of a preset, by one gain and by another.
law = airflock.model(globals(), "mine")
weak = airflock.load("vasarhelyi_2018/4ms", {"duration": 120.0}, law=law)
strong = airflock.load("vasarhelyi_2018/4ms", {"duration": 120.0, "align": 0.05}, law=law)
for name, scenario in (("weak", weak), ("strong", strong)):
    print(name, airflock.score(scenario, seeds=3)[["phi_vel", "phi_corr", "n_coll"]].mean().round(3).to_dict())

# %%
figure = airflock.plots.trajectories(airflock.simulate(strong, seed=1))

# %%
# A typing mistake is told with the nearest right word.


class Wrong:
    """A law that asks for what there is not."""

    COMMAND, Parameters, Sums = "velocity", Parameters, Sums
    decide = staticmethod(decide)

    def neighbour(dx, dy, dz, dvxx, p):
        """Never called."""


try:
    airflock.model(Wrong)
except airflock.AirflockError as fault:
    print(fault)

# %%
# In a file of its own, `mine.py`, the same law flies by `model.kind = "mine.py"` in a scenario file, with `--trust`.
