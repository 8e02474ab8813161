"""What an order parameter means is told by the set that a flight is scored with."""

from airflock.metrics.registry import SETS, reports


def test_each_kind_tells_of_its_own_fitness():
    """A fitness is a power with a unit for birds, a product of factors for drones; quality has none."""
    assert reports(SETS["dimock"])["fitness"][0] == "W"
    assert "product" in reports(SETS["vasarhelyi"])["fitness"][1]
    assert "f_goals" in reports(SETS["kidger"])["fitness"][1]
    assert "fitness" not in reports(SETS["zapotecatl"])


def test_every_name_has_a_meaning():
    for kind in SETS:
        assert all(meaning for _, meaning in reports(SETS[kind]).values()), kind
