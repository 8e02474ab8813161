"""One list of sections: whatever its order, a driver reads each number from the column that holds it."""

from collections import namedtuple
from dataclasses import fields, replace

import numpy as np
import pytest

from airflock.engine import plan_of
from airflock.scenarios import scenario as scenarios
from airflock.scenarios.cost import step_counts
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.sections import ORDER, SECTIONS
from airflock.support.errors import ScenarioError
from inside import Builder, tables_module as engine_tables


def read_by_text(plan, row):
    """Records as the text of a driver makes them from a row, by letter."""
    build = Builder(plan)
    space = {"row": row, "namedtuple": namedtuple}
    lines = build.records(" ".join(plan.records))
    exec("\n".join([*build.source.blocks, *lines]), space)
    return {letter: space[letter] for letter in plan.records}


@pytest.mark.parametrize("name", ["vasarhelyi_2018/4ms", "kidger/city", "vasarhelyi_2018/fixed_wing"])
def test_any_order_of_sections_flies_the_same_numbers(name, seed, monkeypatch):
    found = load(name).with_drawn_scene(0)
    rng = np.random.default_rng(seed)
    truth = engine_tables.driver_records(found, 0.2)
    rows = set()
    for _ in range(5):  # the columns are laid out by one order and filled by another: by name they meet
        for module in (scenarios, engine_tables):
            monkeypatch.setattr(module, "ORDER", tuple(ORDER[i] for i in rng.permutation(len(ORDER))))
        fresh = replace(found)  # which holds no plan of another order
        plan = plan_of(fresh, precision=64)
        row = engine_tables.world_tables(fresh, plan, 0).row
        rows.add(tuple(row.tolist()))
        for letter, record in read_by_text(plan, row).items():
            own = truth | {"c": truth["c"]._replace(period=record.period)} if letter == "c" else truth
            for field, value in record._asdict().items():
                assert value == (getattr(own[letter], field) or 0.0), f"{letter}.{field}"
    assert len(rows) > 1  # the orders did differ


def test_sections_are_the_records_of_a_scenario():
    records = {section.field for section in ORDER}
    assert records <= {field.name for field in fields(Scenario)}
    found = load("vasarhelyi_2018/4ms")
    assert set(found.records) == {"model", "", *SECTIONS}
    for section in ORDER:
        own = section.record is None or isinstance(found.records[section.key], section.record)
        assert own or section.key == "body"


def test_commands_wait_for_a_dead_time_in_whole_steps_and_not_where_agents_move_in_turn():
    """A driver reads no number of seconds: it counts steps, and a dead time below half a step is none."""
    base = {"agents": 3, "dt": 0.05}
    found = load("vasarhelyi_2018/4ms", base | {"body.delay": 0.33})
    assert step_counts(found)["lag"] == 7 and "delay" not in found.numbers["b"]
    assert any("body.delay = 0.33 s is rounded to 0.35 s, 7 steps" in note for note in found.notes)
    none = load("vasarhelyi_2018/4ms", base | {"body.delay": 0.02})
    assert plan_of(none) == plan_of(load("vasarhelyi_2018/4ms", base)) != plan_of(found)
    with pytest.raises(ScenarioError, match="body.delay = 0.4 s: with update = 'sequential' no command waits"):
        load("zapotecatl_2016/best", {"body.delay": 0.4})


def test_a_plan_that_is_built_otherwise_and_back_is_itself():
    plan = plan_of(load("vasarhelyi_2018/4ms"))
    assert plan.built(grid=True, record=True).grid and not plan.grid
    assert plan.built(record=True).built(record=False) == plan
    assert not plan.built(grid=True, near=True).built(grid=False).near  # which order parameters need cells for
