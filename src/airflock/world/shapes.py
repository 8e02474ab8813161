"""Shapes of a scene as rows of numbers: boxes, cylinders, triangles, upright segments, spheres; distances to them.

A row has 18 columns: bounds x0 y0 z0 x1 y1 z1 (m), the kind, up to nine numbers of the kind, the
time (s) at which the shape appears, and 1.0 if it is part of a surface that closes around an
inside. Numbers of the kinds: box and ground (none: the bounds say all), cylinder (x, y, radius),
triangle (ax ay az bx by bz cx cy cz), segment (ax ay bx by): the ground plan of a wall without end
in height, sphere (x y z radius). Distances are exact: signed for the solids (negative within),
unsigned for triangles and segments. All shapes are convex, so a distance along a straight line is
convex too.
"""

import math

from airflock.core import TINY
from airflock.world.arena import Surface

BOX = 0.0
CYLINDER = 1.0
TRIANGLE = 2.0
SEGMENT = 3.0
SPHERE = 5.0
GROUND = 4.0  # a box that is the ground, so that it can be told from what stands on it
APPEARS = 16  # column of the time, s
CLOSED = 17  # column of 1.0 if the shape is part of a closed surface
COLUMNS = 18


def from_box(x, y, z, x0, y0, z0, x1, y1, z1):
    """Distance (m) from an upright box, and the unit vector away from its nearest point."""
    dx = max(x0 - x, x - x1)
    dy = max(y0 - y, y - y1)
    dz = max(z0 - z, z - z1)
    sx = 1.0 if x + x > x0 + x1 else -1.0
    sy = 1.0 if y + y > y0 + y1 else -1.0
    sz = 1.0 if z + z > z0 + z1 else -1.0
    outside = max(dx, max(dy, dz))
    if outside <= 0.0:
        if dx >= max(dy, dz):
            return Surface(dx, sx, 0.0, 0.0)
        if dy >= dz:
            return Surface(dy, 0.0, sy, 0.0)
        return Surface(dz, 0.0, 0.0, sz)
    px = max(dx, 0.0)
    py = max(dy, 0.0)
    pz = max(dz, 0.0)
    # scaled by the largest component, so that neither a great nor a tiny one leaves the numbers of
    # single precision
    qx = px / outside
    qy = py / outside
    qz = pz / outside
    d = math.sqrt(qx * qx + qy * qy + qz * qz)
    return Surface(d * outside, sx * qx / d, sy * qy / d, sz * qz / d)


def from_cylinder(x, y, z, cx, cy, radius, z0, z1):
    """Distance (m) from an upright solid cylinder, and the unit vector away from its nearest point."""
    rx = x - cx
    ry = y - cy
    rho = math.sqrt(rx * rx + ry * ry + TINY)
    nx = rx / rho
    ny = ry / rho
    dr = rho - radius
    dz = max(z0 - z, z - z1)
    sz = 1.0 if z + z > z0 + z1 else -1.0
    if (dr > 0.0) & (dz > 0.0):
        d = math.sqrt(dr * dr + dz * dz + TINY)
        return Surface(d, nx * dr / d, ny * dr / d, sz * dz / d)
    if dr >= dz:
        return Surface(dr, nx, ny, 0.0)
    return Surface(dz, 0.0, 0.0, sz)


def from_segment(x, y, ax, ay, bx, by):
    """Distance (m) in the ground plan from a segment, and the unit vector away from its nearest point."""
    tx = bx - ax
    ty = by - ay
    s = min(max(((x - ax) * tx + (y - ay) * ty) / (tx * tx + ty * ty + TINY), 0.0), 1.0)
    qx = x - ax - s * tx
    qy = y - ay - s * ty
    d = math.sqrt(qx * qx + qy * qy + TINY)
    return Surface(d, qx / d, qy / d, 0.0)


def share(part, whole):
    """Part / whole, 0 where there is no whole."""
    return part / whole if whole > 1e-20 else 0.0


