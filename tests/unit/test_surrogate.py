"""The benchmark's lq-CMA-ES by ask and tell is that of pycma, which calls a function: the same points, bit by bit."""

import sys
from pathlib import Path

import numpy as np
import pytest
from cma.fitness_models import SurrogatePopulation

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from surrogate import LqCMAES  # noqa: E402

from airflock.search.optimisers import CMAES  # noqa: E402


def bowl(x):
    return float(np.sum(np.arange(1.0, 6.0) * (np.asarray(x)[:5] - 0.3) ** 2))


def rough(x):
    """No model of it ranks as it does: most generations fly as a whole."""
    return bowl(x) + 5.0 * np.sin(1e6 * float(np.sum(x)))


@pytest.mark.parametrize("function", [bowl, rough])
def test_it_asks_for_what_pycma_flies(function):
    ours, known = LqCMAES(5, 12, 7), CMAES(5, 12, 7)
    flown = []

    def fly(x):
        flown.append(np.array(x))
        return function(x)

    surrogate = SurrogatePopulation(fly)
    for _ in range(25):
        points = known.strategy.ask()
        known.strategy.tell(points, surrogate(points))
    asked = []
    while ours.generations < 25:
        points = ours.ask()
        asked += list(points)
        ours.tell(points, np.array([[function(x)] for x in points]))
    assert np.array_equal(np.array(asked), np.array(flown)) and np.array_equal(ours.centre(), known.centre())
    share = len(flown) / (25 * 12)
    assert share < 0.3 if function is bowl else share > 0.6, share
