"""Whom agents meet in flight: by drivers and reference, as `look` tells, late, absent, in boxes, on board, by cells."""

from dataclasses import dataclass
from random import Random
from typing import NamedTuple

import numpy as np
import pytest

import airflock
from against_reference import interpreted_flight
from airflock.core.model import model
from airflock.core.parameters import Parameters
from airflock.drones.onboard.card import card_hash, parse_card
from airflock.engine import plan_of
from airflock.scenarios.part_kinds import CallerParts
from airflock.scenarios.scenario_builder import build_scenario
from airflock.search.study import read_space
from airflock.support.errors import CardError, ErrorCollector, ScenarioError
from fleets import document, scenario
from flocks import ISLANDS, interpreted
from inside import cpu, no_cuda, tables
from reference.flight import fly_plainly
from scenarios_drawn import Draw


@dataclass(frozen=True, kw_only=True)
class Nothing(Parameters):
    """No number."""


class Sums(NamedTuple):
    met: float
    east: float


def neighbour(dx, r):
    return Sums(1.0 + 0.0 * r, dx)


def decide(sums):
    return sums.met, sums.east, 0.0


RULES = {"Parameters": Nothing, "Sums": Sums, "neighbour": neighbour, "decide": decide, "COMMAND": "velocity"}
COUNTING = model(RULES, "counting")  # commands as many m/s to the east as it meets neighbours, to the north where
IDEAL = {
    "sensors.noise": 0.0, "radio.delay": 0.0, "duration": 0.0, "body.kind": "direct", "radio.range": 1e6,
    "start.separation": 0.0, "world.side": 400.0,
}  # fmt: skip


def counted(places, velocities=None, **keys):
    """Neighbours met by each agent, and the sum of their offsets to the east, by the driver and the reference."""
    places = np.array(places, float)
    start = np.concatenate([places.T, np.zeros_like(places.T) if velocities is None else np.array(velocities).T])
    keys = IDEAL | {"agents": len(places)} | {name.replace("__", "."): value for name, value in keys.items()}
    found = build_scenario({"model": {"kind": "counting"}}, "test", keys, caller_parts=CallerParts(law=COUNTING))
    text, known = (flight(found, 1, start).frames[-1, 4:6] for flight in (interpreted, fly_plainly))
    np.testing.assert_allclose(text, known, atol=1e-12)
    return text[0].tolist(), text[1].tolist()


ROW = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [6.0, 0.0], [10.0, 0.0]]


def test_a_row_meets_the_nearest_and_all_as_near():
    assert counted(ROW, topology__kind="nearest", topology__k=1)[1] == [1.0, -1.0, -2.0, -3.0, -4.0]
    assert counted(ROW, topology__kind="nearest", topology__k=9)[0] == [4.0] * 5
    even = [[2.0 * k, 0.0] for k in range(5)]
    assert counted(even, topology__kind="nearest", topology__k=1)[0] == [1.0, 2.0, 2.0, 2.0, 1.0]
    assert counted(even, topology__kind="voronoi")[0] == [1.0, 2.0, 2.0, 2.0, 1.0]
    assert counted(even, topology__kind="visible", topology__radius=0.1)[0] == [1.0, 2.0, 2.0, 2.0, 1.0]


def test_only_who_is_heard_can_be_met():
    """The range of the radio cuts first: the nearest that is heard, not the nearest of all."""
    assert counted(ROW, topology__kind="nearest", topology__k=1, radio__range=2.5)[0] == [1.0, 1.0, 1.0, 0.0, 0.0]
    assert counted(ROW, topology__kind="strongest", topology__k=3, radio__range=0.5)[0] == [0.0] * 5


def test_a_neighbour_is_near_across_the_faces_of_a_box():
    places = [[-19.0, 0.0], [0.0, 0.0], [19.5, 0.0]]
    keys = {"world__side": 40.0, "topology__kind": "nearest", "topology__k": 1}
    assert counted(places, **keys)[1] == [19.0, -19.0, -19.5]
    assert counted(places, **keys, world__edges="periodic")[1] == [-1.5, -19.0, 1.5]


