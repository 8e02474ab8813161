"""Flocks of wings fly the same as plain Python and compiled, whichever way the gradient is found."""

import numpy as np
import pytest

from airflock.engine import fly_world
from airflock.scenarios.files import load
from reference.flight import fly_plainly

SMALL = {
    "agents": 3,
    "duration": 1.5,
    "wing.segments": "5",
    "wing.tolerance": 1e-12,
    "start.jitter": 0.05,
    "metrics.t_settle": 0.5,
}
FLIGHTS = {
    "paper": ("dimock_2003/published", SMALL),
    "sound": ("dimock_2003/physical", SMALL | {"start.spacing_z": 0.1, "body.kind": "jostled", "body.noise": 0.01}),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_plain_python_is_the_compiled_flight(name, seed):
    preset, settings = FLIGHTS[name]
    found = load(preset, settings)
    plain, compiled = fly_plainly(found, seed), fly_world(found, seed, precision=64, record=True)
    assert np.abs(np.diff(plain.frames, axis=0)).max() > 1e-2  # something happens
    np.testing.assert_allclose(compiled.frames, plain.frames, rtol=0.0, atol=1e-7)
    assert compiled.values == pytest.approx(plain.values, rel=1e-8, abs=1e-9, nan_ok=True)


def test_a_collision_ends_both_alike(seed):
    found = load("dimock_2003/published", SMALL | {"metrics.r_coll": 2.2, "duration": 3.0})
    plain, compiled = fly_plainly(found, seed), fly_world(found, seed, precision=64, record=True)
    assert plain.values["n_coll"] >= 1.0
    assert 1 < len(plain.frames) < 31
    assert compiled.frames.shape == plain.frames.shape
    assert compiled.values == pytest.approx(plain.values, rel=1e-8, abs=1e-9, nan_ok=True)
