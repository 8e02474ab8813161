"""Simple genetic algorithm on bits, as Dimock & Selig (2003) use it, by the package pymoo.

Each parameter is ten bits k of a chromosome, decoded as low + (high - low) k / 1024. Two children of each pair of
parents replace the whole population: tournament of two, one-point crossover, a flip of each bit with probability
0.01; no elitism, so that the best ever has to be remembered outside. `BinaryGenetic` is the bare algorithm for any
bits; `GeneticSearch` decodes for studies.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.support import StudyError

BITS = 10  # per parameter; 50 bits for five of them
MUTATION = 0.01
BitArray = NDArray[np.bool_]


def decode(bits: BitArray, bits_per_parameter: int = BITS) -> NDArray[np.float64]:
    """Numbers in [0, 1) from bits (..., parameter * per), the highest bit first: (..., parameter).

    The divisor is 1024: the published controller lies on k / 1024 and not on k / 1023.
    """
    shape = (*bits.shape[:-1], -1, bits_per_parameter)
    weights = 2.0 ** np.arange(bits_per_parameter - 1, -1, -1)
    return np.asarray(np.asarray(bits, float).reshape(shape) @ weights / 2.0**bits_per_parameter)


class BinaryGenetic:
    """Generational genetic algorithm: ask for bits (candidate, bit), tell losses (candidate,)."""

    def __init__(
        self, bits: int, population: int = 50, seed: int = 0, *, mutation: float = MUTATION, crossover: float = 1.0
    ):
        """`mutation` flips each bit, `crossover` is the probability that a pair of parents is cut at all."""
        if population % 2:
            raise StudyError(
                f"population = {population} is odd: pairs of parents have two children; give an even number"
            )
        self.algorithm = _algorithm(bits, population, seed, mutation, crossover)
        self.asked: Any = None

    def ask(self) -> BitArray:
        """Next generation (candidate, bit)."""
        self.asked = self.algorithm.ask()
        return np.array(self.asked.get("X"), bool)

    def tell(self, losses: NDArray[np.float64]) -> None:
        """Losses (candidate,) of the generation that was asked for; less is better."""
        self.asked.set("F", np.asarray(losses, float).reshape(-1, 1))
        self.algorithm.tell(infills=self.asked)


class GeneticResult(NamedTuple):
    """Best chromosome ever, its loss, and the best and the mean loss of each generation."""

    bits: BitArray
    loss: float
    best: list[float]
    mean: list[float]


def minimise_over_bits(
    losses: Callable[[BitArray], NDArray[np.float64]],
    bits: int,
    *,
    population: int = 50,
    generations: int = 150,
    mutation: float = MUTATION,
    crossover: float = 1.0,
    seed: int = 0,
) -> GeneticResult:
    """Minimise over bits. `losses` takes a whole generation (candidate, bit) and returns (candidate,)."""
    state = BinaryGenetic(bits, population, seed, mutation=mutation, crossover=crossover)
    winner, least, best, mean = np.zeros(bits, bool), np.inf, [], []
    for _ in range(generations):
        chromosomes = state.ask()
        found = np.asarray(losses(chromosomes), float)
        state.tell(found)
        i = int(np.argmin(found))
        if found[i] < least:
            winner, least = chromosomes[i].copy(), float(found[i])
        best.append(float(found[i]))
        mean.append(float(found.mean()))
    return GeneticResult(winner, least, best, mean)


class GeneticSearch:
    """The genetic algorithm on a study's unit cube, ten bits an axis."""

    def __init__(self, dimension: int, population: int, seed: int):
        """Chromosomes of ten bits for each of `dimension` axes."""
        self.state = BinaryGenetic(BITS * dimension, population, seed)

    def ask(self) -> NDArray[np.float64]:
        """Next generation (candidate, axis)."""
        return decode(self.state.ask())

    def tell(self, points: NDArray[np.float64], losses: NDArray[np.float64]) -> None:
        """Losses (candidate, 1) of the points that were asked for."""
        self.state.tell(losses[:, 0])

    def centre(self) -> None:
        """None: a population of chromosomes has no mean."""


def _algorithm(bits: int, population: int, seed: int, mutation: float, crossover: float) -> Any:
    try:
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination
        from pymoo.operators.crossover.pntx import SinglePointCrossover
        from pymoo.operators.mutation.bitflip import BitflipMutation
        from pymoo.operators.sampling.rnd import BinaryRandomSampling
        from pymoo.operators.selection.tournament import TournamentSelection
    except ModuleNotFoundError as fault:
        raise StudyError("the genetic algorithm needs pymoo: pip install 'airflock[evolve]'") from fault

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
    algorithm.setup(Problem(n_var=bits, n_obj=1, vtype=bool), termination=NoTermination(), seed=seed, verbose=False)
    return algorithm
