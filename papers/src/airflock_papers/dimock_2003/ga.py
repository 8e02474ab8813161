"""The paper's genetic algorithm on the paper's fitness, by seeds and under several readings; CMA-ES beside it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.search import CMAES, binary_genetic, decode
from airflock_papers.dimock_2003.flights import Birds, Flight, Start, Task, in_row
from airflock_papers.dimock_2003.units import Gains, gains

LOST = 1e3  # W: loss of a controller that collides, scatters without end, or coheres over less than it avoids
POPULATION, GENERATIONS = 50, 150
FEW = 12  # generations of the small form
SEEDS = (1, 2, 3)
EARLY, MIDWAY = 5, 13  # generations of Figs 6 and 7
TIMID = 2.0  # ft/s: a small K_a, as the paper counts it
GREEDY = 50.0  # ft²/(lbf s): a high K_d, the upper half of its range
Points = NDArray[np.float64]


class GeneticResult(NamedTuple):
    """Best chromosome ever, its loss, and the best and the mean loss of each generation."""

    bits: NDArray[np.bool_]
    loss: float
    best: list[float]
    mean: list[float]


def minimise_over_bits(
    losses: Callable[[NDArray[np.bool_]], NDArray[np.float64]],
    bits: int,
    *,
    population: int = 50,
    generations: int = 150,
    mutation: float = 0.01,
    crossover: float = 1.0,
    seed: int = 0,
) -> GeneticResult:
    """Minimise over bits. `losses` takes a whole generation (candidate, bit) and returns (candidate,)."""
    state = binary_genetic(bits, population, seed, mutation=mutation, crossover=crossover)
    winner, least, best, mean = np.zeros(bits, bool), np.inf, [], []
    for _ in range(generations):
        chromosomes = state.ask()
        found = np.asarray(losses(chromosomes), float)
        state.tell(chromosomes, found)
        i = int(np.argmin(found))
        if found[i] < least:
            winner, least = chromosomes[i].copy(), float(found[i])
        best.append(float(found[i]))
        mean.append(float(found.mean()))
    return GeneticResult(winner, least, best, mean)


class Reading(NamedTuple):
    """What the paper leaves open: what divides the weighted sums (Eq. 2), and the start of the V.

    wing : keys of a scenario for other wings than those of the paper's last simulation
    """

    centroid: str
    start: Start
    wing: tuple[tuple[str, str | float], ...] = ()

    @property
    def words(self) -> str:
        """For a table."""
        return f"{WEIGHTS[self.centroid]} weights, start ({self.start.sx:g}, {self.start.sy:g}) ft"


WEIGHTS = {"others": "1/(n-1)", "n": "1/n"}
READINGS = {
    "mean": Reading("others", Start()),  # the prototype's
    "near": Reading("others", Start(sx=5.0, sy=5.0)),  # the prototype's, tip to tip from the start
    "n": Reading("n", Start()),  # those under which the published gains hold a V
}
# The paper's first simulation: one horseshoe a wing, before it had a grid. Its gradient is not described: ours is the
# derivative of the same filaments. Their core keeps it finite for two birds abreast, and is far narrower than a row.
HORSESHOE: dict[str, str | float] = {
    "wing.segments": "1",
    "wing.positions": "free",
    "wing.core": 0.01,
    "model.gradient": "frozen",
}
FIRST = Reading("others", Start(), tuple(HORSESHOE.items()))


@dataclass
class Run:
    """One run: by generation the best-ever and the mean power of the fit (W), share of K_a below 2 ft/s.

    champions : the best-ever controller after each generation
    lost      : by generation the share of controllers that collide
    careless  : by generation how many have a K_a below 2 ft/s, and how many of them collide
    rows      : of every flight the K_d, ft²/(lbf s), and whether it ended in a row
    scattered : flights whose birds left the finite numbers
    flown     : flights; a controller that comes again is not flown again
    flights   : of the best-ever after the paper's generations 5 and 13 and the last; full gradient of the last
    """

    reading: Reading
    seed: int
    best: list[float] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)
    timid: list[float] = field(default_factory=list)
    champions: list[Gains] = field(default_factory=list)
    lost: list[float] = field(default_factory=list)
    careless: list[tuple[int, int]] = field(default_factory=list)
    rows: list[tuple[float, bool]] = field(default_factory=list)
    scattered: int = 0
    flown: int = 0
    flights: dict[str, Flight] = field(default_factory=dict)

    @property
    def gains(self) -> Gains:
        """The winner."""
        return self.champions[-1]

    def note(self, points: Points, losses: NDArray[np.float64]) -> None:
        """One more generation: controllers (candidate, axis) in the unit cube, and their losses."""
        fit = losses[losses < LOST]
        i = int(np.argmin(losses))
        better = not self.best or losses[i] < self.best[-1]
        self.champions.append(gains(points[i]) if better else self.champions[-1])
        self.best.append(float(losses[i]) if better else self.best[-1])
        self.mean.append(float(fit.mean()) if fit.size else float("nan"))
        each = [gains(point) for point in points]
        timid = np.array([g.k_a < TIMID for g in each])
        collided = np.array([g.r_c >= g.r_a for g in each]) & (losses >= LOST)
        self.timid.append(float(timid.mean()))
        self.lost.append(float(collided.mean()))
        self.careless.append((int(timid.sum()), int((timid & collided).sum())))


@dataclass
class Evolution:
    """All runs of the genetic algorithm by the name of their reading, on wings of one horseshoe, and of CMA-ES."""

    runs: dict[str, list[Run]]
    cmaes: list[Run]
    first: list[Run] = field(default_factory=list)

    @property
    def winners(self) -> list[Gains]:
        """Winners under the prototype's reading."""
        return [run.gains for run in self.runs["mean"]]


