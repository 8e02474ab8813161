"""Models that steer or turn fly the same as plain Python and compiled: bodies, edges, rays, noise, order of updates."""

import numpy as np
import pytest

from airflock.engine import fly_world
from airflock.scenarios.files import load
from reference.flight import fly_plainly

FLIGHTS = {
    "boids in turn": ("zapotecatl_2016/best", {
        "agents": 9, "dt": 0.02, "duration": 3.0, "metrics.kind": "groups", "metrics.r_cluster": 0.3, "world.side": 1.2,
        "world.height": 0.9, "start.radius": 0.4, "model.fov_a_deg": 200.0, "start.speed": 0.2,
    }),
    "printed": ("zapotecatl_2016/literal", {"agents": 7, "duration": 20.0}),
    "counted by the program": ("zapotecatl_2016/best", {
        "agents": 9, "dt": 0.02, "duration": 2.0, "metrics.count": "program", "metrics.r_b": 0.3, "start.radius": 0.4,
    }),
    "vicsek": ("vicsek_1995/ordered", {"agents": 12, "world.side": 3.0, "duration": 30.0, "model.eta": 1.0}),
    "couzin": ("couzin_2002/torus", {"agents": 9, "duration": 6.0, "start.radius": 3.0}),
}  # fmt: skip


@pytest.mark.parametrize("name", FLIGHTS)
def test_plain_python_is_the_compiled_flight(name, seed):
    preset, settings = FLIGHTS[name]
    found = load(preset, settings)
    plain, compiled = fly_plainly(found, seed), fly_world(found, seed, precision=64, record=True)
    assert np.abs(np.diff(plain.frames, axis=0)).max() > 1e-3  # something happens
    np.testing.assert_allclose(compiled.frames, plain.frames, rtol=0.0, atol=1e-8)
    assert compiled.values == pytest.approx(plain.values, rel=1e-7, abs=1e-7)
