"""Flights in scenes are the same as plain Python and compiled: casts, nearest points, goals; and displays."""

from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from airflock.displays import fly_show, shape_points
from airflock.displays.show_control import assign_points
from airflock.displays.shows import display_scenario, recording_of, waiting_points
from airflock.engine import plan_of
from airflock.recordings.dataset import check_recording
from airflock.recordings.flown_scenario import scenario_of_recording as of_recording
from airflock.recordings.simulation import simulate
from airflock.scenarios.files import load
from inside import cpu, tables
from reference.flight import fly_plainly

CITY = {
    "agents": 3, "duration": 1.2, "model.rays": 60, "model.r_ray": 12.0, "start.side": 40.0, "start.clearance": 0.5,
    "scene.block": 8.0, "scene.street": 7.0, "scene.blocks": 6, "scene.later": 0.3, "scene.later_until": 0.8,
    "goals.count": 3, "goals.apart": 20.0, "goals.clearance": 1.0, "goals.radius": 15.0, "goals.speed": 80.0,
    "goals.role": "herd", "goals.spread": 8.0, "metrics.r_body": 1.2, "metrics.r_coll": 4.0, "model.s_goal": -0.25,
}  # fmt: skip


def same(found, seed, start=None, absence=False):
    plan = plan_of(found, precision=64, record=True, given_start=start is not None, absence=absence)
    plain, compiled = fly_plainly(found, seed, start), cpu.fly_on_cpu(plan, tables(found, plan, seed), start)
    assert plain.status == compiled.status == 0
    np.testing.assert_allclose(compiled.frames, plain.frames, rtol=0.0, atol=1e-8)
    assert set(compiled.values) - set(plain.values) == ({"present"} if absence else set())
    for name, value in plain.values.items():
        assert compiled.values[name] == pytest.approx(value, rel=1e-8, abs=1e-8, nan_ok=True), name
    return plain.values


def test_boids_a_shepherd_and_buildings_that_appear(seed):
    values = same(load("kidger/city", CITY), seed)
    assert values["n_avoid"] > 0.0 and values["n_env_coll"] > 0.0  # spheres wider than those that were cast


def test_each_flight_has_a_city_of_its_own_and_its_recording_knows_it(seed):
    found = load("kidger/city", {**CITY, "scene.draw": "flight", "duration": 0.4})
    first, second = (found.with_drawn_scene(number) for number in (seed, seed + 1))
    assert first.stands().shapes.shape == second.stands().shapes.shape  # as many buildings, of other heights
    assert not np.array_equal(first.stands().shapes, second.stands().shapes)
    assert not np.allclose(first.waypoints(), second.waypoints())
    values = same(found, seed)
    assert repr(values) == repr(same(first, seed))
    recorded = of_recording(simulate(found, seed, precision=64))
    assert recorded.scene == first.scene
    np.testing.assert_array_equal(recorded.stands().shapes, first.stands().shapes)


def test_a_display_among_drones_that_hover(seed):
    """Own goals on their way, and the nearest points of boxes; flown as a show is: from a start, some may be absent."""
    points = shape_points("O", 8)
    hulls = tuple((*(hull - 0.35), *(hull + 0.35), 0.0) for hull in points[6:] + (0.4, 0.3, -2.0))
    keys = {"goals.points": points[:6].tolist(), "duration": 8.0, "scene.boxes": hulls, "agents": 6}
    start = np.zeros((6, 6))
    start[:3] = waiting_points(6, height=20.0).T
    values = same(display_scenario(6, keys), seed, start, absence=True)
    assert values["n_env_coll"] == values["n_coll"] == 0.0


@pytest.mark.parametrize("failure", ["fall", "hover"])
def test_a_show_forms_its_shapes_without_collisions_while_drones_fail(failure, seed):
    shapes = [shape_points(text, 30, seed=number) for number, text in enumerate("AO")]
    for points in shapes:
        assert pdist(points).min() == pytest.approx(3.0)
    show = fly_show(shapes, 30, 0.2, failure, seed)
    assert [formed.drones for formed in show.shape_reports] == [27, 24]
    assert all(formed.worst <= 1.0 and formed.collisions == formed.hulls == 0 for formed in show.shape_reports)
    assert np.isfinite(show.frames[-1]).all(axis=0).sum() == 24
    check_recording(recording_of(show))


def test_an_assignment_is_the_best_of_all_and_its_ways_keep_apart(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.0, 9.0, (6, 3)), rng.uniform(0.0, 9.0, (6, 3))
    found = assign_points(a, b, np.zeros(6, bool))
    least = min(((a - b[list(order)]) ** 2).sum() for order in permutations(range(6)))
    assert ((a - b[found]) ** 2).sum() == pytest.approx(least)
    a, b = (np.array([waiting_points(16)[k] + rng.uniform(-0.4, 0.4, 3) for k in range(16)]) for _ in range(2))
    b = b[rng.permutation(16)] + (30.0, 5.0, 12.0)
    ends, apart = b[assign_points(a, b, np.zeros(16, bool))], min(pdist(a).min(), pdist(b).min())
    assert min(pdist(a + s * (ends - a)).min() for s in np.linspace(0.0, 1.0, 101)) >= apart / 2**0.5 - 1e-9
