"""Arena: its surfaces, each one a scalar function of a position and four numbers.

A surface function returns the distance (m, negative on the far side) and the unit normal that
points to where flying is allowed. A driver loops over rows of four numbers; which functions it
loops over follows from the shape.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, choice, points, quantity, text


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Region where flying is allowed. Positions are relative to the arena's centre; corners are absolute.

    In 3-D an arena reaches from -height/2 to height/2, or from floor to ceiling.
    """

    dimensions: str = choice("2", ("2", "3"), meaning="flight in a plane or in space")
    arena: str = choice("square", ("square", "circle", "polygon", "none"), meaning="shape of the ground plan")
    side: float = quantity(
        250.0, "m", low=0.1, high=1e6, source="Vásárhelyi et al. 2018, Table S2", meaning="side of a square arena"
    )
    radius: float = quantity(125.0, "m", low=0.1, high=1e6, meaning="radius of a circular arena")
    height: float = quantity(100.0, "m", low=0.1, high=1e5, meaning="height of a 3-D arena")
    floor: float | None = quantity(
        None, "m", low=-1e5, high=1e5, meaning="lowest height of a 3-D arena; by default -height/2"
    )
    ceiling: float | None = quantity(
        None, "m", low=-1e5, high=1e5, meaning="highest height of a 3-D arena; by default height/2"
    )
    corners: tuple[tuple[float, ...], ...] = points(
        "m",
        2,
        meaning="corners of a polygonal arena in order; any polygon whose edges do not cross, concave ones too",
    )
    walls: str = choice(
        "every_edge",
        ("every_edge", "nearest_per_axis"),
        source="Vásárhelyi et al. 2018, Methods (every_edge) and the authors' program (nearest_per_axis)",
        meaning="which edges act: all; or, in a square, only the nearer wall of each axis",
    )
    edges: str = choice(
        "open",
        ("open", "bounce", "periodic"),
        source="Zapotecatl et al. 2016, authors' program (bounce); Vicsek et al. 1995 (periodic)",
        meaning="beyond a square's faces: nothing happens; held there, velocity reversed; or back in on the far side",
    )
    obstacles: tuple[tuple[tuple[float, ...], ...], ...] = points(
        "m", 3, meaning="polygons that must not be entered, each a list of corners: trees, houses, holes of the arena"
    )
    heights: tuple[tuple[float, ...], ...] = points(
        "m", 2, meaning="lowest and highest height of each obstacle in 3-D, [[low, high], ...]; by default without end"
    )
    latitude: float | None = quantity(
        None, "deg", low=-85.0, high=85.0, meaning="latitude of the point 0, 0, where it is known, as of a map file"
    )
    longitude: float | None = quantity(
        None, "deg", low=-180.0, high=180.0, meaning="longitude of that point; fly prepare compares it with --site"
    )
    file: str = text(
        meaning="GeoJSON, KML or QGroundControl .plan file with the arena: its largest polygon gives world.corners, "
        "holes and polygons in it are obstacles; beside the scenario or absolute"
    )
    simplify: float = quantity(
        0.0, "m", low=0.0, high=1000.0, meaning="file: how far outlines may move to have fewer corners"
    )


def heights_of(world):
    """Lowest and highest height of a 3-D arena, m."""
    low = -0.5 * world.height if world.floor is None else world.floor
    high = 0.5 * world.height if world.ceiling is None else world.ceiling
    return low, high


class Surface(NamedTuple):
    """Distance (m) and unit normal."""

    distance: float
    nx: float
    ny: float
    nz: float


def plane(x, y, z, a, b, c, d):
    """Half-space with inward unit normal (a, b, c): distance d + n·x, m."""
    return Surface(d + a * x + b * y + c * z, a, b, c)


def slab(x, y, z, a, b, c, d):
    """The nearer of two walls at ±d (m) along the unit axis (a, b, c): one shill agent per axis."""
    s = a * x + b * y + c * z
    k = -1.0 if s > 0.0 else 1.0
    return Surface(d + k * s, k * a, k * b, k * c)


def cylinder(x, y, z, a, b, c, d):
    """Inside of an upright cylinder of radius d (m) about (a, b); one radial shill agent. c is not used."""
    sx = a - x
    sy = b - y
    # 1e-12: on the axis no direction leads out, and none may be nan.
    s = math.sqrt(sx * sx + sy * sy + 1e-12)
    return Surface(d - s, sx / s, sy / s, 0.0 * c)


def convex_obstacle(x, y, z, edges, first, last):
    """Nearest point of a convex polygon (rows first..last-1 of ax ay bx by, counter-clockwise); upright in 3-D.

    Distance (m) is positive outside; the normal points away from the polygon, also from within.
    """
    best = 1e30
    px = 0.0
    py = 0.0
    inside = 1.0
    for e in range(first, last):
        ax = edges[e][0]
        ay = edges[e][1]
        tx = edges[e][2] - ax
        ty = edges[e][3] - ay
        side = tx * (y - ay) - ty * (x - ax)
        if side < 0.0:
            inside = 0.0
        s = min(max(((x - ax) * tx + (y - ay) * ty) / (tx * tx + ty * ty), 0.0), 1.0)
        qx = x - ax - s * tx
        qy = y - ay - s * ty
        if qx * qx + qy * qy < best:
            best = qx * qx + qy * qy
            px = qx
            py = qy
    # From within, the nearest edge is the way out: distance and normal change their sign.
    k = 1.0 - 2.0 * inside
    far = math.sqrt(best + 1e-12)
    return Surface(k * far, k * px / far, k * py / far, 0.0 * z)
