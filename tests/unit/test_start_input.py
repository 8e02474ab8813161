"""Starts outside a bouncing arena are refused: its faces would move an agent farther than it can have flown."""

import numpy as np
import pytest

from airflock.engine import fly
from airflock.errors import FlightError, ScenarioError
from flocks import scenario

BOUNCE = {"world__edges": "bounce", "world__side": 20.0, "duration": 0.2}
VEE = {"start__kind": "echelon", "start__spacing_x": 1.0, "start__spacing_y": 3.0}


@pytest.mark.parametrize("edges", ["bounce", "open"])
def test_a_formation_that_reaches_outside_is_refused(edges):
    """Its extent counts, not start.side, which no formation has."""
    keys = BOUNCE | VEE | {"world__edges": edges}
    scenario(**keys, agents=4, start__side=1e5)
    with pytest.raises(ScenarioError, match=r"agent 4 of 5 would start at \[-4, 12\] m, outside the arena"):
        scenario(**keys, agents=5)


def test_jitter_must_not_carry_an_agent_over_a_face_that_bounces():
    scenario(**BOUNCE, **VEE, agents=4, start__jitter=0.1)
    with pytest.raises(ScenarioError, match="within 2.9 m of jitter of its faces"):
        scenario(**BOUNCE, **VEE, agents=4, start__jitter=0.5)


def test_a_given_start_outside_is_one_line():
    start = np.array([[0.0, 3.0], [0.0, -12.5], [0.0, 0.0], [0.0, 0.0]])
    with pytest.raises(FlightError, match="agent 1 lies 2.5 m outside the arena, from whose faces agents bounce"):
        fly(scenario(**BOUNCE, agents=2), 0, start=start, device="python")
