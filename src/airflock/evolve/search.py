"""The search itself: generations are asked for, flown where the store does not hold them yet, and told.

A study that was ended, however roughly, is continued by running it again: the optimiser is fed with the stored flights
from its first generation on and comes to the very state in which it was left. No state is pickled.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.errors import StudyError
from airflock.evolve.executors import Executor, Flight
from airflock.evolve.fitness import losses
from airflock.evolve.landscape import refuse_flat
from airflock.evolve.optimisers import optimiser
from airflock.evolve.store import Batch, Store
from airflock.evolve.study import Study

SAME = 1e-9  # a rebuilt optimiser may differ from the stored points by rounding on another machine, not by more


@dataclass(frozen=True)
class Progress:
    """How far a search is, after each flight and each generation.

    done, total : flights, those of the store included; fresh : flights of this process
    best, mean  : first objective of the best candidate so far and of the last generation; None before there are any
    """

    run: int
    generation: int
    done: int
    total: int
    fresh: int
    best: float | None
    mean: float | None


Watch = Callable[[Progress], None]


@dataclass
class Tally:
    """Counts of a search so far, told to whoever watches."""

    total: int
    watch: Watch | None
    run: int = 0
    generation: int = 0
    done: int = 0
    fresh: int = 0
    best: float | None = None
    mean: float | None = None

    def note(self, new: bool) -> None:
        """One more flight, flown now or found in the store."""
        self.done, self.fresh = self.done + 1, self.fresh + new
        if self.watch:
            self.watch(Progress(self.run, self.generation, self.done, self.total, self.fresh, self.best, self.mean))

    def generation_over(self, values: Sequence[float | None], maximise: bool) -> None:
        """First objective of a generation's candidates."""
        found = [value for value in values if value is not None]
        if not found:
            return
        self.mean = sum(found) / len(found)
        known = [*found, *([] if self.best is None else [self.best])]
        self.best = max(known) if maximise else min(known)


def total_flights(study: Study) -> int:
    """Flights of the whole search."""
    runs = range(study.whole("restarts") + 1)
    return sum(study.population(run) for run in runs) * study.whole("generations") * study.whole("seeds")


def search(study: Study, store: Store, executor: Executor, watch: Watch | None = None) -> list[NDArray[np.float64]]:
    """Run a study to its end, or to Ctrl-C; returns the final mean (axis,) of each run whose algorithm has one."""
    tally = Tally(total_flights(study), watch)
    centres: list[NDArray[np.float64]] = []
    seen: list[float | None] = []
    for run in range(study.whole("restarts") + 1):
        seed = (study.whole("seed") << 16) + run
        shape = (len(study.space.axes), len(study.objectives), study.population(run))
        state = optimiser(study.search.algorithm, *shape, seed)
        for generation in range(study.whole("generations")):
            tally.run, tally.generation = run, generation
            batch = Batch("search", run, generation)
            points = _asked(store, batch, state.ask())
            rows = evaluate(study, store, executor, batch, points, tally.note)
            state.tell(points, losses(rows, study.objectives))
            tally.generation_over([row[0] for row in rows], study.objectives[0].maximise)
            seen += [row[0] for row in rows]
            if run == 0:
                refuse_flat(study, store, generation, seen)
        centre = state.centre()
        if centre is not None:
            centres.append(np.clip(centre, 0.0, 1.0))
    return centres


def _asked(store: Store, batch: Batch, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points that an optimiser asks for, as the store has them if it has."""
    stored = store.asked(batch)
    if not stored:
        return points
    known = np.array(stored)
    if known.shape != points.shape or not np.allclose(known, points, rtol=0.0, atol=SAME):
        raise StudyError(
            f"{store.path}: run {batch.run}, generation {batch.generation} cannot be rebuilt here: the optimiser asks "
            "for other candidates than are stored; continue with the versions that the table session names"
        )
    return known


def evaluate(
    study: Study,
    store: Store,
    executor: Executor,
    batch: Batch,
    points: NDArray[np.float64],
    note: Callable[[bool], None] | None = None,
    *,
    seeds: Sequence[Sequence[int]] | None = None,
    parameters: Sequence[Mapping[str, float]] | None = None,
) -> list[list[float | None]]:
    """Fitness (candidate, objective) of a batch; flies what the store lacks and stores it. None: failed.

    note  : called after each flight, with whether it is a new one
    seeds : (candidate, repeat); by default those of the search
    parameters : of each candidate; by default those of its point
    """
    given = [study.space.parameters(point) for point in points] if parameters is None else parameters
    numbers = _seeds(study, batch, len(points)) if seeds is None else seeds
    store.ask(batch, points.tolist(), given)
    flown: dict[tuple[int, int], Mapping[str, Any] | None] = store.flown(batch)
    if note:
        for _ in flown:
            note(False)
    missing = [
        Flight(i, j, given[i], seed)
        for i, row in enumerate(numbers)
        for j, seed in enumerate(row)
        if (i, j) not in flown
    ]
    for landed in executor.fly(missing):
        store.land(batch, landed)
        if landed.values is not None and all(values is None for values in flown.values()):
            for objective in study.objectives:  # a fault in one shows at the first flight, not after a generation
                objective.of_flight(landed.values)
        flown[landed.flight.candidate, landed.flight.repeat] = landed.values
        if note:
            note(True)
    rows = [
        [o.of_candidate([flown[i, j] for j in range(len(row))]) for o in study.objectives]
        for i, row in enumerate(numbers)
    ]
    store.tell(batch, rows)
    return rows


def _seeds(study: Study, batch: Batch, candidates: int) -> list[list[int]]:
    """Seeds (candidate, repeat) of a generation of the search."""
    k = study.whole("seeds")
    before = sum(study.population(run) for run in range(batch.run)) * study.whole("generations")
    first = before + batch.generation * study.population(batch.run)
    how = study.search.random_numbers
    return [
        [study.seed(0, k * {"fresh": first + i, "generation": first, "study": 0}[how] + j) for j in range(k)]
        for i in range(candidates)
    ]
