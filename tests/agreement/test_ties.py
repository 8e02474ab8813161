"""What lies exactly on an edge: one rule, for a compiled driver's text and for the reference, in every perception.

A neighbour at exactly the radio's range is heard, one at exactly the law's reach is met.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pytest

from airflock.core.model import model
from airflock.core.parameters import Parameters, quantity
from airflock.scenarios.files import load
from airflock.scenarios.part_kinds import CallerParts
from airflock.scenarios.scenario_builder import build_scenario
from flocks import interpreted
from reference.flight import fly_plainly


@dataclass(frozen=True, kw_only=True)
class Counted(Parameters):
    near: float = quantity(7.0, "m", low=0.0, high=1e6, meaning="reach", source="none")


class Sums(NamedTuple):
    met: float


def reach(p):
    return p.near


def neighbour(r):
    return Sums(1.0 + 0.0 * r)


def decide(sums):
    return sums.met, 0.0, 0.0


def counting(bounded):
    """A law that commands as many m/s to the east as it meets neighbours, within a reach of p.near m or of none."""
    rules = {"Parameters": Counted, "Sums": Sums, "neighbour": neighbour, "decide": decide, "COMMAND": "velocity"}
    return model(rules | ({"reach": reach} if bounded else {}), "counting")


PERCEPTIONS = {
    "perfect": {},
    "noisy": {"sensors.noise": 1e-30},
    "late": {"radio.delay": 0.1},
    "lossy": {"radio.loss": 1e-30},
    "links": {"radio.kind": "links", "radio.received_near": 1.0, "radio.near": 1e6, "radio.far": 1e6},
}


@pytest.mark.parametrize("perception", PERCEPTIONS)
@pytest.mark.parametrize("edges", ["open", "periodic"])
@pytest.mark.parametrize("limit", ["range", "reach"])
def test_a_neighbour_at_exactly_the_edge_counts(perception, edges, limit, seed):
    """Three agents at rest in a row, 7 m apart: the middle one meets two, the others one each; a bit less, and none."""
    ideal = {"sensors.noise": 0.0, "radio.delay": 0.0, "agents": 3, "duration": 0.1, "body.kind": "direct"}
    keys = ideal | PERCEPTIONS[perception] | {"world.edges": edges, "world.side": 100.0, "start.separation": 0.0}
    start = np.array([[-7.0, 0.0, 7.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    for length, met in ((7.0, [1.0, 2.0, 1.0]), (7.0 - 1e-9, [0.0, 0.0, 0.0])):
        key = {"range": {"radio.range": length}, "reach": {"model.near": length, "radio.range": 1e6}}[limit]
        found = build_scenario(
            {"model": {"kind": "counting"}},
            "test",
            keys | key,
            caller_parts=CallerParts(law=counting(limit == "reach")),
        )
        for flight in (interpreted, fly_plainly):
            assert flight(found, seed, start).frames[0, 4].tolist() == met


@pytest.mark.parametrize("wall", [0.0, 200.0])
def test_what_stands_between_shades_at_exactly_the_range_too(wall, seed):
    """Two agents 7 m apart, a block between them: without loss in the walls both are heard, with it neither is."""
    radio = {"radio.kind": "shadow", "radio.near": 20.0, "radio.far": 21.0, "radio.received_near": 1.0}
    keys = radio | {"radio.wall": wall, "radio.range": 7.0, "radio.delay": 0.0, "sensors.noise": 0.0}
    keys |= {"agents": 2, "duration": 0.1, "body.kind": "direct", "world.side": 100.0, "start.separation": 0.0}
    keys["world.obstacles"] = [[[-1.0, -2.0], [1.0, -2.0], [1.0, 2.0], [-1.0, 2.0]]]
    start = np.array([[-3.5, 3.5], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    found = build_scenario({"model": {"kind": "counting"}}, "test", keys, caller_parts=CallerParts(law=counting(False)))
    for flight in (interpreted, fly_plainly):
        assert flight(found, seed, start).frames[0, 4].tolist() == ([1.0, 1.0] if wall == 0.0 else [0.0, 0.0])


def test_two_equally_near_neighbours_weigh_the_same(seed):
    """A flock that is its own mirror image stays so: no neighbour wins by its number."""
    found = load("vasarhelyi_2018/4ms", {"agents": 3, "duration": 5.0, "sensors.noise": 0.0, "body.noise": 0.0})
    found = replace(found, radio=found.radio.with_numbers(delay=0.0))
    start = np.array([[0.0, -6.0, 6.0], [0.0, 3.0, 3.0], [0.0, 1.0, -1.0], [4.0, 3.0, 3.0]])
    for flight in (interpreted, fly_plainly):
        frames = flight(found, seed, start).frames
        np.testing.assert_allclose(frames[:, [0, 2], 1], -frames[:, [0, 2], 2], atol=1e-9)
        np.testing.assert_allclose(frames[:, [1, 3], 1], frames[:, [1, 3], 2], atol=1e-9)
