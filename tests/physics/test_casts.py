"""Casts and distances against closed forms, and what must hold for any shape."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from airflock.core.maths import FAR
from airflock.world import bvh, casts, shapes
from airflock.world.scenery import Parameters
from airflock.world.scenes.scene_builder import (
    box_rows,
    cylinder_rows,
    make_scene,
    scene_of,
    segment_rows,
    sphere_rows,
    triangle_rows,
)
from kernels import compiled

coordinate = st.floats(-20.0, 20.0, allow_subnormal=False)


RULES = {"cast": bvh.cast, "touches": bvh.touches, "nearest": bvh.nearest}
CALLS = {
    "cast": "RULE(x, y, z, u, v, w, real(20.0), number, shapes, nodes, links)",
    "touches": "RULE(x, y, z, u, v, w, number, shapes, nodes, links)",
    "nearest": "RULE(x, y, z, number, shapes, nodes, links)[0]",
}
LOOPS = {
    name: f"""
@njit(**JIT | CALLED)
def run(a, b, number, shapes, nodes, links):
    found = np.zeros(len(a), a.dtype)
    for i in range(len(a)):
        x, y, z = a[i]
        u, v, w = b[i]
        found[i] = {call}
    return found
"""
    for name, call in CALLS.items()
}


def unit(*v):
    return np.array(v) / np.linalg.norm(v)


def alone(rows, *ray, radius=0.0, length=100.0):
    return bvh.cast(*ray, length, radius, *make_scene([rows]).as_lists)


def mixed(seed=0, count=25):
    """A scene of all kinds."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(-40.0, 40.0, (count, 3))
    middle = rng.uniform(-40.0, 40.0, (count, 1, 3))
    tubes = np.column_stack([rng.uniform(-40.0, 40.0, (count, 2)), rng.uniform(0.3, 3.0, count), np.zeros(count)])
    ends = rng.uniform(-40.0, 40.0, (count // 4, 2))
    balls = np.hstack([rng.uniform(-40.0, 40.0, (count, 3)), rng.uniform(0.2, 5.0, (count, 1))])
    return make_scene([
        sphere_rows(balls),
        box_rows(np.hstack([low, low + rng.uniform(1.0, 8.0, (count, 3))])),
        cylinder_rows(np.column_stack([tubes, rng.uniform(2.0, 20.0, count)])),
        triangle_rows(middle + rng.uniform(-5.0, 5.0, (count, 3, 3))),
        segment_rows(np.hstack([ends, ends + rng.uniform(-6.0, 6.0, ends.shape)])),
    ])  # fmt: skip


def test_sphere_meets_face_edge_and_corner_of_a_box():
    cube = box_rows([0.0, 0.0, 0.0, 2.0, 2.0, 2.0])
    assert alone(cube, -5.0, 1.0, 1.0, 1.0, 0.0, 0.0, radius=0.5) == pytest.approx(4.5, abs=2e-4)
    # flying along x, 0.3 m beside the upright edge at x = 0, y = 2: contact where the distance to the edge is 0.5
    assert alone(cube, -5.0, 2.3, 1.0, 1.0, 0.0, 0.0, radius=0.5) == pytest.approx(5.0 - 0.4, abs=3e-4)
    # towards the corner along the diagonal of space
    far = 10.0
    start = -far * unit(1.0, 1.0, 1.0)
    assert alone(cube, *start, *unit(1.0, 1.0, 1.0), radius=0.5) == pytest.approx(far - 0.5, abs=3e-4)
    # just past the rounded edge: a box grown by the radius would stop it, the rounded one does not
    assert alone(cube, -5.0, 2.45, 2.45, 1.0, 0.0, 0.0, radius=0.5) == 100.0


def test_sphere_meets_a_cylinder_where_two_circles_touch():
    trunk = cylinder_rows([0.0, 0.0, 1.0, 0.0, 10.0])
    offset = 1.2
    assert alone(trunk, -8.0, offset, 5.0, 1.0, 0.0, 0.0, radius=0.5) == pytest.approx(
        8.0 - math.sqrt(1.5**2 - offset**2), abs=5e-4
    )
    assert alone(trunk, 0.0, 0.0, 20.0, 0.0, 0.0, -1.0, radius=0.5) == pytest.approx(9.5, abs=2e-4)
    assert alone(trunk, -8.0, 0.5, 5.0, 1.0, 0.0, 0.0) == pytest.approx(8.0 - math.sqrt(0.75), rel=1e-9)


def test_ray_and_sphere_meet_a_ball_where_the_chord_begins():
    ball = sphere_rows([1.0, 2.0, 3.0, 2.0])
    for radius in (0.0, 0.5):
        for offset in (0.0, 1.2, 1.99):
            chord = math.sqrt((2.0 + radius) ** 2 - offset**2)
            met = alone(ball, -9.0, 2.0 + offset, 3.0, 1.0, 0.0, 0.0, radius=radius)
            assert met == pytest.approx(10.0 - chord, abs=5e-4 if radius else 1e-9)
        assert alone(ball, -9.0, 4.01 + radius, 3.0, 1.0, 0.0, 0.0, radius=radius) == 100.0
    assert alone(ball, 1.0, 2.0, 3.5, *unit(1.0, 1.0, 0.0)) == 0.0  # from within
    assert alone(ball, 9.0, 2.0, 3.0, 1.0, 0.0, 0.0) == 100.0  # behind the ray


def test_distance_from_a_ball_is_that_from_its_centre_less_the_radius(seed):
    rng = np.random.default_rng(seed)
    rows = sphere_rows(np.hstack([rng.normal(0.0, 9.0, (50, 3)), rng.uniform(0.1, 6.0, (50, 1))]))
    for k, row in enumerate(rows):
        at = rng.normal(0.0, 9.0, 3)
        found = shapes.from_shape(*at, rows.tolist(), k)
        away = at - row[7:10]
        assert found.distance == pytest.approx(np.linalg.norm(away) - row[10], abs=1e-9)
        assert [found.nx, found.ny, found.nz] == pytest.approx(away / np.linalg.norm(away), abs=1e-9)
    centre = shapes.from_shape(*rows[0, 7:10], rows.tolist(), 0)
    assert centre.distance == pytest.approx(-rows[0, 10], abs=1e-5) and centre.nz == 1.0


def test_thin_triangle_stops_a_ray_and_a_sphere_from_both_sides():
    wall = triangle_rows([[[0.0, -5.0, -5.0], [0.0, 5.0, -5.0], [0.0, 0.0, 5.0]]])
    for side in (-1.0, 1.0):
        assert alone(wall, 3.0 * side, 0.0, -1.0, -side, 0.0, 0.0) == pytest.approx(3.0, rel=1e-12)
        assert alone(wall, 3.0 * side, 0.0, -1.0, -side, 0.0, 0.0, radius=0.5) == pytest.approx(2.5, abs=2e-4)


@given(coordinate, coordinate, coordinate, coordinate, coordinate, coordinate, st.floats(0.05, 1.0))
@settings(max_examples=300, deadline=None)
def test_a_sphere_touches_where_its_cast_ends_and_nowhere_before(x, y, z, a, b, c, radius):
    if a * a + b * b + c * c < 1e-3:
        return
    place = mixed()
    ux, uy, uz = unit(a, b, c)
    if bvh.nearest(x, y, z, 1e6, *place.as_lists).distance <= radius:
        return
    t = bvh.cast(x, y, z, ux, uy, uz, 60.0, radius, *place.as_lists)
    at = [
        bvh.nearest(x + s * ux, y + s * uy, z + s * uz, 1e6, *place.as_lists).distance for s in np.linspace(0.0, t, 40)
    ]
    assert min(at) > radius - 1e-6
    if t < 60.0:
        assert at[-1] < radius + 2.0 * casts.SKIN + 1e-9


@given(coordinate, coordinate, coordinate)
@settings(max_examples=200, deadline=None)
def test_the_unit_vector_of_a_distance_is_its_gradient(x, y, z):
    place, h = mixed(3, 8), 1e-6
    for k in range(len(place.shapes)):
        s = shapes.from_shape(x, y, z, place.as_lists[0], k)
        if s.distance < 0.01:
            continue
        slope = [
            (shapes.from_shape(*(np.array([x, y, z]) + h * e), place.as_lists[0], k).distance - s.distance) / h
            for e in np.eye(3)
        ]
        assert slope == pytest.approx([s.nx, s.ny, s.nz], abs=2e-3)


def test_gathered_shapes_answer_like_the_tree():
    place, rng = mixed(7, 60), np.random.default_rng(8)
    for _ in range(300):
        o, u = rng.uniform(-40.0, 40.0, 3), unit(*rng.normal(size=3))
        near = [0] * 300
        n = bvh.gather(*o, 20.6, *place.as_lists, near)
        for radius in (0.0, 0.6):
            fast = bvh.cast_near(*o, *u, 20.0, radius, place.as_lists[0], near, n)
            assert fast == bvh.cast(*o, *u, 20.0, radius, *place.as_lists)
    assert bvh.gather(0.0, 0.0, 0.0, 1e3, *place.as_lists, [0] * 5) == -1


def test_a_sphere_that_touches_may_leave_but_not_come_nearer():
    cube = box_rows([0.0, 0.0, 0.0, 2.0, 2.0, 2.0])
    for x in (-0.3, 0.2):  # overlapping from outside, and the centre inside
        assert alone(cube, x, 1.0, 1.0, -1.0, 0.0, 0.0, radius=0.5) == 100.0
        assert alone(cube, x, 1.0, 1.0, 1.0, 0.0, 0.0, radius=0.5) == 0.0


@pytest.mark.parametrize("bits", [32, 64])
def test_nothing_thin_is_crossed(bits):
    """10,000 random approaches to thin walls and corners at up to the length of a ray per frame."""
    rng = np.random.default_rng(9)
    real = np.float32 if bits == 32 else np.float64
    thin = [box_rows([-10.0, 0.0, 0.0, 10.0, 0.01, 20.0]), box_rows([0.0, 0.0, 0.0, 0.01, 10.0, 20.0])]
    thin += [triangle_rows([[[-10.0, -10.0, 0.0], [10.0, -10.0, 0.0], [0.0, -10.0, 20.0]]])]
    place = make_scene([*thin, segment_rows([[15.0, -10.0, 15.0, 10.0], [15.0, 10.0, 25.0, 10.0]])])
    arrays = place.shapes.astype(real), place.nodes.astype(real), place.links
    cast, touches, nearest = (compiled(rule, bits, LOOPS[name]) for name, rule in RULES.items())
    count, radius, length = 12_000, 0.6, 20.0
    o = rng.uniform((-12.0, -12.0, 0.0), (28.0, 12.0, 20.0), (count, 3)).astype(real)
    u = rng.normal(size=(count, 3))
    u = (u / np.linalg.norm(u, axis=1)[:, None]).astype(real)
    free = nearest(o, o, real(1e6), *arrays) > radius + 1e-4
    o, u = o[free][:10_000], u[free][:10_000]
    t = cast(o, u, real(radius), *arrays)
    assert len(o) == 10_000
    assert (t < length).sum() > 2000
    assert touches(o, (o + t[:, None] * u).astype(real), real(0.5), *arrays).sum() == 0.0


def test_nothing_stands_in_an_empty_scene():
    empty = make_scene([])
    assert bvh.cast(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 20.0, 0.6, *empty.as_lists) == 20.0
    assert bvh.nearest(0.0, 0.0, 0.0, 1e6, *empty.as_lists).distance == FAR


def test_city_and_forest_follow_their_numbers_and_seed():
    city = scene_of(Parameters(kind="city"), 3)
    assert len(city.shapes) == 101  # and the ground
    heights = city.shapes[city.shapes[:, 5] > 0.0][:, 5]
    assert 15.0 <= heights.min() < 20.0 and 55.0 < heights.max() <= 60.0
    assert bvh.nearest(0.0, 0.0, 1.0, 1e6, *city.as_lists).distance == pytest.approx(
        1.0
    )  # a crossing; the ground is nearest
    assert bvh.nearest(0.0, 0.0, 50.0, 8.0, *city.as_lists).distance == FAR
    forest = scene_of(Parameters(kind="forest"), 3)
    assert len(forest.shapes) == 801
    other = scene_of(Parameters(kind="forest", seed=1), 3)
    assert not np.array_equal(forest.shapes, other.shapes)
    assert len(scene_of(Parameters(kind="forest", density=0.5), 3).shapes) == 401
