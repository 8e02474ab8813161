"""Our casts and distances against trimesh and embree on the same triangles: 100,000 rays."""

import numpy as np
import pytest

from airflock.world import bvh
from airflock.world.scenes.scene_builder import box_rows, cylinder_rows, make_scene, triangle_rows
from kernels import compiled
from needed import needed

trimesh = needed("trimesh")
needed("embreex")

RAYS = 100_000
LENGTH = 400.0  # m
FACE = 42.5  # m, longest edge of the scenery: the diagonal of a box of 30 m
LOOP = """
@njit(**JIT | CALLED)
def run(origins, directions, length, shapes, nodes, links):
    found = np.zeros(len(origins), origins.dtype)
    for i in range(len(origins)):
        x, y, z = origins[i]
        u, v, w = directions[i]
        found[i] = RULE(x, y, z, u, v, w, length, real(0.0), shapes, nodes, links)
    return found
"""


def scenery(seed, bits):
    """Terrain of boxes, a sphere, a torus and loose triangles, with corners that single precision can hold."""
    rng = np.random.default_rng(seed)
    parts = [
        trimesh.creation.box(extents=rng.uniform(3.0, 30.0, 3)).apply_translation(rng.uniform(-100.0, 100.0, 3))
        for _ in range(40)
    ]
    parts += [trimesh.creation.icosphere(subdivisions=3, radius=15.0), trimesh.creation.torus(60.0, 5.0)]
    mesh = trimesh.util.concatenate(parts)
    real = np.float32 if bits == 32 else np.float64
    return trimesh.Trimesh(mesh.vertices.astype(np.float32).astype(float), mesh.faces, process=False), real


def rays(rng, real):
    origins = rng.uniform(-120.0, 120.0, (RAYS, 3)).astype(np.float32)
    directions = rng.normal(size=(RAYS, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return origins.astype(real), directions.astype(real)


def exact_hits(mesh, origins, directions, faces):
    """Distance along each ray to the plane of a given face, in double precision, and how far inside its edges, m."""
    corners = mesh.triangles[faces]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    t = np.einsum("ij,ij->i", a - origins, normal) / np.einsum("ij,ij->i", directions, normal)
    return t


def edge_distance(mesh, points, faces):
    """Distance (m) of points from the nearest edge of given faces."""
    corners = mesh.triangles[faces]
    least = np.full(len(points), np.inf)
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        along = b - a
        s = np.clip(np.einsum("ij,ij->i", points - a, along) / np.einsum("ij,ij->i", along, along), 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(points - a - s[:, None] * along, axis=1))
    return least


@pytest.mark.parametrize(("bits", "relative"), [(32, 1e-4), (64, 1e-9)])
def test_rays_hit_what_embree_hits(bits, relative):
    mesh, real = scenery(1, bits)
    found = make_scene([triangle_rows(mesh.triangles)])
    origins, directions = rays(np.random.default_rng(2), real)
    ours = compiled(bvh.cast, bits, LOOP)(
        origins, directions, real(LENGTH), found.shapes.astype(real), found.nodes.astype(real), found.links
    )
    wide, aimed = origins.astype(float), directions.astype(float)
    faces = mesh.ray.intersects_first(wide, aimed)
    hit, met = faces >= 0, ours < LENGTH
    both = hit & met
    theirs = exact_hits(mesh, wide[both], aimed[both], faces[both])
    # A start just before a face: what is left is a difference of coordinates across the face, at most FACE m long.
    rounding = 4.0 * np.finfo(real).eps * FACE
    wrong = np.abs(ours[both] - theirs) > relative * theirs + rounding
    # disagreement is allowed within 1e-4 m of an edge only, on the face that embree or we have hit
    doubtful = np.flatnonzero(hit != met)
    doubtful = np.concatenate([doubtful, np.flatnonzero(both)[wrong]])
    edges = 0
    for i in doubtful:
        close = False
        for t, face in ((ours[i], None), (None, faces[i])):
            if face is not None and face >= 0:
                t = exact_hits(mesh, wide[i : i + 1], aimed[i : i + 1], np.array([face]))[0]
            if t is not None and t < LENGTH:
                point = wide[i] + t * aimed[i]
                near = mesh.triangles_tree.intersection([*(point - 1e-3), *(point + 1e-3)])
                near = np.fromiter(near, int)
                close |= bool(len(near)) and bool(
                    (edge_distance(mesh, np.tile(point, (len(near), 1)), near) < 1e-4).any()
                )
        edges += close
        assert close, (i, ours[i], faces[i])
    assert both.sum() > RAYS // 10
    assert edges < 20


def test_distances_are_those_of_trimesh():
    mesh, _ = scenery(3, 64)
    found = make_scene([triangle_rows(mesh.triangles)])
    points = np.random.default_rng(4).uniform(-120.0, 120.0, (2000, 3))
    nearest = compiled(bvh.nearest)
    ours = np.array([nearest(*p, 1e6, found.shapes, found.nodes, found.links)[0] for p in points])
    _, theirs, _ = trimesh.proximity.closest_point(mesh, points)
    assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-6)


def test_boxes_and_cylinders_are_their_own_meshes():
    """A box cast exactly is a box cast as triangles; a cylinder nearly one of many sides."""
    rng = np.random.default_rng(5)
    low = rng.uniform(-100.0, 80.0, (30, 3))
    high = low + rng.uniform(2.0, 20.0, (30, 3))
    solids = [trimesh.creation.box(bounds=pair) for pair in zip(low, high, strict=True)]
    upright = np.column_stack([rng.uniform(-100.0, 100.0, (30, 2)), rng.uniform(1.0, 5.0, 30), low[:, 2], high[:, 2]])
    for x, y, radius, z0, z1 in upright:
        tube = trimesh.creation.cylinder(radius=radius, height=z1 - z0, sections=512)
        solids.append(tube.apply_translation([x, y, 0.5 * (z0 + z1)]))
    mesh = trimesh.util.concatenate(solids)
    exact = make_scene([box_rows(np.hstack([low, high])), cylinder_rows(upright)])
    tiled = make_scene([triangle_rows(mesh.triangles)])
    origins, directions = rays(rng, np.float64)
    outside = np.array([bvh.nearest(*p, 1e6, *exact.as_lists).distance > 0.1 for p in origins[:3000].tolist()])
    origins, directions = origins[:3000][outside], directions[:3000][outside]
    cast = compiled(bvh.cast, 64, LOOP)
    a, b = (cast(origins, directions, LENGTH, s.shapes, s.nodes, s.links) for s in (exact, tiled))
    near = np.abs(a - b) < 0.05
    grazing = 3e-3  # share of rays that pass a cylinder within the flatness of 512 sides
    assert near.mean() > 1.0 - grazing
    assert (a < LENGTH).mean() > 0.05
