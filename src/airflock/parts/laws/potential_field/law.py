"""Artificial potential field, the textbook's: a goal that draws, obstacles that push, neighbours at a distance. Ours.

The goal and the obstacles are those of Khatib 1986: the velocity that a quadratic potential wants,
cut to a largest speed, with damping; and a push that grows without limit at a surface and ends at a
distance from it. Neighbours are those of Leonard and Fiorelli 2001: a logarithmic potential with
its minimum at d_0, cut off at d_1.

Differences
-----------
The texts were not at hand; both potentials are as textbooks print them. Without a goal an agent
keeps v_max along its own velocity. Nothing aligns velocities, so this is the law that others are
compared with. Pushes are counted no nearer than r_min, and the whole acceleration is at most a_max.
"""

from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, quantity, shorten, unit

COMMAND = "acceleration"
PARTS = {
    "goal": ("k_p", "k_v", "v_max"),
    "walls and obstacles": ("eta", "rho_0"),
    "neighbours": ("alpha", "d_0", "d_1"),
    "limits": ("r_min", "a_max"),
}
OURS = "our choice, for drones"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Strengths and ranges of the potentials."""

    k_p: float = quantity(0.2, "1/s^2", low=0.0, high=1e4, source=OURS, meaning="curvature of the goal's potential")
    k_v: float = quantity(0.3, "1/s", low=1e-6, high=1e4, source=OURS, meaning="damping")
    v_max: float = quantity(4.0, "m/s", low=0.01, high=1e3, source=OURS, meaning="largest and preferred speed")
    eta: float = quantity(5000.0, "m^4/s^2", low=0.0, high=1e9, source=OURS, meaning="strength of surfaces")
    rho_0: float = quantity(
        30.0, "m", low=0.01, high=1e4, source=OURS, meaning="distance at which surfaces begin to act"
    )
    alpha: float = quantity(13.0, "m^2/s^2", low=0.0, high=1e6, source=OURS, meaning="strength of neighbours")
    d_0: float = quantity(35.0, "m", low=0.01, high=1e4, source=OURS, meaning="distance of neighbours at rest")
    d_1: float = quantity(
        60.0, "m", low=0.01, high=1e4, source=OURS, meaning="distance beyond which neighbours are free"
    )
    r_min: float = quantity(0.5, "m", low=1e-6, high=100.0, source=OURS, meaning="distance below which pushes are even")
    a_max: float = quantity(4.0, "m/s^2", low=0.0, high=1e4, source=OURS, meaning="largest acceleration")


class Sums(NamedTuple):
    """Acceleration by neighbours, m/s²."""

    x: float
    y: float
    z: float


class Walls(NamedTuple):
    """Acceleration by surfaces, m/s²."""

    x: float
    y: float
    z: float


def preferred_speed(p):
    """Largest speed, m/s, which an agent keeps without a goal."""
    return p.v_max


def reach(p):
    """Distance beyond which neighbours are free, m."""
    return p.d_1


def interaction_range(p):
    """Radius within which agents count as one group, m."""
    return p.d_1


def wall_reach(p):
    """Distance beyond which a surface says nothing, m."""
    return p.rho_0


def neighbour(dx, dy, dz, r, p):
    """Pull (beyond d_0) or push (within it) of one neighbour, m/s² (Leonard and Fiorelli 2001)."""
    s = max(r, p.r_min)
    k = p.alpha * (1.0 / s - p.d_0 / (s * s)) / s if r < p.d_1 else 0.0
    return Sums(k * dx, k * dy, k * dz)


def boundary(distance, nx, ny, nz, p):
    """Push of one surface, m/s² (Khatib 1986); behind it as at r_min."""
    s = max(distance, p.r_min)
    k = p.eta * max(1.0 / s - 1.0 / p.rho_0, 0.0) / (s * s)
    return Walls(k * nx, k * ny, k * nz)


def decide(own, sums, walls, percept, p):
    """Acceleration, m/s²: the gap to the velocity that the goal wants, and the pushes."""
    gx, gy, gz = unit(percept.goal_x, percept.goal_y, percept.goal_z)
    free = gx * gx + gy * gy + gz * gz < 0.25
    c = p.k_v * p.v_max
    x, y, z = shorten(p.k_p * percept.goal_x, p.k_p * percept.goal_y, p.k_p * percept.goal_z, c)
    return shorten(
        (c * own.hx if free else x) - p.k_v * own.vx + sums.x + walls.x,
        (c * own.hy if free else y) - p.k_v * own.vy + sums.y + walls.y,
        (c * own.hz if free else z) - p.k_v * own.vz + sums.z + walls.z,
        p.a_max,
    )
