"""Polygonal arenas, obstacles and prisms: distances against shapely, walls against lines of sight, flights in an L."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from shapely.geometry import LineString, Point, Polygon

from airflock.scenarios.flight_world import FlightWorld as Seen
from airflock.support.errors import ScenarioError
from airflock.view.scene import prism_solid as drawn_prism
from airflock.world import arena, polygon
from airflock.world.shapes import from_triangle
from airflock.world.world_map import WorldMap, edge_rows
from flocks import from_start, ideal, interpreted, scenario

L = [[-60.0, 0.0], [0.0, 0.0], [0.0, -60.0], [30.0, -60.0], [30.0, 30.0], [-60.0, 30.0]]  # its notch is at the origin
POND = [[-30.0, 10.0], [-22.0, 12.0], [-26.0, 15.0], [-24.0, 20.0], [-33.0, 18.0]]  # concave
angles = st.floats(0.0, 2.0 * math.pi)
sites = st.tuples(st.floats(-70.0, 70.0), st.floats(-70.0, 70.0))


@st.composite
def polygons(draw):
    """A simple polygon around the origin, mostly concave: each corner in a direction of its own."""
    n = draw(st.integers(3, 9))
    far = draw(st.lists(st.floats(5.0, 50.0), min_size=n, max_size=n))
    return [(r * math.cos(2.0 * math.pi * k / n), r * math.sin(2.0 * math.pi * k / n)) for k, r in enumerate(far)]


def rows(corners):
    return edge_rows(arena.Parameters(arena="polygon", corners=tuple(map(tuple, corners))))[0]


@given(polygons(), sites)
@settings(max_examples=200)
def test_distances_to_polygons_are_those_of_shapely(corners, at):
    shape, point, edges = Polygon(corners), Point(at), rows(corners)
    assume(shape.exterior.distance(point) > 1e-3)
    inside = shape.contains(point)
    assert polygon.inner(*at, edges, 0, len(edges)) == float(inside)
    s = polygon.obstacle(*at, 0.0, edges, 0, len(edges))
    assert s.distance == pytest.approx((-1.0 if inside else 1.0) * shape.exterior.distance(point), abs=1e-9)
    foot = Point(at[0] - s.distance * s.nx, at[1] - s.distance * s.ny)
    assert shape.exterior.distance(foot) < 1e-8


@given(sites)
def test_an_arena_with_a_hole_is_a_polygon_with_a_hole(at):
    place = WorldMap(
        arena.Parameters(arena="polygon", corners=tuple(map(tuple, L)), obstacles=(tuple(map(tuple, POND)),))
    )
    field, point = Polygon(L, [POND]), Point(at)
    signed = (-1.0 if field.contains(point) else 1.0) * field.boundary.distance(point)
    assert place.excursion(*at, 0.0) == pytest.approx(signed, abs=1e-5)


@given(polygons(), sites)
@settings(max_examples=200)
def test_an_edge_acts_on_those_on_its_inner_side_that_see_its_closest_point(corners, at):
    edges, shape = rows(corners), Polygon(corners)
    n, point = len(edges), Point(at)
    acting = [polygon.wall(*at, 0.0, edges, e, n, 1e9) for e in range(n)]
    for e, (ax, ay, bx, by) in enumerate(edges):
        line = LineString([(ax, ay), (bx, by)])
        side = ((bx - ax) * (at[1] - ay) - (by - ay) * (at[0] - ax)) / line.length
        nearest = line.interpolate(line.project(point))
        way = LineString([at, (at[0] + 0.999 * (nearest.x - at[0]), at[1] + 0.999 * (nearest.y - at[1]))])
        crossed = way.intersects(shape.exterior)
        assume(abs(side) > 1e-3 and way.length > 0.1)
        assume(crossed or way.distance(shape.exterior) > 1e-7)  # nothing is grazed
        s = acting[e]
        if side < 0.0:
            assert s.distance == 1e30
        elif s.distance < 1e30:
            assert not crossed
            assert s.distance == pytest.approx(line.distance(point), abs=1e-6)
            assert s.nx * (at[0] - nearest.x) + s.ny * (at[1] - nearest.y) > 0.0
        elif not crossed:  # the next edge stands at their common corner instead
            following = acting[(e + 1) % n]
            assert (nearest.x, nearest.y) == pytest.approx((bx, by), abs=1e-6)
            assert following.distance == pytest.approx(line.distance(point), abs=1e-6)


@given(polygons(), sites)
def test_whoever_is_outside_is_called_back_to_the_nearest_point(corners, at):
    edges, shape = rows(corners), Polygon(corners)
    assume(shape.exterior.distance(Point(at)) > 1e-3)
    s = polygon.outside(*at, 0.0, edges, len(edges))
    if shape.contains(Point(at)):
        assert s.distance == 1e30
    else:
        assert s.distance == pytest.approx(-shape.distance(Point(at)), abs=1e-9)
        back = Point(at[0] - s.distance * s.nx, at[1] - s.distance * s.ny)
        assert shape.distance(back) < 1e-8


def test_the_normal_at_a_reentrant_corner_is_the_direction_from_it_and_turns_steadily():
    place = WorldMap(arena.Parameters(arena="polygon", corners=tuple(map(tuple, L))), look=5.0)
    before = None
    for turn in np.linspace(0.99 * math.pi, -0.49 * math.pi, 400):  # from one edge of the notch to the other
        at = 3.0 * math.cos(turn), 3.0 * math.sin(turn)
        (s,) = place.surfaces(*at, 0.0)  # one shill agent all the way round
        beside = np.array([s.distance, s.nx, s.ny])
        if 0.0 < turn < 0.5 * math.pi:
            assert beside == pytest.approx([3.0, at[0] / 3.0, at[1] / 3.0], abs=1e-6)
        if before is not None:
            assert np.abs(beside - before).max() < 0.05
        before = beside


def divided(corners, parts):
    """The same outline with corners on its straight sides, `parts` pieces each."""
    ends = zip(corners, [*corners[1:], corners[0]], strict=True)
    return [[a[c] + (b[c] - a[c]) * k / parts for c in (0, 1)] for a, b in ends for k in range(parts)]


@pytest.mark.parametrize("begin", [0, 1, 2])
def test_a_straight_side_is_one_side_however_it_is_divided(begin, seed):
    """It was felt once for each of its pieces: a square of 80 pieces slowed a flock of 3.6 m/s to 3.0 m/s."""
    whole, pieces = (arena.Parameters(arena="polygon", corners=tuple(map(tuple, each))) for each in (L, divided(L, 3)))
    turned = replace(pieces, corners=pieces.corners[begin:] + pieces.corners[:begin])
    assert {tuple(row) for row in edge_rows(turned)[0]} == {tuple(row) for row in edge_rows(whole)[0]}
    one, many = (
        interpreted(
            ideal(world__arena="polygon", world__corners=corners, agents=4, duration=12.0, start__separation=4.0), seed
        ).frames
        for corners in (L, divided(L, 3))
    )
    assert np.array_equal(one, many)


def test_a_corner_that_hardly_turns_is_a_corner():
    bent = [[-60.0, 0.0], [0.0, 1e-4], [60.0, 0.0], [0.0, 80.0]]
    assert len(rows(bent)) == 4


def test_in_one_arm_of_an_l_the_edges_of_the_other_are_not_felt(seed):
    """However long the other arm is, not a bit changes of a flight in this one."""
    rng = np.random.default_rng(seed)
    flock = [(x, 15.0 + rng.uniform(-9.0, 9.0), *rng.normal(0.0, 1.0, 2)) for x in (-50.0, -41.0, -30.0)]
    keys = {"world__arena": "polygon", "duration": 12.0, "agents": 3, "model__v_flock": 1.0, "model__r0_shill": 5.0}
    flights = []
    for end in (-60.0, -35.0):
        corners = [[x, end if y == -60.0 else y] for x, y in L]
        flights.append(from_start(ideal(world__corners=corners, **keys), *flock).frames)
    assert flights[0][:, 0].max() < 0.0 and np.abs(np.diff(flights[0], axis=0)).max() > 0.01
    assert np.array_equal(*flights)
    narrow = [[x, 24.0 if y == 30.0 else y] for x, y in L]  # of this arm they are
    assert not np.array_equal(from_start(ideal(world__corners=narrow, **keys), *flock).frames, flights[0])


def test_a_flock_stays_in_an_l_with_a_pond(seed):
    found = scenario(
        agents=5, duration=40.0, world__arena="polygon", world__corners=L, world__obstacles=[POND],
        start__separation=4.0, model__v_flock=4.0, sensors__noise=0.0, body__noise=0.0, dt=0.05,
    )  # fmt: skip
    frames = interpreted(found, seed).frames
    field = Polygon(L, [POND])
    assert max(field.distance(Point(*frame[:2, i])) for frame in frames[::5] for i in range(5)) < 2.5


@given(sites, st.floats(-30.0, 40.0))
@settings(max_examples=60)
def test_distances_to_a_prism_are_those_to_its_faces(at, z):
    world = arena.Parameters(dimensions="3", obstacles=(tuple(map(tuple, POND)),), heights=((-5.0, 12.0),))
    edges, _, ((first, last),) = edge_rows(world)
    s = polygon.prism(*at, z, edges, first, last)
    solid = drawn_prism("", np.array(POND), -5.0, 12.0, (0, 0, 0))
    faces = solid.vertices[solid.faces].astype(float).tolist()
    faces += [[[x, y, -5.0] for x, y, _ in f] for f in faces if all(corner[2] == 12.0 for corner in f)]
    nearest = min(from_triangle(*at, z, *a, *b, *c).distance for a, b, c in faces)
    inside = Polygon(POND).contains(Point(at)) and -5.0 < z < 12.0
    assert s.distance == pytest.approx((-1.0 if inside else 1.0) * nearest, abs=1e-4)


@given(sites, st.floats(-30.0, 40.0), angles, st.floats(-1.0, 1.0))
@settings(max_examples=100)
def test_rays_end_where_a_prism_begins(at, z, turn, up):
    world = arena.Parameters(dimensions="3", obstacles=(tuple(map(tuple, POND)),), heights=((-5.0, 12.0),))
    edges, _, ((first, last),) = edge_rows(world)
    flat = math.sqrt(1.0 - up * up)
    u = flat * math.cos(turn), flat * math.sin(turn), up
    start = polygon.prism(*at, z, edges, first, last).distance
    assume(start > 1e-2)
    went, gap = 0.0, start
    while went < 200.0 and gap > 1e-6:  # a sphere of the free distance is always free
        went += gap
        gap = polygon.prism(*(p + went * d for p, d in zip((*at, z), u, strict=True)), edges, first, last).distance
    free = polygon.ray_to_prism(*at, z, *u, edges, first, last)
    if went < 200.0:
        assert free == pytest.approx(went, abs=1e-2)
    else:
        assert free == 1e30 or free > 199.0


def test_a_geofence_in_height_holds(seed):
    found = scenario(
        agents=4, duration=30.0, world__dimensions="3", world__side=60.0, world__floor=12.0, world__ceiling=60.0,
        start__separation=4.0, sensors__noise=0.0, body__noise=0.0, start__speed=3.0, dt=0.05,
    )  # fmt: skip
    heights = interpreted(found, seed).frames[:, 2]
    assert heights.min() > 10.0 and heights.max() < 62.0 and heights.max() - heights.min() > 1.0
    place = WorldMap(found.world)
    assert place.excursion(0.0, 0.0, 8.0) == pytest.approx(4.0)
    assert place.excursion(0.0, 0.0, 36.0) == pytest.approx(-24.0)
    assert place.ray(0.0, 0.0, 20.0, 0.0, 0.0, -1.0, 99.0) == pytest.approx(8.0)
    same = replace(found.world, floor=None, ceiling=None, height=48.0)
    assert WorldMap(same).excursion(3.0, 40.0, -30.0) == WorldMap(found.world).excursion(3.0, 40.0, 6.0)


def test_a_law_that_casts_sees_a_prism_between_its_heights():
    found = scenario("kidger", world__dimensions="3", world__obstacles=[POND], world__heights=[[-5.0, 12.0]], agents=1)
    edges, _, ((first, last),) = edge_rows(found.world)
    place = Seen(found)
    for turn in np.linspace(0.0, 6.0, 25):
        u = -math.cos(turn), -math.sin(turn), 0.0
        at = -26.0 - 20.0 * u[0], 14.0 - 20.0 * u[1]
        for z in (3.0, 14.0):
            seen = place.cast(*at, z, *u, 60.0, 0.0)
            assert seen == pytest.approx(min(60.0, polygon.ray_to_prism(*at, z, *u, edges, first, last)), abs=1e-6)


def test_nobody_starts_nearer_than_the_wall_clearance(seed):
    near, solids = [], [Polygon(L).exterior, Polygon(POND)]
    for room in (0.0, 4.0, 9.0):
        found = scenario(
            agents=60, duration=0.1, dt=0.1, world__arena="polygon", world__corners=L, world__obstacles=[POND],
            start__wall_clearance=room, start__separation=0.0,
        )  # fmt: skip
        spots = [Point(spot) for spot in interpreted(found, seed).frames[0, :2].T]
        near.append(min(solid.distance(spot) for spot in spots for solid in solids))
        assert near[-1] >= room * (1.0 - 1e-12) and all(map(Polygon(L, [POND]).contains, spots))
        assert all(WorldMap(found.world).excursion(*spot.coords[0], 0.0) <= -room for spot in spots)
    assert near[0] < 4.0 and near[1] < 9.0  # who is not asked for room comes nearer


def test_a_wall_clearance_that_leaves_no_place_is_refused():
    with pytest.raises(ScenarioError, match="start.wall_clearance = 25 m: no place is left"):
        scenario(agents=2, world__arena="polygon", world__corners=L, start__wall_clearance=25.0)
