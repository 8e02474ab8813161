"""Flights among what stands in a scene are the same as plain Python and compiled: casts, nearest points, goals."""

import numpy as np
import pytest

from airflock.engine.plain import fly_plainly
from airflock.scenarios.files import load
from flocks import IDEAL, flown, scenario

CITY = {
    "agents": 3, "duration": 1.2, "model.rays": 60, "model.r_ray": 12.0, "start.side": 40.0, "start.clearance": 0.5,
    "scene.block": 8.0, "scene.street": 7.0, "scene.blocks": 6, "scene.later": 0.3, "scene.later_until": 0.8,
    "goals.count": 3, "goals.apart": 20.0, "goals.clearance": 1.0, "goals.radius": 15.0, "goals.speed": 80.0,
    "goals.role": "herd", "goals.spread": 8.0, "metrics.r_body": 1.2, "metrics.r_coll": 4.0, "model.s_goal": -0.25,
}  # fmt: skip


def same(found, seed):
    plain, compiled = fly_plainly(found, seed), flown(found, seed)
    assert plain.status == compiled.status == 0
    np.testing.assert_allclose(compiled.frames, plain.frames, rtol=0.0, atol=1e-8)
    assert set(plain.values) == set(compiled.values)
    for name, value in plain.values.items():
        assert compiled.values[name] == pytest.approx(value, rel=1e-8, abs=1e-8, nan_ok=True), name
    return plain.values


def test_boids_a_shepherd_and_buildings_that_appear(seed):
    values = same(load("kidger/city", CITY), seed)
    assert values["n_avoid"] > 0.0 and values["n_env_coll"] > 0.0  # spheres wider than those that were cast


def test_a_flock_that_feels_the_nearest_points_of_a_forest(seed):
    settings = IDEAL | {
        "agents": 4, "duration": 8.0, "world.dimensions": "3", "world.side": 60.0, "world.height": 60.0,
        "scene.kind": "forest", "scene.side": 60.0, "scene.trees": 40, "start.kind": "box", "start.side": 30.0,
        "start.separation": 3.0, "metrics.kind": "kidger",
    }  # fmt: skip
    values = same(scenario(**{key.replace(".", "__"): value for key, value in settings.items()}), seed)
    assert values["n_env_coll"] == 0.0
