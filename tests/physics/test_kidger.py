"""The oracles, schemes and rays of the thesis: closed forms, caps, coverings, and flights among obstacles."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial import SphericalVoronoi

import airflock
from airflock.core.maths import norm
from airflock.core.vocabulary import Own, Percept
from airflock.engine import score_flights
from airflock.parts.laws import kidger
from airflock.parts.metric_sets import kidger as fitness_kidger
from airflock.world import goals
from needed import needed

EMPTY = kidger.Tally(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
QUIET = kidger.Sums(*[0.0] * 11)
component = st.floats(-60.0, 60.0, allow_subnormal=False)
suggestions = st.lists(st.tuples(component, component, component, st.floats(0.0, 2.0)), min_size=1, max_size=6)


class Walled(Percept):
    """A wall at x = distance without end, seen by spheres; the goal is behind it."""

    distance = 5.0

    def cast(self, ux, uy, uz, length, radius):
        free = (self.distance - radius) / ux if ux > 1e-9 else length
        return min(length, max(free, 0.0))


def directions(p, heading=(0.0, 0.0, 1.0)):
    return np.array([kidger.ray_direction(float(k), *heading, p) for k in range(int(p.rays))])


@pytest.mark.parametrize("n", [100, 1000])
def test_fibonacci_sphere_covers_nearly_as_well_as_can_be(n):
    """No n points cover a sphere with smaller caps than the circumradius of 2n - 4 equal triangles (Fejes Tóth)."""
    points = directions(kidger.Parameters(rays=n))
    corners = SphericalVoronoi(points / np.linalg.norm(points, axis=1)[:, None]).vertices
    covering = np.arccos(np.clip((corners @ points.T).max(axis=1), -1.0, 1.0)).max()
    bound = math.acos(1.0 / (math.sqrt(3.0) * math.tan(n * math.pi / (6.0 * (n - 2)))))
    assert bound <= covering <= 1.25 * bound


@pytest.mark.parametrize("heading", [(0.0, 0.0, 1.0), (0.6, -0.64, 0.48), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)])
def test_rays_leave_the_heading_by_ever_greater_angles(heading):
    found = directions(kidger.Parameters(rays=300), heading) @ np.array(heading)
    assert (np.diff(found) < 0.0).all()
    point = directions(kidger.Parameters(rays=300, first="point"), heading)
    assert point[0] == pytest.approx(heading, abs=1e-6)  # the thesis: its first point lies on the movement
    assert np.linalg.norm(point, axis=1) == pytest.approx(1.0, abs=1e-6)


def test_a_fan_alternates_left_and_right():
    found = directions(kidger.Parameters(rays=8, fan="plane"), (1.0, 0.0, 0.0))
    turns = np.arctan2(found[:, 1], found[:, 0])
    assert turns[:6] == pytest.approx([-math.pi / 4, math.pi / 4, -math.pi / 2, math.pi / 2, -2.3561945, 2.3561945])


@given(suggestions)
@settings(max_examples=200, deadline=None)
def test_capped_summation_never_passes_the_cap_and_cuts_only_the_last(found):
    p = kidger.Parameters(speed=60.0)
    tally, plain = EMPTY, np.zeros(3)
    for x, y, z, scale in found:
        before = tally
        tally = kidger.take(tally, x, y, z, scale, p)
        assert norm(tally.x, tally.y, tally.z) <= 60.0 * (1.0 + 1e-6)
        if before.full > 0.5:
            assert tally[:3] == before[:3]
        elif norm(x, y, z) >= 1e-5 and scale > 0.0:
            plain = plain + scale * np.array([x, y, z])
            if tally.full < 0.5:
                assert tally[:3] == pytest.approx(plain, abs=1e-6)


def test_each_scheme_combines_as_it_says():
    wishes = [((60.0, 0.0, 0.0), 1.0), ((0.0, 40.0, 0.0), 0.25), ((0.0, 0.0, 20.0), 0.5), ((0.0, -10.0, 0.0), 1.0)]
    expected = {
        "1": (60.0, 0.0, 0.0),
        "2": (15.0, 7.5, 5.0),
        "3": (60.0 / 2.75, 0.0, 10.0 / 2.75),
        "4": (20.0, 10.0 / 3.0, 10.0 / 3.0),
        "5": (60.0, 0.0, 0.0),
    }
    for scheme, answer in expected.items():
        p, tally = kidger.Parameters(scheme=scheme), EMPTY
        for wish, scale in wishes:
            tally = kidger.take(tally, *wish, scale, p)
        assert kidger.movement(tally, p) == pytest.approx(answer, abs=1e-4), scheme


@pytest.mark.parametrize("scheme", ["1", "2", "3", "4", "5"])
def test_an_average_flies_into_the_wall_that_avoidance_saw(scheme):
    """Bug 1 of the thesis: flying at a wall with the goal behind it, an average still comes nearer."""
    p = kidger.Parameters(scheme=scheme)
    own, percept = Own(60.0, 0.0, 0.0, 1.0, 0.0, 0.0), Walled(0.0, 0.0, 0.0, 0.0, 100.0, 0.0, 0.0)
    x, y, z = kidger.decide(own, QUIET, percept, 1.0 / 60.0, p)
    nears = percept.cast(*(c / norm(x, y, z) for c in (x, y, z)), p.r_ray, 0.6) < p.r_ray
    assert nears == (scheme in ("2", "3", "4"))


def test_gravity_is_a_steady_sinking():
    p, own = kidger.Parameters(gravity=3.0, speed=12.0, s_prev=1.0), Own(6.0, 0.0, -3.0, 0.9, 0.0, -0.4)
    for _ in range(300):
        x, y, z = kidger.decide(own, QUIET, Percept(0.0, 0.0, 0.0, 0.0), 1.0 / 60.0, p)
        own = Own(x, y, z, 0.0, 0.0, 0.0)
    assert (x, y, z) == pytest.approx((12.0, 0.0, -3.0), abs=1e-3)


def test_a_turned_heading_turns_away_and_more_so_when_near():
    p, heading = kidger.Parameters(method="turn"), (1.0, 0.0, 0.0)
    angles = []
    for r in (9.0, 5.0, 1.0):
        x, y, z = kidger.turned_away(0.6 * r, 0.8 * r, 0.0, r, *heading, p)  # r m apart, and 1 m less on the surfaces
        assert y < 0.0 and norm(x, y, z) == pytest.approx(1.0, abs=1e-6)
        angles.append(math.acos(x))
    assert angles == sorted(angles) and angles[0] == pytest.approx(0.2 * 0.1 * math.pi**2, abs=1e-6)
    assert angles[-1] == pytest.approx(0.1 * math.pi**2, abs=1e-6)  # in contact


@pytest.mark.parametrize(("apart", "flown"), [(6.0, 60.0), (4.0, 60.0), (2.0, 15.0), (1.0, 0.0)])
def test_separation_as_printed_comes_before_all_else_from_four_metres_on(apart, flown):
    """A neighbour ahead pushes back at 0.25 of its distance per frame; what the cap leaves, cohesion pulls forwards."""
    p, own = kidger.Parameters(), Own(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    sums = kidger.neighbour(apart, 0.0, 0.0, apart, *[0.0] * 9, p)
    tally = kidger.others(EMPTY, own, sums, Percept(0.0, 0.0, 0.0, 0.0), p)
    assert kidger.movement(tally, p) == pytest.approx((-flown, 0.0, 0.0), abs=1e-3)
    even = kidger.Parameters(separation="normalised")  # cancels against cohesion at any distance
    sums = kidger.neighbour(apart, 0.0, 0.0, apart, *[0.0] * 9, even)
    assert kidger.movement(kidger.others(EMPTY, own, sums, Percept(0.0, 0.0, 0.0, 0.0), even), even) == pytest.approx(
        (0.0, 0.0, 0.0), abs=1e-3
    )


def test_a_shepherd_stands_behind_whom_it_drives():
    gone = goals.herd(0.0, 0.0, 0.0, 100.0, 0.0, 0.0, 50.0, 0.0, 0.0, 50.0, 10.0, 0.0, 40.0, 15.0, 20.0, 1e9)
    assert gone[:3] == pytest.approx((25.0, 0.0, 0.0))  # behind all: the farthest is 10 m from the centre
    gone = goals.herd(0.0, 0.0, 0.0, 100.0, 0.0, 0.0, 50.0, 0.0, 0.0, 50.0, 60.0, 0.0, 40.0, 15.0, 20.0, 1e9)
    assert gone[:3] == pytest.approx((50.0, 75.0, 0.0))  # a stray is gathered first
    assert goals.herd(0.0, 0.0, 0.0, 60.0, 0.0, 0.0, 50.0, *[0.0] * 5, 1.0, 1.0, 20.0, 1.0).reached == 1.0


def test_fitness_is_the_share_flocked_of_a_flight_without_faults_and_falls_with_each():
    sound = {"flocked": 0.8, "time_to_goal": [0.0, 0.0], "n_coll": 0.0, "phi_coll": 0.0, "n_env_coll": 0.0}
    assert fitness_kidger.fitness(sound, 10, 120.0)["fitness"] == pytest.approx(0.8)
    late, never = {"time_to_goal": [0.0, 30.0]}, {"time_to_goal": [0.0, math.nan]}
    for fault in (late, {"n_coll": 3.0}, {"phi_coll": 0.1}, {"n_env_coll": 1.0}, {"flocked": 0.7}):
        assert fitness_kidger.fitness(sound | fault, 10, 120.0)["fitness"] < 0.8
    assert fitness_kidger.fitness(sound | late, 10, 120.0)["f_goals"] == pytest.approx(0.875)
    assert fitness_kidger.fitness(sound | never, 10, 120.0)["f_goals"] == pytest.approx(0.5)
    twice = fitness_kidger.fitness(sound | {"n_coll": 60.0}, 10, 120.0)  # three per agent and minute
    assert twice["f_coll"] == pytest.approx(0.25)


def test_a_flock_that_fell_together_has_not_avoided_collisions():
    """It met once and never parted: 9 meetings of ten boids are fewer than anyone's who keeps a distance for long."""
    heap = {"flocked": 1.0, "n_coll": 9.0, "phi_coll": 1.0, "n_env_coll": 0.0}
    parted = {"flocked": 1.0, "n_coll": 90.0, "phi_coll": 0.001, "n_env_coll": 0.0}
    found = [fitness_kidger.fitness(values, 10, 60.0)["f_coll"] for values in (heap, parted)]
    assert found[0] < 0.01 * found[1]


