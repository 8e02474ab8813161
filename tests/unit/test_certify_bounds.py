"""Bounds of certify: exact by themselves, and all together where the truth is known."""

from functools import cache
from itertools import takewhile

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.stats import binomtest

from airflock.certificates import campaign as seeds
from airflock.certificates.certificate import event_timing
from airflock.certificates.limits import (
    flights_needed,
    look_schedule,
    lower_bound,
    probability_per_flight,
    rate_per_hour,
    take_look,
)
from airflock.recordings.rare_events import upper_probability_bound
from airflock.scenarios.files import load
from airflock.scenarios.scenario_builder import rebuilt
from airflock.search.study import load_study


@given(st.integers(1, 3000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))), st.floats(0.5, 0.9999))
def test_bounds_are_those_of_clopper_and_pearson(counts, confidence):
    k, n = counts
    above, below = (binomtest(k, n, alternative=side).proportion_ci(confidence) for side in ("less", "greater"))
    assert upper_probability_bound(k, n, confidence) == pytest.approx(above.high, rel=1e-9)
    assert lower_bound(k, n, confidence) == pytest.approx(below.low, rel=1e-9, abs=1e-12)


@given(st.floats(1e-6, 0.5), st.floats(1e-4, 0.2))
def test_the_first_upper_bound_shows_a_limit_with_no_flight_to_spare(limit, alpha):
    n = flights_needed(limit, alpha)
    assert upper_probability_bound(0, n, 1.0 - alpha) <= limit * (1.0 + 1e-9)
    assert n == 1 or upper_probability_bound(0, n - 1, 1.0 - alpha) > limit * (1.0 - 1e-9)


@given(st.floats(1e-6, 0.4), st.floats(1e-3, 0.2))
def test_looks_grow_and_never_pay_more_than_there_is(limit, alpha):
    looks = [due for due, _ in zip(look_schedule(limit, alpha), range(60), strict=False)]
    assert all(a[0] < b[0] for a, b in zip(looks, looks[1:], strict=False))
    assert sum(above for _, above, _ in looks) <= alpha and sum(below for _, _, below in looks) <= alpha


def outcomes(rng, truth, limit, alpha, flocks, most):
    """(shown, refuted) of many campaigns of up to `most` flights whose events have the probability `truth`."""
    looks = list(takewhile(lambda due: due[0] <= most, look_schedule(limit, alpha)))
    found = cache(take_look)
    sizes = np.diff([0, *(size for size, _, _ in looks)])
    events = rng.binomial(sizes, truth, (flocks, len(looks))).cumsum(axis=1)
    shown = refuted = 0
    for row in events:
        bounds = [found(n, int(k), above, below) for k, (n, above, below) in zip(row, looks, strict=True)]
        high, low = min(b.high for b in bounds), max(b.low for b in bounds)
        shown, refuted = shown + (high <= limit), refuted + (low > limit)
    return shown / flocks, refuted / flocks


@pytest.mark.parametrize(("limit", "alpha"), [(0.05, 0.05), (0.01, 0.1), (0.2, 0.05)])
def test_what_is_false_is_shown_no_more_often_than_promised_over_all_looks(limit, alpha, seed):
    rng, flocks = np.random.default_rng(seed), 2000
    slack = 3.0 * np.sqrt(alpha * (1.0 - alpha) / flocks)
    shown, refuted = outcomes(rng, limit, limit, alpha, flocks, 200 / limit)
    assert shown <= alpha + slack and refuted <= alpha + slack
    for factor, right in ((0.3, 0), (3.0, 1)):  # and what is clearly so is nearly always found
        found = outcomes(rng, factor * limit, limit, alpha, 200, 200 / limit)
        assert found[right] > 0.9 and found[1 - right] <= 0.05


@given(st.floats(1e-9, 0.999), st.floats(1e-3, 10.0))
def test_a_rate_and_a_probability_per_flight_are_one_another(p, hours):
    assert probability_per_flight(rate_per_hour(p, hours), hours) == pytest.approx(p, rel=1e-9)


def test_events_of_an_even_rate_are_even_and_those_of_a_bad_start_are_not(seed):
    rng = np.random.default_rng(seed)
    times = rng.exponential(900.0, 4000)
    even = event_timing([t for t in times if t < 600.0], 4000, 600.0)
    assert even.chance > 1e-4 and even.expected == pytest.approx(1.0 / (1.0 + np.exp(-300.0 / 900.0)), rel=0.02)
    assert event_timing(list(rng.uniform(0.0, 200.0, 100)), 4000, 600.0).verdict == "uneven"
    assert event_timing([1.0] * 9, 4000, 600.0).verdict == "too few events to say"


def test_seeds_of_search_choice_and_certification_never_meet():
    """Those given by hand are small; every part of every study lies above them, every certificate above all studies."""
    study = load_study("vasarhelyi_2018/6ms", search={"seed": 2**20})
    largest = study.seed(15, 2**36 - 1)
    assert 2**40 <= load_study("vasarhelyi_2018/6ms").seed(0, 0) < largest < seeds.FIRST
    parts = (seeds.COUNT_PURPOSE, seeds.TOLERANCE_PURPOSE, seeds.SPLIT_PURPOSE, seeds.MAP_PURPOSE)
    ends = [seeds.certificate_seed("f" * 64, part, number) for part in parts for number in (0, 2**30 - 1)]
    assert ends == sorted(set(ends)) and ends[-1] < 2**63 and seeds.certificate_seed("0" * 64, 0, 0) == seeds.FIRST


def test_a_scenario_fixes_its_seeds_by_what_decides_a_flight_and_by_nothing_else():
    scenario = load("vasarhelyi_2018/4ms")
    one = seeds.scenario_identity(scenario)
    assert one == seeds.scenario_identity(rebuilt(scenario, {"title": "lucky", "metrics.r_coll": 1.0}))
    others = [{"model.p_rep": 0.2}, {"agents": 99}, {"radio.delay": 0.5}, {"world.side": 200.0}]
    assert len({one, *(seeds.scenario_identity(rebuilt(scenario, other)) for other in others)}) == 5
