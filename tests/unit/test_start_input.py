"""Starts outside a box: refused where its faces would move an agent farther than it can have flown."""

import numpy as np
import pytest

from airflock.engine import driver_text, fly_world, plan_of
from airflock.scenarios.files import load
from airflock.support.errors import FlightError, ScenarioError
from flocks import scenario

BOUNCE = {"world__edges": "bounce", "world__side": 20.0, "duration": 0.2}
VEE = {"start__kind": "echelon", "start__spacing_x": 1.0, "start__spacing_y": 3.0}


@pytest.mark.parametrize("edges", ["bounce", "open", "periodic"])
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
        fly_world(scenario(**BOUNCE, agents=2), 0, start=start, device="python")


PERIODIC = {"world__edges": "periodic", "world__side": 4.0, "start__separation": 0.0}


def test_a_given_start_beyond_a_periodic_box_is_the_place_inside(seed):
    """Positions from 0 to the side, as many programs keep them, or any number of sides away, fly the same."""
    found = scenario("vicsek_1995", **PERIODIC, agents=8, duration=2.0)
    rng = np.random.default_rng(seed)
    inside = np.concatenate([rng.integers(-31, 32, (2, 8)) / 16, 0.03 * rng.normal(size=(2, 8))])  # no rounding
    away = inside + np.concatenate([4.0 * rng.integers(-3, 4, (2, 8)), np.zeros((2, 8))])
    known, moved = (fly_world(found, seed, record=True, start=start, device="python") for start in (inside, away))
    np.testing.assert_array_equal(moved.frames, known.frames)
    assert moved.values == known.values


def test_a_collision_over_the_face_of_a_periodic_box_is_seen_from_the_first_step(seed):
    """Found by a draw: two agents two sides apart, so at one place, were not looked at until they could have flown."""
    found = scenario("vicsek_1995", **PERIODIC, agents=2, duration=1.0, metrics__kind="vasarhelyi", metrics__r_coll=0.5)
    start = np.array([[0.0, 8.05], [0.0, 0.0], [0.01, 0.01], [0.0, 0.0]])
    assert fly_world(found, seed, start=start, device="python").values["n_coll"] == 1.0


@pytest.mark.parametrize(
    ("name", "bounded"), [("vicsek_1995/ordered", False), ("vasarhelyi_2018/4ms", True), ("kidger/city", True)]
)
def test_places_are_asked_whether_they_lie_inside_where_they_may_lie_outside(name, bounded):
    found = load(name)
    assert plan_of(found).bounded is bounded
    assert ("excursion(s_x" in driver_text(found)) is bounded
