"""Generations of a search: ask the optimiser for candidates, fly those missing in the store, report their losses.

A study that was ended, however roughly, is continued by running it again: the optimiser is fed with
the stored flights from its first generation on and comes to the very state in which it was left. No
state is pickled.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.runs import (
    CandidateBatch,
    Executor,
    Flight,
    FlightStore,
    OnProgress,
    ProgressTally,
    declared_numbers,
    parse_values,
)
from airflock.scenarios import Scenario
from airflock.search.limit_excess import batch_excess, rank_by_excess
from airflock.search.objectives import Objective, candidate_losses
from airflock.search.optimisers import make_optimiser
from airflock.search.study import Study, combine_scenarios
from airflock.search.study_result import DURATION_COLUMN
from airflock.support import StudyError

FlightScores = dict[tuple[int, int], Mapping[str, Any] | None]  # (candidate, repeat) → order parameters, None: failed


@dataclass(frozen=True)
class Evaluator:
    """Evaluator of candidates: a study with its store of flights and its executor.

    note : called after each flight with True if it is new
    """

    study: Study
    store: FlightStore
    executor: Executor
    note: Callable[[bool], None] | None = None

    def evaluate(
        self,
        batch: CandidateBatch,
        points: NDArray[np.float64],
        *,
        seeds: Sequence[Sequence[int]] | None = None,
        duration_share: float = 1.0,
    ) -> list[list[float | None]]:
        """Return the fitness (candidate, objective) of a batch; fly and store missing flights. None: failed.

        points : (candidate, axis) of the unit cube
        seeds  : (candidate, repeat); by default those of the search
        duration_share : share of the scenarios' duration that is flown
        """
        study = self.study
        parameters = [study.space.parameters(point) for point in points]
        numbers = _seeds(study, batch, len(points)) if seeds is None else seeds
        places = [_shortened(scenario, duration_share) for scenario in study.scenarios]
        self.store.ask(batch, points.tolist(), [{**each, **places[0]} for each in parameters])
        flown: FlightScores = self.store.flown(batch)
        if self.note:
            for _ in flown:
                self.note(False)
        n = len(places)
        missing = [
            # One number holds seed and scenario, so that the scenarios of a seed lie side by side in the store.
            Flight(i, j * n + k, {**parameters[i], **shorter}, seed, k)
            for i in range(len(parameters))
            for j, seed in enumerate(numbers[i])
            for k, shorter in enumerate(places)
            if (i, j * n + k) not in flown
        ]
        self._fly(batch, missing, flown)
        rows = [
            [self._fitness(objective, [flown[i, r] for r in range(len(row) * n)]) for objective in study.objectives]
            for i, row in enumerate(numbers)
        ]
        self.store.tell(batch, rows)
        return rows

    def _fly(self, batch: CandidateBatch, missing: Sequence[Flight], flown: FlightScores) -> None:
        """Fly what is missing; each flight is stored and known as soon as it lands."""
        for landed in self.executor.fly(missing):
            if landed.values is not None:
                first = all(values is None for values in flown.values())
                landed = replace(landed, reason=landed.reason or self._fitness_error(landed.values, first))
            self.store.land(batch, landed)
            flown[landed.flight.candidate_index, landed.flight.repeat] = landed.values
            if self.note:
                self.note(True)

    def _fitness_error(self, values: Mapping[str, Any], first: bool) -> str:
        """Return how a fitness of the user's own fails for a flight, or "". Raises StudyError for one of its text."""
        lines = []
        for objective in self.study.objectives:
            line, of_numbers = objective.error_of_flight(values)
            # An error in the text shows at the first flight; one that comes later is of a flight.
            if first and line and not of_numbers:
                raise StudyError(line)
            if first:
                objective.of_flight(values)  # raises where an order parameter is unknown
            lines += [line] if line else []
        return "; ".join(lines)

    def _fitness(self, objective: Objective, flights: Sequence[Mapping[str, Any] | None]) -> float | None:
        """Return the fitness of a candidate: over the seeds of each scenario, then over the scenarios."""
        n = len(self.study.scenarios)
        each = [objective.of_candidate(flights[place::n]) for place in range(n)]
        return combine_scenarios(each, self.study.over_scenarios, objective.maximise)


