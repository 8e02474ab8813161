"""Limits of a search: who keeps them comes first, chances are estimated rightly, the safe optimum is found."""

import math
import random

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import norm
from test_harden import flown_by

import toys
from airflock.certificates.limits import estimated_probability, parse_limit, reliability_indices
from airflock.runs.executors import ThreadExecutor
from airflock.scenarios.files import load
from airflock.search import hardening as harden
from airflock.search.evolution import run_study
from airflock.search.limit_excess import allowed_probability, flights_per_event, limit_excess, rank_by_excess
from airflock.search.study import make_study
from airflock.support.errors import ScenarioError

PAPER = load("vasarhelyi_2018/6ms")
NEAR = "r_min<3 at 1%"
SD = 0.8  # m, of the smallest distance in flights of the toy


def distance(r0_rep):
    """Mean smallest distance of the toy, m: half of all flights collide where it is fittest."""
    return 3.0 + 0.5 * (r0_rep - 15.0)


def fitness(parameters):
    """The fittest is at r0_rep = 15 m, p_rep = 0.2 and v_frict = 1."""
    away = ((parameters["model.r0_rep"] - 15.0) / 20.0) ** 2 + ((parameters["model.p_rep"] - 0.2) / 0.5) ** 2
    return 1.0 - away - ((parameters["model.v_frict"] - 1.0) / 5.0) ** 2


def flight(parameters, seed):
    """A flight of the toy."""
    dice = random.Random(seed)
    r_min = distance(parameters["model.r0_rep"]) + SD * dice.gauss(0.0, 1.0)
    return {"fitness": fitness(parameters) + 0.02 * dice.gauss(0.0, 1.0), "r_min": r_min}


def searched(folder, limits=()):
    """The result of a search on the toy."""
    few = {"population": 12, "generations": 40, "seeds": 4, "averages": 2, "pool": 24, "top": 4, "final_seeds": 100}
    study = toys.study(limits=limits, **few)
    folder.mkdir(exist_ok=True)
    return run_study(study, folder, ThreadExecutor(flight, 1))


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    monkeypatch.setattr("airflock.search.evolution.draw_study", lambda *_: None)


def test_a_search_with_a_limit_finds_the_safe_optimum_and_one_without_leaves_it(tmp_path):
    """The safe optimum is known: as far out as the reserve of ten asks for; a careful final goes somewhat farther."""
    free, safe = searched(tmp_path / "free"), searched(tmp_path / "safe", [NEAR])
    collides = [float(norm.cdf((3.0 - distance(r.parameters["model.r0_rep"])) / SD)) for r in (free, safe)]
    assert collides[0] > 0.2 and collides[1] < 0.01
    nearest, best, farthest = (15.0 + 2.0 * SD * float(norm.isf(p)) for p in (0.01, 0.001, 0.00001))
    assert nearest < safe.parameters["model.r0_rep"] < farthest
    means = safe.finalists[safe.finalists["origin"] == "mean"]["model.r0_rep"]
    assert means.mean() == pytest.approx(best, abs=0.8)  # where it stands: 19.9 m
    assert 1.0 - ((farthest - 15.0) / 20.0) ** 2 - 0.02 < fitness(safe.parameters) < fitness(free.parameters)
    (told,) = safe.limits
    assert told["keeps"] and told["flights"] == 100 and told["allowed"] == pytest.approx(0.01)
    assert not free.limits and "limits" not in free.document() and safe.document()["limits"] == [told]
    again = searched(tmp_path / "safe", [NEAR])  # from stored flights alone
    assert again.document() == safe.document()


def test_where_no_candidate_keeps_a_limit_the_nearest_is_told_to_break_it(tmp_path):
    found = searched(tmp_path, ["r_min<60 at 1%"])
    (told,) = found.limits
    assert not told["keeps"] and told["events"] == told["flights"]
    assert found.parameters["model.r0_rep"] > 75.0  # as far apart as the space allows


@given(
    st.lists(st.tuples(st.floats(-5, 5), st.just(0.0) | st.floats(0.01, 9.0)), min_size=1, max_size=30),
)
def test_who_keeps_limits_comes_first_in_order_of_fitness_then_who_breaks_them_least(rows):
    losses, much = np.array(rows).T
    found = rank_by_excess(losses[:, None], much)[:, 0]
    order = sorted(range(len(rows)), key=lambda i: found[i])
    kept = [i for i in order if much[i] == 0.0]
    assert order[: len(kept)] == kept and (np.diff(losses[kept]) >= 0.0).all()
    assert (np.diff(much[order[len(kept) :]]) >= -1e-5).all()
    assert (found[kept] == losses[kept]).all()


