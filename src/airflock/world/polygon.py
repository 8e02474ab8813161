"""Polygons as arenas and as obstacles: any simple polygon, also a concave one, and upright prisms over them.

A polygon is a run of rows `ax ay bx by` (m), its edges in counter-clockwise order, so that its
inside lies to the left of each edge. An arena is the first `corners` rows. Distances are exact.
"""

import math

from airflock.world.arena import Surface
from airflock.world.casts import ray_to_segment


def inner(x, y, edges, first, last):
    """1.0 if a position lies inside the polygon of rows first..last-1, else 0.0: crossings of a ray to the east."""
    odd = 0.0
    for e in range(first, last):
        ay = edges[e][1]
        by = edges[e][3]
        if (ay > y) != (by > y) and x < edges[e][0] + (y - ay) * (edges[e][2] - edges[e][0]) / (by - ay):
            odd = 1.0 - odd
    return odd


def obstacle(x, y, z, edges, first, last):
    """Nearest point of a simple polygon (rows first..last-1), upright without end in 3-D.

    Distance (m) is positive outside; the normal points away from the polygon, also from within.
    """
    # One shill agent at the nearest point of the whole polygon. One for each edge would make a
    # round tree of 16 edges push eight times as hard as a tree of two.
    best = 1e30
    px = 0.0
    py = 0.0
    for e in range(first, last):
        ax = edges[e][0]
        ay = edges[e][1]
        tx = edges[e][2] - ax
        ty = edges[e][3] - ay
        s = min(max(((x - ax) * tx + (y - ay) * ty) / (tx * tx + ty * ty), 0.0), 1.0)
        qx = x - ax - s * tx
        qy = y - ay - s * ty
        if qx * qx + qy * qy < best:
            best = qx * qx + qy * qy
            px = qx
            py = qy
    k = 1.0 - 2.0 * inner(x, y, edges, first, last)
    far = math.sqrt(best + 1e-12)
    return Surface(k * far, k * px / far, k * py / far, 0.0 * z)


def prism(x, y, z, edges, first, last):
    """Find the nearest point of a prism with ends in height: row `last` holds the lowest and the highest height, m."""
    beside = obstacle(x, y, z, edges, first, last)
    low = edges[last][0]
    high = edges[last][1]
    above = max(low - z, z - high)
    up = 1.0 if z + z > low + high else -1.0
    if (beside.distance > 0.0) & (above > 0.0):
        d = math.sqrt(beside.distance * beside.distance + above * above + 1e-12)
        k = beside.distance / d
        return Surface(d, k * beside.nx, k * beside.ny, up * above / d)
    if beside.distance >= above:
        return beside
    return Surface(above, 0.0, 0.0, up)


def hidden(x, y, qx, qy, edges, corners):
    """1.0 if an edge of the arena lies between a position and the point q, else 0.0.

    Looked at is the way to a thousandth before q, so that the edges which meet in q hide nothing.
    """
    ux = 0.999 * (qx - x)
    uy = 0.999 * (qy - y)
    # Only edges of the arena hide an edge; obstacles do not, so that a square with obstacles flies
    # as it always did.
    for e in range(corners):
        ax = edges[e][0] - x
        ay = edges[e][1] - y
        bx = edges[e][2] - x
        by = edges[e][3] - y
        tx = bx - ax
        ty = by - ay
        here = ty * ax - tx * ay
        there = here + tx * uy - ty * ux
        if (((ux * ay - uy * ax) > 0.0) != ((ux * by - uy * bx) > 0.0)) & ((here > 0.0) != (there > 0.0)):
            return 1.0
    return 0.0


def wall(x, y, z, edges, e, corners, look):
    """Shill agent of edge e of an arena: it stands at the point of the edge that is closest to the position.

    It acts on positions on the inner side of the edge that can see this point; for others, and
    beyond `look` (m), the distance is 1e30. The normal is that of the edge; at a re-entrant corner,
    which is nearest from many sides, it is the direction from the corner. Where both edges of such
    a corner are nearest there, one of them acts.
    """
    before = corners - 1 if e == 0 else e - 1
    after = 0 if e == corners - 1 else e + 1
    ax = edges[e][0]
    ay = edges[e][1]
    tx = edges[e][2] - ax
    ty = edges[e][3] - ay
    px = x - ax
    py = y - ay
    square = tx * tx + ty * ty
    along = (px * tx + py * ty) / square
    s = min(max(along, 0.0), 1.0)
    qx = px - s * tx
    qy = py - s * ty
    d = math.sqrt(qx * qx + qy * qy + 1e-12)
    if (tx * py - ty * px <= 0.0) | (d >= look):
        return Surface(1e30, 0.0, 0.0, 0.0 * z)
    length = math.sqrt(square)
    nx = -ty / length
    ny = tx / length
    if along <= 0.0 and (ax - edges[before][0]) * ty - (ay - edges[before][1]) * tx < 0.0:
        nx = qx / d
        ny = qy / d
    if along >= 1.0:
        ux = edges[after][2] - edges[after][0]
        uy = edges[after][3] - edges[after][1]
        if tx * uy - ty * ux < 0.0:
            if (ux * qy - uy * qx > 0.0) & (ux * qx + uy * qy <= 0.0):
                return Surface(1e30, 0.0, 0.0, 0.0 * z)  # the next edge has its shill agent there as well
            nx = qx / d
            ny = qy / d
    if hidden(x, y, ax + s * tx, ay + s * ty, edges, corners) > 0.5:
        return Surface(1e30, 0.0, 0.0, 0.0 * z)
    return Surface(d, nx, ny, 0.0 * z)


def outside(x, y, z, edges, corners):
    """For a position outside the arena: the nearest point of its edges, with a negative distance, m; inside 1e30.

    The normal points to where flying is allowed.
    """
    if inner(x, y, edges, 0, corners) > 0.5:
        return Surface(1e30, 0.0, 0.0, 0.0 * z)
    s = obstacle(x, y, z, edges, 0, corners)
    return Surface(-s.distance, -s.nx, -s.ny, 0.0 * z)


def ray_to_prism(x, y, z, ux, uy, uz, edges, first, last):
    """Distance (m) along a unit vector to the sides or an end of a prism (as `prism` reads it); 1e30 if missed."""
    low = edges[last][0]
    high = edges[last][1]
    best = 1e30
    for e in range(first, last):
        t = ray_to_segment(x, y, ux, uy, edges[e][0], edges[e][1], edges[e][2], edges[e][3])
        height = z + t * uz
        if (t < best) & (height >= low) & (height <= high):
            best = t
    up = 1.0 if uz > 0.0 else -1.0
    end = low if uz > 0.0 else high  # the end that a ray in this direction can come in by
    t = (end - z) * up / (abs(uz) + 1e-12)
    if (t >= 0.0) & (t < best) and inner(x + t * ux, y + t * uy, edges, first, last) > 0.5:
        best = t
    return best
