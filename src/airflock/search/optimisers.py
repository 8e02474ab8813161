"""Optimisers by name, behind one interface: ask for points of the unit cube, tell their losses."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from airflock.search.cmaes import CMAES, START_SIGMA

ALGORITHMS = ("cmaes", "ga", "nsga2")
MULTI_OBJECTIVE = "nsga2"  # the one for several objectives


class Optimiser(Protocol):
    """State of a search. The same seed and the same losses give the same points, bit by bit."""

    def ask(self) -> NDArray[np.float64]:
        """Next generation (candidate, axis)."""

    def tell(self, points: NDArray[np.float64], losses: NDArray[np.float64]) -> None:
        """Losses (candidate, objective) of those points; less is better."""

    def centre(self) -> NDArray[np.float64] | None:
        """Mean of the search's distribution (axis,), if it has one."""


def make_optimiser(
    algorithm: str,
    dimension: int,
    objectives: int,
    population: int,
    seed: int,
    *,
    spread: float = START_SIGMA,
    start: NDArray[np.float64] | None = None,
) -> Optimiser:
    """A fresh optimiser; CMA-ES starts with a standard deviation `spread` at the point `start`, else in the middle."""
    if algorithm == "cmaes":
        return CMAES(dimension, population, seed, spread, start)
    from airflock.search.genetic import GeneticSearch
    from airflock.search.nondominated import NonDominatedSorting

    if algorithm == "ga":
        return GeneticSearch(dimension, population, seed)
    return NonDominatedSorting(dimension, objectives, population, seed)