@pytest.mark.parametrize("beta", [0.0, 1.0, 2.0])
def test_chances_come_near_the_probability_of_normal_distances(beta):
    """One candidate of 20,000 flights knows it, and 2,000 equal ones of two flights know it together."""
    rng = np.random.default_rng(5)
    limit = parse_limit("r_min<3 at 1%", PAPER)
    many = [{"r_min": x} for x in 3.0 + beta + rng.standard_normal(20_000)]
    assert estimated_probability(limit, many) == pytest.approx(float(norm.sf(beta)), rel=0.1)
    pairs = 3.0 + beta + rng.standard_normal((2000, 2))
    found = reliability_indices(limit, [[{"r_min": x} for x in pair] for pair in pairs])
    assert found.mean() == pytest.approx(beta, abs=0.1) and np.ptp(found) < 0.7  # nobody is told to be safe by luck
    order = np.argsort(pairs.mean(axis=1))
    assert found[order[:500]].mean() < beta < found[order[-500:]].mean()  # and yet who was nearer is worse


TAILS = {  # how far a flight came nearer than the mean, and the share of flights that came nearer than so much
    "exponential": (lambda rng, n: rng.exponential(1.0, n), lambda x: np.exp(-x)),
    "normal": (lambda rng, n: rng.standard_normal(n), norm.sf),
    "logistic": (lambda rng, n: rng.logistic(size=n), lambda x: 1.0 / (1.0 + np.exp(x))),
    "that ends": (lambda rng, n: rng.uniform(0.0, 1.0, n), lambda x: 1.0 - x),
}


@pytest.mark.parametrize("tail", TAILS)
@pytest.mark.parametrize("rarity", [0.03, 0.003])
def test_what_is_rarer_than_flights_could_count_does_not_look_rarer_than_it_is(tail, rarity):
    """Right where tails are exponential, careful where they fall faster: as the mean beyond a tenth of them says."""
    draw, share = TAILS[tail]
    begin, far = (brentq(lambda x, at=at: share(x) - at, -10.0, 10.0) for at in (0.1, rarity))
    limit_excess = quad(share, begin, 1.0 if tail == "that ends" else 60.0)[0] / 0.1
    known = max(1.0, 0.1 * math.exp(-(far - begin) / limit_excess) / rarity)  # no less than what was counted
    limit, rng = parse_limit("r_min<3 at 1%", PAPER), np.random.default_rng(11)
    many = estimated_probability(limit, [{"r_min": 3.0 + far - x} for x in draw(rng, 200_000)]) / rarity
    assert many == pytest.approx(known, rel=0.05)
    few = [
        estimated_probability(limit, [{"r_min": 3.0 + far - x} for x in draw(rng, 601)]) / rarity for _ in range(200)
    ]
    assert np.quantile(few, 0.1) > 0.5  # where 601 flights show two events, or none


def test_distances_that_meet_by_chance_in_single_precision_keep_their_tail():
    limit, rng = parse_limit("r_min<3 at 1%", PAPER), np.random.default_rng(13)
    nearest = np.float32(9.0 - rng.exponential(1.0, 20_000)).astype(float)
    assert len(np.unique(nearest)) < len(nearest)
    kept = nearest[nearest > 3.5]  # of 20,000 flights none is an event, and a fifth of them says what is beyond
    few = [{"r_min": x} for x in kept[:4000]]
    assert 0.0 < estimated_probability(limit, few) < 0.01


def test_wide_distances_are_no_danger_and_near_ones_are():
    """Of flights that vary alike, those whose long tail lies on the safe side are safer."""
    limit, rng = parse_limit("r_min<3 at 1%", PAPER), np.random.default_rng(7)
    tail = rng.exponential(1.0, 5000)
    wide, near = ([{"r_min": 9.0 + sign * x} for x in tail - tail.mean()] for sign in (1.0, -1.0))
    assert reliability_indices(limit, [wide])[0] > 1.5 * reliability_indices(limit, [near])[0]


