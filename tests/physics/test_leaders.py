"""Informed individuals of Couzin et al. 2005, by what must hold whatever the engine."""

import math

import numpy as np
import pytest

from airflock.engine import fly_world
from airflock.parts.laws.couzin_2005 import Parameters, neighbour
from airflock.scenarios.files import load

PRESET = "couzin_2005/informed"


def flown(seed, start=None, **keys):
    settings = {name.replace("__", "."): value for name, value in keys.items()}
    scenario = load(PRESET, {"duration": 20.0, **settings})
    return fly_world(scenario, seed, record=True, start=start, device="python").frames


@pytest.mark.parametrize("direction", [0.0, 1.0, -2.5])
def test_who_is_informed_and_alone_turns_at_its_rate_to_where_it_wants_to_go(direction):
    """From 1.5 rad off at 0.2 rad/s, social memory being the own heading alone: within 20 s it is there."""
    off = direction + 1.5
    start = np.array([[0.0], [0.0], [math.cos(off)], [math.sin(off)]])
    keys = {"agents": 1, "groups": [], "model__omega": 5.0, "model__direction": direction, "model__sigma": 0.0}
    frames = flown(1, start, body__turn=0.2, **keys)
    heading = np.unwrap(np.arctan2(frames[:, 3, 0], frames[:, 2, 0])) - direction
    assert heading[-1] == pytest.approx(0.0, abs=1e-6)
    turning = np.abs(np.diff(heading))[np.abs(heading[1:]) > 0.2]
    np.testing.assert_allclose(turning, 0.2 * 0.2, atol=1e-9)


def test_two_who_lead_apart_and_follow_nobody_else_go_between():
    """Side by side, out of each other's alpha, they prefer directions 1 rad apart: the mean is in the middle."""
    groups = [
        {"name": "left", "agents": [1], "model": {"direction": 0.5, "omega": 0.3}},
        {"name": "right", "agents": [0], "model": {"direction": -0.5, "omega": 0.3}},
    ]
    start = np.array([[0.0, 0.0], [-1.5, 1.5], [1.0, 1.0], [0.0, 0.0]])
    frames = flown(1, start, agents=2, groups=groups, model__sigma=0.0, duration=4.0)
    angle = np.arctan2(frames[:, 3], frames[:, 2])
    np.testing.assert_allclose(angle[:, 0], -angle[:, 1], atol=1e-9)


def test_a_flock_with_informed_goes_where_they_want_and_one_without_does_not():
    """Of ten, five that know the way; without them the same starts go anywhere."""

    def directions(informed):
        groups = [{"name": "informed", "agents": informed, "model": {"omega": 0.5}}, {"name": "others"}]
        found = []
        for seed in range(8):
            x = flown(seed, agents=10, groups=groups if informed else [], start__radius=2.0, duration=60.0)[:, :2]
            way = x[-1].mean(axis=1) - x[len(x) // 2].mean(axis=1)
            found.append(way / np.linalg.norm(way))
        return np.array(found).mean(axis=0)

    led, free = directions(5), directions(0)
    assert led[0] > 0.9 and abs(led[1]) < 0.4
    assert np.linalg.norm(free) < 0.8  # eight random directions: beyond it one time in 170


def test_zones_share_the_distances_among_them():
    p = Parameters(alpha=1.0, rho=6.0)
    for r in (0.5, 0.999, 1.0, 3.0, 6.0, 6.001):
        sums = neighbour(0.6 * r, 0.8 * r, 0.0, r, 0.0, 1.0, 0.0, p)
        assert sums.close == (1.0 if r < 1.0 else 0.0)
        assert math.hypot(sums.rx, sums.ry) == pytest.approx(sums.close)
        assert math.hypot(sums.ax, sums.ay) == pytest.approx(1.0 if 1.0 <= r <= 6.0 else 0.0) == abs(sums.oy)
