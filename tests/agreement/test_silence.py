"""The rule of silence in the simulator: a blackout that ends in collisions without it, and who is refused."""

import numpy as np
import pytest

import airflock
from airflock.errors import ScenarioError
from flocks import interpreted

FLOCK = {"agents": 10, "duration": 40.0, "world.side": 120.0, "metrics.period": 0.2, "metrics.kind": "order"}
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
    """Twelve seeds here; docs/decisions/0021-stop-near-silent-neighbours.md has forty."""
    with_rule = smallest(BLACKOUT | {"silence.rule": "stop"}, 12)
    assert np.median(with_rule) > 5.0 and (with_rule < 3.0).sum() <= 1
    assert np.median(smallest(BLACKOUT, 12)) < 1.0, "who forgets whom it does not hear flies into it"


def test_who_hears_everybody_flies_as_without_the_rule():
    """Data that are as old as the radio makes them stop nobody: the same flight to the last bit."""
    free, bound = (airflock.load("vasarhelyi_2018/real_4ms", {"agents": 5, "duration": 4.0, "silence.rule": rule})
                   for rule in ("fly_on", "stop"))  # fmt: skip
    np.testing.assert_array_equal(interpreted(free, 1).frames, interpreted(bound, 1).frames)


@pytest.mark.parametrize("kind", ["range", "nearest"])
def test_look_tells_whom_an_agent_hears_until_they_are_lost(kind, seed):
    """More than a half of all packets are lost; the terms of those who count add up to what the law was given."""
    keys = {
        "agents": 8, "world.side": 60.0, "radio.loss": 0.6, "radio.loss_at": 25.0, "radio.delay": 0.2,
        "silence.rule": "stop", "topology.kind": kind, "duration": 20.0,
    }  # fmt: skip
    flight = airflock.open(airflock.load("vasarhelyi_2018/4ms", keys), seed, device="python")
    flight.advance(steps=60).sense()
    ages = []
    for agent in range(8):
        view = flight.look(agent)
        ages += [other.age for other in view.heard]
        np.testing.assert_allclose(np.sum([*view.terms, [0.0] * len(view.sums)], axis=0), view.sums, atol=1e-9)
    assert max(ages) > 0.35 and max(ages) <= 0.7, "older than what came last, and younger than the patience"


REFUSED = {
    "couzin_2002/torus": "commands a heading",
    "zapotecatl_2016/best": "commands an acceleration",
    "dimock_2003/physical": "no rule for the neighbours",
}


@pytest.mark.parametrize(("name", "why"), REFUSED.items())
def test_a_law_that_cannot_stop_for_a_neighbour_is_refused(name, why):
    with pytest.raises(ScenarioError, match=rf"silence.rule = 'stop': model \w+ .*{why}"):
        airflock.load(name, {"silence.rule": "stop"})


def test_a_gpu_flies_it():
    from airflock.engine import plan_of
    from inside import no_cuda

    plan = plan_of(airflock.load("vasarhelyi_2018/4ms", {"silence.rule": "stop"}))
    assert no_cuda(plan, 100) is None
