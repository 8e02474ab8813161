"""CMA-ES: the covariance matrix adaptation evolution strategy of Hansen & Ostermeier (2001), by the package pycma.

Settings of Vásárhelyi et al. 2018, Table S6 and Methods: start in the middle of all ranges, standard deviation a sixth
of a range, no elitism, everything else as the package has it; a run ends after its generations, and pycma's other
reasons to stop are not asked for. Beyond the bounds pycma transforms smoothly back into them.
"""

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

INSIDE = 0.01  # a start on a bound lies on the edge of what pycma's smooth transformation reaches
MIDDLE, START_SIGMA = 0.5, 1.0 / 6.0  # Methods, "Fitness function", last paragraph


class CMAES:
    """Ask for a generation of points in the unit cube, tell their losses (candidate, 1)."""

    def __init__(
        self,
        dimension: int,
        population: int,
        seed: int,
        sigma: float = START_SIGMA,
        start: NDArray[np.float64] | None = None,
    ):
        """Start at a point (axis,) of the cube, by default its middle.

        `seed` decides all random numbers; no generator is shared with anybody.
        """
        import cma

        self.dimension = dimension
        draw = np.random.default_rng(seed).standard_normal
        options = {
            "popsize": population,
            "bounds": [0.0, 1.0],
            "CMA_elitist": 0,
            "verbose": -9,
            "seed": np.nan,  # leave NumPy's shared generator alone
            "randn": lambda *shape: draw(shape if shape else None),
        }
        # pycma knows no single dimension: a second coordinate goes along that nobody looks at
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            first = [MIDDLE] * max(dimension, 2)
            if start is not None:
                first[:dimension] = np.clip(start, INSIDE, 1.0 - INSIDE).tolist()
            self.strategy: Any = cma.CMAEvolutionStrategy(first, sigma, options)
        self.asked: list[Any] = []

    def ask(self) -> NDArray[np.float64]:
        """Next generation (candidate, axis)."""
        self.asked = self.strategy.ask()
        return np.array(self.asked)[:, : self.dimension]

    def tell(self, points: NDArray[np.float64], losses: NDArray[np.float64]) -> None:
        """Losses (candidate, 1) of the points that were asked for."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of flat fitness: a first generation of which nobody flies
            self.strategy.tell(self.asked, losses[:, 0].tolist())

    def centre(self) -> NDArray[np.float64]:
        """Mean of the distribution (axis,): where the evolution stands, and not the luckiest of its candidates."""
        return np.array(self.strategy.result.xfavorite)[: self.dimension]
