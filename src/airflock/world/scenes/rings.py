"""Rings: what a file of a map says of a shape, in degrees, as its reader finds it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from airflock.support import FormatError, shortened

NO_AREA = {"Point", "MultiPoint", "LineString", "MultiLineString", "LinearRing", "Track", "MultiTrack", "Model"}
Ring = list[tuple[float, float]]


@dataclass(frozen=True)
class Outline:
    """One shape of a file: its name, its rings in degrees (longitude, latitude), and heights (m) that it tells.

    shape : of one that is no polygon, and so is left out: what it is
    """

    name: str
    shell: Ring
    holes: list[Ring] = field(default_factory=list)
    heights: Mapping[str, float] = field(default_factory=dict)
    shape: str = ""


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
