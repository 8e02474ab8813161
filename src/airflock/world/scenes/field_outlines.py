"""Outlines of fields as people have them: polygons of GeoJSON, KML and QGroundControl's plans, in local metres.

A file is untrusted: it is read through `untrusted`, and all its errors are raised together.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from shapely import union_all
from shapely.geometry import LineString, Point, Polygon
from shapely.validation import explain_validity

from airflock.support import (
    Element,
    FlightSite,
    FormatError,
    ScenarioError,
    as_error,
    parse_json_object,
    parse_xml,
    read_text,
    shortened,
)

NO_AREA = {"Point", "MultiPoint", "LineString", "MultiLineString", "LinearRing", "Track", "MultiTrack", "Model"}
Ring = list[tuple[float, float]]


@dataclass(frozen=True)
class Outline:
    """One shape of a file: its name, its rings in degrees (longitude, latitude), and heights (m) that it gives.

    shape : of one that is no polygon, and so is left out: what it is; `shell` holds the points of a
            line
    parts : number of the MultiPolygon or MultiGeometry that it is a part of; 0 of one that stands
            alone
    solid : it must not be entered, and is no arena even if it is the largest
    """

    name: str
    shell: Ring
    holes: list[Ring] = field(default_factory=list)
    heights: Mapping[str, float] = field(default_factory=dict)
    shape: str = ""
    parts: int = 0
    solid: bool = False


def open_ring(ring: Ring) -> Ring:
    """A ring without its last point, where that is the first again, and without points that are given twice."""
    return [point for point, after in zip(ring, [*ring[1:], ring[0]], strict=True) if point != after] if ring else []


def heights_of(properties: Mapping[str, Any]) -> dict[str, float]:
    """The properties floor and ceiling, m."""
    found = {key: properties[key] for key in ("floor", "ceiling") if properties.get(key) is not None}
    for key, value in found.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise FormatError(f"the property {key} = {shortened(repr(value), 40)} is not a height in m")
    return {key: float(value) for key, value in found.items()}


MOST_CORNERS = 100_000  # of all polygons of a file


def parse_geojson(text: str) -> list[Outline]:
    """Shapes of a GeoJSON text (RFC 7946), in its order."""
    document = parse_json_object(text)
    crs = str(document.get("crs", "")).upper()
    if crs and "CRS84" not in crs and "4326" not in crs:
        raise FormatError("is in other coordinates than longitude and latitude (key crs); export it as WGS 84")
    found = list(_features(document, ""))
    if sum(len(ring) for one in found for ring in (one.shell, *one.holes)) > MOST_CORNERS:
        raise FormatError(f"has more than {MOST_CORNERS} corners")
    return found


def _features(value: Any, name: str, properties: Mapping[str, Any] | None = None) -> Iterator[Outline]:
    """Shapes of a GeoJSON object and of all that it holds."""
    if not isinstance(value, Mapping):
        return
    kind = str(value.get("type"))
    if kind == "FeatureCollection":
        for number, one in enumerate(_list(value.get("features"), "features")):
            yield from _features(one, f"feature {number + 1}")
    elif kind == "Feature":
        given = value.get("properties")
        given = given if isinstance(given, Mapping) else {}
        yield from _features(value.get("geometry"), shortened(str(given.get("name") or name), 60), given)
    elif kind == "GeometryCollection":
        for one in _list(value.get("geometries"), "geometries"):
            yield from _features(one, name, properties)
    elif kind in ("Polygon", "MultiPolygon"):
        polygons = _list(value.get("coordinates"), "coordinates")
        for rings in [polygons] if kind == "Polygon" else polygons:
            shell, *holes = [_ring(ring) for ring in _list(rings, "coordinates")] or [[]]
            parts = id(value) if kind == "MultiPolygon" else 0
            yield Outline(name or "polygon", shell, holes, heights_of(properties or {}), parts=parts)
    elif kind in NO_AREA:
        line = _points(value.get("coordinates")) if kind == "LineString" else []
        yield Outline(name or "a shape", line, shape=kind)


def _list(value: Any, key: str) -> list[Any]:
    if not isinstance(value, list):
        raise FormatError(f"{key} is not a list")
    return value


def _ring(points: Any) -> Ring:
    return open_ring(_points(points))


def _points(points: Any) -> Ring:
    found = []
    for point in _list(points, "a ring of coordinates"):
        numbers = point if isinstance(point, list) else []
        if len(numbers) < 2 or any(isinstance(n, bool) or not isinstance(n, (int, float)) for n in numbers[:2]):
            raise FormatError(f"{shortened(repr(point), 40)} is not a point [longitude, latitude]")
        found.append((float(numbers[0]), float(numbers[1])))
    return found


def parse_plan(text: str) -> list[Outline]:
    """Fences of a plan of QGroundControl: polygons and circles, latitude first; no missions and no rally points."""
    fence = parse_json_object(text).get("geoFence")
    if not isinstance(fence, Mapping):
        raise FormatError("holds no geoFence; is it a plan of QGroundControl?")
    found = []
    for number, one in enumerate(_list(fence.get("polygons", []), "polygons"), 1):
        ring = [(longitude, latitude) for latitude, longitude in _ring(_entry(one, "polygon"))]
        found.append(Outline(f"fence {number}", ring, solid=_entry(one, "inclusion") is False))
    for number, one in enumerate(_list(fence.get("circles", []), "circles"), 1):
        circle, solid = _entry(one, "circle"), _entry(one, "inclusion") is False
        (latitude, longitude), radius = _points([_entry(circle, "center")])[0], _entry(circle, "radius")
        if isinstance(radius, bool) or not isinstance(radius, (int, float)) or not 0.0 < radius <= MOST_RADIUS:
            raise FormatError(
                f"circle {number}: radius = {shortened(repr(radius), 40)} is not in (0, {MOST_RADIUS:g}] m"
            )
        # Its sides lie inside of a circle to fly in, and outside of one that must not be entered.
        radius, site = radius / (math.cos(math.pi / SIDES) if solid else 1.0), FlightSite(latitude, longitude, 0.0)
        turns = [2.0 * math.pi * k / SIDES for k in range(SIDES)]
        places = [site.to_geodetic(radius * math.cos(a), radius * math.sin(a), 0.0) for a in turns]
        ring = [(place.longitude, place.latitude) for place in places]
        found.append(Outline(f"circle {number}", ring, solid=solid))
    if sum(not one.solid for one in found) > 1:
        raise FormatError("has several fences to stay inside of; leave one of them, and make the others exclusions")
    return found


def _entry(value: Any, key: str) -> Any:
    if not isinstance(value, Mapping) or key not in value:
        raise FormatError(f"a fence without the key {key}")
    return value[key]


SIDES = 36  # of the polygon that stands for a circle
MOST_RADIUS = 1e5  # m


def parse_kml(text: str) -> list[Outline]:
    """Shapes of a KML text, in its order; heights are those of its extended data, not of its coordinates."""
    return list(_placed(parse_xml(text), "", {}))


def _placed(element: Element, name: str, data: Mapping[str, str], parts: int = 0) -> Iterator[Outline]:
    """Shapes within an element, with the name of the nearest thing around them that has one, and its extended data."""
    name = next((shortened(one.text, 60) for one in element.children if one.tag == "name" and one.text), name)
    if element.tag == "Placemark":
        data = {key: value for one in element.children if one.tag == "ExtendedData" for key, value in _data(one)}
    parts = id(element) if element.tag == "MultiGeometry" else parts
    if element.tag == "Polygon":
        shells, holes = (
            [ring for one in element.children if one.tag == tag for ring in _rings(one)]
            for tag in ("outerBoundaryIs", "innerBoundaryIs")
        )
        yield Outline(name or "polygon", shells[0] if shells else [], holes, heights_of(_numbers(data)), parts=parts)
        return
    if element.tag in NO_AREA:
        line = next((one.text for one in element.children if one.tag == "coordinates"), "")
        yield Outline(name or "a shape", _line(line) if element.tag != "Point" else [], shape=element.tag)
    for one in element.children:
        yield from _placed(one, name, data, parts)


def _data(extended: Element) -> Iterator[tuple[str, str]]:
    """Names and values of an element ExtendedData: of Data (Google Earth) and of SimpleData (QGIS, GDAL)."""
    for one in extended.children:
        if one.tag == "SimpleData":
            yield one.name, one.text
        elif one.tag == "Data":
            yield from ((one.name, two.text) for two in one.children if two.tag == "value")
        elif one.tag == "SchemaData":
            yield from _data(one)


def _numbers(data: Mapping[str, str]) -> dict[str, Any]:
    """Texts of a KML as numbers where they are some; without those that are empty."""
    found: dict[str, Any] = {}
    for key, value in data.items():
        try:
            found[key] = float(value) if value else None
        except ValueError:
            found[key] = value
    return found


def _rings(boundary: Element) -> list[Ring]:
    """Rings of a boundary: Google Earth writes several holes into one innerBoundaryIs."""
    texts = [two.text for one in boundary.children if one.tag == "LinearRing" for two in one.children
             if two.tag == "coordinates"]  # fmt: skip
    return [open_ring(_line(text)) for text in texts] or [[]]


def _line(text: str) -> Ring:
    found = []
    for point in text.split():
        try:
            longitude, latitude, *_ = (float(number) for number in point.split(","))
        except ValueError:
            raise FormatError(f"{shortened(repr(point), 40)} is not a point longitude,latitude") from None
        found.append((longitude, latitude))
    return found


MOST_KEPT = 500  # of one polygon that is flown in: each decision looks along lines of sight past all of them
ENDLESS = 1e5  # m; heights of an obstacle that has none, where others have
LARGE = 5000.0  # m; beyond, a degree is not the same everywhere
HUGE = 1e6  # m; no field is as wide, but one of 10 m whose metres are read as degrees
SAME = 1e-3  # m; corners that lie no farther apart are one
STRAIGHT = 0.01  # m; a corner that moves an outline by less is none, as on a straight side with points on it
MANY = 12  # corners, from which on a note says how many fewer would do
COARSE = 1.0  # m; tolerance that this note assumes
FEW = 2000  # corners, up to which an outline is simplified as a whole: the time grows with the square
MOST_SIMPLIFIED = 10_000  # corners, beyond which this takes minutes, or more stack than there is
Solid = tuple[str, Polygon, Mapping[str, float]]  # name, plan in m, and heights (m) of what must not be entered


@dataclass(frozen=True)
class Field:
    """A field in local metres about its origin: keys of the section [world], and a note of what was read."""

    keys: dict[str, Any]
    origin: tuple[float, float]
    note: str


def load_field(path: Path, *, simplify: float = 0.0, space: bool = False) -> Field:
    """The field of a GeoJSON or KML file or of a plan: its largest polygon, and what must not be entered inside.

    simplify : how far outlines may move to have fewer corners, m
    space    : whether the flight has heights; else those of the file are left out

    Raises ScenarioError with one line per fault.
    """
    where = f"world.file = {shortened(str(path), 120)}"
    kinds: dict[str, Callable[[str], list[Outline]]] = {
        ".geojson": parse_geojson, ".json": parse_geojson, ".kml": parse_kml, ".plan": parse_plan,
    }  # fmt: skip
    if path.suffix.lower() not in kinds:
        hint = "; unzip it first" if path.suffix.lower() == ".kmz" else ""
        raise ScenarioError([f"{where}: the name ends in none of {', '.join(kinds)}{hint}"])
    with as_error(where):
        found = kinds[path.suffix.lower()](read_text(path))
    outlines, others = [one for one in found if not one.shape], [one for one in found if one.shape]
    closed = [one for one in others if len(one.shell) > 3 and one.shell[0] == one.shell[-1]]
    taken = ""
    if not outlines and closed:
        # Many programs draw a fence as a line that comes back to its start.
        outlines = [replace(one, shell=open_ring(one.shell)) for one in closed]
        others = [one for one in others if one not in closed]
        taken = f"; {closed[0].name}, a closed line, is taken for an outline"
    if all(one.solid for one in outlines):
        raise ScenarioError([f"{where}: holds no polygon{_open_line(others)}"])
    outlines = _around_date_line(outlines)
    faults = [f"{where}: {fault}" for fault in dict.fromkeys(fault for one in outlines for fault in _degrees(one))]
    if faults:
        raise ScenarioError(faults)
    with as_error(where):
        return _ground(outlines, where, simplify, space, taken + _left_out(others))


def _open_line(others: Sequence[Outline]) -> str:
    """Return by how much the first open line misses its start; "" where there is none."""
    for one in others:
        if len(one.shell) > 2:
            (longitude, latitude), end = one.shell[0], one.shell[-1]
            apart = math.hypot(*FlightSite(latitude, longitude, 0.0).local(end[1], end[0], 0.0)[:2])
            return f"; {one.name} ({one.shape}) is not closed: its ends lie {apart:.3g} m apart"
    return ""


def _around_date_line(outlines: list[Outline]) -> list[Outline]:
    """Return outlines that go on beyond 180° where a field lies across it; longitudes jump there by a full turn.

    A polygon that was cut in two there, as RFC 7946 wants it, is one again.
    """
    longitudes = [longitude for one in outlines for longitude, _ in one.shell]
    if not longitudes or max(longitudes) - min(longitudes) <= 180.0 or max(map(abs, longitudes)) > 180.0:
        return outlines

    def shifted(ring: Ring) -> Ring:
        return [(longitude % 360.0, latitude) for longitude, latitude in ring]

    moved = [replace(one, shell=shifted(one.shell), holes=[shifted(hole) for hole in one.holes]) for one in outlines]
    whole: list[Outline] = []
    for number in dict.fromkeys(one.parts for one in moved):
        parts = [one for one in moved if one.parts == number]
        shapes = [Polygon(one.shell, one.holes) for one in parts if len(one.shell) > 2] if number else []
        union = union_all(shapes) if shapes and all(shape.is_valid for shape in shapes) else None
        if isinstance(union, Polygon) and len(parts) > 1:
            holes = [list(ring.coords)[:-1] for ring in union.interiors]
            parts = [replace(parts[0], shell=list(union.exterior.coords)[:-1], holes=holes)]
        whole += parts
    return whole


def _left_out(others: Sequence[Outline]) -> str:
    """Return a note on shapes without an area, such as a tree that is a point."""
    if not others:
        return ""
    several = f" and {len(others) - 1} more, no polygons, are" if len(others) > 1 else ", no polygon, is"
    return f"; {others[0].name} ({others[0].shape}){several} left out"


def _degrees(one: Outline) -> Iterator[str]:
    """Yield the errors of the rings of an outline as degrees."""
    for ring in (one.shell, *one.holes):
        if len(ring) < 3:
            yield f"{one.name}: a ring of {len(ring)} corners; a polygon needs at least 3"
        for longitude, latitude in ring:
            if not (-180.0 <= longitude <= 360.0 and abs(latitude) <= 85.0):
                swapped = abs(longitude) <= 85.0 and abs(latitude) <= 180.0
                hint = "; are they exchanged? longitude comes first" if swapped else ""
                yield f"{one.name}: ({longitude:g}, {latitude:g}) is not a longitude and latitude in degrees{hint}"
                break


def _flat(ring: Ring, site: FlightSite, simplify: float) -> Polygon:
    """A ring in metres about a site, without corners that are given twice or lie on a straight side."""
    points = [site.local(latitude, longitude, 0.0)[:2] for longitude, latitude in ring]
    apart = [point for point, after in zip(points, [*points[1:], points[0]], strict=True)
             if math.dist(point, after) > SAME]  # fmt: skip
    if len(apart) > FEW:
        # Piece by piece: simplifying all of 10^5 corners takes half a minute, or ends the process.
        pieces = [LineString([*apart, apart[0]][k : k + 501]) for k in range(0, len(apart), 500)]
        thin = [piece.simplify(0.5 * max(simplify, STRAIGHT), preserve_topology=False) for piece in pieces]
        apart = [point for piece in thin for point in list(piece.coords)[:-1]]
        if len(apart) > MOST_SIMPLIFIED:
            raise FormatError(f"an outline {_too_many(len(apart))}")
        simplify *= 0.5
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
    largest = max((one for one in outlines if not one.solid), key=lambda one: Polygon(one.shell).area)
    west, south, east, north = Polygon(largest.shell).bounds
    middle = 0.5 * (west + east)
    origin = round(0.5 * (south + north), 7), round(middle - 360.0 if middle > 180.0 else middle, 7)
    site = FlightSite(*origin, 0.0)

    def local(ring: Ring) -> Polygon:
        return _flat(ring, site, simplify)

    shapes = [(one, local(one.shell), [local(hole) for hole in one.holes]) for one in outlines]
    arena, plan, holes = max((each for each in shapes if not each[0].solid), key=lambda shape: shape[1].area)
    across = max(plan.bounds[2] - plan.bounds[0], plan.bounds[3] - plan.bounds[1])
    if across > HUGE:
        raise FormatError(f"{arena.name} is {across / 1000.0:.3g} km wide: are its numbers metres instead of degrees?")
    # Parts of one MultiPolygon are parts of the field; those that lie apart from it are no obstacles.
    apart = [one for one, shape, _ in shapes
             if one.parts and one.parts == arena.parts and one is not arena and plan.disjoint(shape)]  # fmt: skip
    shapes = [each for each in shapes if each[0] not in apart]
    if apart:
        left_out = f"; {len(apart)} smaller parts of {arena.name}, which lie apart, are left out{left_out}"
    holes = [_cut(hole, plan, max(simplify, STRAIGHT)) for hole in holes]
    solid: list[Solid] = [(arena.name, hole, {}) for hole in holes]
    solid += [(one.name, _cut(shape, plan, max(simplify, STRAIGHT)), one.heights)
              for one, shape, _ in shapes if one is not arena]  # fmt: skip
    faults = [f"{where}: {fault}" for fault in _faults(arena.name, plan, holes, solid)]
    if faults:
        raise ScenarioError(faults)
    keys: dict[str, Any] = {"arena": "polygon", "corners": _corners(plan)}
    keys |= dict(zip(("latitude", "longitude"), origin, strict=True))
    if solid:
        keys["obstacles"] = [_corners(shape) for _, shape, _ in solid]
    heights = [own for _, _, own in solid]
    dropped = "" if space or not any((arena.heights, *heights)) else "; its heights are left out in a plane"
    if space:
        keys |= arena.heights
        if any(heights):
            keys["heights"] = [[own.get("floor", -ENDLESS), own.get("ceiling", ENDLESS)] for own in heights]
    far = f"; {across / 1000.0:.3g} km are much for a flat map" if across > LARGE else ""
    note = (
        f"{where}: {arena.name}, {len(keys['corners'])} corners and {plan.area:.4g} m², {len(solid)} obstacles; its "
        f"origin is at latitude {origin[0]:.7f}, longitude {origin[1]:.7f}{_many(plan)}{dropped}{far}{left_out}"
    )
    return Field(keys, origin, note)


def _cut(shape: Polygon, plan: Polygon, most: float) -> Polygon:
    """Cut a forbidden shape off where it reaches outside of a field by no more than `most`, m.

    A wood that ends where the field does is outside by the rounding of its coordinates, or by what
    corners moved.
    """
    if not (shape.is_valid and plan.is_valid) or plan.covers(shape) or not plan.buffer(2.0 * most).covers(shape):
        return shape
    inside = shape.intersection(plan)
    parts = [part for part in getattr(inside, "geoms", [inside]) if isinstance(part, Polygon)]
    return max(parts, key=lambda part: part.area, default=shape)


def _many(plan: Polygon) -> str:
    """Return a note on an outline of many short sides, each of which laws feel for itself."""
    count, fewer = (len(shape.exterior.coords) - 1 for shape in (plan, plan.simplify(COARSE)))
    if count < MANY or 2 * fewer > count:
        return ""
    return f"; agents feel each of its sides for itself: world.simplify = {COARSE:g} leaves {fewer} of them"


def _faults(name: str, plan: Polygon, holes: Sequence[Polygon], solid: Sequence[Solid]) -> list[str]:
    """Return the errors of the shapes of a field: of the arena, its plan, and the forbidden shapes in it."""
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
        yield _too_many(len(shape.exterior.coords) - 1)


def _too_many(corners: int) -> str:
    return f"has {corners} corners, more than {MOST_KEPT}; world.simplify = 1.0 lets outlines move by 1 m to have fewer"


def _corners(shape: Polygon) -> list[list[float]]:
    """Corners to the millimetre."""
    return [[round(x, 3), round(y, 3)] for x, y in list(shape.exterior.coords)[:-1]]
