"""What is measured for the sentences about the real drones and about boids out of sight, on made-up recordings."""

import numpy as np
import pytest
import xarray as xr

import airflock
from airflock_papers.kidger import alone
from airflock_papers.vasarhelyi_2018 import real


def recording(position: np.ndarray, velocity: np.ndarray) -> xr.Dataset:
    """A recording of one world: (time, axis, agent)."""
    dims = ("time", "space", "world", "individual")
    return xr.Dataset(
        {"position": (dims, position[:, :, None, :]), "velocity": (dims, velocity[:, :, None, :])},
        coords={"time": 0.2 * np.arange(len(position))},
    )


def test_the_wall_term_is_that_of_eqs_8_and_9_at_the_nearer_wall_of_each_axis() -> None:
    scenario = airflock.load("vasarhelyi_2018/real_6ms")
    p = scenario.parameters
    place, velocity = np.zeros((1, 2, 2)), np.zeros((1, 2, 2))
    place[0, 0, 0] = 0.5 * scenario.world.side  # at the eastern wall, towards which it flies; the other stands inside
    velocity[0, 0, 0] = 6.0
    outside = p.v_shill + 6.0  # of the shill agent's velocity against the drone's; at the wall nothing is allowed
    found = real.wall_term(recording(place, velocity), scenario)
    assert found == pytest.approx(outside, rel=1e-6)


def test_shill_agents_of_both_tables_differ_in_nothing_else() -> None:
    for v in real.SPEEDS:
        s4, s1 = (each.parameters for each in real.sides(v).values())
        assert {k for k in vars(s4) if getattr(s4, k) != getattr(s1, k)} == {"v_shill", "r0_shill"}
        assert s4.v_shill < s1.v_shill and s4.r0_shill > s1.r0_shill


def test_stragglers_are_those_whom_nobody_is_near() -> None:
    place, velocity = np.zeros((2, 3, 3)), np.zeros((2, 3, 3))
    place[:, :, 1] = (10.0, 0.0, 0.0)
    place[:, :, 2] = (0.0, -100.0, 0.0)  # out of sight
    goal = np.array(alone.GOAL)
    velocity[:, :, 2] = goal - place[0, :, 2]
    velocity[:, :, 0] = np.cross(goal, (0.0, 0.0, 1.0))  # across the way to the goal
    velocity[:, :, 1] = np.cross(goal - place[0, :, 1], (0.0, 0.0, 1.0))
    velocity[1, 2, :] = (-3.0, -3.0, -3.0)
    found = alone.measures(recording(place[:1], velocity[:1]), sight=40.0, top=60.0)
    assert found["focus"] == pytest.approx(1.0) and found["alone"] == pytest.approx(1 / 3)
    falling = alone.measures(recording(place[1:], velocity[1:]), sight=40.0, top=60.0)
    assert falling["fall"] == pytest.approx(3.0) and falling["climb"] == 0.0


def test_who_moves_once_at_the_end_is_not_stuck() -> None:
    """Of three boids one stands, one stands until its last instant, one has never flown slower than half the limit."""
    place, velocity = np.zeros((2, 3, 3)), np.zeros((2, 3, 3))
    velocity[:, 0, 2] = 30.0
    velocity[1, 1, 1] = 7.0
    assert alone.measures(recording(place, velocity), sight=40.0, top=60.0)["stuck"] == pytest.approx(1 / 3)
