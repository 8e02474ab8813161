"""Goals: points that a flock makes for, one after another, standing or moving."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import TINY, Parameters as Record, choice, points, quantity

OURS = "our choice, because the thesis shows moving goals without numbers"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Goals of the flock. A goal is reached when the flock's centre is within `radius`; then the next counts."""

    kind: str = choice(
        "none",
        ("none", "points", "scene", "own"),
        meaning="no goal, given points, free points of the scene; or to each agent a point of its own, all under way "
        "for the same time",
    )
    points: tuple[tuple[float, ...], ...] = points("m", 2, axes=3, meaning="goals in order, [east, north, up]")
    count: float = quantity(
        5, "1", low=1, high=1000, source=OURS, meaning="number of free points of the scene, a whole number"
    )
    low: float = quantity(5.0, "m", low=0.0, high=1e4, source=OURS, meaning="smallest height of free points")
    high: float = quantity(15.0, "m", low=0.0, high=1e4, source=OURS, meaning="largest height of free points")
    clearance: float = quantity(3.0, "m", low=0.0, high=1e3, source=OURS, meaning="free distance around free points")
    apart: float = quantity(
        60.0, "m", low=0.0, high=1e5, source=OURS, meaning="smallest distance from one free point to the next"
    )
    radius: float = quantity(
        20.0,
        "m",
        low=0.01,
        high=1e5,
        source="our choice: the flocking radius",
        meaning="distance from the goal at which the flock's centre has reached it",
    )
    speed: float = quantity(
        0.0, "m/s", low=0.0, high=1e3, source=OURS, usual=(0.0, 20.0),
        meaning="speed of the goal on its way to the next point; 0: it jumps",
    )  # fmt: skip
    role: str = choice(
        "lead",
        ("lead", "herd"),
        source="the thesis; Strömbom et al. 2014",
        meaning="the goal leads to the points; or it is a shepherd that drives the flock there from behind, which "
        "takes a model that flees it (kidger: a negative s_goal)",
    )
    spread: float = quantity(
        40.0,
        "m",
        low=0.0,
        high=1e5,
        source="our choice: the thesis's radius of cohesion",
        meaning="a shepherd first gathers agents that are farther than this from the flock's centre",
    )
    behind: float = quantity(
        15.0, "m", low=0.0, high=1e5, source=OURS, meaning="how far a shepherd stays behind those that it drives"
    )


class Aim(NamedTuple):
    """Position of the goal, m, and 1.0 if it has just been reached."""

    x: float
    y: float
    z: float
    reached: float


def glide(a, b, time, duration):
    """Coordinate (m) of an agent's own goal on its way from a to b, at rest at both ends (a cubic in time).

    All agents take the same time: then straight ways of an assignment with the least sum of squared
    lengths keep the agents apart (Turpin, Michael and Kumar 2014).
    """
    u = min(time / max(duration, 1e-6), 1.0)
    return a + (b - a) * u * u * (3.0 - 2.0 * u)


def pursue(x, y, z, wx, wy, wz, cx, cy, cz, radius, travel):
    """Goal at x y z on its way to the point w, with the flock's centre at c: one step of at most travel (m).

    It waits at the point until the centre is within radius (m) of it.
    """
    dx = wx - x
    dy = wy - y
    dz = wz - z
    left = math.sqrt(dx * dx + dy * dy + dz * dz + TINY)
    k = min(travel / left, 1.0)
    square = (cx - wx) * (cx - wx) + (cy - wy) * (cy - wy) + (cz - wz) * (cz - wz)
    reached = 1.0 if (k >= 1.0) & (square <= radius * radius) else 0.0
    return Aim(x + k * dx, y + k * dy, z + k * dz, reached)


def herd(x, y, z, wx, wy, wz, cx, cy, cz, fx, fy, fz, spread, behind, radius, travel):
    """Shepherd at x y z that drives a flock with its centre at c and its farthest agent at f to the point w.

    One step of at most travel (m): behind the farthest agent as seen from the centre while that
    agent is farther than spread (m) from it, else behind the flock as seen from the point (Strömbom
    et al. 2014, collecting and driving). The point is reached when the centre is within radius (m)
    of it.
    """
    sx = fx - cx
    sy = fy - cy
    sz = fz - cz
    stray = math.sqrt(sx * sx + sy * sy + sz * sz + TINY)
    ox = cx - wx
    oy = cy - wy
    oz = cz - wz
    off = math.sqrt(ox * ox + oy * oy + oz * oz + TINY)
    collect = stray > spread
    k = behind / stray if collect else (stray + behind) / off
    px = fx + k * sx if collect else cx + k * ox
    py = fy + k * sy if collect else cy + k * oy
    pz = fz + k * sz if collect else cz + k * oz
    dx = px - x
    dy = py - y
    dz = pz - z
    s = min(travel / math.sqrt(dx * dx + dy * dy + dz * dz + TINY), 1.0)
    return Aim(x + s * dx, y + s * dy, z + s * dz, 1.0 if off <= radius else 0.0)
