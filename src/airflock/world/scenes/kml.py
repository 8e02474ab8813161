"""KML (OGC 2.2): the shapes of a text, whatever its namespaces, folders and geometries of several parts."""

from collections.abc import Iterator, Mapping
from typing import Any

from airflock.support import Element, FormatError, parse_xml, shortened
from airflock.world.scenes.rings import NO_AREA, Outline, Ring, heights_of, open_ring


def parse_outlines(text: str) -> list[Outline]:
    """Shapes of a KML text, in its order; heights are those of its extended data, not of its coordinates."""
    return list(_placed(parse_xml(text), "", {}))


def _placed(element: Element, name: str, told: Mapping[str, str]) -> Iterator[Outline]:
    """Shapes within an element, with the name of the nearest thing around them that has one, and what is told of it."""
    name = next((shortened(one.text, 60) for one in element.children if one.tag == "name" and one.text), name)
    if element.tag == "Placemark":
        told = {key: value for one in element.children if one.tag == "ExtendedData" for key, value in _data(one)}
    if element.tag == "Polygon":
        shells, holes = (
            [ring for one in element.children if one.tag == tag for ring in _rings(one)]
            for tag in ("outerBoundaryIs", "innerBoundaryIs")
        )
        yield Outline(name or "polygon", shells[0] if shells else [], holes, heights_of(_numbers(told)))
        return
    if element.tag in NO_AREA:
        yield Outline(name or "a shape", [], shape=element.tag)
    for one in element.children:
        yield from _placed(one, name, told)


def _data(extended: Element) -> Iterator[tuple[str, str]]:
    """Names and values of an element ExtendedData: of Data (Google Earth) and of SimpleData (QGIS, GDAL)."""
    for one in extended.children:
        if one.tag == "SimpleData":
            yield one.name, one.text
        elif one.tag == "Data":
            yield from ((one.name, two.text) for two in one.children if two.tag == "value")
        elif one.tag == "SchemaData":
            yield from _data(one)


def _numbers(told: Mapping[str, str]) -> dict[str, Any]:
    """Texts of a KML as numbers where they are some; without those that are empty."""
    found: dict[str, Any] = {}
    for key, value in told.items():
        try:
            found[key] = float(value) if value else None
        except ValueError:
            found[key] = value
    return found


def _rings(boundary: Element) -> list[Ring]:
    """Rings of a boundary: Google Earth writes several holes into one innerBoundaryIs."""
    texts = [two.text for one in boundary.children if one.tag == "LinearRing" for two in one.children
             if two.tag == "coordinates"]  # fmt: skip
    return [_coordinates(text) for text in texts] or [[]]


def _coordinates(text: str) -> Ring:
    found = []
    for point in text.split():
        try:
            longitude, latitude, *_ = (float(number) for number in point.split(","))
        except ValueError:
            raise FormatError(f"{shortened(repr(point), 40)} is not a point longitude,latitude") from None
        found.append((longitude, latitude))
    return open_ring(found)
