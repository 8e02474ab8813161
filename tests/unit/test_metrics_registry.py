"""What an order parameter means is told by the set that a flight is scored with."""

from airflock.parts.metrics.metric_sets import METRICS, SETS, reported_values


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
