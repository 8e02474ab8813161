"""Two ways to hold CMA-ES to a limit: who keeps it comes first, or pycma's augmented Lagrangian.

    python benchmarks/limits.py --runs 8

Flights cost nothing: eleven numbers, a fitness that is best where half of all flights collide, and a smallest distance
whose chance is known. So the probability of a collision of what a search ends with is known, too, and the fitness of
the safest best. Two flights a candidate, as in `airflock tune`; the mean of the last quarter of all generations counts.
"""

import argparse
import warnings
from contextlib import chdir
from tempfile import TemporaryDirectory

import numpy as np
from cma.constraints_handler import AugmentedLagrangian
from scipy.optimize import minimize
from scipy.stats import norm

import airflock
from airflock.certificates.limits import parse_limit, reliability_index, reliability_indices
from airflock.search.limit_excess import allowed_probability, rank_by_excess
from airflock.search.optimisers import CMAES

AXES, SD, GENERATIONS, POPULATION, FLIGHTS = 11, 1.5, 300, 24, 2
SCENARIO = airflock.load("vasarhelyi_2018/6ms")
LIMIT = parse_limit("r_min<3 at 0.01/h", SCENARIO)
ASKED = reliability_index(allowed_probability(LIMIT, SCENARIO) / 10.0)


def distance(points):
    """Mean smallest distance, m, of points (..., axis)."""
    return 2.0 + 16.0 * points[..., 0] + 3.0 * points[..., 1]


def fitness(points):
    """Mean fitness of flights without a collision."""
    return np.exp(-2.0 * points[..., 0] ** 2 - ((points[..., 1:] - 0.4) ** 2).sum(axis=-1))


def searched(how, seed):
    """Probability of a collision of what a search ends with, and its fitness."""
    dice, state, means, lagrange = np.random.default_rng(seed), CMAES(AXES, POPULATION, seed), [], None
    for _ in range(GENERATIONS):
        points = state.ask()
        near = distance(points)[:, None] + SD * dice.standard_normal((POPULATION, FLIGHTS))
        good = fitness(points)[:, None] * np.where(near < LIMIT.value, 0.3, 1.0)
        losses = -(good * (1.0 + 0.05 * dice.standard_normal(near.shape))).mean(axis=1)
        short = ASKED - reliability_indices(LIMIT, [[{"r_min": x} for x in row] for row in near])
        if how == "first":
            losses = rank_by_excess(losses[:, None], np.maximum(short, 0.0))[:, 0]
        elif how == "lagrange":
            lagrange = lagrange or AugmentedLagrangian(AXES)
            if not lagrange.is_initialized:
                lagrange.set_coefficients(losses.tolist(), short[:, None].tolist())
            penalties = np.array([sum(lagrange([x])) for x in short])
            lagrange.update(losses.mean(), [short.mean()])
            losses = losses + penalties
        state.tell(points, losses[:, None])
        means.append(np.clip(state.centre(), 0.0, 1.0))
    mean = np.mean(means[-GENERATIONS // 4 :], axis=0)
    return float(norm.cdf((LIMIT.value - distance(mean)) / SD)), float(fitness(mean))


def main():
    """Print a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=8)
    runs = parser.parse_args().runs
    room = {"type": "ineq", "fun": lambda point: distance(point) - LIMIT.value - ASKED * SD}
    best = minimize(lambda p: -fitness(p), np.full(AXES, 0.5), constraints=[room], bounds=[(0.0, 1.0)] * AXES)
    print(
        f"asked {norm.sf(ASKED):.2g}, allowed {allowed_probability(LIMIT, SCENARIO):.2g}; "
        f"the safe optimum has {-best.fun:.3f}"
    )
    warnings.simplefilter("ignore")
    for how in ("none", "first", "lagrange"):
        chances, found = zip(*(searched(how, seed) for seed in range(runs)), strict=True)
        told = ", ".join(f"{chance:.1g}" for chance in sorted(chances))
        print(f"{how}: collisions {told}; fitness {min(found):.3f} to {max(found):.3f}", flush=True)


if __name__ == "__main__":
    with TemporaryDirectory() as folder, chdir(folder):  # pycma keeps logs of its multipliers where it runs
        main()