def test_what_repeats_itself_is_counted_and_a_flight_that_failed_is_an_event():
    limit = parse_limit("phi_wall>0 at 1%", PAPER)
    clean, touching = [{"phi_wall": 0.0}] * 4, [{"phi_wall": 0.0}, {"phi_wall": 0.3}, {"phi_wall": 0.0}, None]
    always = touching[1::2]
    assert (
        estimated_probability(limit, clean),
        estimated_probability(limit, touching),
        estimated_probability(limit, always),
    ) == (0.0, 0.5, 1.0)
    assert reliability_indices(limit, [clean, touching, always]).tolist() == [np.inf, 0.0, float(norm.isf(0.75))]
    near = parse_limit("r_min<3 at 1%", PAPER)
    assert reliability_indices(near, [[None, {"r_min": 20.0}], [{"r_min": 21.0}, {"r_min": 22.0}]])[0] == 0.0


def test_a_rate_allows_less_in_a_shorter_flight_and_says_how_many_flights_tell():
    limit = parse_limit("r_min<3 at 0.01/h", PAPER)
    whole = allowed_probability(limit, PAPER)
    assert whole == pytest.approx(1.0 - np.exp(-0.01 / 6.0))
    assert allowed_probability(limit, PAPER, 0.5) == pytest.approx(whole / 2.0, rel=1e-3)
    assert flights_per_event([limit], PAPER) == 601 and flights_per_event([], PAPER) == 1
    rows = [[{"r_min": 30.0}, {"r_min": 31.0}], [{"r_min": 3.0}, {"r_min": 4.0}]]
    much = limit_excess(
        [limit], PAPER, rows, reserve=10.0
    )  # both vary by 0.71 m; the second is 0.71 of that off the limit
    assert much.tolist() == pytest.approx([0.0, float(norm.isf(whole / 10.0)) - 0.5**0.5], rel=0.02)


def test_a_study_without_limits_is_what_it_was_and_one_with_them_says_so():
    plain, limited = toys.study(), make_study(
        {"space": toys.SPACE, "objective": {"limits": NEAR}}, "toy", scenario=PAPER, search={"seeds": 2}
    )  # fmt: skip
    assert "limits" not in plain.document() and "reserve" not in plain.document()["search"]
    assert limited.document()["limits"] == [NEAR] and limited.document()["search"]["reserve"] == 10
    assert toys.study(limits=[NEAR]).search.seeds == 2 and toys.study(limits=[NEAR], seeds=1).search.seeds == 1


@pytest.mark.parametrize(
    ("objective", "search", "words"),
    [
        ({"limits": ["r_min<3"]}, {}, "does not say how rarely; write r_min<3 at 0.01/h"),
        ({"limits": ["r_mim<3 at 1%"]}, {}, "unknown order parameter; did you mean r_min"),
        ({"limits": 3}, {}, "objective.limits = 3 is neither a limit nor a list of limits"),
        ({"limit": NEAR}, {}, "objective.limit: unknown key; did you mean objective.limits"),
        ({"limits": NEAR}, {"racing": "optimistic"}, "search.racing: unknown key"),
        ({"limits": NEAR}, {"reserve": 0.5}, r"search.reserve = 0.5 lies outside \[1, 1e\+06\]"),
    ],
)  # fmt: skip
def test_limits_that_cannot_be_are_one_line(objective, search, words):
    with pytest.raises(ScenarioError, match=words):
        make_study({"space": toys.SPACE, "objective": objective}, "toy", search=search, scenario=PAPER)


def test_hardening_pays_more_for_a_limit_that_is_not_kept_and_undoes_what_breaks_one(monkeypatch):
    """More repulsion widens distances here and costs much; more alignment narrows them and costs nothing."""

    def score(p, dice):
        r_min = 2.0 + 400.0 * (p.p_rep - 0.07) - 20.0 * (p.c_frict - 0.05) + dice
        return {"fitness": 1.0 - 4.0 * (p.p_rep - 0.07), "r_min": r_min, "n_coll": 0.0}

    flown_by(monkeypatch, score)
    free = {step.name: step for step in harden.harden(PAPER, range(50))}
    assert "costs 0.14 of fitness" in free["p_rep up"].verdict and not free["on fresh seeds"].kept
    found = {step.name: step for step in harden.harden(PAPER, range(50), limit=NEAR)}
    assert found["p_rep up"].kept and found["p_rep up"].cost[0] == pytest.approx(0.14)
    assert not found["c_frict up"].kept and found["on fresh seeds"].verdict == "kept: p_rep up"
    with pytest.raises(ScenarioError, match="does not say how rarely"):
        harden.harden(PAPER, range(4), limit="r_min<3")
