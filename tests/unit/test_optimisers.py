"""Optimisers on problems whose answer is known, and that their chance is their own."""

import numpy as np
import pytest

import toys
from airflock.runs.executors import ThreadExecutor
from airflock.runs.flight_store import FlightStore
from airflock.search.generations import Evaluator, race_candidates
from airflock.search.optimisers import binary_genetic, decode, make_optimiser, pareto_front
from airflock.search.study import Objective, candidate_losses
from airflock.support.errors import StudyError
from airflock_papers.dimock_2003.ga import minimise_over_bits


def run(algorithm, f, dimension, objectives, population, generations, seed):
    state = make_optimiser(algorithm, dimension, objectives, population, seed)
    for _ in range(generations):
        points = state.ask()
        assert points.shape == (population, dimension) and points.min() >= 0.0 and points.max() <= 1.0
        state.tell(points, f(points).reshape(population, objectives))
    return state, points, f(points)


def sphere(x):
    return ((x - 0.3) ** 2).sum(axis=1)


def rosenbrock(x):
    """Its valley in [-2, 2]^n; the optimum, 0, lies at (1, 1, ...), that is 0.75 of each range."""
    y = 4.0 * x - 2.0
    return (100.0 * (y[:, 1:] - y[:, :-1] ** 2) ** 2 + (1.0 - y[:, :-1]) ** 2).sum(axis=1)


def zdt1(x):
    """Zitzler, Deb & Thiele 2000: the front is f2 = 1 - sqrt(f1)."""
    g = 1.0 + 9.0 * x[:, 1:].mean(axis=1)
    return np.stack([x[:, 0], g * (1.0 - np.sqrt(x[:, 0] / g))], axis=1)


def test_cma_es_finds_the_optimum_of_the_sphere_and_of_rosenbrock(seed):
    assert np.allclose(run("cmaes", sphere, 11, 1, 20, 150, seed)[0].centre(), 0.3, atol=1e-3)
    assert np.allclose(run("cmaes", rosenbrock, 5, 1, 30, 250, seed)[0].centre(), 0.75, atol=1e-3)


def test_cma_es_takes_one_dimension_and_optima_on_the_bounds(seed):
    centre = run("cmaes", lambda x: x.sum(axis=1), 1, 1, 10, 60, seed)[0].centre()
    assert centre.shape == (1,) and 0.0 <= centre[0] < 1e-3


def test_cma_es_begins_in_the_middle_with_a_sixth_of_the_range(seed):
    points = np.concatenate([make_optimiser("cmaes", 4, 1, 100, seed + i).ask() for i in range(20)])
    assert np.allclose(points.mean(axis=0), 0.5, atol=0.02)
    assert np.allclose(points.std(axis=0), 1.0 / 6.0, rtol=0.05)


def test_genetic_algorithm_finds_all_ones_and_the_cell_of_a_sphere(seed):
    ones = minimise_over_bits(lambda bits: 30.0 - bits.sum(axis=1), 30, generations=120, seed=seed)
    assert ones.loss <= 1.0 and len(ones.best) == 120
    near = minimise_over_bits(lambda bits: sphere(decode(bits)), 50, generations=150, seed=seed)
    assert near.loss < 0.01


def test_nondominated_sorting_reaches_the_front_of_zdt1(seed):
    _, _, found = run("nsga2", zdt1, 10, 2, 60, 120, seed)
    best = found[pareto_front(found)]
    assert len(best) >= 25
    away = np.abs(best[:, 1] - (1.0 - np.sqrt(best[:, 0])))
    assert np.median(away) < 0.01 and np.quantile(away, 0.9) < 0.05
    assert best[:, 0].min() < 0.05 and best[:, 0].max() > 0.9


