"""Rays: the free distance from a position along a unit vector, as a range finder measures it.

One function per shape of arena with the same arguments, so that a driver can bind the one that the
arena needs. Faces are seen from inside; 1e30 means that nothing is in the way.
"""

import math

from airflock.world.casts import ray_to_segment


def to_box(x, y, z, ux, uy, uz, half_x, half_y, half_z, edges, corners):
    """Distance (m) to the faces of a box of these half sides about the origin; 0 on a face or beyond it."""
    tx = max(half_x - x * (1.0 if ux > 0.0 else -1.0), 0.0) / (abs(ux) + 1e-12)
    ty = max(half_y - y * (1.0 if uy > 0.0 else -1.0), 0.0) / (abs(uy) + 1e-12)
    tz = max(half_z - z * (1.0 if uz > 0.0 else -1.0), 0.0) / (abs(uz) + 1e-12)
    return min(tx, min(ty, tz))


def to_cylinder(x, y, z, ux, uy, uz, half_x, half_y, half_z, edges, corners):
    """Distance (m) to an upright cylinder of radius half_x and half height half_z, from inside."""
    a = ux * ux + uy * uy + 1e-12
    b = x * ux + y * uy
    c = min(x * x + y * y - half_x * half_x, 0.0)
    tz = max(half_z - z * (1.0 if uz > 0.0 else -1.0), 0.0) / (abs(uz) + 1e-12)
    return min((math.sqrt(b * b - a * c + 1e-12) - b) / a, tz)


def to_edges(x, y, ux, uy, edges, first, last):
    """Distance (m) along the ground plan to the nearest of the polygon edges first..last-1 (rows ax ay bx by)."""
    best = 1e30
    for e in range(first, last):
        best = min(best, ray_to_segment(x, y, ux, uy, edges[e][0], edges[e][1], edges[e][2], edges[e][3]))
    return best


def to_polygon(x, y, z, ux, uy, uz, half_x, half_y, half_z, edges, corners):
    """Distance (m) to an upright prism: the first `corners` rows of edges, and half height half_z."""
    tz = max(half_z - z * (1.0 if uz > 0.0 else -1.0), 0.0) / (abs(uz) + 1e-12)
    return min(to_edges(x, y, ux, uy, edges, 0, corners), tz)


def to_nothing(x, y, z, ux, uy, uz, half_x, half_y, half_z, edges, corners):
    """Without walls every ray is free."""
    return 1e30
