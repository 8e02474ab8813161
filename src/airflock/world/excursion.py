"""Excursion: how far (m) a position lies outside an arena; negative or zero where flying is allowed.

One function per shape, each with the same four numbers and the polygon's edges, so that a driver
can bind the one that the arena needs.
"""

import math

from airflock.world.polygon import obstacle


def beyond_box(x, y, z, half_x, half_y, half_z, edges, corners):
    """Euclidean distance to a box of these half sides about the origin; inside, minus the distance to its face."""
    ex = abs(x) - half_x
    ey = abs(y) - half_y
    ez = abs(z) - half_z
    px = max(ex, 0.0)
    py = max(ey, 0.0)
    pz = max(ez, 0.0)
    return math.sqrt(px * px + py * py + pz * pz) + min(max(ex, max(ey, ez)), 0.0)


def beyond_cylinder(x, y, z, half_x, half_y, half_z, edges, corners):
    """Distance to an upright cylinder of radius half_x and half height half_z about the origin."""
    er = math.sqrt(x * x + y * y) - half_x
    ez = abs(z) - half_z
    pr = max(er, 0.0)
    pz = max(ez, 0.0)
    return math.sqrt(pr * pr + pz * pz) + min(max(er, ez), 0.0)


def beyond_polygon(x, y, z, half_x, half_y, half_z, edges, corners):
    """Distance to an upright prism: the polygon of the first `corners` rows of edges, and half height half_z."""
    er = obstacle(x, y, z, edges, 0, corners).distance
    ez = abs(z) - half_z
    pr = max(er, 0.0)
    pz = max(ez, 0.0)
    return math.sqrt(pr * pr + pz * pz) + min(max(er, ez), 0.0)


def beyond_nothing(x, y, z, half_x, half_y, half_z, edges, corners):
    """Without an arena nobody is outside."""
    return -1e30
