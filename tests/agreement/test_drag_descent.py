"""Drag descent added to a model: no bit changes at no gain, plain Python is compiled, and the rule is dimock_2003's."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import airflock
from airflock.core.model import add_laws, model
from airflock.core.parameters import Parameters as Record
from airflock.engine import fly_world
from airflock.parts.aero import descent
from airflock.parts.laws import reynolds_1987, vasarhelyi_2018
from airflock.scenarios.files import load
from airflock.scenarios.part_kinds import DESCENT
from airflock.support.errors import RuleError, ScenarioError
from reference.flight import fly_plainly

SMALL = {"agents": 4, "duration": 1.0, "metrics.kind": "order", "wing.segments": "5", "start.jitter": 0.1}
PRESET = "vasarhelyi_2018/fixed_wing"


class Still:
    """A law that asks for nothing and wants to stay where it is."""

    COMMAND = "velocity"

    @dataclass(frozen=True, kw_only=True)
    class Parameters(Record):
        """None."""

    @staticmethod
    def decide(period):
        """Rest."""
        return 0.0 * period, 0.0 * period, 0.0 * period


def test_without_gain_no_bit_of_a_flight_changes(seed):
    bare = load(PRESET, SMALL)
    document = {key: value for key, value in bare.document.items() if key != "aero"}
    alone = airflock.scenarios.scenario_builder.build_scenario(document, "alone")
    assert alone.model.flock is None
    frames = [
        fly_world(each, seed, record=True, device="python").frames
        for each in (alone, load(PRESET, SMALL | {"aero.k_d": 0}))
    ]
    np.testing.assert_array_equal(*frames)
    moved = fly_world(bare, seed, record=True, device="python").frames
    assert np.abs(moved - frames[0]).max() > 1e-3


def test_plain_python_is_the_compiled_flight(seed):
    found = load(PRESET, SMALL)
    plain, compiled = fly_plainly(found, seed), fly_world(found, seed, precision=64, record=True)
    np.testing.assert_allclose(compiled.frames, plain.frames, rtol=0.0, atol=1e-7)


def test_two_birds_tip_to_tip_move_as_by_the_rule_of_dimock_2003():
    settings = {"agents": 2, "duration": 0.5, "start.spacing_y": 1.6, "start.spacing_x": 1.0, "metrics.kind": "order"}
    wing = {"wing.segments": "10", "wing.tolerance": 1e-13}
    bird = {"model.k_c": 0.0, "model.k_a": 0.0, "model.k_d": 0.3, "model.v_max": 2.0, "model.gradient": "frozen"}
    theirs = load("dimock_2003/physical", settings | wing | bird)
    gain = {"aero.k_d": 0.3, "aero.v_max": 2.0, "aero.gradient": "frozen"}
    ours = load("dimock_2003/physical", settings | wing | gain, law=model(Still, "still"))
    frames = [fly_plainly(found).frames for found in (theirs, ours)]
    assert np.abs(np.diff(frames[0], axis=0)).max() > 1e-3
    np.testing.assert_allclose(*frames, rtol=0.0, atol=1e-12)


def test_equal_sums_are_the_same_functions_and_ask_for_what_both_need():
    base = model(vasarhelyi_2018, "vasarhelyi_2018")
    both = add_laws(base, DESCENT)
    assert both.decide is add_laws(model(vasarhelyi_2018, "vasarhelyi_2018"), DESCENT).decide
    assert both.flock is descent.flock and both.neighbour is base.neighbour and both.Memory is base.Memory
    with pytest.raises(RuleError, match="solves for the whole flock itself"):
        add_laws(both, DESCENT)
    with pytest.raises(RuleError, match="commands acceleration"):
        add_laws(model(reynolds_1987, "reynolds_1987"), DESCENT)
    with pytest.raises(RuleError, match=r"can have no neighbour, .*sums.* of its own"):
        add_laws(base, replace(base, name="second"))


BAD = {
    "dimock_2003/physical": ({"aero.k_d": 0.1}, "goes down the gradient of the drag by itself"),
    "zapotecatl_2016/best": ({"aero.k_d": 0.1}, "commands acceleration"),
    "vasarhelyi_2018/fixed_wing": ({"aero.k_d": -1.0}, "aero.k_d = -1 m^2/(N s) lies outside [0, 1000] m^2/(N s)"),
    "vasarhelyi_2018/4ms": ({"aero.gradient": "steep"}, "aero.gradient = 'steep' is none of frozen, analytic"),
    "viragh_2014/4ms": ({"aero.k_d": 0.1, "wing.positions": "grid"}, "aero.gradient = 'frozen' is a derivative"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line(name):
    settings, line = BAD[name]
    with pytest.raises(ScenarioError) as fault:
        load(name, settings)
    assert line in str(fault.value) and len(str(fault.value).splitlines()) == 1
