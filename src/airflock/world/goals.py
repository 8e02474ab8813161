"""Goals: points that a flock makes for, one after another, standing or moving."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core.maths import TINY
from airflock.core.parameters import Parameters as Record
from airflock.core.parameters import choice, points, quantity

OURS = "our choice, because the thesis shows moving goals without numbers"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Where a flock shall go. A goal is reached when the flock's centre is within `radius`; then the next counts."""

    kind: str = choice(
        "none", ("none", "points", "scene"), meaning="no goal, given points, or free points of the scene"
    )
    points: tuple[tuple[float, ...], ...] = points("m", 2, axes=3, meaning="goals in their order, [east, north, up]")
    count: float = quantity(5, "1", low=1, high=1000, source=OURS, meaning="free points of the scene, a whole number")
    low: float = quantity(5.0, "m", low=0.0, high=1e4, source=OURS, meaning="least height of free points")
    high: float = quantity(15.0, "m", low=0.0, high=1e4, source=OURS, meaning="greatest height of free points")
    clearance: float = quantity(3.0, "m", low=0.0, high=1e3, source=OURS, meaning="free distance around free points")
    apart: float = quantity(
        60.0, "m", low=0.0, high=1e5, source=OURS, meaning="least way from one free point to the next"
    )
    radius: float = quantity(
        20.0,
        "m",
        low=0.01,
        high=1e5,
        source="our choice: the flocking radius",
        meaning="the centre is at the goal within",
    )
    speed: float = quantity(
        0.0, "m/s", low=0.0, high=1e3, source=OURS, meaning="of the goal on its way to the next point; 0: it jumps"
    )


class Aim(NamedTuple):
    """Where the goal is, m; 1.0 if it has just been reached."""

    x: float
    y: float
    z: float
    reached: float


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
