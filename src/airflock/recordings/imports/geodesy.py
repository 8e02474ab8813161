"""Latitude, longitude and height to local metres and back, exactly: WGS84, earth-centred, then east-north-up."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

SEMI_MAJOR = 6378137.0  # m, WGS84 (NIMA TR8350.2)
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)


def to_ecef(lat: Any, lon: Any, height: Any) -> NDArray[np.float64]:
    """Earth-centred, earth-fixed coordinates (..., 3), m, of latitude and longitude (degrees) and height (m)."""
    phi, lam, h = np.radians(lat), np.radians(lon), np.asarray(height, float)
    normal = SEMI_MAJOR / np.sqrt(1.0 - ECCENTRICITY2 * np.sin(phi) ** 2)
    across = (normal + h) * np.cos(phi)
    up = (normal * (1.0 - ECCENTRICITY2) + h) * np.sin(phi)
    return np.stack(np.broadcast_arrays(across * np.cos(lam), across * np.sin(lam), up), axis=-1)


def enu_axes(lat: float, lon: float) -> NDArray[np.float64]:
    """Unit vectors east, north and up at a place, as rows, in earth-centred coordinates."""
    phi, lam = np.radians(lat), np.radians(lon)
    east = [-np.sin(lam), np.cos(lam), 0.0]
    north = [-np.sin(phi) * np.cos(lam), -np.sin(phi) * np.sin(lam), np.cos(phi)]
    return np.array([east, north, np.cross(east, north)])


def to_enu(lat: Any, lon: Any, height: Any, origin: tuple[float, float, float]) -> NDArray[np.float64]:
    """East, north, up (..., 3), m, about an origin of latitude, longitude (degrees) and height (m)."""
    offset: NDArray[np.float64] = (to_ecef(lat, lon, height) - to_ecef(*origin)) @ enu_axes(*origin[:2]).T
    return offset


def points_to_origin(
    local: NDArray[np.float64], from_origin: tuple[float, float, float], to_origin: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Points (row, 3) of the frame about one origin in the frame about another, m."""
    centred = local @ enu_axes(*from_origin[:2]) + (to_ecef(*from_origin) - to_ecef(*to_origin))
    return centred @ enu_axes(*to_origin[:2]).T


def vectors_to_origin(
    vectors: NDArray[np.float64], from_origin: tuple[float, float, float], to_origin: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Vectors (row, 3), such as velocities, from the axes at one origin to those at another."""
    rotated: NDArray[np.float64] = vectors @ enu_axes(*from_origin[:2]) @ enu_axes(*to_origin[:2]).T
    return rotated