def evolve(birds: Birds, quick: bool = False, until: int | None = None) -> Evolution:
    """Three readings, one horseshoe a wing, and CMA-ES, three seeds each.

    quick : one seed, few generations but of the first reading, whose course is judged; until : so many instead
    """
    seeds = SEEDS[:1] if quick else SEEDS
    whole, generations = until or GENERATIONS, until or (FEW if quick else GENERATIONS)
    count, title = 0, "evolution"
    total = len(seeds) * (len(READINGS) + 2)

    def told(run: Run) -> Run:
        nonlocal count
        count += 1
        if birds.progress:
            birds.progress(title, count, total)
        return run

    runs = {
        name: [told(with_genetic(birds, reading, seed, whole if name == "mean" else generations)) for seed in seeds]
        for name, reading in READINGS.items()
    }
    first = [told(with_genetic(birds, FIRST, seed, generations)) for seed in seeds]
    cmaes = [told(with_cmaes(birds, READINGS["mean"], run.seed, run.flown)) for run in runs["mean"]]
    return Evolution(runs, cmaes, first)


def with_genetic(birds: Birds, reading: Reading, seed: int, generations: int = GENERATIONS) -> Run:
    """The paper's algorithm; the gradient holds the others' circulations, winners fly again with the full one."""
    run = Run(reading, seed)
    losses = losses_of(birds, run)
    minimise_over_bits(lambda bits: losses(decode(bits)), 50, population=POPULATION, generations=generations, seed=seed)
    return _flown_again(birds, run)


def with_cmaes(birds: Birds, reading: Reading, seed: int, flights: int, population: int = 20) -> Run:
    """CMA-ES on the same fitness, for as many flights as the genetic algorithm took."""
    run = Run(reading, seed)
    losses, search = losses_of(birds, run), CMAES(5, population, seed)
    while run.flown < flights and len(run.best) < flights // population:
        points = search.ask()
        search.tell(points, losses(points)[:, None])
    return _flown_again(birds, run)


def losses_of(birds: Birds, run: Run) -> Callable[[Points], NDArray[np.float64]]:
    """Losses (W) of controllers (candidate, axis) of one generation: all that are new fly side by side."""
    known: dict[bytes, float] = {}

    def losses(points: Points) -> NDArray[np.float64]:
        fresh = {point.tobytes(): gains(point) for point in points if point.tobytes() not in known}
        inside = {key: found for key, found in fresh.items() if found.r_c >= found.r_a}
        tasks = [Task(found, run.reading.start) for found in inside.values()]
        flown = birds.fly("", tasks, scatter=bool(run.reading.wing), **settings_of(run.reading))
        run.flown += len(flown)
        run.rows += [(task.gains.k_d, in_row(flight)) for task, flight in zip(tasks, flown, strict=True)]
        known.update(dict.fromkeys(fresh, LOST))
        for key, flight in zip(inside, flown, strict=True):
            finite = bool(np.isfinite(flight.power))
            run.scattered += not finite
            good = finite and not flight.collided
            known[key] = flight.power if good else LOST
        every = np.array([known[point.tobytes()] for point in points])
        run.note(points, every)
        return every

    return losses


def settings_of(reading: Reading) -> dict[str, Any]:
    """Keys of the scenario that a reading sets."""
    return {"model.centroid": reading.centroid, **dict(reading.wing)}


def _flown_again(birds: Birds, run: Run) -> Run:
    last = len(run.best) - 1
    moments = {"early": EARLY, "midway": MIDWAY, "final": last}
    tasks = [Task(run.champions[min(at, last)], run.reading.start) for at in moments.values()]
    settings = settings_of(run.reading)
    flown = birds.fly("", tasks, scatter=bool(run.reading.wing), **settings)
    run.flights = dict(zip(moments, flown, strict=True))
    whole = {"frozen": "analytic"}.get(settings.get("model.gradient", ""), "cells")
    run.flights["full gradient"] = birds.fly(
        "", tasks[-1:], scatter=bool(run.reading.wing), **settings | {"model.gradient": whole}
    )[0]
    return run
