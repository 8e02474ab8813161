"""Two agents never come nearer than a flight believes that they may have: positions and velocities drawn at random."""

from types import SimpleNamespace

import numpy as np
import pytest

import airflock
from inside import stages_approach as approach


def flock_of(x, v):
    return SimpleNamespace(position=x, velocity=v)


@pytest.mark.parametrize("dimensions", (2, 3))
def test_no_pair_comes_nearer_than_is_counted(dimensions, seed):
    """In single precision, also far from the origin, where each step is rounded."""
    plan, draw, dt, n = SimpleNamespace(dimensions=dimensions), np.random.default_rng(seed), np.float32(0.01), 12
    for far, drift, beside in ((100.0, 4.0, 1.0), (3e4, 30.0, 0.05), (1e5, 300.0, 0.0), (0.0, 0.0, 5.0)):
        x = (draw.normal(size=(dimensions, n)) * 20.0 + far).astype(np.float32)
        v = (draw.normal(size=(dimensions, n)) * beside + drift).astype(np.float32)
        held = np.zeros(approach.HELD_SIZE, np.float32)
        approach.start_drift(held, flock_of(x, v), n, plan=plan)
        first, counted = apart(x), np.float32(0.0)
        for _ in range(300):
            v = (v + draw.normal(size=v.shape) * 0.02 * beside).astype(np.float32)
            flock = flock_of(x, v)
            squares = [
                sum(approach.velocity_beside_drift(i, a, held, flock) ** 2 for a in range(dimensions)) for i in range(n)
            ]
            x = x + v * dt
            counted = np.float32(counted + approach.approach_bound(held, max(squares), dt))
            assert (first - apart(x)).max() <= counted + approach.SLACK


def apart(x):
    """Distances of all pairs, in double precision."""
    d = x.astype(float)[:, :, None] - x.astype(float)[:, None, :]
    return np.sqrt((d * d).sum(axis=0))


@pytest.mark.parametrize(("preset", "settings"), (
    ("vasarhelyi_2018/4ms", {"faults": [{"kind": "motor", "at": 0.0, "agents": [1]}]}),
    ("zapotecatl_2016/best", {}),
    ("vasarhelyi_2018/4ms", {"world.edges": "bounce"}),
))  # fmt: skip
def test_a_flight_that_counts_no_collisions_flies_as_one_that_does(preset, settings):
    """Also where only some agents are asked, and where agents move in turn: it wants to know nobody's speed."""
    settings = {"agents": 5, "duration": 1.0, **settings}
    found = [airflock.load(preset, settings, metrics=metrics) for metrics in (None, ["speed"])]
    counted, other = (airflock.simulate(one, 3, device="python") for one in found)
    np.testing.assert_array_equal(counted["position"], other["position"])


def test_a_flock_that_flies_past_without_a_change_of_shape_comes_no_nearer():
    plan = SimpleNamespace(dimensions=2)
    flock = flock_of(np.zeros((2, 5)), np.full((2, 5), 20.0))
    held = np.zeros(approach.HELD_SIZE)
    approach.start_drift(held, flock, 5, plan=plan)
    assert all(approach.velocity_beside_drift(i, a, held, flock) == 0.0 for i in range(5) for a in range(2))
    assert approach.approach_bound(held, 0.0, 0.01) < 1e-6


def test_the_least_distance_is_that_of_all_pairs(seed):
    draw = np.random.default_rng(seed)
    plan = SimpleNamespace(dimensions=3, periodic=False)
    for n in (1, 2, 31, 33, 70):
        x = draw.normal(size=(3, n)) * 10.0
        found = approach.nearest(range(n), flock_of(x, None), SimpleNamespace(w=None), n, n, plan=plan)
        others = apart(x) + np.diag(np.full(n, np.inf))
        assert found == (pytest.approx(others.min(), rel=1e-9) if n > 1 else approach.FAR**0.5)
