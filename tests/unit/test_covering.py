"""The fixed sets of flights hold what they say: every kind in twelve, every pair of kinds in a hundred."""

from itertools import combinations

import covering


def test_every_kind_is_held_by_at_most_twelve_flights():
    kinds = [covering.held(covering.build(name)) for name in covering.PLANS]
    assert set().union(*kinds) == covering.EVERY
    assert len(kinds) <= 12


def test_every_pair_of_kinds_is_held_by_at_most_a_hundred_flights():
    """Counted from the plans of the flights, not from what was asked of them."""
    flights = covering.pairs()
    found = [frozenset(pair) for one in flights for pair in combinations(covering.held(covering.flight(one)), 2)]
    assert set(found) >= covering.PAIRS
    assert len(flights) <= 100
    assert flights == covering.pairs()  # the same in every run, so that a night goes on where the last one stopped
