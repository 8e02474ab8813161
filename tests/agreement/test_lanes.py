"""Lanes without an agent, which fill up vectors: nobody meets them, whatever becomes of a flight on its way.

A driver flies 33 agents without any, one of a flock whose numbers differ fills 48 lanes, and so does one of 31 agents.
"""

import numpy as np
import pytest

import airflock
from airflock.scenarios.files import load

AGENTS, AWAY = 33, 1e9  # m; farther than anybody hears or collides
DIFFER = {"groups": [{"name": "odd", "agents": 5, "model": {"p_rep": 0.3}}, {"name": "others"}]}
SMALL = {"agents": AGENTS, "duration": 4.0, "radio.delay": 0.4, "start.kind": "ball", "start.radius": 60.0}
STILL = {"sensors.noise": 0.0, "body.noise": 0.0}


def filled(flight):
    """Places of the lanes without an agent, now and as they are heard later on, m."""
    state = flight._state
    rows = [state.driver.ROWS[axis] for axis in state.plan.axes]
    return np.append(state.arrays["work"][rows][:, AGENTS:], state.arrays["past"][:, : len(rows), AGENTS:])


def begun(**more):
    """An open flight of 33 drones after a second."""
    return airflock.open(load("vasarhelyi_2018/4ms", {**SMALL, **STILL, **more}), 4, precision=64, device="python")


def test_lanes_without_an_agent_are_far_away_before_and_after_a_change():
    flight = begun().advance(0.4)
    assert filled(flight).min() >= AWAY
    assert filled(flight.change(DIFFER).advance(0.02)).min() >= AWAY
    assert filled(begun(**DIFFER).advance(0.4).remove([31, 32]).advance(0.02)).min() >= AWAY


@pytest.mark.parametrize("act", [lambda flight: flight.change(DIFFER), lambda flight: flight.remove([31, 32])])
def test_a_flight_that_fills_up_lanes_on_its_way_flies_as_the_interpreted_one(act):
    """Which has no such lanes."""
    compiled = airflock.open(load("vasarhelyi_2018/4ms", {**SMALL, **STILL}), 4, precision=64)
    ends = [act(flight.advance(0.6)).advance(2.0).state for flight in (compiled, begun())]
    assert np.allclose(*ends, rtol=0.0, atol=1e-9, equal_nan=True)
