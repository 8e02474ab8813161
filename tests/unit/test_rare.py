"""What flights can say of rare events: the bound of Clopper and Pearson, and the worst seed."""

import pytest
from hypothesis import given, strategies as st
from scipy.stats import binom

from airflock.recordings.rare_events import rare_event_notes, upper_probability_bound


@given(st.integers(1, 2000).flatmap(lambda n: st.tuples(st.integers(0, n - 1), st.just(n))))
def test_at_the_bound_so_few_events_have_a_chance_of_one_in_twenty(pair):
    events, flights = pair
    assert binom.cdf(events, flights, upper_probability_bound(events, flights)) == pytest.approx(0.05, rel=1e-6)


def test_no_event_is_the_rule_of_three_and_every_flight_says_nothing():
    assert upper_probability_bound(0, 100) == pytest.approx(1.0 - 0.05 ** (1.0 / 100.0), rel=1e-9)
    assert upper_probability_bound(0, 1000) == pytest.approx(3.0 / 1000.0, rel=0.01)
    assert upper_probability_bound(5, 5) == 1.0


def test_remarks_name_the_bound_and_the_worst_seed():
    rows = [{"n_coll": 0.0, "fitness": 0.9}, {"n_coll": 2.0, "fitness": 0.1}, {"n_coll": 0.0, "fitness": 0.8}]
    first, second = rare_event_notes(rows, [4, 5, 6])
    assert first.startswith("collisions in 1 of 3 flights: with 95 % confidence, at most 86 %")
    assert second.startswith("worst flight: seed 5, fitness 0.1")
    assert rare_event_notes(rows[:1], [4]) == [] and rare_event_notes([{"quality": 1.0}] * 2, [0, 1]) == []
