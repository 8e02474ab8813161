"""Splitting, driven through a random walk whose rare falls are known exactly; and when it gives no number."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from airflock.certificates.campaign import Campaign
from airflock.certificates.counting import CampaignFlyer
from airflock.certificates.limits import parse_limits
from airflock.certificates.splitting import (
    Lineage,
    LineageFlight,
    LineageFlyer,
    Repetition,
    estimate_probability,
    run_repetition,
)
from airflock.runs.flight_store import FlightStore
from airflock.scenarios.files import load

STEPS, HEIGHT = 100, 100.0


def walk(lineage):
    """Falls of a walk of steps -1 and 1 from HEIGHT; the random numbers are those of the lineage's worlds."""
    steps = np.empty(STEPS, int)
    for begin, world in ((0, 0), *lineage.branches):
        steps[begin:] = 2 * np.random.default_rng([lineage.seed, world]).integers(0, 2, STEPS)[begin:] - 1
    path = HEIGHT + np.concatenate([[0], steps.cumsum()])
    running = np.minimum.accumulate(path)
    return [(k, running[k]) for k in np.flatnonzero(np.diff(running, prepend=np.inf) < 0.0)]


def truth(depth):
    """P(the walk falls by `depth` within STEPS): P(S <= -depth) + P(S < -depth), by reflection."""
    ups = (STEPS - depth) // 2  # S <= -depth is at most so many steps up
    return binom.cdf(ups, STEPS, 0.5) + binom.cdf(ups - (1 if (STEPS - depth) % 2 == 0 else 0), STEPS, 0.5)


def test_the_exact_probability_is_that_of_counting(seed):
    falls = [walk(Lineage(seed * 100_000 + i))[-1][1] for i in range(4000)]
    share = np.mean(np.array(falls) <= HEIGHT - 20)
    assert share == pytest.approx(truth(20), abs=4.0 * math.sqrt(truth(20) / 4000))


def repetitions(seed, count, depth, counted=400, start=100):
    made, values = [], []
    for number in range(count):
        first = [
            LineageFlight(x, walk(x)) for x in (Lineage(seed * 10**6 + number * counted + i) for i in range(counted))
        ]
        values += [particle.least for particle in first]
        near = sorted(first, key=lambda particle: particle.least)[:start]
        rng = np.random.default_rng([seed, number])
        fly = lambda batch, lineages: [walk(x) for x in lineages]  # noqa: E731
        made.append(run_repetition(near, counted, HEIGHT - depth, fly, 10.0, rng, size=100))
    return made, values


def test_splitting_finds_the_probability_of_a_rare_fall(seed):
    """A fall of 34 in 100 steps: about 1 in 1,500, where 400 flights see nothing or one."""
    made, values = repetitions(seed, 12, 34)
    found = np.array([r.probability(HEIGHT - 34) for r in made])
    error = found.std(ddof=1) / math.sqrt(len(found))
    assert found.mean() == pytest.approx(truth(34), abs=4.0 * error) and error < 0.4 * truth(34)
    told = estimate_probability(made, HEIGHT - 34, values)
    assert not told.refused and told.low < truth(34) * 1.5 and told.high > truth(34) / 1.5


def test_every_flight_that_is_found_is_flown_again_by_its_lineage(seed):
    (made,), _ = repetitions(seed, 1, 30)
    assert made.last and all(walk(p.lineage) == p.falls and p.least <= HEIGHT - 30 for p in made.last)


def test_a_branch_changes_nothing_before_it():
    one = Lineage(3, ((10, 5), (40, 6)))
    assert one.branch(40, 7).branches == ((10, 5), (40, 7)) and one.branch(7, 9).branches == ((7, 9),)
    before, after = (dict(walk(x)) for x in (one, one.branch(60, 8)))
    assert {k: v for k, v in before.items() if k <= 60} == {k: v for k, v in after.items() if k <= 60}


def test_splitting_that_goes_on_after_more_flights_takes_no_flight_of_the_one_before_for_its_own(tmp_path, monkeypatch):
    """It starts from other flights then, so that flights of the same number are other ones."""
    monkeypatch.setattr(
        "airflock.certificates.splitting.record_falls", lambda _, lineage, *rest: [list(f) for f in walk(lineage)]
    )
    scenario = load("vasarhelyi_2018/real_6ms")
    with FlightStore(tmp_path) as store:
        flyer = CampaignFlyer(Campaign(scenario, parse_limits(["r_min<1 at 1e-3/h"], scenario)), store, None)
        for counted, seed in ((400, 1), (800, 2), (400, 1)):
            (found,) = LineageFlyer(flyer, 0, 1, counted)(0, [Lineage(seed)])
            assert found == [list(f) for f in walk(Lineage(seed))]


def synthetic(p, ancestors=20):
    """A repetition that says: half of the flights of the level 5 are below 1, and these are p of all."""
    last = [LineageFlight(Lineage(i), [(0, 0.5)]) for i in range(ancestors)]
    return Repetition([(5.0, 2.0 * p), (1.0, p)], last, [(5.0, 2.0 * p, [0.5, 3.0] * 50)])


def test_no_number_is_given_where_counting_says_otherwise_or_too_few_flights_are_behind_it():
    values = [0.5] * 50 + [9.0] * 9950
    ps = (0.0048, 0.005, 0.0052, 0.0049, 0.0051)
    sound = estimate_probability([synthetic(p) for p in ps], 1.0, values)
    assert not sound.refused and sound.low < 0.005 < sound.high
    low = estimate_probability([synthetic(0.1 * p) for p in ps], 1.0, values)
    assert "disagrees with counting" in low.refused and math.isnan(low.probability)
    few = estimate_probability([synthetic(p, ancestors=3) for p in ps], 1.0, values)
    assert "stem from 3 first flights or fewer" in few.refused
    never = estimate_probability([*(synthetic(p) for p in ps), Repetition([(5.0, 0.01)], [])], 1.0, values)
    assert "5 of 6 repetitions came so far" in never.refused
