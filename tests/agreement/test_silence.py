"""The rule of silence in the simulator: a blackout that ends in collisions without it, and who is refused."""

import numpy as np
import pytest

import airflock
from airflock.errors import ScenarioError
from flocks import interpreted

FLOCK = {"agents": 10, "duration": 40.0, "world.side": 120.0, "metrics.period": 0.2}
BLACKOUT = {"faults": [{"kind": "radio_deaf", "at": 20.0, "lasts": 15.0}]}


def smallest(settings, seeds):
    """Smallest distance of any two agents from the blackout on, of each seed, m."""
    found = airflock.load("vasarhelyi_2018/real_4ms", FLOCK | settings)
    lows = []
    for seed in range(seeds):
        flown = airflock.simulate(found, seed).position.isel(keypoint=0).transpose("time", "individual", "space").values
        gaps = np.linalg.norm(flown[100:, :, None] - flown[100:, None], axis=-1)
        lows.append(float((gaps + 1e9 * np.eye(10)).min()))
    return np.array(lows)


def test_fifteen_seconds_of_silence_bring_nobody_near():
    """Twelve seeds here; docs/decisions/0056 has forty."""
    with_rule = smallest(BLACKOUT | {"silence.rule": "stop"}, 12)
    assert np.median(with_rule) > 5.0 and (with_rule < 3.0).sum() <= 1
    assert np.median(smallest(BLACKOUT, 12)) < 1.0, "who forgets whom it does not hear flies into it"


def test_who_hears_everybody_flies_as_without_the_rule():
    """Data that are as old as the radio makes them stop nobody: the same flight to the last bit."""
    free, bound = (airflock.load("vasarhelyi_2018/real_4ms", {"agents": 5, "duration": 4.0, "silence.rule": rule})
                   for rule in ("fly_on", "stop"))  # fmt: skip
    np.testing.assert_array_equal(interpreted(free, 1).frames, interpreted(bound, 1).frames)


REFUSED = {
    "couzin_2002/torus": "commands a heading",
    "zapotecatl_2016/best": "commands an acceleration",
    "dimock_2003/physical": "no rule for the neighbours",
}


@pytest.mark.parametrize(("name", "why"), REFUSED.items())
def test_a_law_that_cannot_stop_for_a_neighbour_is_refused(name, why):
    with pytest.raises(ScenarioError, match=rf"silence.rule = 'stop': model \w+ .*{why}"):
        airflock.load(name, {"silence.rule": "stop"})


def test_a_gpu_says_that_it_does_not_fly_it():
    from airflock.engine.devices import no_cuda
    from airflock.engine.simulate import plan_of

    plan = plan_of(airflock.load("vasarhelyi_2018/4ms", {"silence.rule": "stop"}))
    assert "silence.rule" in str(no_cuda(plan, 100))
