"""A flight is the same in hand-written C: the reference of `benchmarks/` has the same equations, numbers and order."""

import sys
from pathlib import Path

import numpy as np
import pytest

from airflock.engine import fly_world
from airflock.scenarios.files import load

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

import c_reference  # noqa: E402

pytestmark = pytest.mark.skipif(c_reference.compiler() is None, reason="no C compiler: neither $CC, cc nor gcc")

# crowded, with sluggish bodies and weak walls, so that agents collide and leave the arena within seconds
CROWDED = {
    "agents": 24, "world.side": 60.0, "start.separation": 4.0, "metrics.r_coll": 5.0, "body.a_max": 1.5,
    "model.v_shill": 2.0, "model.a_shill": 20.0, "model.p_shill": 1.0,
}  # fmt: skip


def crowd(seconds):
    return load("vasarhelyi_2018/4ms", CROWDED | {"duration": seconds})


@pytest.mark.parametrize(("bits", "seconds", "margin"), [(64, 12.0, 1e-9), (32, 5.0, 1e-3)])
def test_hand_written_c_flies_the_compiled_flight(tmp_path, seed, bits, seconds, margin):
    found = crowd(seconds)
    frames, score = c_reference.Reference(found, tmp_path, bits=bits).frames(seed)
    flown = fly_world(found, seed, precision=bits, record=True)
    assert np.abs(np.diff(frames, axis=0)).max() > 0.1  # something happens
    np.testing.assert_allclose(frames, flown.frames[:, :4], rtol=0.0, atol=margin)
    assert score["n_coll"] > 0.0
    assert score["phi_wall"] > 0.0 > score["clearance"]
    assert flown.values == pytest.approx(score, rel=margin, abs=margin)


def test_hand_written_c_hears_the_packets_that_the_compiled_flight_hears(tmp_path, seed):
    keys = {"radio.kind": "links", "radio.delay": 0.4, "radio.near": 5.0, "radio.far": 15.0, "radio.received_far": 0.2}
    found = load("vasarhelyi_2018/4ms", CROWDED | keys | {"duration": 12.0})
    frames, score = c_reference.Reference(found, tmp_path, bits=64).frames(seed)
    flown = fly_world(found, seed, precision=64, record=True)
    np.testing.assert_allclose(frames, flown.frames[:, :4], rtol=0.0, atol=1e-9)
    assert flown.values == pytest.approx(score, rel=1e-9, abs=1e-9)


def test_skipping_the_pairs_changes_no_bit_in_c(tmp_path, seed):
    reference = c_reference.Reference(crowd(5.0), tmp_path)
    assert reference.evaluate(seed, skip=True) == reference.evaluate(seed, skip=False)
    assert reference.evaluate_many(seed, 3)[0] == reference.evaluate(seed)
