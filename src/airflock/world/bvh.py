"""A scene as a flat tree of bounding boxes: which shapes are near, what a cast meets, and what is nearest.

nodes : rows x0 y0 z0 x1 y1 z1 (m) in the order of a walk that visits a node before what it holds
links : rows skip, first, last: the node to go on with when this one is not met, and the shapes of a
        leaf (first = last where it holds nodes)
No stack is needed: a node that is met is followed by the next row, one that is not by `skip`.
"""

import math

from airflock.core import FAR, TINY
from airflock.world.arena import Surface
from airflock.world.casts import entry, inverse, to_shape
from airflock.world.shapes import GROUND, from_shape


def beside(x, y, z, boxes, i):
    """Squared distance (m²) from a position to box i (rows x0 y0 z0 x1 y1 z1 ...); 0 within."""
    dx = max(max(boxes[i][0] - x, x - boxes[i][3]), 0.0)
    dy = max(max(boxes[i][1] - y, y - boxes[i][4]), 0.0)
    dz = max(max(boxes[i][2] - z, z - boxes[i][5]), 0.0)
    return dx * dx + dy * dy + dz * dz


def gather(x, y, z, sight, shapes, nodes, links, near):
    """Numbers of all shapes whose bounds are within sight (m) of a position, written to `near`.

    Returns how many; -1 if `near` is too short for them.
    """
    n = 0
    i = 0
    # The tree lies in depth-first order with the number of the next node to visit where a box is
    # missed, so that no stack is needed: kernels on a GPU have none.
    while i < len(nodes):
        if beside(x, y, z, nodes, i) <= sight * sight:
            for k in range(links[i][1], links[i][2]):
                if beside(x, y, z, shapes, k) <= sight * sight:
                    if n >= len(near):
                        return -1
                    near[n] = k
                    n += 1
            i += 1
        else:
            i = links[i][0]
    return n


def cast_near(x, y, z, ux, uy, uz, length, radius, shapes, near, n):
    """Distance (m, at most length) that a sphere goes along a unit vector before it meets one of n gathered shapes."""
    best = length
    ix = inverse(ux)
    iy = inverse(uy)
    iz = inverse(uz)
    for j in range(n):
        k = near[j]
        t = entry(x, y, z, ix, iy, iz, shapes, k, radius)
        if t < best:
            best = min(best, to_shape(x, y, z, ux, uy, uz, shapes, k, t, best, radius))
    return best


def cast(x, y, z, ux, uy, uz, length, radius, shapes, nodes, links):
    """Cast against all shapes, through the tree."""
    best = length
    ix = inverse(ux)
    iy = inverse(uy)
    iz = inverse(uz)
    i = 0
    # `best` shrinks with each hit, so later boxes are skipped by the same test that skips those out
    # of the way.
    while i < len(nodes):
        if entry(x, y, z, ix, iy, iz, nodes, i, radius) < best:
            for k in range(links[i][1], links[i][2]):
                t = entry(x, y, z, ix, iy, iz, shapes, k, radius)
                if t < best:
                    best = min(best, to_shape(x, y, z, ux, uy, uz, shapes, k, t, best, radius))
            i += 1
        else:
            i = links[i][0]
    return best


def nearest(x, y, z, reach, shapes, nodes, links):
    """Distance (m) and unit vector away from the nearest shape within reach (m); FAR if there is none."""
    return nearest_of(x, y, z, reach, 2.0, shapes, nodes, links)


def nearest_of(x, y, z, reach, ground, shapes, nodes, links):
    """Find the nearest surface of the shapes on the ground (0.0), the ground alone (1.0), or all (2.0)."""
    found = Surface(FAR, 0.0, 0.0, 1.0)
    best = reach
    i = 0
    while i < len(nodes):
        bound = max(best, 0.0)
        if beside(x, y, z, nodes, i) <= bound * bound:
            for k in range(links[i][1], links[i][2]):
                meant = (ground > 1.5) | ((shapes[k][6] == GROUND) == (ground > 0.5))
                if meant & (beside(x, y, z, shapes, k) <= bound * bound):
                    s = from_shape(x, y, z, shapes, k)
                    if s.distance < best:
                        best = s.distance
                        found = s
            i += 1
        else:
            i = links[i][0]
    return found


def touches(ax, ay, az, bx, by, bz, radius, shapes, nodes, links):
    """1.0 if a sphere of this radius (m) touches a shape on its straight way from a to b or at b, else 0.0."""
    if nearest(bx, by, bz, radius, shapes, nodes, links).distance < radius:
        return 1.0
    dx = bx - ax
    dy = by - ay
    dz = bz - az
    length = math.sqrt(dx * dx + dy * dy + dz * dz + TINY)
    k = 1.0 / length
    return 1.0 if cast(ax, ay, az, k * dx, k * dy, k * dz, length, radius, shapes, nodes, links) < length else 0.0