def from_triangle(x, y, z, ax, ay, az, bx, by, bz, cx, cy, cz):
    """Distance (m) from a triangle, and the unit vector away from its nearest point.

    The nearest point is found by the signs of six projections (Ericson 2005, section 5.1.5).
    """
    ux = bx - ax
    uy = by - ay
    uz = bz - az
    vx = cx - ax
    vy = cy - ay
    vz = cz - az
    px = x - ax
    py = y - ay
    pz = z - az
    d1 = ux * px + uy * py + uz * pz
    d2 = vx * px + vy * py + vz * pz
    uu = ux * ux + uy * uy + uz * uz
    uv = ux * vx + uy * vy + uz * vz
    vv = vx * vx + vy * vy + vz * vz
    d3 = d1 - uu
    d4 = d2 - uv
    d5 = d1 - uv
    d6 = d2 - vv
    va = d3 * d6 - d5 * d4
    vb = d5 * d2 - d1 * d6
    vc = d1 * d4 - d3 * d2
    if (d1 <= 0.0) & (d2 <= 0.0):
        s = 0.0
        t = 0.0
    elif (d3 >= 0.0) & (d4 <= d3):
        s = 1.0
        t = 0.0
    elif (d6 >= 0.0) & (d5 <= d6):
        s = 0.0
        t = 1.0
    elif (vc <= 0.0) & (d1 >= 0.0) & (d3 <= 0.0):
        s = share(d1, d1 - d3)
        t = 0.0
    elif (vb <= 0.0) & (d2 >= 0.0) & (d6 <= 0.0):
        s = 0.0
        t = share(d2, d2 - d6)
    elif (va <= 0.0) & (d4 >= d3) & (d5 >= d6):
        t = share(d4 - d3, (d4 - d3) + (d5 - d6))
        s = 1.0 - t
    else:
        s = share(vb, va + vb + vc)
        t = share(vc, va + vb + vc)
    qx = px - s * ux - t * vx
    qy = py - s * uy - t * vy
    qz = pz - s * uz - t * vz
    d = math.sqrt(qx * qx + qy * qy + qz * qz + TINY)
    return Surface(d, qx / d, qy / d, qz / d)


def from_sphere(x, y, z, cx, cy, cz, radius):
    """Distance (m) from a solid sphere, and the unit vector away from its centre; upwards at the centre itself."""
    dx = x - cx
    dy = y - cy
    dz = z - cz
    d = math.sqrt(dx * dx + dy * dy + dz * dz + TINY)
    if d < 2e-6:
        return Surface(-radius, 0.0, 0.0, 1.0)
    return Surface(d - radius, dx / d, dy / d, dz / d)


def from_edged_shape(x, y, z, shapes, k):
    """Distance (m) from row k of the shapes, which is no sphere, and the unit vector away from its nearest point."""
    kind = shapes[k][6]
    if (kind == BOX) | (kind == GROUND):
        return from_box(x, y, z, shapes[k][0], shapes[k][1], shapes[k][2], shapes[k][3], shapes[k][4], shapes[k][5])
    if kind == CYLINDER:
        return from_cylinder(x, y, z, shapes[k][7], shapes[k][8], shapes[k][9], shapes[k][2], shapes[k][5])
    if kind == TRIANGLE:
        return from_triangle(
            x, y, z, shapes[k][7], shapes[k][8], shapes[k][9], shapes[k][10], shapes[k][11], shapes[k][12],
            shapes[k][13], shapes[k][14], shapes[k][15],
        )  # fmt: skip
    return from_segment(x, y, shapes[k][7], shapes[k][8], shapes[k][9], shapes[k][10])


def from_shape(x, y, z, shapes, k):
    """Distance (m) from row k of the shapes, and the unit vector away from its nearest point; also of a sphere."""
    if shapes[k][6] == SPHERE:
        return from_sphere(x, y, z, shapes[k][7], shapes[k][8], shapes[k][9], shapes[k][10])
    return from_edged_shape(x, y, z, shapes, k)
