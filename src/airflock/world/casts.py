"""Casts: how far a thin ray, or a sphere, travels from a position along a unit vector before it meets a shape.

A ray meets a solid from within at 0. A sphere that already touches a shape meets it at 0 if it
comes nearer, and not at all if it moves away; otherwise nothing that once came too near could leave
again. FAR means that nothing is met.
"""

import math

from airflock.core import FAR, TINY
from airflock.world.shapes import BOX, CYLINDER, GROUND, SPHERE, TRIANGLE, from_edged_shape, from_shape

SKIN = 1e-4  # m; a sphere as near as this has met a shape: below what positions resolve in single precision
STEPS = 32  # of the search for the point of contact; each at least doubles the digits, except where a sphere grazes


def inverse(u):
    """1 / u for a component of a direction, bounded where u is nearly 0."""
    return 1.0 / (u if abs(u) > 1e-9 else (1e-9 if u >= 0.0 else -1e-9))


def entry(x, y, z, ix, iy, iz, boxes, i, radius):
    """Distance (m) at which a ray enters box i (rows x0 y0 z0 x1 y1 z1 ...) grown by a radius (m); FAR if it does not.

    It is 0 within. ix, iy, iz : inverse components of its unit direction
    """
    ax = (boxes[i][0] - radius - x) * ix
    bx = (boxes[i][3] + radius - x) * ix
    ay = (boxes[i][1] - radius - y) * iy
    by = (boxes[i][4] + radius - y) * iy
    az = (boxes[i][2] - radius - z) * iz
    bz = (boxes[i][5] + radius - z) * iz
    # Slabs (Kay & Kajiya 1986): the ray is in the box where it is between all three pairs of faces.
    near = max(min(ax, bx), max(min(ay, by), min(az, bz)))
    far = min(max(ax, bx), min(max(ay, by), max(az, bz)))
    return max(near, 0.0) if (near <= far) & (far >= 0.0) else FAR


def ray_to_cylinder(x, y, z, ux, uy, uz, cx, cy, radius, z0, z1):
    """Distance (m) along a ray to an upright solid cylinder: where it is inside the round wall and between the caps."""
    rx = x - cx
    ry = y - cy
    a = ux * ux + uy * uy + TINY
    b = rx * ux + ry * uy
    across = rx * uy - ry * ux  # a times the squared distance of closest approach; no cancellation far away
    root = a * radius * radius - across * across
    if root < 0.0:
        return FAR
    s = math.sqrt(root + TINY)
    iz = inverse(uz)
    near = max((-b - s) / a, min((z0 - z) * iz, (z1 - z) * iz))
    far = min((-b + s) / a, max((z0 - z) * iz, (z1 - z) * iz))
    return max(near, 0.0) if (near <= far) & (far >= 0.0) else FAR


def ray_to_segment(x, y, ux, uy, ax, ay, bx, by):
    """Distance (m) along a ray to an upright wall over a segment of the ground plan."""
    px = ax - x
    py = ay - y
    tx = bx - ax
    ty = by - ay
    cross = ux * ty - uy * tx
    side = 1.0 if cross > 0.0 else -1.0
    bound = abs(cross) + TINY
    # Numerators are compared with the denominator before any division, which would be by 0 for a
    # ray along the wall.
    t = (px * ty - py * tx) * side
    s = (px * uy - py * ux) * side
    return t / bound if (t >= 0.0) & (s >= 0.0) & (s <= bound) else FAR


def ray_to_triangle(x, y, z, ux, uy, uz, ax, ay, az, bx, by, bz, cx, cy, cz):
    """Distance (m) along a ray to a triangle, from either side (Möller and Trumbore 1997)."""
    px = ax - x
    py = ay - y
    pz = az - z
    ex = bx - ax
    ey = by - ay
    ez = bz - az
    fx = cx - ax
    fy = cy - ay
    fz = cz - az
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    d = ux * nx + uy * ny + uz * nz
    side = 1.0 if d > 0.0 else -1.0
    bound = abs(d) + 1e-30
    t = (px * nx + py * ny + pz * nz) * side
    wx = uy * pz - uz * py
    wy = uz * px - ux * pz
    wz = ux * py - uy * px
    s = -(wx * fx + wy * fy + wz * fz) * side
    r = (wx * ex + wy * ey + wz * ez) * side
    slack = -1e-6 * bound  # neighbouring triangles overlap by their rounding, so that no ray slips between them
    return t / bound if (t >= 0.0) & (s >= slack) & (r >= slack) & (s + r <= bound - slack) else FAR