def test_who_is_near_is_a_matter_of_what_was_heard():
    """Number 1 comes from afar and is beside number 0 now; what is heard of it is a second old."""
    places, velocities = [[0.0, 0.0], [30.0, 0.0], [-12.0, 0.0]], [[0.0, 0.0], [-25.0, 0.0], [0.0, 0.0]]
    keys = {"duration": 1.0, "topology__kind": "nearest", "topology__k": 1, "dt": 0.1}
    keys |= {"body__kind": "multirotor", "body__noise": 0.0, "body__a_max": 0.01}
    now, late = (counted(places, velocities, **keys, radio__delay=delay)[1][0] for delay in (0.0, 1.0))
    assert now == pytest.approx(5.0, abs=0.05) and late == pytest.approx(-12.0, abs=0.05)


def test_who_is_absent_is_met_by_nobody_and_hides_nobody():
    keys = {"duration": 0.2, "faults": [{"kind": "fails", "at": 0.0, "agents": [1]}], "dt": 0.1}
    for kind in ("nearest", "voronoi", "visible"):
        met, east = counted(ROW[:3], **keys, topology__kind=kind, topology__k=1)
        assert (met[0], met[2]) == (1.0, 1.0) and np.isnan(met[1]) and east[0] > 2.0, kind


@pytest.mark.parametrize("kind", ["nearest", "voronoi", "visible", "strongest"])
def test_look_tells_whom_an_agent_meets(kind, seed):
    """The terms of those met add up to what the law was given, whatever the radio."""
    keys = {
        "agents": 9, "world.side": 60.0, "start.separation": 4.0, "topology.kind": kind, "topology.k": 3, "dt": 0.05,
        "topology.radius": 3.0, "radio.loss": 0.3, "radio.kind": "links", "world.obstacles": ISLANDS, "duration": 20.0,
    }  # fmt: skip
    flight = airflock.open(airflock.load("vasarhelyi_2018/4ms", keys), seed, device="python")
    flight.advance(steps=4).sense()
    fewer = 0
    for agent in range(9):
        view = flight.look(agent)
        assert len(view.met) == len(view.heard) == len(view.terms)
        fewer += sum(view.met) < len(view.heard)
        assert not any(any(term) for term, met in zip(view.terms, view.met, strict=True) if not met)
        np.testing.assert_allclose(np.sum([*view.terms, [0.0] * len(view.sums)], axis=0), view.sums, atol=1e-9)
    assert fewer > 3


RADIOS = (
    {"radio.loss": 0.4, "radio.loss_at": 20.0},
    {"radio.kind": "links", "radio.near": 5.0, "radio.far": 25.0, "radio.slow_rate": 4.0},
    {"silence.rule": "stop", "silence.patience": 0.1, "silence.keep": 15.0},
    {"faults": [
        {"kind": "radio_deaf", "at": 0.1, "agents": [1]}, {"kind": "radio_silent", "at": 0.15, "agents": [2]},
        {"kind": "radio_range", "at": 0.0, "agents": [0, 3], "share": 0.5}, {"kind": "clock", "at": 0.0, "agents": [4]},
    ]},
    {"world.edges": "periodic", "world.obstacles": []},
    {"radio.delay": 0.1},
)  # fmt: skip


