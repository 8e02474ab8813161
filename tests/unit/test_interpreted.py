"""An interpreted flight stops where a person wants to look: in a rule of one's own, and in a stage of the driver."""

import bdb
import sys

import pytest

from airflock.engine import plan_of
from airflock.parts.laws.viragh_2014 import law as viragh_2014
from airflock.scenarios.files import load
from flocks import interpreted as flown, scenario
from inside import interpreted

KEYS = {"agents": 3, "duration": 0.4, "world.side": 60.0, "start.separation": 5.0}


def small(kind, **more):
    """Three agents for three decisions, at 0, 0.2 and 0.4 s."""
    return scenario(kind, **{key.replace(".", "__"): value for key, value in KEYS.items()}, **more)


class Stops(bdb.Bdb):
    """A debugger that notes at each breakpoint what the variables of that place are."""

    def __init__(self):
        super().__init__()
        self.seen = []

    def user_line(self, frame):
        if self.break_here(frame):
            self.seen.append(dict(frame.f_locals))
        self.set_continue()

    def stopped_at(self, file, line, work):
        """What was seen at a line while `work` was done."""
        assert self.set_break(file, line) is None
        tracing = sys.gettrace()  # of a coverage or a debugger around this test
        try:
            self.runcall(work)
        finally:
            sys.settrace(tracing)
            self.clear_all_breaks()
        return self.seen


def line_of(file, words):
    """First line of a file that holds some words."""
    with open(file, encoding="utf-8") as text:
        return next(number for number, line in enumerate(text, 1) if words in line)


def first_line(rule):
    """Number of the first line of a rule that does something."""
    return next(number for _, _, number in rule.__code__.co_lines() if number and number > rule.__code__.co_firstlineno)


def test_a_breakpoint_in_a_rule_stops_at_every_neighbour_and_nowhere_else():
    found = small("viragh_2014")
    plan_of(found)  # which probes every rule once
    seen = Stops().stopped_at(viragh_2014.__file__, first_line(viragh_2014.neighbour), lambda: flown(found, 1))
    assert len(seen) == 3 * 3 * 2
    assert all(type(value) is float for name, value in seen[0].items() if name != "p")
    assert all(values["dx"] ** 2 + values["dy"] ** 2 > 9.0 for values in seen)  # nobody meets itself


def test_a_breakpoint_in_a_stage_stops():
    found = small("viragh_2014")
    plan = plan_of(found, precision=64, record=True).built(grid=False)
    file = interpreted.flight_driver(plan).__file__
    seen = Stops().stopped_at(file, line_of(file, "o = viragh_2014_decide("), lambda: flown(found, 1))
    assert [values["i"] for values in seen] == [0, 1, 2] * 3


def test_breakpoint_may_be_written_into_a_rule(monkeypatch):
    def decide(own, sums, p):
        breakpoint()
        return own.vx, own.vy, 0.0

    law = {name: getattr(viragh_2014, name) for name in ("Parameters", "COMMAND", "neighbour", "Sums")}
    stops = []
    monkeypatch.setattr(sys, "breakpointhook", lambda: stops.append(sys._getframe(1).f_code.co_name))
    flown(load("viragh_2014/4ms", KEYS, law=law | {"decide": decide, "__name__": "mine"}), 1)
    assert stops[-9:] == ["decide"] * 9


@pytest.mark.parametrize("limit", ["cap", "rescale"])
def test_choices_are_at_hand_as_texts(limit):
    """A rule asks p.limit == "cap" in its own file: the record that it is handed must know."""
    found = small("vasarhelyi_2018", model__limit=limit)
    rule = found.model.decide
    seen = Stops().stopped_at(rule.__code__.co_filename, first_line(rule), lambda: flown(found, 1))
    assert {(values["p"].limit, type(values["p"].p_rep)) for values in seen} == {(limit, float)}