def ray_to_sphere(x, y, z, ux, uy, uz, cx, cy, cz, radius):
    """Distance (m) along a ray to a solid sphere."""
    px = cx - x
    py = cy - y
    pz = cz - z
    along = px * ux + py * uy + pz * uz
    # Across the ray from the centre, by the cross product: no cancellation far away.
    ax = py * uz - pz * uy
    ay = pz * ux - px * uz
    az = px * uy - py * ux
    root = radius * radius - (ax * ax + ay * ay + az * az)
    if root < 0.0:
        return FAR
    half = math.sqrt(root + TINY)
    return max(along - half, 0.0) if along + half >= 0.0 else FAR


def ray_to_edged_shape(x, y, z, ux, uy, uz, shapes, k, start):
    """Distance (m) along a ray to row k of the shapes, which is no sphere; start is where it enters the bounds."""
    kind = shapes[k][6]
    if (kind == BOX) | (kind == GROUND):
        return start
    if kind == CYLINDER:
        return ray_to_cylinder(
            x, y, z, ux, uy, uz, shapes[k][7], shapes[k][8], shapes[k][9], shapes[k][2], shapes[k][5]
        )
    if kind == TRIANGLE:
        return ray_to_triangle(
            x, y, z, ux, uy, uz, shapes[k][7], shapes[k][8], shapes[k][9], shapes[k][10], shapes[k][11], shapes[k][12],
            shapes[k][13], shapes[k][14], shapes[k][15],
        )  # fmt: skip
    return ray_to_segment(x, y, ux, uy, shapes[k][7], shapes[k][8], shapes[k][9], shapes[k][10])


def ray_to_shape(x, y, z, ux, uy, uz, shapes, k, start):
    """Distance (m) along a ray to row k of the shapes, also to a sphere; start is where it enters the bounds."""
    if shapes[k][6] == SPHERE:
        return ray_to_sphere(x, y, z, ux, uy, uz, shapes[k][7], shapes[k][8], shapes[k][9], shapes[k][10])
    return ray_to_edged_shape(x, y, z, ux, uy, uz, shapes, k, start)


# Rules of all shapes → those without spheres, which drivers have where no sphere stands: a test more
# for each shape that is looked at would cost every flight in a city.
WITHOUT_SPHERES = {from_shape: from_edged_shape, ray_to_shape: ray_to_edged_shape}


def sphere_to_shape(x, y, z, ux, uy, uz, shapes, k, start, best, radius):
    """Distance (m) that a sphere of this radius (m) travels to row k of the shapes, if shorter than best, else FAR.

    The distance along the way is convex, so Newton's steps from outside approach the contact from
    before and never pass it; start is any distance before it.
    """
    t = start
    for _ in range(STEPS):
        s = from_shape(x + t * ux, y + t * uy, z + t * uz, shapes, k)
        gap = s.distance - radius
        slope = ux * s.nx + uy * s.ny + uz * s.nz
        # Convex along the way: a distance that grows never shrinks again.
        if slope >= 0.0:
            return FAR
        if gap <= SKIN:
            return t
        t -= gap / slope
        if t >= best:
            return FAR
    return t


def to_shape(x, y, z, ux, uy, uz, shapes, k, start, best, radius):
    """Distance (m) that a sphere (or a ray, with radius 0) travels to row k of the shapes."""
    if radius > 0.0:
        return sphere_to_shape(x, y, z, ux, uy, uz, shapes, k, start, best, radius)
    return ray_to_shape(x, y, z, ux, uy, uz, shapes, k, start)