def _shortened(scenario: Scenario, share: float) -> dict[str, float]:
    """Return the parameters that shorten a flight; none for a whole one."""
    return {} if share == 1.0 else {DURATION_COLUMN: share * scenario.flight.duration}


def _seeds(study: Study, batch: CandidateBatch, candidates: int) -> list[list[int]]:
    """Return the seeds (candidate, repeat) of a generation of the search."""
    # Seeds follow from the place in the search alone, so that a resumed search flies the same ones.
    k, most = study.seeds(batch.generation), max(study.whole("seeds"), study.whole("late_seeds"))
    population = study.whole("population")
    first = (batch.run * study.whole("generations") + batch.generation) * population
    how = study.search.random_numbers
    return [
        [study.seed(0, most * {"fresh": first + i, "generation": first, "study": 0}[how] + j) for j in range(k)]
        for i in range(candidates)
    ]


SHARES = (0.125, 0.25, 0.5, 1.0)  # of the scenario's duration
LONGEST = 8  # of all generations, at most one in so many has each length but the last


class FlightLength:
    """Length of the next generation's flights as a share of a whole one; it grows with the first objective."""

    def __init__(self, generations: int, maximise: bool, *, growing: bool):
        """`generations` of the whole run; without `growing` all flights are whole."""
        self.left = list(SHARES) if growing else [1.0]
        self.most, self.sign = max(1, generations // LONGEST), 1.0 if maximise else -1.0
        self.flown, self.aim = 0, 0.0

    @property
    def share(self) -> float:
        """Share of the scenario's duration."""
        return self.left[0]

    @property
    def whole(self) -> bool:
        """Return True if flights are as long as the scenario says."""
        return len(self.left) == 1

    def end_generation(self, values: Sequence[float | None]) -> None:
        """Take the first objective of all candidates of a generation (None: failed) and lengthen flights if due."""
        # Values of one length are compared with each other only, so the rule holds for any
        # objective. Fixed thresholds (0.35, 0.5, 0.6) were tried and fitted one law.
        if self.whole:
            return
        found = [-float("inf") if value is None else self.sign * value for value in values]
        if not self.flown:
            self.aim = max(found)
        self.flown += 1
        reached = self.flown > 1 and median(found) >= self.aim
        if reached or max(found) == min(found) or self.flown >= self.most:
            self.left, self.flown = self.left[1:], 0


EARLY = 3  # generations after which a search that has seen nothing but one value ends
FEWEST = 40  # candidates of which that can be said
ZERO_FITNESS = 1e-6  # a product of partial fitnesses below this does not fly
# partial fitness → what it says if it is zero, and what may be changed
ADVICE = {
    "f_speed": "the flock is too slow: lower model.v_flock, or take fewer agents, walls and obstacles",
    "f_coll": "agents collide: take fewer agents, a larger arena, a smaller metrics.r_coll, or a shorter radio.delay",
    "f_disc": "agents are too far from all others: raise radio.range, or take a smaller arena",
    "f_cluster": "the flock falls apart: raise radio.range or metrics.r_cluster, or take a smaller arena",
    "f_wall": "agents leave the arena or enter obstacles: lower model.v_flock, raise metrics.r_tol, or take more room",
    "f_corr": "neighbours do not fly the same way: lower radio.delay, the noise or model.v_flock",
}


def refuse_flat(study: Study, store: FlightStore, generation: int, values: Sequence[float | None]) -> None:
    """Raise StudyError once a search has seen one value only; what it is and why, in one line.

    generation : number of the generation, of those with whole flights, from 0
    values     : first objective of every candidate so far that flew a whole flight
    """
    found, name = [value for value in values if value is not None], study.objectives[0].name
    last = generation + 1 == study.whole("generations")
    if len(values) < FEWEST or not (generation + 1 >= EARLY or last):
        return
    if not found:
        number = f"{name} is nan or inf, no finite number, for all of {len(values)} candidates"
        why = next(iter(store.reasons()), number)
        raise StudyError(f"{study.scenario.name}: every candidate failed; the first one: {why}")
    if len(found) < FEWEST:
        return
    if max(found) - min(found) <= 1e-12 * max(1.0, abs(max(found))):
        raise StudyError(
            f"{study.scenario.name}: nothing to search: {name} is flat, {found[0]:g} for all of {len(found)} candidates"
            f"{zero_fitness_reason(search_scores(store)) if found[0] == 0.0 else ''}"
        )


def dead_reason(study: Study, scores: Sequence[Mapping[str, Any] | None]) -> str:
    """Return why a winner does not fly, if its fitness, a product, is zero in all fresh flights; else empty."""
    sound = [row for row in scores if row is not None]
    if study.objectives[0].name != "fitness" or not sound or not _parts(sound):
        return ""
    if max(float(row["fitness"]) for row in sound) >= ZERO_FITNESS:
        return ""
    return f"no candidate flies, so there is no best one{zero_fitness_reason(sound)}"


def search_scores(store: FlightStore) -> list[Mapping[str, Any]]:
    """Return the scores of all flights of the search."""
    return [
        parse_values(scores) for (scores,) in store.rows("SELECT scores FROM flight WHERE stage='search'") if scores
    ]


def zero_fitness_reason(scores: Sequence[Mapping[str, Any]]) -> str:
    """Say which partial fitness is zero most often, in how many flights, and what may be changed; empty if none is."""
    shares = {name: sum(float(row[name]) < ZERO_FITNESS for row in scores) / len(scores) for name in _parts(scores)}
    worst = sorted(((share, name) for name, share in shares.items() if share > 0.5), reverse=True)
    if not worst:
        return ""
    zeros = ", ".join(f"{name} is zero in {100.0 * share:.0f} % of flights" for share, name in worst)
    advice = ADVICE.get(worst[0][1], "")
    return f": {zeros}{f'; {advice}' if advice else ''}"


def _parts(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the names of the partial fitnesses that all flights have."""
    names = [name for name, value in (rows[0] if rows else {}).items() if name.startswith("f_") and _number(value)]
    return [name for name in names if all(_number(row.get(name)) for row in rows)]


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not math.isnan(value)


SAME = 1e-9  # a rebuilt optimiser may differ from the stored points by rounding on another machine, not by more


def total_flights(study: Study) -> int:
    """Return the number of flights of the whole search."""
    candidates = (study.whole("restarts") + 1) * study.whole("population")
    each = sum(study.seeds(generation) for generation in range(study.whole("generations")))
    return candidates * each * len(study.scenarios)


def run_search(
    study: Study, store: FlightStore, executor: Executor, on_progress: OnProgress | None = None
) -> list[NDArray[np.float64]]:
    """Run the search of a study to its end, or to Ctrl-C.

    Returns the final mean (axis,) of each run whose algorithm has one, and averages of its means if
    requested.
    """
    tally = ProgressTally("search", total_flights(study), on_progress)
    sound: list[list[float]] = []
    evaluator = Evaluator(study, store, executor, tally.note)
    centres: list[NDArray[np.float64]] = []
    for run in range(study.whole("restarts") + 1):
        means = _run(evaluator, run, tally, sound)
        if means:
            found = averaged_means(means, study.whole("averages")) + windowed_means(means, study.whole("windows"))
            centres += [means[-1], *found]
    return centres


def _run(evaluator: Evaluator, run: int, tally: ProgressTally, sound: list[list[float]]) -> list[NDArray[np.float64]]:
    """Run the optimiser once; return its mean (axis,) after each generation of whole flights, if it has one.

    sound : first objective of the candidates that keep all limits, of each generation so far; grows
    """
    # Optimiser state is not stored: replay with the stored flights takes 4 ms a generation and
    # notices another version of pycma, which a pickle would follow astray.
    study, store = evaluator.study, evaluator.store
    first = study.objectives[0]
    state = make_optimiser(
        study.search.algorithm, len(study.space.axes), len(study.objectives), study.whole("population"),
        (study.whole("seed") << 16) + run, spread=study.search.spread, start=_start(study),
    )  # fmt: skip
    length = FlightLength(study.whole("generations"), first.maximise, growing=study.search.flights == "growing")
    means: list[NDArray[np.float64]] = []
    seen: list[float | None] = []
    whole = 0
    for generation in range(study.whole("generations")):
        where = f"run {run + 1}, " if study.search.restarts else ""
        tally.text = f"{where}generation {generation + 1}/{study.whole('generations')}"
        if sound:
            best = (max if first.maximise else min)(max(row) if first.maximise else min(row) for row in sound)
            tally.text += f", best {best:.4f}, mean {sum(sound[-1]) / len(sound[-1]):.4f}"
        batch = CandidateBatch("search", run, generation)
        points = _asked(store, batch, state.ask())
        rows = evaluator.evaluate(batch, points, duration_share=length.share)
        values, losses = [row[0] for row in rows], candidate_losses(rows, study.objectives)
        excess = np.zeros(len(values))
        if study.limits:
            excess = batch_excess(study, store, batch, length.share)
            losses = rank_by_excess(losses, excess)
        state.tell(points, losses)
        centre = state.centre()
        # Means of generations with short flights are no finalists: their fitness is on another
        # scale.
        if length.whole:
            kept = [v for v, much in zip(values, excess, strict=True) if v is not None and much == 0.0]
            sound += [kept] if kept else []
            seen += values
            if run == 0:
                refuse_flat(study, store, whole, seen)
            whole += 1
            means += [] if centre is None else [np.clip(centre, 0.0, 1.0)]
        length.end_generation(values)
    return means


def averaged_means(means: Sequence[NDArray[np.float64]], windows: int) -> list[NDArray[np.float64]]:
    """Return averages (axis,) of the last half of all means, of the last quarter, and so on.

    On a plateau a mean wanders by chance; the average of many wanders less (Polyak & Juditsky
    1992).
    """
    spans = (max(1, len(means) >> (k + 1)) for k in range(windows))
    return [np.mean(means[-span:], axis=0) for span in spans]


def windowed_means(means: Sequence[NDArray[np.float64]], windows: int) -> list[NDArray[np.float64]]:
    """Return averages (axis,) of the means in each of so many equal parts of the last half.

    CMA-ES ranks single flights and so ends where most flights are good, which is not where their
    mean is best if a few are bad: on its way it may pass a better place.
    """
    late = np.array(means[len(means) // 2 :])
    return [part.mean(axis=0) for part in np.array_split(late, min(windows, len(late)))] if windows else []


def _start(study: Study) -> NDArray[np.float64] | None:
    """Return the start of the optimiser: None for the middle, or the scenario's own numbers."""
    if study.search.start == "middle":
        return None
    known = declared_numbers(study.scenario)
    return study.space.point({key: float(known[key][1] or 0.0) for key in study.space.keys})


def _asked(store: FlightStore, batch: CandidateBatch, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the next points of the optimiser, as stored if the store has them."""
    stored = store.asked(batch)
    if not stored:
        return points
    known = np.array(stored)
    # A rebuilt optimiser may differ in the last bits on another machine. A larger difference is
    # another optimiser, which would learn from flights of points that are not its own.
    if known.shape != points.shape or not np.allclose(known, points, rtol=0.0, atol=SAME):
        if store.forget_from(batch):
            return points
        raise StudyError(
            f"{store.path}: run {batch.run}, generation {batch.generation} cannot be rebuilt here: the optimiser asks "
            "for other candidates than are stored; continue with the versions that the table session names"
        )
    return known
