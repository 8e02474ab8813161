"""Groups in large flocks: by cells each agent meets whom it meets among all pairs, whatever its numbers and its law."""

from pathlib import Path

import numpy as np
import pytest

import airflock
import wary as wary_law
from airflock.engine import driver_text, plan_of
from airflock.scenarios import cost
from airflock.scenarios.cost import estimated_seconds
from airflock.scenarios.files import load
from inside import cpu, tables

SCHOOL = {
    "agents": 90, "duration": 2.0, "start.kind": "ball", "start.radius": 4.0, "metrics.kind": "order",
    "metrics.period": 0.2,
}  # fmt: skip
FAR = {"name": "far", "agents": 10, "model": {"r_r": 2.0, "dr_a": 6.0}}
PARTICLES = [
    {"name": f"particles {r:g}", "agents": 15, "model": {"kind": "vicsek_1995", "r": r, "eta": 0.3}} for r in (1.5, 3.0)
]
BOX = {"start.kind": "arena", "start.separation": 0.0, "world.arena": "square", "world.edges": "periodic",
       "world.side": 26.0, "world.height": 26.0, "model.dr_a": 5.0}  # fmt: skip


@pytest.fixture
def wary(tmp_path):
    """A law that asks for groups, remembers, draws, does not ask how it moves itself, and looks 3 m far."""
    text = Path(wary_law.__file__).read_text(encoding="utf-8")
    text = text.replace('COMMAND = "velocity"', 'COMMAND = "heading"')
    (tmp_path / "wary.py").write_text(text + "\n\ndef reach(p):\n    return 3.0\n", encoding="utf-8")
    return str(tmp_path / "wary.py")


@pytest.fixture
def soon(monkeypatch):
    """Flocks go by cells from 50 agents on."""
    monkeypatch.setattr(cost, "GRID_FROM", 50)


def test_laws_and_numbers_fly_by_cells_as_among_all_pairs(wary, soon):
    """Two laws, one with numbers that differ; some fail; later groups change. Twins fly on as they were."""
    box = {"agents": 90, "world.side": 14.0, "duration": 20.0, "model.r": 1.0, "model.eta": 0.3}
    far = {"name": "far", "agents": 20, "model": {"r": 2.5}}
    first = [{"name": "wary", "agents": 20, "model": {"kind": wary}}, far]
    then = [{"name": "wary", "agents": 30, "model": {"kind": wary, "k": 2.0}}, far]
    fails = [{"kind": "fails", "at": 7.0, "agents": [3, 25, 40, 60, 89]}]
    flown = []
    for device in ("python", "cpu"):
        scenario = load("vicsek_1995/transition", {**box, "groups": first, "faults": fails}, trust=True)
        assert len(scenario.laws) == 2 and plan_of(scenario).grid
        flight = airflock.open(scenario, 2, device=device, record=True, precision=64).advance(10.0)
        twin = flight.branch()
        flight.change({"groups": then})
        flight.finish()
        twin.finish()
        flown.append([np.array(each.frames) for each in (flight, twin)])
    (changed, plain), by_cells = flown
    assert np.nanmax(np.abs(changed - plain)) > 0.1
    for one, two in zip((changed, plain), by_cells, strict=True):
        np.testing.assert_allclose(two, one, rtol=0.0, atol=1e-9)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("groups", "more"),
    [
        ([FAR], {}),
        ([FAR, *PARTICLES], {}),
        ([{"name": "drawn", "agents": 40, "model": {"r_r": {"value": 1.0, "spread": 0.4}}}], {}),
        ([*PARTICLES], {"topology.kind": "nearest", "topology.k": 4}),
        ([FAR, *PARTICLES], BOX),
        ([FAR], {**BOX, "world.dimensions": "2", "model.sigma": 0.2}),
    ],
    ids=["numbers", "laws", "tolerances", "nearest", "periodic laws", "periodic plane"],
)
def test_groups_of_many_kinds_fly_by_cells_as_among_all_pairs(groups, more, seed):
    scenario = load("couzin_2002/torus", {**SCHOOL, "agents": 150, **more, "groups": groups})
    plans = [plan_of(scenario, precision=64, record=True, grid=grid) for grid in (True, False)]
    assert plans[0].grid
    by_cells, by_pairs = (
        cpu.fly_on_cpu(plan, tables(scenario, plan, seed), None, device).frames
        for plan, device in zip(plans, ("cpu", "python"), strict=True)
    )
    np.testing.assert_allclose(by_cells, by_pairs, rtol=0.0, atol=1e-9)


def test_a_law_that_does_not_ask_how_it_moves_itself_has_a_driver_by_cells(wary):
    scenario = load(
        "couzin_2002/torus", {**SCHOOL, "agents": 1000, "groups": [{"agents": 1, "model": {"kind": wary}}]}, trust=True
    )
    assert plan_of(scenario).grid and "def neighbours_1(" in driver_text(scenario)


@pytest.mark.parametrize("reach", [12.9, 13.1])
def test_a_box_has_room_for_cells_where_it_is_two_of_the_widest_reaches_wide(reach, soon):
    """The reach of the few who look far counts, in their law as in one of their own."""
    school = {**SCHOOL, **BOX, "agents": 60}
    for model in ({"dr_a": reach - 1.0 - 2.0, "r_r": 1.0, "dr_o": 2.0}, {"kind": "vicsek_1995", "r": reach}):
        found = load("couzin_2002/torus", {**school, "groups": [{"name": "far", "agents": 1, "model": model}]})
        assert plan_of(found).grid == (reach < 13.0)
        assert any("the box is less than two of their reaches wide" in note for note in found.notes) == (reach > 13.0)


def test_a_reach_of_chance_flies_by_cells_in_the_open_alone(soon):
    def drawn(name, **more):
        own = {"name": "a", "agents": 9, "model": {name: {"value": 0.5, "spread": 0.1}}}
        return load("couzin_2002/torus", {**SCHOOL, **more, "groups": [own]})

    assert plan_of(drawn("r_r")).grid and plan_of(drawn("sigma", **BOX)).grid
    found = drawn("r_r", **BOX)
    assert not plan_of(found).grid and any("their reach is drawn" in note for note in found.notes)


def test_a_law_without_a_reach_keeps_a_large_flock_from_cells_and_a_note_says_so(wary):
    text = Path(wary).read_text(encoding="utf-8").partition("\n\n\ndef reach")[0]
    Path(wary).write_text(text, encoding="utf-8")
    group = {"name": "wary", "agents": 20, "model": {"kind": wary}}
    large = {**SCHOOL, "agents": 2000, "groups": [group]}
    found, plain = load("couzin_2002/torus", large, trust=True), load("couzin_2002/torus", {**large, "groups": []})
    assert not plan_of(found).grid and estimated_seconds(found) > 10.0 * estimated_seconds(plain)
    assert any("wary sees without limit" in note and "on one core" in note for note in found.notes)
