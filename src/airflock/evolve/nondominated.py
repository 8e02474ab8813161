"""Several objectives at once: NSGA-II (Deb et al. 2002) and NSGA-III (Deb & Jain 2014), by the package pymoo."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.errors import StudyError


class Nondominated:
    """Ask for points of the unit cube, tell their losses (candidate, objective)."""

    def __init__(self, algorithm: str, dimension: int, objectives: int, population: int, seed: int):
        """`algorithm` is nsga2 or nsga3, with pymoo's usual operators."""
        self.algorithm = _algorithm(algorithm, dimension, objectives, population, seed)
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


def front(losses: NDArray[np.float64]) -> NDArray[np.int64]:
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


def _algorithm(name: str, dimension: int, objectives: int, population: int, seed: int) -> Any:
    try:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.algorithms.moo.nsga3 import NSGA3
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination
        from pymoo.util.ref_dirs import get_reference_directions
    except ModuleNotFoundError as fault:
        raise StudyError(f"{name} needs pymoo: pip install 'airflock[evolve]'") from fault
    if name == "nsga2":
        algorithm: Any = NSGA2(pop_size=population, eliminate_duplicates=False)
    else:
        directions = get_reference_directions("energy", objectives, max(population // 2, objectives), seed=1)
        algorithm = NSGA3(pop_size=population, ref_dirs=directions, eliminate_duplicates=False)
    problem = Problem(n_var=dimension, n_obj=objectives, xl=np.zeros(dimension), xu=np.ones(dimension))
    algorithm.setup(problem, termination=NoTermination(), seed=seed, verbose=False)
    return algorithm
