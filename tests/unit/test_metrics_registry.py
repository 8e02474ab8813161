"""What an order parameter means is told by the set that a flight is scored with."""

import pytest

import airflock
from airflock.parts import METRICS, SETS
from airflock.parts.metrics.metric_sets import reported_values


def test_each_kind_tells_of_its_own_fitness():
    """A fitness is a power with a unit for birds, a product of factors for drones; quality has none."""
    assert reported_values(SETS["dimock"])["fitness"][0] == "W"
    assert "product" in reported_values(SETS["vasarhelyi"])["fitness"][1]
    assert "f_goals" in reported_values(SETS["kidger"])["fitness"][1]
    assert "fitness" not in reported_values(SETS["zapotecatl"])


def test_every_name_has_a_meaning():
    for kind in SETS:
        assert all(meaning for _, meaning in reported_values(SETS[kind]).values()), kind


def test_every_order_parameter_says_what_it_is_while_some_are_absent():
    """Of sums it is pooled, of means each instant counts once, whoever is there."""
    said = {name: metric.absence(name) for metric in METRICS.values() for name in metric.reports}
    for name, how in {
        "phi_vel": "mean over instants", "phi_wall": "mean over agents and instants", "n_coll": "counted",
        "r_min": "smallest", "clearance": "smallest",
    }.items():  # fmt: skip
        assert how in said[name], name
    assert all("who are there" in how for how in said.values())


@pytest.mark.parametrize("kind", ["groups", "zapotecatl"])
def test_without_a_largest_extension_only_what_needs_it_is_missing(kind):
    """And has a number as soon as metrics.max_e or an arena says it; all else has the same bits in any case."""
    free = {"world.arena": "none", "world.edges": "open", "start.kind": "ball", "start.radius": 5.0, "agents": 6}
    keys = {**free, "duration": 2.0, "metrics.kind": kind}
    open_air = airflock.load("vicsek_1995/ordered", keys)
    said = [note for note in open_air.notes if note.startswith("metrics.max_e is missing")]
    without, known = (
        airflock.score(airflock.load("vicsek_1995/ordered", {**keys, **more}), [3], device="python").iloc[0]
        for more in ({}, {"metrics.max_e": 50.0})
    )
    missing = {name for name in without.index if name in known.index and without[name] != without[name]}
    assert missing == {name for name in known.index if name.startswith(("cns_ext", "quality"))} and len(said) == 1
    assert known[sorted(missing)].notna().all() and all(name in said[0] for name in missing)
    rest = [name for name in known.index if name not in missing]
    assert without[rest].equals(known[rest])
    tracks = airflock.simulate(open_air, 3, device="python")
    assert set(airflock.score(tracks).columns) >= {"f_collision", "cns_pol"}
    assert not {"cns_ext", "quality"} & set(airflock.score(tracks).columns)
