"""Outlines of fields as people have them: polygons of GeoJSON and KML files, in local metres.

A file is untrusted: it is read through `untrusted`, and everything that is wrong with it is told at once.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shapely.geometry import LineString, Point, Polygon
from shapely.validation import explain_validity

from airflock.support import FlightSite, ScenarioError, as_error, read_text, shortened
from airflock.world.scenes import geojson, kml
from airflock.world.scenes.rings import Outline, Ring

MOST_KEPT = 500  # of one polygon that is flown in: each decision looks along lines of sight past all of them
ENDLESS = 1e5  # m; heights of an obstacle that has none, where others have
LARGE = 5000.0  # m; beyond, a degree is not the same everywhere
SAME = 1e-3  # m; corners that lie no farther apart are one
STRAIGHT = 0.01  # m; a corner that moves an outline by less is none, as on a straight side with points on it
MANY = 12  # corners, from which on it is told how many fewer would do
COARSE = 1.0  # m; of what is told then
Solid = tuple[str, Polygon, Mapping[str, float]]  # name, plan in m, and heights (m) of what must not be entered


@dataclass(frozen=True)
class Field:
    """A field in local metres about its origin: keys of the section [world], and a note of what was read."""

    keys: dict[str, Any]
    origin: tuple[float, float]
    note: str


def load_field(path: Path, *, simplify: float = 0.0, space: bool = False) -> Field:
    """The field of a GeoJSON or KML file: its largest polygon, and what must not be entered inside.

    simplify : how far outlines may move to have fewer corners, m
    space    : whether the flight has heights; else those of the file are left out

    Raises ScenarioError with one line per fault.
    """
    where = f"world.file = {shortened(str(path), 120)}"
    kinds: dict[str, Callable[[str], list[Outline]]] = {
        ".geojson": geojson.parse_outlines, ".json": geojson.parse_outlines, ".kml": kml.parse_outlines,
    }  # fmt: skip
    if path.suffix.lower() not in kinds:
        hint = "; unzip it first" if path.suffix.lower() == ".kmz" else ""
        raise ScenarioError([f"{where}: the name ends in none of {', '.join(kinds)}{hint}"])
    with as_error(where):
        found = kinds[path.suffix.lower()](read_text(path))
    outlines, others = [one for one in found if not one.shape], [one for one in found if one.shape]
    if not outlines:
        raise ScenarioError([f"{where}: holds no polygon"])
    faults = [f"{where}: {fault}" for fault in dict.fromkeys(fault for one in outlines for fault in _degrees(one))]
    if faults:
        raise ScenarioError(faults)
    return _ground(outlines, where, simplify, space, _left_out(others))


def _left_out(others: Sequence[Outline]) -> str:
    """What a note says of shapes without an area, such as a tree that is a point."""
    if not others:
        return ""
    several = f" and {len(others) - 1} more, no polygons, are" if len(others) > 1 else ", no polygon, is"
    return f"; {others[0].name} ({others[0].shape}){several} left out"


def _degrees(one: Outline) -> Iterator[str]:
    """What is wrong with the rings of an outline as degrees."""
    for ring in (one.shell, *one.holes):
        if len(ring) < 3:
            yield f"{one.name}: a ring of {len(ring)} corners; a polygon needs at least 3"
        for longitude, latitude in ring:
            if not (abs(longitude) <= 180.0 and abs(latitude) <= 85.0):
                yield f"{one.name}: ({longitude:g}, {latitude:g}) is not a longitude and latitude in degrees"
                break


def _flat(ring: Ring, site: FlightSite, simplify: float) -> Polygon:
    """A ring in metres about a site, without corners that are given twice or lie on a straight side."""
    points = [site.local(latitude, longitude, 0.0)[:2] for longitude, latitude in ring]
    apart = [point for point, after in zip(points, [*points[1:], points[0]], strict=True)
             if math.dist(point, after) > SAME]  # fmt: skip
    shape = Polygon(apart if len(apart) > 2 else points)
    return _fewer(shape, max(simplify, STRAIGHT)) if shape.is_valid else shape


def _fewer(shape: Polygon, most: float) -> Polygon:
    """A polygon with fewer corners, none of which moves by more than `most`, m: also not the first one."""
    few = shape.simplify(most)
    ring = list(few.exterior.coords)[:-1]
    if len(ring) > 3 and LineString([ring[-1], ring[1]]).distance(Point(ring[0])) <= STRAIGHT:
        few = Polygon(ring[1:])
    return few


def _ground(outlines: list[Outline], where: str, simplify: float, space: bool, left_out: str) -> Field:
    """The largest polygon as an arena, holes and other polygons as obstacles."""
    west, south, east, north = Polygon(max(outlines, key=lambda one: Polygon(one.shell).area).shell).bounds
    origin = round(0.5 * (south + north), 7), round(0.5 * (west + east), 7)
    site = FlightSite(*origin, 0.0)

    def local(ring: Ring) -> Polygon:
        return _flat(ring, site, simplify)

    shapes = [(one, local(one.shell), [local(hole) for hole in one.holes]) for one in outlines]
    arena, plan, holes = max(shapes, key=lambda shape: shape[1].area)
    holes = [_cut(hole, plan, max(simplify, STRAIGHT)) for hole in holes]
    solid: list[Solid] = [(arena.name, hole, {}) for hole in holes]
    solid += [(one.name, _cut(shape, plan, max(simplify, STRAIGHT)), one.heights)
              for one, shape, _ in shapes if one is not arena]  # fmt: skip
    faults = [f"{where}: {fault}" for fault in _faults(arena.name, plan, holes, solid)]
    if faults:
        raise ScenarioError(faults)
    keys: dict[str, Any] = {"arena": "polygon", "corners": _corners(plan)}
    if solid:
        keys["obstacles"] = [_corners(shape) for _, shape, _ in solid]
    heights = [own for _, _, own in solid]
    dropped = "" if space or not any((arena.heights, *heights)) else "; its heights are left out in a plane"
    if space:
        keys |= arena.heights
        if any(heights):
            keys["heights"] = [[own.get("floor", -ENDLESS), own.get("ceiling", ENDLESS)] for own in heights]
    across = max(plan.bounds[2] - plan.bounds[0], plan.bounds[3] - plan.bounds[1])
    far = f"; {across / 1000.0:.3g} km are much for a flat map" if across > LARGE else ""
    note = (
        f"{where}: {arena.name}, {len(keys['corners'])} corners and {plan.area:.4g} m², {len(solid)} obstacles; its "
        f"origin is at latitude {origin[0]:.7f}, longitude {origin[1]:.7f}{_many(plan)}{dropped}{far}{left_out}"
    )
    return Field(keys, origin, note)


def _cut(shape: Polygon, plan: Polygon, most: float) -> Polygon:
    """What must not be entered, cut off where it reaches outside of a field by no more than `most`, m.

    A wood that ends where the field does is outside by the rounding of its coordinates, or by what corners moved.
    """
    if not (shape.is_valid and plan.is_valid) or plan.covers(shape) or not plan.buffer(2.0 * most).covers(shape):
        return shape
    inside = shape.intersection(plan)
    parts = [part for part in getattr(inside, "geoms", [inside]) if isinstance(part, Polygon)]
    return max(parts, key=lambda part: part.area, default=shape)


def _many(plan: Polygon) -> str:
    """What a note says of an outline of many short sides, each of which laws feel for itself."""
    count, fewer = (len(shape.exterior.coords) - 1 for shape in (plan, plan.simplify(COARSE)))
    if count < MANY or 2 * fewer > count:
        return ""
    return f"; agents feel each of its sides for itself: world.simplify = {COARSE:g} leaves {fewer} of them"


def _faults(name: str, plan: Polygon, holes: Sequence[Polygon], solid: Sequence[Solid]) -> list[str]:
    """What is wrong with the shapes of a field: of the arena and its plan, and of what must not be entered in it."""
    faults = [f"{name} {fault}" for fault in _shape_faults(plan)]
    for own, shape, _ in solid:
        of = "a hole of " if any(shape is hole for hole in holes) else ""
        found = list(_shape_faults(shape))
        if not found and not faults and not plan.buffer(SAME).covers(shape):
            found = [f"lies outside {name}" if plan.disjoint(shape) else f"reaches outside {name}"]
        faults += [f"{of}{own} {fault}" for fault in found]
    return faults


def _shape_faults(shape: Polygon) -> Iterator[str]:
    if not shape.is_valid:
        yield f"crosses or touches itself ({explain_validity(shape)}, m from the middle)"
    elif shape.area < 1e-2:
        yield f"has an area of {shape.area:.2g} m²"
    elif len(shape.exterior.coords) > MOST_KEPT + 1:
        yield (
            f"has {len(shape.exterior.coords) - 1} corners, more than {MOST_KEPT}; world.simplify = 1.0 lets outlines "
            "move by 1 m to have fewer"
        )


def _corners(shape: Polygon) -> list[list[float]]:
    """Corners to the millimetre."""
    return [[round(x, 3), round(y, 3)] for x, y in list(shape.exterior.coords)[:-1]]
