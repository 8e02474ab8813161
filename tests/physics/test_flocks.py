"""Whole flights without noise: what must be true of two agents, of walls, and of a turned world."""

import numpy as np
import pytest

from airflock.scenarios.files import load
from flocks import PENTAGON, SILENT, from_start, ideal, interpreted, scenario

OPEN = {"world__side": 1e4, "world__height": 1e4}


def distances(frames, dims=2):
    """Distance of the first two agents over time, m."""
    return np.linalg.norm(frames[:, :dims, 0] - frames[:, :dims, 1], axis=1)


def test_two_parallel_agents_part_until_they_are_r0_rep_apart():
    found = ideal(duration=120.0, **OPEN, model__c_frict=0.0)
    gap = distances(from_start(found, (0.0, -3.0, 0.5, 0.0), (0.0, 3.0, 0.5, 0.0)).frames)
    r0_rep = found.parameters.r0_rep
    assert gap[0] == 6.0
    assert gap[-1] >= r0_rep - 0.05
    assert gap[0] < gap[50] < gap[200]
    # with v_d always v_flock long they leave the range with some sideways speed, which then never ends
    first_out = int(np.argmax(gap >= r0_rep))
    assert (np.diff(gap)[:first_out] >= -1e-9).all()


def test_two_agents_out_of_each_others_range_fly_on():
    found = ideal(duration=5.0, **OPEN, radio__range=50.0)
    frames = from_start(found, (0.0, 0.0, 4.0, 0.0), (0.0, 60.0, 4.0, 0.0)).frames
    np.testing.assert_allclose(distances(frames), 60.0, rtol=1e-12)
    np.testing.assert_allclose(frames[:, 2], 4.0, rtol=1e-9)


def crowd(seed, n, dims, spread=30.0):
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(-2.0, 3.0)] * dims), -1).reshape(-1, dims)
    places = rng.permutation(grid)[:n] * spread / 2.0 + rng.uniform(-1.0, 1.0, (n, dims))
    return np.concatenate([places, rng.normal(0.0, 3.0, (n, dims))], axis=1)


def test_turning_the_world_by_90_degrees_turns_the_flight(seed):
    found, start = ideal(duration=30.0, world__side=100.0), crowd(seed, 8, 2)
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    turned = np.concatenate([start[:, :2] @ turn.T, start[:, 2:] @ turn.T], axis=1)
    here, there = from_start(found, *start).frames, from_start(found, *turned).frames
    for part in range(3):
        rows = slice(2 * part, 2 * part + 2)
        np.testing.assert_allclose(np.einsum("ab,tbn->tan", turn, here[:, rows]), there[:, rows], atol=1e-6)


def test_renumbering_the_agents_renumbers_the_flight(seed):
    found, start = ideal(duration=20.0, world__side=100.0), crowd(seed, 8, 2)
    order = np.random.default_rng(seed).permutation(8)
    here, there = from_start(found, *start).frames, from_start(found, *start[order]).frames
    np.testing.assert_allclose(here[:, :, order], there, atol=1e-7)


def test_a_flight_in_the_plane_of_space_is_the_flight_in_the_plane(seed):
    flat = crowd(seed, 7, 2)
    zero = np.zeros((7, 1))
    solid = np.concatenate([flat[:, :2], zero, flat[:, 2:], zero], axis=1)
    keys = {"duration": 20.0, "world__side": 100.0, "world__height": 1e4}
    two, three = from_start(ideal(2, **keys), *flat).frames, from_start(ideal(3, **keys), *solid).frames
    assert (three[:, [2, 5, 8]] == 0.0).all()
    np.testing.assert_allclose(three[:, [0, 1, 3, 4, 6, 7]], two, atol=1e-8)


@pytest.mark.parametrize(("speed", "duration"), [(4, 20.0), (8, 16.0), (16, 16.0)])
def test_the_nearest_wall_of_each_axis_is_enough_up_to_16_m_s(speed, duration, seed):
    """Table S1: the far walls of the square never act, so both readings of the walls agree to rounding."""
    name = f"vasarhelyi_2018/{speed}ms"
    flights = {}
    for walls in ("every_edge", "nearest_per_axis"):
        found = load(name, {"agents": 5, "duration": duration, "world.walls": walls})
        corner = 0.5 * found.world.side - 10.0
        start = crowd(seed, 5, 2).T + np.array([[corner], [0.8 * -corner], [1.0], [-1.0]])
        flights[walls] = interpreted(found, seed, start).frames
    every, nearest = flights.values()
    assert np.abs(np.diff(np.sign(every[:, 2]), axis=0)).sum() > 0.0  # somebody turned
    np.testing.assert_allclose(every, nearest, atol=1e-9)


WALLED = {"agents": 8, "duration": 120.0, "start__separation": 6.0} | {
    k.replace(".", "__"): v for k, v in SILENT.items()
}
# The law brakes for walls with a delay of tau = 1 s, so it overshoots: less than 1 m at 4 m/s, the margin here.
MARGIN = 1.0


def test_walls_of_a_square_hold(seed):
    found = ideal(duration=120.0, world__side=100.0)
    frames = from_start(found, *crowd(seed, 8, 2)).frames
    assert np.abs(frames[:, :2]).max() < 50.0 + MARGIN


def test_walls_of_a_box_hold(seed):
    found = ideal(3, duration=120.0, world__side=100.0, world__height=80.0)
    frames = from_start(found, *crowd(seed, 8, 3)).frames
    assert np.abs(frames[:, :2]).max() < 50.0 + MARGIN
    assert np.abs(frames[:, 2]).max() < 40.0 + MARGIN
    assert np.abs(frames[-1, 2]).max() > 1.0  # space is used


def test_the_wall_of_a_circle_holds(seed):
    frames = interpreted(scenario(**WALLED, world__arena="circle", world__radius=50.0, radio__delay=0.0), seed).frames
    assert np.hypot(frames[:, 0], frames[:, 1]).max() < 50.0 + MARGIN


def test_walls_of_a_polygon_hold(seed):
    found = scenario(**WALLED, world__arena="polygon", world__corners=PENTAGON)
    assert interpreted(found, seed).values["phi_wall"] < MARGIN


@pytest.mark.parametrize("dims", [2, 3])
def test_a_flock_without_noise_becomes_parallel(dims, seed):
    """In the open, alignment with no slack brings all velocities together."""
    keys = OPEN | {"model__v_frict": 0.0, "model__c_frict": 0.1, "radio__range": 1e6, "model__r0_frict": 500.0}
    flock = from_start(ideal(dims, duration=200.0, **keys), *crowd(seed, 8, dims))
    velocity = flock.frames[-1, dims : 2 * dims]
    np.testing.assert_allclose(velocity, velocity.mean(axis=1, keepdims=True) * np.ones(8), atol=0.02)
    assert np.linalg.norm(velocity[:, 0]) == pytest.approx(4.0, rel=0.01)
