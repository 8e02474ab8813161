"""What flights of a scenario have in common is made once, and no flight finds in it what belongs to another seed."""

from copy import copy
from dataclasses import fields, replace

import numpy as np
import pytest

import airflock
from airflock.engine import plan_of
from inside import tables

GROUPS = [{"name": "heavy", "agents": 3, "body": {"tau": {"value": 1.0, "spread": 0.2}}}]
SETTINGS = {
    "as it is": {},
    "spread": {"groups": GROUPS},
    "faults": {"faults": [{"kind": "motor", "per_hour": 400.0}]},
    "another scene for each flight": {"scene.kind": "forest", "scene.draw": "flight"},
}


@pytest.mark.parametrize("name", SETTINGS)
def test_tables_of_a_scenario_that_has_flown_are_those_of_a_fresh_one(name):
    scenario = airflock.load("vasarhelyi_2018/4ms", {"agents": 8, "duration": 60.0} | SETTINGS[name])
    seen = []
    for seed in (1, 2**40 + 7, 1):
        for world in (0, 3):
            fresh = replace(scenario)
            assert plan_of(scenario) == plan_of(fresh)
            flown = tables(scenario, plan_of(scenario), seed, world)
            other = tables(fresh, plan_of(fresh), seed, world)
            for each in fields(flown):
                mine, theirs = getattr(flown, each.name), getattr(other, each.name)
                assert np.array_equal(mine, theirs) if each.name != "due" else mine == theirs
            seen.append((flown.whole.tolist(), flown.own.tolist(), flown.due, flown.shapes.tolist()))
    assert seen[0] == seen[4]
    assert seen[0] != seen[2]


def test_what_was_prepared_is_no_part_of_a_scenario():
    scenario = airflock.load("vasarhelyi_2018/4ms")
    before = replace(scenario)
    plan_of(scenario)
    assert scenario.engine_cache
    assert scenario == before
    assert not copy(scenario).engine_cache
    assert not replace(scenario).engine_cache
