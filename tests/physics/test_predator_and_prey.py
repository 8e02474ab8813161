"""Prey and predators of Chen and Kolokolnikov 2014, by what must hold whatever the engine."""

import numpy as np
import pytest

from airflock.engine import fly_world
from airflock.scenarios.files import load


def hunted(prey, v_hunt, place, **numbers):
    """Where prey are from the predator after ten seconds, (axis, agent), m: they start around it, it at a place."""
    groups = [
        {"name": "prey", "agents": prey},
        {"name": "predator", "agents": 1, "model": {"role": "predator", "v_hunt": v_hunt}},
    ]
    settings = {"duration": 10.0, "metrics.period": 10.0, "dt": 0.02, "agents": prey + 1, "groups": groups}
    turn, start = 2.0 * np.pi * np.arange(prey) / prey, np.zeros((4, prey + 1))
    start[:2, :prey], start[0, prey] = 0.7 * np.array([np.cos(turn), np.sin(turn)]), place
    scenario = load("chen_2014/hunt", {**settings, **numbers})
    x = fly_world(scenario, 1, record=True, start=start, device="python").frames[-1, :2]
    return x[:, :-1] - x[:, -1:]


@pytest.mark.parametrize(("flee", "attract"), [(0.0, 1.0), (0.2, 1.0), (0.5, 0.8)])
def test_prey_rest_in_a_ring_of_the_size_that_theory_gives(flee, attract):
    """Where all rest, places times velocities sum to zero: the mean square radius is ((1 - 1/N)/2 k_rep + b) / a."""
    away = hunted(12, 0.4, 0.0, **{"model.k_flee": flee, "model.k_att": attract})
    radius = np.linalg.norm(away, axis=0)
    assert (radius**2).mean() == pytest.approx((0.5 * (1.0 - 1.0 / 12.0) + flee) / attract, rel=1e-5)


def test_a_predator_that_does_not_hunt_is_left_alone():
    away = hunted(9, 0.0, -0.5)
    assert np.linalg.norm(away, axis=0).min() > 1.0  # the swarm has fled
    assert away.var(axis=1).sum() == pytest.approx(0.5 * (1.0 - 1.0 / 9.0), rel=0.1)  # as one: its size as if alone


def test_a_strong_predator_keeps_up_with_prey_that_leave_a_weak_one_behind():
    weak, strong = (np.linalg.norm(hunted(9, v, -0.9).mean(axis=1)) for v in (0.1, 2.0))
    assert weak > 1.2 > 0.9 > strong
