"""Any valid scenario flies the same by the text of its driver, interpreted, and by the reference.

Forty draws here, the same ones whatever else changes; `.ci/nightly random-scenarios` flies 5,000 and counts that they
hold everything.
"""

import warnings
from random import Random

import numpy as np
import pytest

from against_reference import compared
from flocks import ISLANDS, interpreted, scenario
from reference.flight import fly_plainly
from scenarios_drawn import drawn, missing, notions


@pytest.mark.parametrize("number", range(201800, 201840))
def test_any_valid_scenario_flies_as_the_reference_does(number):
    draw = drawn(Random(number))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        verdict = compared(draw)
    assert verdict.agrees, (verdict, draw.keys, draw.start)


def test_draws_hold_every_choice_and_every_pair_of_notions():
    """Noisy or not with periodic or not, and so on; `.ci/nightly random-scenarios` flies 5,000 draws and counts too."""
    assert missing([sorted(notions(drawn(Random(number)))) for number in range(2200)]) == []


@pytest.mark.parametrize("dims", ["2", "3"])
@pytest.mark.parametrize("gust", [0.0, 2.0])
def test_agents_that_move_in_turn_feel_noise_and_wind(dims, gust, seed):
    """Found by a draw: where agents move one after another, wind and noise did not reach the stage that moves them."""
    keys = {"sensors__noise": 0.0, "sensors__period": 0.0, "radio__delay": 0.0, "update": "sequential", "dt": 0.05}
    world = {"world__dimensions": dims, "world__obstacles": ISLANDS, "wind__gust": gust, "wind__north": 0.5}
    found = scenario("viragh_2014", **keys, **world, agents=3, duration=0.5, world__side=90.0)
    text, known = interpreted(found, seed), fly_plainly(found, seed)
    np.testing.assert_allclose(text.frames, known.frames, atol=1e-12)
    quiet = interpreted(
        scenario("viragh_2014", **keys, agents=3, duration=0.5, world__side=90.0, body__noise=0.0), seed
    )
    assert np.abs(quiet.frames[-1, :2] - text.frames[-1, :2]).max() > 1e-3