@pytest.mark.parametrize("kind", ["nearest", "voronoi", "visible", "strongest"])
def test_whatever_the_radio_the_same_are_met_as_in_the_reference(kind, seed):
    """Each trait is that of half of the flights. Every line of a driver runs in every other one."""
    rng, flights, fewer = Random(f"{seed} {kind}"), 4, 0
    halves = [rng.sample(range(flights), flights // 2) for _ in RADIOS]
    for number in range(flights):
        keys = {
            "agents": 7, "duration": 0.2, "dt": 0.05, "sensors.period": 0.1, "world.side": 40.0, "radio.range": 28.0,
            "radio.delay": 0.0, "start.separation": 4.0, "topology.kind": kind, "topology.k": 1, "metrics.period": 0.1,
            "topology.radius": 4.0, "topology.fading": 4.0, "world.obstacles": ISLANDS,
        }  # fmt: skip
        for trait, half in zip(RADIOS, halves, strict=True):
            keys |= trait if number in half else {}
        found, plain = (
            build_scenario({"model": {"kind": "counting"}}, "test", keys | more, caller_parts=CallerParts(law=COUNTING))
            for more in ({}, {"topology.kind": "range"})
        )
        world = rng.randrange(2**32)
        text = interpreted(found, world) if number % 2 else interpreted_flight(Draw(found, world, None, keys))
        np.testing.assert_allclose(text.frames, fly_plainly(found, world).frames, atol=1e-9, err_msg=f"{world} {keys}")
        fewer += not np.array_equal(text.frames, interpreted(plain, world).frames)
    assert fewer > 1


def test_a_change_in_flight_takes_effect():
    flight = airflock.open(airflock.load("vasarhelyi_2018/4ms", {"topology.kind": "nearest"}), 1, device="python")
    assert sum(flight.sense().look(3).met) == 7
    flight.change({"topology.k": 4}).advance(steps=20).sense()
    assert sum(flight.look(3).met) == 4


def test_what_cannot_be_is_refused_at_once():
    with pytest.raises(ScenarioError) as told:
        airflock.load("vasarhelyi_2018/4ms", {"topology.kind": "voronoi", "world.dimensions": "3", "topology.k": 2.5})
    assert "topology.k = 2.5 is not a whole number" in str(told.value)
    with pytest.raises(ScenarioError, match="works in a plane only"):
        airflock.load("vasarhelyi_2018/4ms", {"topology.kind": "voronoi", "world.dimensions": "3"})
    alone = model({"Parameters": Nothing, "decide": lambda period: (period, 0.0, 0.0), "COMMAND": "velocity"}, "alone")
    with pytest.raises(ScenarioError, match="has no rule for single neighbours"):
        airflock.load("vasarhelyi_2018/4ms", {"topology.kind": "nearest"}, law=alone)
    found = airflock.load("vasarhelyi_2018/4ms", {"topology.kind": "nearest"})
    assert no_cuda(plan_of(found), 100) is None  # a block ranks
    assert "topology.kind = nearest" in no_cuda(plan_of(found, grid=True).built(grid=True), 100_000)


def test_numbers_of_neighbours_are_searched_as_whole_numbers():
    found = airflock.load("vasarhelyi_2018/4ms", {"topology.kind": "nearest"})
    space = read_space({"topology": {"k": {"low": 3, "high": 12}}}, found, ErrorCollector())
    values = {space.parameters([x])["topology.k"] for x in np.linspace(0.0, 1.0, 101)}
    assert values == set(range(3, 13))
    errors = ErrorCollector()
    assert read_space({"topology": {"k": {"fixed": 3.5}}}, found, errors) is None
    assert errors.errors == ["space.topology.k.fixed = 3.5 is not a whole number"]
    assert read_space({"topology": {"k": {"low": 3, "high": 9, "integer": False}}}, found, ErrorCollector()) is None


def test_a_card_carries_the_topology():
    plain, near = (document(scenario(**keys)) for keys in ({}, {"topology.kind": "nearest"}))
    assert "topology" not in plain and parse_card(plain | {"hash": card_hash(plain)}).pilot(1).topology is None
    pilot = parse_card(near | {"hash": card_hash(near)}).pilot(1)
    assert pilot.topology.name == "nearest" and pilot.t.k == 7.0
    wrong = near | {"topology": {"kind": "nearst", "k": 1.5}}
    with pytest.raises(CardError, match="topology.kind"):
        parse_card(wrong | {"hash": card_hash(wrong)})


def test_by_cells_the_same_are_met():
    """The cells that a law's reach fills hold all who decide. Sparse enough for cells that differ."""
    keys = {
        "agents": 150, "duration": 0.1, "dt": 0.05, "update": "synchronous", "sensors.period": 0.0, "topology.k": 3,
        "metrics.kind": "order", "start.separation": 0.0, "world.side": 4.0, "world.height": 4.0,
        "topology.kind": "nearest", "world.edges": "periodic",
    }  # fmt: skip
    found = airflock.load("zapotecatl_2016/best", keys)
    plan = plan_of(found, precision=64, record=True, grid=True)
    by_cells = cpu.fly_on_cpu(plan, tables(found, plan, 1), device="python").frames
    by_pairs = interpreted(found, 1).frames
    assert plan.grid and np.abs(by_pairs[-1] - by_pairs[0]).max() > 0.1
    np.testing.assert_allclose(by_cells, by_pairs, atol=1e-12)