def flights(name, seeds, **keys):
    found = airflock.load(f"kidger/{name}", {key.replace("__", "."): value for key, value in keys.items()})
    return score_flights([found] * seeds, list(range(seeds)), threads=1)


def mean(rows, name):
    return float(np.nanmean([row[name] for row in rows]))


def test_boids_stay_out_of_city_forest_and_mesh(tmp_path):
    trimesh = needed("trimesh")
    bodies = [trimesh.creation.icosphere(subdivisions=2, radius=14.0) for _ in range(5)]
    for number, body in enumerate(bodies):
        body.apply_translation([60.0 * math.cos(number * 1.2566), 60.0 * math.sin(number * 1.2566), 12.0])
    trimesh.util.concatenate(bodies).export(tmp_path / "balls.stl")
    mesh = {"scene__kind": "mesh", "scene__file": str(tmp_path / "balls.stl"), "goals__apart": 40.0, "goals__count": 5}
    for rows in (
        flights("city", 2, duration=20),
        flights("forest", 2, duration=20),
        flights("city", 2, duration=20, **mesh),
    ):
        assert mean(rows, "n_env_coll") == mean(rows, "n_coll") == mean(rows, "phi_coll") == 0.0
        assert all(row["n_avoid"] >= 5.0 and row["goals_reached"] >= 2.0 for row in rows)


@pytest.mark.papers  # a plan of its own takes 20 s to compile; tests/agreement flies it in plain Python too
def test_buildings_that_appear_meet_nobody():
    rows = flights("city", 2, duration=20, scene__later=0.6, scene__later_until=15.0)
    assert mean(rows, "n_env_coll") == 0.0 and mean(rows, "n_avoid") >= 5.0


def test_poor_flocks_less_collides_more_and_reaches_fewer_goals_than_final():
    poor, final, natural = (flights(name, 2, duration=60) for name in ("poor", "city", "natural"))
    assert mean(poor, "flocked") < 0.5 * mean(final, "flocked")
    assert mean(poor, "n_coll") > 100.0 and mean(final, "n_coll") == mean(natural, "n_coll") == 0.0
    assert mean(poor, "goals_reached") < 0.5 * mean(final, "goals_reached")
    assert mean(natural, "polarisation") > mean(final, "polarisation")
