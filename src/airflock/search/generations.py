"""Search of a study: ask the optimiser for candidates, fly those missing in the store, report their losses; finals.

A study that was ended, however roughly, is continued by running it again: the optimiser is fed with
the stored flights from its first generation on and comes to the very state in which it was left. No
state is pickled.

The best of 15,000 noisy evaluations is the luckiest as much as the best. The final mean of each run
and the top candidates (of a race, `race_candidates`) fly again on the same fresh seeds, the winner
once more on other fresh seeds for an unbiased score; working ranges are those of Table S1: where
candidates of the search reached at least the winner's mean.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from airflock.runs import (
    CandidateBatch,
    Executor,
    Flight,
    FlightStore,
    OnProgress,
    ProgressTally,
    declared_numbers,
    parse_values,
    with_parameters,
    write_toml_file,
)
from airflock.scenarios import Scenario
from airflock.search.limit_excess import batch_excess, limit_reports, rank_by_excess
from airflock.search.optimisers import make_optimiser, pareto_front
from airflock.search.study import Objective, Study, candidate_losses, combine_scenarios
from airflock.search.study_result import (
    DURATION_COLUMN,
    EvolveResult,
    best_document,
    best_files,
    candidate_table,
    full_length_candidates,
    mean_interval,
    sort_by_fitness,
)
from airflock.support import StudyError

FlightScores = dict[tuple[int, int], Mapping[str, Any] | None]  # (candidate, repeat) → order parameters, None: failed


class NothingFliesError(StudyError):
    """A search has no winner, whatever its folder: all candidates fail, or their fitness is the same."""


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
        raise NothingFliesError(f"{study.scenario.name}: every candidate failed; the first one: {why}")
    if len(found) < FEWEST:
        return
    if max(found) - min(found) <= 1e-12 * max(1.0, abs(max(found))):
        raise NothingFliesError(
            f"{study.scenario.name}: nothing to search: {name} is flat, {found[0]:g} for all of {len(found)} candidates"
            f"{zero_fitness_reason(search_scores(store)) if found[0] == 0.0 else ''}"
        )


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


SCORE = CandidateBatch("score", 0, 0)


def total_finals(study: Study) -> int:
    """Return about how many flights choose among finalists and judge the winner."""
    flights = (study.whole("top") + study.whole("restarts") + 2) * study.whole("final_seeds")
    flights += round(sum(share * seeds for share, seeds in RACE_ROUNDS) * study.whole("pool"))
    return flights * len(study.scenarios)


def conclude_study(
    study: Study,
    store: FlightStore,
    executor: Executor,
    centres: Sequence[NDArray[np.float64]],
    folder: Path,
    on_progress: OnProgress | None = None,
) -> EvolveResult:
    """Evaluate finalists, choose the winner, and write best.toml into the study's folder.

    centres : final mean of each run, points of the unit cube
    on_progress : called after each flight

    Raises StudyError where every candidate of the search failed.
    """
    first = study.objectives[0]
    table = candidate_table(store, [objective.name for objective in study.objectives])
    sound = _sound_candidates(study, store, table, folder)
    tally = ProgressTally("finals", total_finals(study), on_progress, "finalists on fresh seeds")
    evaluator = Evaluator(study, store, executor, tally.note)
    points, origins = select_finalists(evaluator, sound, centres)
    rows, i = fly_finalists(evaluator, points)
    winner = study.space.parameters(points[i])
    unbiased = [study.seed(2, j) for j in range(study.whole("final_seeds"))]
    evaluator.evaluate(SCORE, points[i : i + 1], seeds=[unbiased])
    flown = store.flown(SCORE)
    values, each = _scored(study, flown)
    mean, sd, low, high = mean_interval(values)
    # The best value of the search is the luckiest, so the winner is scored on seeds that have
    # chosen nothing.
    # Working ranges are of those that keep all limits, if any of them does.
    safe = sound[sound[EXCESS_COLUMN] == 0.0] if study.limits and (sound[EXCESS_COLUMN] == 0.0).any() else sound
    good = safe[safe[first.name] >= mean] if first.maximise else safe[safe[first.name] <= mean]
    result = EvolveResult(
        folder=folder,
        scenario=with_parameters(study.scenario, winner),
        parameters=winner,
        fitness=mean,
        sd=sd,
        low=low,
        high=high,
        seeds=len(values),
        largest=float(safe[first.name].iloc[0]),
        origin=origins[i],
        ranges={key: (float(good[key].min()), float(good[key].max())) for key in study.space.keys if len(good)},
        above=len(good),
        candidate_count=len(table),
        failed=int(table[first.name].isna().sum()),
        reasons=store.reasons(),
        finalists=finalist_table(study, points, origins, rows),
        dead_reason=dead_reason(study, flown),
        scenarios=each,
        limits=tuple(limit_reports(study, [flown[0, r] for r in range(len(unbiased) * len(study.scenarios))])),
    )
    if not result.dead_reason:
        for place, name in enumerate(best_files(study)):
            document = best_document(study, winner, result, folder, place)
            write_toml_file(folder / name, document, "The winner of a study, ready to fly.")
    return result


def _sound_candidates(study: Study, store: FlightStore, table: pd.DataFrame, folder: Path) -> pd.DataFrame:
    """Return candidates of whole flights that did not fail, the best first; with limits also their excess."""
    first = study.objectives[0]
    whole = full_length_candidates(table, study.search.flights == "growing")
    if study.limits:
        whole = whole.assign(**{EXCESS_COLUMN: candidate_excesses(study, store, whole)})
    sound = sort_by_fitness(whole, first.name, first.maximise)
    if not len(sound):
        reason = next(iter(store.reasons()), f"{first.name} is nan or inf, no finite number")
        raise NothingFliesError(f"{folder}: every candidate failed; the first one: {reason}")
    return sound


def _scored(study: Study, flown: FlightScores) -> tuple[list[float], dict[str, tuple[float, float, float]]]:
    """Return the fitness of the winner's flights, one number a seed, and the interval in each of several scenarios.

    Over scenarios it is the mean in all of them on one seed, or that in the scenario whose mean is
    the worst.
    """
    first, n = study.objectives[0], len(study.scenarios)
    sound = [j for j in range(len(flown) // n) if all(flown[0, j * n + place] is not None for place in range(n))]
    table = np.array([[first.of_flight(flown[0, j * n + place] or {}) for place in range(n)] for j in sound]).reshape(
        -1, n
    )
    if n == 1:
        return table[:, 0].tolist(), {}
    each = {label: mean_interval(table[:, place].tolist()) for place, label in enumerate(study.labels)}
    means = table.mean(axis=0) * (1.0 if first.maximise else -1.0)
    values = table[:, int(np.argmin(means))] if study.over_scenarios == "worst" else table.mean(axis=1)
    return values.tolist(), {label: (mean, low, high) for label, (mean, _, low, high) in each.items()}


def dead_reason(study: Study, flown: FlightScores) -> str:
    """Return why a winner does not fly: its fitness, a product, is zero in all fresh flights of a scenario; else ""."""
    n = len(study.scenarios)
    for place, label in enumerate(study.labels):
        sound = [scores for (_, repeat), scores in flown.items() if repeat % n == place and scores is not None]
        if study.objectives[0].name != "fitness" or not sound or not _parts(sound):
            continue
        if max(float(row["fitness"]) for row in sound) < ZERO_FITNESS:
            reason = f"no candidate flies, so there is no best one{zero_fitness_reason(sound)}"
            return reason if n == 1 else f"{label}: {reason}"
    return ""


FINAL, HALF, AGAIN = CandidateBatch("final", 0, 0), CandidateBatch("final", 0, 1), CandidateBatch("again", 0, 0)
EXCESS_COLUMN = "excess"  # column: how far a candidate is from keeping all limits


def select_finalists(
    evaluator: Evaluator, candidates: pd.DataFrame, centres: Sequence[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], list[str]]:
    """Return points (candidate, axis) of finalists: the mean of each run, then the top of the search or its front."""
    study, store = evaluator.study, evaluator.store
    names, top = [objective.name for objective in study.objectives], study.whole("top")
    signs = np.array([-1.0 if objective.maximise else 1.0 for objective in study.objectives])
    known = candidates[candidates[names].notna().all(axis=1)].drop_duplicates(list(study.space.keys))
    losses = known[names].to_numpy() * signs
    # Ranks of excess come first here, too: a fast candidate that breaks limits must not fill the
    # final.
    if study.limits:
        losses = rank_by_excess(losses, known[EXCESS_COLUMN].to_numpy())
        order = np.argsort(losses[:, 0], kind="stable")
        known, losses = known.iloc[order], losses[order]
    if len(names) > 1:
        best = pareto_front(losses)
        best = best[np.argsort(losses[best, 0], kind="stable")]
        chosen = best[np.unique(np.linspace(0, len(best) - 1, min(top, len(best))).round().astype(int))]
    elif study.whole("pool") > top > 0:
        chosen = race_candidates(evaluator, _of_candidates(known, store.asked), losses[:, 0])
    else:
        chosen = np.arange(min(top, len(known)))
    if not len(chosen) and not centres:
        raise StudyError("search.top = 0 leaves no candidate to fly again; give at least 1")
    return np.array([*centres, *_of_candidates(known.iloc[chosen], store.asked)]), ["mean"] * len(centres) + [
        "top"
    ] * len(chosen)


def fly_finalists(evaluator: Evaluator, points: NDArray[np.float64]) -> tuple[Sequence[Sequence[float | None]], int]:
    """Fly the finalists on the same fresh seeds; return their fitness by objective, and the index of the best."""
    study = evaluator.study
    fresh = [study.seed(1, j) for j in range(study.whole("final_seeds"))]
    if study.whole("again"):
        return fly_by_successive_halving(evaluator, points, fresh)
    rows = evaluator.evaluate(FINAL, points, seeds=[fresh] * len(points))
    return rows, _winner(study, rows, batch_excess(study, evaluator.store, FINAL) if study.limits else None)


def fly_by_successive_halving(
    evaluator: Evaluator, points: NDArray[np.float64], fresh: Sequence[int]
) -> tuple[list[list[float | None]], int]:
    """Let all finalists fly a third of the fresh seeds, the better half the others, the best twice as many again.

    Returns the fitness of all finalists, of each over all its flights, and the index of the best of
    the last round.
    """
    # A third of the seeds for all, the rest for the better half: 660 of 6,208 flights were mostly
    # spent on points that were far behind after 20; the median search went from 243 to 234 s.
    study, first, again = evaluator.study, max(1, len(fresh) // 3), evaluator.study.whole("again")
    further = [study.seed(1, len(fresh) + j) for j in range(2 * len(fresh))]
    half = max(again, (len(points) + 1) // 2)
    rows = [row[0] for row in evaluator.evaluate(FINAL, points, seeds=[fresh[:first]] * len(points))]
    alive, flown = list(range(len(points))), first
    for batch, most, seeds in ((HALF, half, fresh[first:]), (AGAIN, again, further)):
        alive = _best(study, rows, alive, most)
        if not alive:
            break
        found = evaluator.evaluate(batch, points[alive], seeds=[seeds] * len(alive))
        for k, (value,) in zip(alive, found, strict=True):
            before = float(rows[k] or 0.0)
            rows[k] = None if value is None else (flown * before + len(seeds) * value) / (flown + len(seeds))
        flown += len(seeds)
    both = [[value] for value in rows]
    return both, alive[_winner(study, [both[k] for k in alive])] if alive else _winner(study, both)


def _best(study: Study, values: Sequence[float | None], among: Sequence[int], most: int) -> list[int]:
    """Return the indices of the best candidates that have not failed, the best first."""
    sign = -1.0 if study.objectives[0].maximise else 1.0
    sound = [k for k in among if values[k] is not None]
    return sorted(sound, key=lambda k: sign * float(values[k] or 0.0))[:most]


def finalist_table(
    study: Study, points: NDArray[np.float64], origins: Sequence[str], fitness_rows: Sequence[Sequence[float | None]]
) -> pd.DataFrame:
    """Return the finalists as a table: origin, parameters, fitness on fresh seeds."""
    names = [objective.name for objective in study.objectives]
    return pd.DataFrame(
        [
            {"origin": origin, **study.space.parameters(point), **dict(zip(names, row, strict=True))}
            for origin, point, row in zip(origins, points, fitness_rows, strict=True)
        ]
    )


def _winner(study: Study, rows: Sequence[Sequence[float | None]], excess: NDArray[np.float64] | None = None) -> int:
    """Return the index of the best finalist; with several objectives, of the one nearest to the best of each.

    excess : how far each is from keeping all limits; the one that is nearest wins, of equals the
             fittest
    """
    signs = np.array([1.0 if objective.maximise else -1.0 for objective in study.objectives])
    table = np.array([[np.nan if v is None else v for v in row] for row in rows], float) * signs
    sound = np.isfinite(table).all(axis=1)
    if not sound.any():
        raise StudyError("every finalist failed on fresh seeds; the store says why in the column reason")
    if excess is not None:
        sound &= excess == excess[sound].min()
    if table.shape[1] == 1:
        return int(np.argmax(np.where(sound, table[:, 0], -np.inf)))
    best, worst = table[sound].max(axis=0), table[sound].min(axis=0)
    # Each objective is scaled by its range over the front, so that units do not decide.
    away = ((best - table) / np.where(best > worst, best - worst, 1.0)) ** 2
    return int(np.argmin(np.where(sound, away.sum(axis=1), np.inf)))


def _of_candidates(table: pd.DataFrame, read: Callable[[CandidateBatch], Any]) -> NDArray[np.float64]:
    """Return what is read of the generations of the search, for each candidate of a table."""
    known: dict[CandidateBatch, Any] = {}
    found = []
    for run, generation, candidate in zip(table["run"], table["generation"], table["candidate"], strict=True):
        batch = CandidateBatch("search", int(run), int(generation))
        if batch not in known:
            known[batch] = read(batch)
        found.append(known[batch][candidate])
    return np.array(found)


def candidate_excesses(study: Study, store: FlightStore, table: pd.DataFrame) -> NDArray[np.float64]:
    """Return how far each candidate of the search is from keeping all limits, in the order of the table."""
    durations = table[DURATION_COLUMN] if DURATION_COLUMN in table else pd.Series(np.nan, table.index)
    shares = (durations / study.scenario.flight.duration).fillna(1.0)
    rows = reversed([*zip(table["run"], table["generation"], shares, strict=True)])  # the first of each counts
    of_batch = {(run, generation): share for run, generation, share in rows}
    return _of_candidates(table, lambda batch: batch_excess(study, store, batch, of_batch[batch[1:]]))


NEIGHBOURS = 10
RACE_ROUNDS = ((1.0, 4), (0.25, 16))  # share of the pool that flies, and with how many seeds
UPPER = 0.2  # share of all candidates whose spread is the unit of distance


def smoothed_losses(points: NDArray[np.float64], losses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean loss (candidate,) over each candidate and its neighbours; points (candidate, axis)."""
    # Axes are scaled by the spread of the good candidates: along an axis that matters they stand
    # close together.
    good = points[np.argsort(losses, kind="stable")[: max(2, int(UPPER * len(points)))]]
    scale = np.maximum(good.std(axis=0), 1e-9)
    tree = cKDTree(points / scale)
    _, near = tree.query(points / scale, k=min(NEIGHBOURS, len(points)))
    return np.asarray(losses[np.asarray(near).reshape(len(points), -1)].mean(axis=1))


def race_candidates(
    evaluator: Evaluator, points: NDArray[np.float64], losses: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Race candidates; return the indices of the winners, the best first, at most `search.top`.

    points : (candidate, axis) of all candidates that did not fail
    losses : (candidate,), less is better; candidates that break limits come after all others
    """
    study = evaluator.study
    pool, top = study.whole("pool"), study.whole("top")
    alive = np.argsort(smoothed_losses(points, losses), kind="stable")[:pool]
    number = 0
    for k, (share, seeds) in enumerate(RACE_ROUNDS):
        alive = alive[: max(top, round(share * pool))]
        numbers = [[study.seed(4, number + j) for j in range(seeds)]] * len(alive)
        # Fresh seeds in each round: the winners of a round are partly lucky on its seeds.
        number += seeds
        batch = CandidateBatch("race", 0, k)
        found = candidate_losses(evaluator.evaluate(batch, points[alive], seeds=numbers), study.objectives)
        if study.limits:
            found = rank_by_excess(found, batch_excess(study, evaluator.store, batch))
        alive = alive[np.argsort(found[:, 0], kind="stable")]
    return alive[:top]
