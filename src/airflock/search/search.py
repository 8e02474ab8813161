"""The search itself: generations are asked for, flown where the store does not hold them yet, and told.

A study that was ended, however roughly, is continued by running it again: the optimiser is fed with the stored flights
from its first generation on and comes to the very state in which it was left. No state is pickled.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airflock.runs import CandidateBatch, Executor, FlightStore, declared_numbers
from airflock.search.evaluator import Evaluator
from airflock.search.fitness import candidate_losses
from airflock.search.growing import FlightLength
from airflock.search.landscape import refuse_flat
from airflock.search.optimisers import make_optimiser
from airflock.search.safe import batch_excess, rank_by_excess
from airflock.search.study import Study
from airflock.support import StudyError

SAME = 1e-9  # a rebuilt optimiser may differ from the stored points by rounding on another machine, not by more


@dataclass(frozen=True)
class SearchProgress:
    """How far a search is, after each flight and each generation.

    done, total : flights, those of the store included; fresh : flights of this process
    best, mean  : first objective of the best candidate so far and of the last generation, of those that keep all
                  limits; None before there are any
    """

    run: int
    generation: int
    done: int
    total: int
    fresh: int
    best: float | None
    mean: float | None


OnSearchProgress = Callable[[SearchProgress], None]


@dataclass
class ProgressTally:
    """Counts of a search so far, reported to `watch`."""

    total: int
    watch: OnSearchProgress | None
    run: int = 0
    generation: int = 0
    done: int = 0
    fresh: int = 0
    best: float | None = None
    mean: float | None = None

    def note(self, is_new: bool) -> None:
        """One more flight, flown now or found in the store."""
        self.done, self.fresh = self.done + 1, self.fresh + is_new
        if self.watch:
            self.watch(
                SearchProgress(self.run, self.generation, self.done, self.total, self.fresh, self.best, self.mean)
            )

    def end_generation(self, values: Sequence[float | None], maximise: bool) -> None:
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
    each = sum(study.seeds(generation) for generation in range(study.whole("generations")))
    return sum(study.population(run) for run in runs) * each * len(study.scenarios)


def run_search(
    study: Study, store: FlightStore, executor: Executor, on_progress: OnSearchProgress | None = None
) -> list[NDArray[np.float64]]:
    """Run a study to its end, or to Ctrl-C.

    Returns the final mean (axis,) of each run whose algorithm has one, and averages of its means if asked for.
    """
    tally = ProgressTally(total_flights(study), on_progress)
    evaluator = Evaluator(study, store, executor, tally.note)
    centres: list[NDArray[np.float64]] = []
    for run in range(study.whole("restarts") + 1):
        means = _run(evaluator, run, tally)
        if means:
            found = averaged_means(means, study.whole("averages")) + windowed_means(means, study.whole("windows"))
            centres += [means[-1], *found]
    return centres


def _run(evaluator: Evaluator, run: int, tally: ProgressTally) -> list[NDArray[np.float64]]:
    """One run of the optimiser; returns its mean (axis,) after each generation of whole flights, if it has one."""
    study, store = evaluator.study, evaluator.store
    first = study.objectives[0]
    state = make_optimiser(
        study.search.algorithm, len(study.space.axes), len(study.objectives), study.population(run),
        (study.whole("seed") << 16) + run, spread=study.search.spread, start=_start(study),
    )  # fmt: skip
    length = FlightLength(study.whole("generations"), first.maximise, growing=study.search.flights == "growing")
    means: list[NDArray[np.float64]] = []
    seen: list[float | None] = []
    whole = 0
    for generation in range(study.whole("generations")):
        tally.run, tally.generation = run, generation
        batch = CandidateBatch("search", run, generation)
        points = _asked(store, batch, state.ask())
        begun = tally.done
        racing = study.search.racing == "optimistic"
        rows = evaluator.evaluate(batch, points, duration_share=length.share, racing=racing)
        tally.total -= len(points) * study.seeds(generation) * len(study.scenarios) - (tally.done - begun)
        values, told = [row[0] for row in rows], candidate_losses(rows, study.objectives)
        sound = values
        if study.limits:
            broken = batch_excess(study, store, batch, length.share)
            told, sound = (
                rank_by_excess(told, broken),
                [v for v, much in zip(values, broken, strict=True) if much == 0.0],
            )
        state.tell(points, told)
        centre = state.centre()
        if length.whole:
            tally.end_generation(sound, first.maximise)
            seen += values
            if run == 0:
                refuse_flat(study, store, whole, seen)
            whole += 1
            means += [] if centre is None else [np.clip(centre, 0.0, 1.0)]
        length.end_generation(values)
    return means


def averaged_means(means: Sequence[NDArray[np.float64]], windows: int) -> list[NDArray[np.float64]]:
    """Average (axis,) of the last half of all means, of the last quarter, and so on, as many as asked for.

    On a plateau a mean wanders by chance; the average of many wanders less (Polyak & Juditsky 1992).
    """
    spans = (max(1, len(means) >> (k + 1)) for k in range(windows))
    return [np.mean(means[-span:], axis=0) for span in spans]


def windowed_means(means: Sequence[NDArray[np.float64]], windows: int) -> list[NDArray[np.float64]]:
    """Average (axis,) of the means in each of so many equal parts of the last half.

    CMA-ES ranks single flights and so ends where most flights are good, which is not where their mean is best if a few
    are bad: on its way it may pass a better place.
    """
    late = np.array(means[len(means) // 2 :])
    return [part.mean(axis=0) for part in np.array_split(late, min(windows, len(late)))] if windows else []


def _start(study: Study) -> NDArray[np.float64] | None:
    """Where the optimiser starts: None for the middle, or the scenario's own numbers."""
    if study.search.start == "middle":
        return None
    known = declared_numbers(study.scenario)
    return study.space.point({key: float(known[key][1] or 0.0) for key in study.space.keys})


def _asked(store: FlightStore, batch: CandidateBatch, points: NDArray[np.float64]) -> NDArray[np.float64]:
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
