"""Outlines of fields as people have them: polygons of GeoJSON and KML files, in local metres.

A file is untrusted: it is read through `untrusted`, and everything that is wrong with it is told at once.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shapely.geometry import Polygon
from shapely.validation import explain_validity

from airflock.errors import ScenarioError, bounded
from airflock.mavlink.coordinates import Site
from airflock.untrusted import Element, FormatError, from_outside, json_object, read_text, xml

MOST_CORNERS = 100_000  # of all polygons of a file
MOST_KEPT = 500  # of one polygon that is flown in: each decision looks along lines of sight past all of them
ENDLESS = 1e5  # m; heights of an obstacle that has none, where others have
LARGE = 5000.0  # m; beyond, a degree is not the same everywhere
Ring = list[tuple[float, float]]
Solid = tuple[str, Polygon, Mapping[str, float]]  # name, plan in m, and heights (m) of what must not be entered


@dataclass(frozen=True)
class Outline:
    """One polygon of a file: its name, its rings in degrees (longitude, latitude), and heights (m) that it tells."""

    name: str
    shell: Ring
    holes: list[Ring] = field(default_factory=list)
    heights: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Ground:
    """A field in local metres about its origin: keys of the section [world], and a note of what was read."""

    keys: dict[str, Any]
    origin: tuple[float, float]
    note: str


def ground_of(path: Path, *, simplify: float = 0.0, space: bool = False) -> Ground:
    """The field of a GeoJSON or KML file: its largest polygon, and what must not be entered inside.

    simplify : how far outlines may move to have fewer corners, m
    space    : whether the flight has heights; else those of the file are left out

    Raises ScenarioError with one line per fault.
    """
    where = f"world.file = {bounded(str(path), 120)}"
    kinds: dict[str, Callable[[str], list[Outline]]] = {
        ".geojson": geojson, ".json": geojson, ".kml": kml,
    }  # fmt: skip
    if path.suffix.lower() not in kinds:
        hint = "; unzip it first" if path.suffix.lower() == ".kmz" else ""
        raise ScenarioError([f"{where}: the name ends in none of {', '.join(kinds)}{hint}"])
    with from_outside(where):
        outlines = kinds[path.suffix.lower()](read_text(path))
    if not outlines:
        raise ScenarioError([f"{where}: holds no polygon"])
    faults = [f"{where}: {fault}" for fault in dict.fromkeys(fault for one in outlines for fault in _degrees(one))]
    if faults:
        raise ScenarioError(faults)
    return _ground(outlines, where, simplify, space)


def geojson(text: str) -> list[Outline]:
    """Polygons of a GeoJSON text (RFC 7946), in its order."""
    document = json_object(text)
    crs = str(document.get("crs", "")).upper()
    if crs and "CRS84" not in crs and "4326" not in crs:
        raise FormatError("is in other coordinates than longitude and latitude (key crs); export it as WGS 84")
    found = list(_features(document, ""))
    if sum(len(ring) for one in found for ring in (one.shell, *one.holes)) > MOST_CORNERS:
        raise FormatError(f"has more than {MOST_CORNERS} corners")
    return found


def _features(value: Any, name: str, properties: Mapping[str, Any] | None = None) -> Iterator[Outline]:
    """Polygons of a GeoJSON object and of all that it holds."""
    if not isinstance(value, Mapping):
        return
    kind = value.get("type")
    if kind == "FeatureCollection":
        for number, one in enumerate(_list(value.get("features"), "features")):
            yield from _features(one, f"feature {number + 1}")
    elif kind == "Feature":
        given = value.get("properties")
        given = given if isinstance(given, Mapping) else {}
        yield from _features(value.get("geometry"), bounded(str(given.get("name") or name), 60), given)
    elif kind == "GeometryCollection":
        for one in _list(value.get("geometries"), "geometries"):
            yield from _features(one, name, properties)
    elif kind in ("Polygon", "MultiPolygon"):
        polygons = _list(value.get("coordinates"), "coordinates")
        for rings in [polygons] if kind == "Polygon" else polygons:
            shell, *holes = [_ring(ring) for ring in _list(rings, "coordinates")] or [[]]
            yield Outline(name or "polygon", shell, holes, _heights(properties or {}))


def _heights(properties: Mapping[str, Any]) -> dict[str, float]:
    """The properties floor and ceiling, m."""
    found = {key: properties[key] for key in ("floor", "ceiling") if properties.get(key) is not None}
    for key, value in found.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise FormatError(f"the property {key} = {bounded(repr(value), 40)} is not a height in m")
    return {key: float(value) for key, value in found.items()}


def _list(value: Any, key: str) -> list[Any]:
    if not isinstance(value, list):
        raise FormatError(f"{key} is not a list")
    return value


def _ring(points: Any) -> Ring:
    found = []
    for point in _list(points, "a ring of coordinates"):
        numbers = point if isinstance(point, list) else []
        if len(numbers) < 2 or any(isinstance(n, bool) or not isinstance(n, (int, float)) for n in numbers[:2]):
            raise FormatError(f"{bounded(repr(point), 40)} is not a point [longitude, latitude]")
        found.append((float(numbers[0]), float(numbers[1])))
    return _open(found)


def kml(text: str) -> list[Outline]:
    """Polygons of a KML text, in its order; heights are not read from it."""
    return list(_placed(xml(text), ""))


def _placed(element: Element, name: str) -> Iterator[Outline]:
    """Polygons within an element, with the name of the nearest thing around them that has one."""
    name = next((bounded(one.text, 60) for one in element.children if one.tag == "name" and one.text), name)
    if element.tag == "Polygon":
        shells = [_coordinates(one) for one in element.children if one.tag == "outerBoundaryIs"]
        holes = [_coordinates(one) for one in element.children if one.tag == "innerBoundaryIs"]
        yield Outline(name or "polygon", shells[0] if shells else [], holes)
    for one in element.children:
        yield from _placed(one, name)


def _coordinates(boundary: Element) -> Ring:
    texts = [two.text for one in boundary.children if one.tag == "LinearRing" for two in one.children
             if two.tag == "coordinates"]  # fmt: skip
    found = []
    for point in (texts[0] if texts else "").split():
        try:
            longitude, latitude, *_ = (float(number) for number in point.split(","))
        except ValueError:
            raise FormatError(f"{bounded(repr(point), 40)} is not a point longitude,latitude") from None
        found.append((longitude, latitude))
    return _open(found)


def _open(ring: Ring) -> Ring:
    """A ring without its last point, where that is the first again, and without points that are given twice."""
    return [point for point, after in zip(ring, [*ring[1:], ring[0]], strict=True) if point != after] if ring else []


def _degrees(one: Outline) -> Iterator[str]:
    """What is wrong with the rings of an outline as degrees."""
    for ring in (one.shell, *one.holes):
        if len(ring) < 3:
            yield f"{one.name}: a ring of {len(ring)} corners; a polygon needs at least 3"
        for longitude, latitude in ring:
            if not (abs(longitude) <= 180.0 and abs(latitude) <= 85.0):
                yield f"{one.name}: ({longitude:g}, {latitude:g}) is not a longitude and latitude in degrees"
                break


def _ground(outlines: list[Outline], where: str, simplify: float, space: bool) -> Ground:
    """The largest polygon as an arena, holes and other polygons as obstacles."""
    west, south, east, north = Polygon(max(outlines, key=lambda one: Polygon(one.shell).area).shell).bounds
    origin = round(0.5 * (south + north), 7), round(0.5 * (west + east), 7)
    site = Site(*origin, 0.0)

    def local(ring: Ring) -> Polygon:
        metres = Polygon([site.local(latitude, longitude, 0.0)[:2] for longitude, latitude in ring])
        return metres.simplify(simplify) if simplify > 0.0 and metres.is_valid else metres

    shapes = [(one, local(one.shell), [local(hole) for hole in one.holes]) for one in outlines]
    arena, plan, holes = max(shapes, key=lambda shape: shape[1].area)
    solid: list[Solid] = [(arena.name, hole, {}) for hole in holes]
    solid += [(one.name, shape, one.heights) for one, shape, _ in shapes if one is not arena]
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
        f"origin is at latitude {origin[0]:.7f}, longitude {origin[1]:.7f}{dropped}{far}"
    )
    return Ground(keys, origin, note)


def _faults(name: str, plan: Polygon, holes: Sequence[Polygon], solid: Sequence[Solid]) -> list[str]:
    """What is wrong with the shapes of a field: of the arena and its plan, and of what must not be entered in it."""
    faults = [f"{name} {fault}" for fault in _shape_faults(plan)]
    for own, shape, _ in solid:
        of = "a hole of " if any(shape is hole for hole in holes) else ""
        found = list(_shape_faults(shape))
        if not found and not faults and not plan.covers(shape):
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
