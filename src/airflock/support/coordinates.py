"""Coordinates: latitude and longitude to metres about a site, and north-east-down to east-north-up.

The local plane touches the WGS 84 ellipsoid at the site; a degree has the length that it has there.
Within 1 km of the site and below 70° of latitude that is off the true tangent plane by less than
0.5 m, equally for all drones.
"""

import math
from typing import NamedTuple

SEMI_MAJOR = 6378137.0  # m, WGS 84
FLATTENING = 1.0 / 298.257223563  # WGS 84


class Geodetic(NamedTuple):
    """Latitude and longitude (degrees), altitude above mean sea level (m)."""

    latitude: float
    longitude: float
    altitude: float


class FlightSite:
    """The origin of a flight's local coordinates: its arena's centre on the ground."""

    def __init__(self, latitude: float, longitude: float, altitude: float):
        self.origin = Geodetic(latitude, longitude, altitude)
        # One length of a degree for the whole site, instead of a projection: all drones share the
        # error, so that their distances agree.
        e2 = FLATTENING * (2.0 - FLATTENING)
        phi = math.radians(latitude)
        w = 1.0 - e2 * math.sin(phi) ** 2
        meridian = SEMI_MAJOR * (1.0 - e2) / w**1.5  # radius of curvature northwards
        normal = SEMI_MAJOR / math.sqrt(w)  # and eastwards
        self._north = math.radians(1.0) * (meridian + altitude)  # m per degree
        self._east = math.radians(1.0) * (normal + altitude) * math.cos(phi)

    def local(self, latitude: float, longitude: float, altitude: float) -> tuple[float, float, float]:
        """Return east, north, up (m) of a point in degrees and metres; across the date line, too."""
        # Modulo a full turn, so that a site beside the date line has no jump in it.
        around = (longitude - self.origin.longitude + 180.0) % 360.0 - 180.0
        north = (latitude - self.origin.latitude) * self._north
        return around * self._east, north, altitude - self.origin.altitude

    def to_geodetic(self, x: float, y: float, z: float) -> Geodetic:
        """Return latitude, longitude (degrees) and altitude (m) of a local point (m)."""
        longitude = (self.origin.longitude + x / self._east + 180.0) % 360.0 - 180.0
        return Geodetic(self.origin.latitude + y / self._north, longitude, self.origin.altitude + z)


def swap_enu_ned(a: float, b: float, c: float) -> tuple[float, float, float]:
    """Convert north-east-down to east-north-up, or back: the exchange is its own inverse."""
    return b, a, -c
