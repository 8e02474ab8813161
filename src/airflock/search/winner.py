"""The winner of a search: who is best when luck is taken out, and which parameters work.

The best of 15,000 noisy evaluations is the luckiest as much as the best. The final mean of each run and the top
candidates (of a race, `airflock.search.race`) fly again on the same fresh seeds, the winner once more on other fresh
seeds for an unbiased score; working ranges are those of Table S1: where candidates of the search reached at least the
winner's mean.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airflock.runs import CandidateBatch, Executor, FlightStore, with_parameters, write_toml_file
from airflock.search import tables
from airflock.search.evaluator import Evaluator
from airflock.search.finalists import EXCESS_COLUMN, candidate_excesses, finalist_table, fly_finalists, select_finalists
from airflock.search.intervals import mean_interval
from airflock.search.landscape import dead_reason
from airflock.search.result import RESULT_FILE, EvolveResult, best_document, best_files
from airflock.search.safe import limit_reports
from airflock.search.study import Study
from airflock.support import StudyError

SCORE = CandidateBatch("score", 0, 0)


def conclude_study(
    study: Study,
    store: FlightStore,
    executor: Executor,
    centres: Sequence[NDArray[np.float64]],
    folder: Path,
    on_flight: Callable[[bool], None] | None = None,
) -> EvolveResult:
    """Re-evaluate, choose, and write result.toml, best.toml and the tables into the study's folder.

    centres : final mean of each run, points of the unit cube
    note    : called after each flight, with whether it is a new one

    Raises StudyError where every candidate of the search failed.
    """
    first = study.objectives[0]
    table = tables.candidate_table(store, [objective.name for objective in study.objectives])
    sound = _sound_candidates(study, store, table, folder)
    evaluator = Evaluator(study, store, executor, on_flight)
    points, origins = select_finalists(evaluator, sound, centres)
    rows, i = fly_finalists(evaluator, points)
    winner = study.space.parameters(points[i])
    unbiased = [study.seed(2, j) for j in range(study.whole("final_seeds"))]
    evaluator.evaluate(SCORE, points[i : i + 1], seeds=[unbiased])
    flown = store.flown(SCORE)
    values, each = _scored(study, flown)
    mean, sd, low, high = mean_interval(values)
    safe = _safe(study, sound)
    good = _as_good(study, safe, mean)
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
        finalists=finalist_table(study, points, origins, rows),
        dead_reason=_dead(study, flown),
        scenarios=each,
        limits=tuple(limit_reports(study, [flown[0, r] for r in range(len(unbiased) * len(study.scenarios))])),
    )
    write_toml_file(folder / RESULT_FILE, result.document(), "What the study found; parameters and ranges in SI units.")
    if not result.dead_reason:
        for place, name in enumerate(best_files(study)):
            document = best_document(study, winner, result, folder, place)
            write_toml_file(folder / name, document, "The winner of a study, ready to fly.")
    tables.export(store, folder, study.labels)
    return result


def _sound_candidates(study: Study, store: FlightStore, table: pd.DataFrame, folder: Path) -> pd.DataFrame:
    """Candidates of whole flights that did not fail, the best first; with limits also how far each is from them."""
    first = study.objectives[0]
    whole = tables.full_length_candidates(table, study.search.flights == "growing")
    if study.limits:
        whole = whole.assign(**{EXCESS_COLUMN: candidate_excesses(study, store, whole)})
    sound = tables.sort_by_fitness(whole, first.name, first.maximise)
    if not len(sound):
        reason = store.rows("SELECT reason FROM flight WHERE reason <> '' LIMIT 1")
        raise StudyError(f"{folder}: every candidate failed; the first one: {reason[0][0] if reason else 'unknown'}")
    return sound


def _safe(study: Study, sound: pd.DataFrame) -> pd.DataFrame:
    """Candidates that keep all limits; all of them where there are no limits, or nobody keeps them."""
    if study.limits and (sound[EXCESS_COLUMN] == 0.0).any():
        return sound[sound[EXCESS_COLUMN] == 0.0]
    return sound


def _as_good(study: Study, candidates: pd.DataFrame, fitness: float) -> pd.DataFrame:
    """Candidates of the search that reach a fitness."""
    first = study.objectives[0]
    reached = candidates[first.name] >= fitness if first.maximise else candidates[first.name] <= fitness
    return candidates[reached]


def _scored(
    study: Study, flown: Mapping[tuple[int, int], Mapping[str, Any] | None]
) -> tuple[list[float], dict[str, tuple[float, float, float]]]:
    """Fitness of the winner's flights, one number a seed, and of several scenarios the interval in each.

    Over scenarios it is the mean in all of them on one seed, or that in the scenario whose mean is the worst.
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


def _dead(study: Study, flown: Mapping[tuple[int, int], Mapping[str, Any] | None]) -> str:
    """Why the winner does not fly, in the first scenario in which it does not; else empty."""
    n = len(study.scenarios)
    for place, label in enumerate(study.labels):
        rows = [scores for (_, repeat), scores in flown.items() if repeat % n == place]
        if found := dead_reason(study, rows):
            return found if n == 1 else f"{label}: {found}"
    return ""
