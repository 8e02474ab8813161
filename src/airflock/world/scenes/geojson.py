"""GeoJSON (RFC 7946): the shapes of a text."""

from collections.abc import Iterator, Mapping
from typing import Any

from airflock.support import FormatError, parse_json_object, shortened
from airflock.world.scenes.rings import NO_AREA, Outline, Ring, heights_of, open_ring

MOST_CORNERS = 100_000  # of all polygons of a file


def parse_outlines(text: str) -> list[Outline]:
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
    kind = value.get("type")
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
            yield Outline(name or "polygon", shell, holes, heights_of(properties or {}))
    elif kind in NO_AREA:
        yield Outline(name or "a shape", [], shape=str(kind))


def _list(value: Any, key: str) -> list[Any]:
    if not isinstance(value, list):
        raise FormatError(f"{key} is not a list")
    return value


def _ring(points: Any) -> Ring:
    found = []
    for point in _list(points, "a ring of coordinates"):
        numbers = point if isinstance(point, list) else []
        if len(numbers) < 2 or any(isinstance(n, bool) or not isinstance(n, (int, float)) for n in numbers[:2]):
            raise FormatError(f"{shortened(repr(point), 40)} is not a point [longitude, latitude]")
        found.append((float(numbers[0]), float(numbers[1])))
    return open_ring(found)
