"""Several objectives at once: NSGA-II (Deb et al. 2002), by the package pymoo."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.support import StudyError


class NonDominatedSorting:
    """Ask for points of the unit cube, tell their losses (candidate, objective)."""

    def __init__(self, dimension: int, objectives: int, population: int, seed: int):
        """Set up NSGA-II with pymoo's default operators."""
        self.algorithm = _algorithm(dimension, objectives, population, seed)
        self.asked: Any = None

    def ask(self) -> NDArray[np.float64]:
        """Next generation (candidate, axis)."""
        self.asked = self.algorithm.ask()
        return np.array(self.asked.get("X"), float)

    def tell(self, points: NDArray[np.float64], losses: NDArray[np.float64]) -> None:
        """Losses (candidate, objective) of the points that were asked for."""
        self.asked.set("F", np.asarray(losses, float))
        self.algorithm.tell(infills=self.asked)

    def centre(self) -> None:
        """None: a front has no mean."""


def pareto_front(losses: NDArray[np.float64]) -> NDArray[np.int64]:
    """Indices of the candidates that no other one betters in all objectives; losses (candidate, objective)."""
    order = np.lexsort(losses.T[::-1])
    kept = np.empty(len(losses), np.int64)
    n = 0
    for i in order:
        row = losses[i]
        better = losses[kept[:n]]
        if np.isfinite(row).all() and not ((better <= row).all(axis=1) & (better < row).any(axis=1)).any():
            kept[n], n = i, n + 1
    return np.sort(kept[:n])


def _algorithm(dimension: int, objectives: int, population: int, seed: int) -> Any:
    try:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination
    except ModuleNotFoundError as fault:
        raise StudyError("nsga2 needs pymoo: pip install 'airflock[evolve]'") from fault
    algorithm = NSGA2(pop_size=population, eliminate_duplicates=False)
    problem = Problem(n_var=dimension, n_obj=objectives, xl=np.zeros(dimension), xu=np.ones(dimension))
    algorithm.setup(problem, termination=NoTermination(), seed=seed, verbose=False)
    return algorithm
