"""Optimisers by name, behind one interface: ask for points of the unit cube, tell their losses."""

import warnings
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.support import StudyError

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
        self.generation: list[Any] = []

    def ask(self) -> NDArray[np.float64]:
        """Return the next generation (candidate, axis)."""
        self.generation = self.strategy.ask()
        return np.array(self.generation)[:, : self.dimension]

    def tell(self, points: NDArray[np.float64], losses: NDArray[np.float64]) -> None:
        """Take the losses (candidate, 1) of the last generation."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of flat fitness: a first generation of which nobody flies
            self.strategy.tell(self.generation, losses[:, 0].tolist())

    def centre(self) -> NDArray[np.float64]:
        """Mean of the distribution (axis,): where the evolution stands, and not the luckiest of its candidates."""
        return np.array(self.strategy.result.xfavorite)[: self.dimension]


BITS = 10  # per parameter; 50 bits for five of them
MUTATION = 0.01


def decode(bits: NDArray[np.bool_], bits_per_parameter: int = BITS) -> NDArray[np.float64]:
    """Numbers in [0, 1) from bits (..., parameter * per), the highest bit first: (..., parameter).

    The divisor is 1024: the published controller lies on k / 1024 and not on k / 1023.
    """
    shape = (*bits.shape[:-1], -1, bits_per_parameter)
    weights = 2.0 ** np.arange(bits_per_parameter - 1, -1, -1)
    return np.asarray(np.asarray(bits, float).reshape(shape) @ weights / 2.0**bits_per_parameter)


class PymooOptimiser:
    """An algorithm of pymoo: ask for a generation of points, tell their losses (candidate, objective)."""

    def __init__(self, algorithm: Any, problem: Any, seed: int, convert: Callable[[Any], Any]):
        """`convert` makes points of the algorithm's own candidates; `seed` decides all random numbers."""
        from pymoo.core.termination import NoTermination

        self.algorithm, self.convert = algorithm, convert
        self.generation: Any = None
        algorithm.setup(problem, termination=NoTermination(), seed=seed, verbose=False)

    def ask(self) -> NDArray[Any]:
        """Return the next generation (candidate, axis)."""
        self.generation = self.algorithm.ask()
        return np.asarray(self.convert(np.array(self.generation.get("X"))))

    def tell(self, points: NDArray[Any], losses: NDArray[np.float64]) -> None:
        """Take the losses (candidate, objective) of the last generation; less is better."""
        self.generation.set("F", np.asarray(losses, float).reshape(len(points), -1))
        self.algorithm.tell(infills=self.generation)

    def centre(self) -> None:
        """Return None: neither a population nor a front has a mean."""


def _need_pymoo(what: str) -> None:
    if find_spec("pymoo") is None:
        raise StudyError(f"{what} needs pymoo: pip install 'airflock[evolve]'")


def binary_genetic(
    bits: int, population: int = 50, seed: int = 0, *, mutation: float = MUTATION, crossover: float = 1.0,
    convert: Callable[[Any], Any] = np.array,
) -> PymooOptimiser:  # fmt: skip
    """Make a generational genetic algorithm over bits (candidate, bit).

    `mutation` flips each bit, `crossover` is the probability that a pair of parents is cut at all.
    """
    if population % 2:
        raise StudyError(f"population = {population} is odd: pairs of parents have two children; give an even number")
    _need_pymoo("the genetic algorithm")
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.core.problem import Problem
    from pymoo.operators.crossover.pntx import SinglePointCrossover
    from pymoo.operators.mutation.bitflip import BitflipMutation
    from pymoo.operators.sampling.rnd import BinaryRandomSampling
    from pymoo.operators.selection.tournament import TournamentSelection

    # pymoo merges parents and children and keeps the best. The published algorithm replaces the
    # whole population.
    class Generational(GA):  # type: ignore[misc]
        """Children replace their parents, even better ones."""

        def _advance(self, infills: Any = None, **_: Any) -> None:
            self.pop = infills

    def fitter(population: Any, pairs: Any, random_state: Any = None, **_: Any) -> Any:
        loss = population.get("F")[:, 0][pairs]
        return pairs[np.arange(len(pairs)), np.argmin(loss, axis=1)][:, None]

    algorithm = Generational(
        pop_size=population,
        sampling=BinaryRandomSampling(),
        selection=TournamentSelection(func_comp=fitter, pressure=2),
        crossover=SinglePointCrossover(prob=crossover),
        mutation=BitflipMutation(prob=1.0, prob_var=mutation),
        eliminate_duplicates=False,
    )
    return PymooOptimiser(algorithm, Problem(n_var=bits, n_obj=1, vtype=bool), seed, convert)


def pareto_front(losses: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the indices of candidates that no other dominates; losses (candidate, objective)."""
    # Sorted by the first objective, a candidate can only be dominated by one before it: one pass
    # over the front so far.
    order = np.lexsort(losses.T[::-1])
    kept = np.empty(len(losses), np.int64)
    n = 0
    for i in order:
        row = losses[i]
        better = losses[kept[:n]]
        if np.isfinite(row).all() and not ((better <= row).all(axis=1) & (better < row).any(axis=1)).any():
            kept[n], n = i, n + 1
    return np.sort(kept[:n])


def non_dominated_sorting(dimension: int, objectives: int, population: int, seed: int) -> PymooOptimiser:
    """Make NSGA-II with pymoo's default operators, over points of the unit cube."""
    _need_pymoo("nsga2")
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem

    problem = Problem(n_var=dimension, n_obj=objectives, xl=np.zeros(dimension), xu=np.ones(dimension))
    return PymooOptimiser(NSGA2(pop_size=population, eliminate_duplicates=False), problem, seed, np.asarray)


ALGORITHMS = ("cmaes", "ga", "nsga2")
MULTI_OBJECTIVE = "nsga2"  # the one for several objectives


def make_optimiser(
    algorithm: str,
    dimension: int,
    objectives: int,
    population: int,
    seed: int,
    *,
    spread: float = START_SIGMA,
    start: NDArray[np.float64] | None = None,
) -> CMAES | PymooOptimiser:
    """Make a fresh optimiser: the same seed and the same losses give the same points, bit by bit.

    CMA-ES starts with a standard deviation `spread` at the point `start`, else in the middle.
    """
    if algorithm == "cmaes":
        return CMAES(dimension, population, seed, spread, start)
    if algorithm == "ga":
        return binary_genetic(BITS * dimension, population, seed, convert=decode)
    return non_dominated_sorting(dimension, objectives, population, seed)