@pytest.mark.parametrize(("algorithm", "objectives"), [("cmaes", 1), ("ga", 1), ("nsga2", 2)])
def test_same_seed_same_points_whatever_others_draw(algorithm, objectives, seed):
    f = zdt1 if objectives == 2 else sphere
    first = run(algorithm, f, 4, objectives, 20, 5, seed)[1]
    np.random.default_rng().random(7)
    np.random.seed(seed + 1)  # noqa: NPY002 - a library that draws from the shared generator would notice
    assert np.array_equal(first, run(algorithm, f, 4, objectives, 20, 5, seed)[1])
    assert not np.array_equal(first, run(algorithm, f, 4, objectives, 20, 5, seed + 1)[1])


def test_chromosomes_decode_by_1024_with_the_highest_bit_first():
    bits = np.zeros((2, 20), bool)
    bits[0, 0] = bits[0, 19] = True
    bits[1] = True
    assert decode(bits).tolist() == [[0.5, 1.0 / 1024.0], [1023.0 / 1024.0] * 2]


def test_generations_of_the_genetic_algorithm_replace_their_parents(seed):
    """Without selection, cut or flip, children are copies of parents; with a flip of every bit, their negatives."""
    state = binary_genetic(16, 20, seed, mutation=0.0, crossover=0.0)
    first = state.ask()
    state.tell(first, np.zeros(20))
    second = state.ask()
    assert {tuple(row) for row in second} <= {tuple(row) for row in first}
    flipped = binary_genetic(16, 20, seed, mutation=1.0, crossover=0.0)
    first = flipped.ask()
    flipped.tell(first, np.zeros(20))
    assert {tuple(~row) for row in flipped.ask()} <= {tuple(row) for row in first}
    with pytest.raises(StudyError, match="odd"):
        binary_genetic(10, 5)


def test_front_holds_exactly_those_whom_nobody_betters(seed):
    table = np.random.default_rng(seed).random((80, 3)).round(1)
    brute = [i for i, a in enumerate(table) if not any((b <= a).all() and (b < a).any() for b in table)]
    assert pareto_front(table).tolist() == brute


def test_failed_candidates_lose_against_all_of_their_generation():
    up, down = Objective("a"), Objective("b", maximise=False)
    table = candidate_losses([[1.0, 1.0], [None, None], [3.0, 5.0]], (up, down))
    assert table.tolist() == [[-1.0, 1.0], [0.0, 6.0], [-3.0, 5.0]]
    assert candidate_losses([[None]], (up,)).tolist() == [[1.0]]


def test_objectives_over_seeds():
    flights = [{"f": value} for value in (4.0, 1.0, 3.0, 2.0)]
    assert Objective("f").of_candidate(flights) == 2.5
    assert Objective("f", over_seeds="worst").of_candidate(flights) == 1.0
    assert Objective("f", False, "worst").of_candidate(flights) == 4.0
    assert Objective("f", over_seeds="quantile", quantile=1.0 / 3.0).of_candidate(flights) == 2.0
    assert Objective("f", False, "quantile", 1.0 / 3.0).of_candidate(flights) == 3.0
    assert Objective("f").of_candidate([*flights, None]) is None
    assert Objective("f").of_candidate([{"f": float("nan")}]) is None
    assert Objective("x", own=lambda v: v["f"] * 2.0).of_candidate(flights) == 5.0


def test_race_finds_the_best_where_one_flight_says_little(tmp_path, seed):
    """The noise of a flight is ten times what the best hundred candidates differ by."""
    study = toys.study(pool=200, top=5)
    rng = np.random.default_rng(seed)
    points = rng.random((2000, 3))
    noisy = ThreadExecutor(lambda p, s: {"fitness": toys.bowl(p | {"model.p_rep": 0.2}, s, noise=0.1)["fitness"]}, 2)
    given = [study.space.parameters(point) | {"model.p_rep": 0.2} for point in points]
    true = np.array([toys.bowl(parameters, 0, noise=0.0)["fitness"] for parameters in given])
    with FlightStore(tmp_path) as store:
        winners = race_candidates(Evaluator(study, store, noisy), points, -(true + rng.normal(0.0, 0.1, len(true))))
    noisy.close()
    ranks = np.argsort(np.argsort(-true))[winners]
    assert len(winners) == 5 and np.median(ranks) < 200
