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

from airflock.runs.executors import Executor
from airflock.runs.folder import write
from airflock.runs.space import with_parameters
from airflock.runs.store import Batch, Store
from airflock.search import tables
from airflock.search.evaluator import Evaluator
from airflock.search.finalists import EXCESS, excesses, finalist_table, finalists, fly_finalists
from airflock.search.intervals import interval
from airflock.search.landscape import dead
from airflock.search.result import RESULT, Result, best_files, scenario_document
from airflock.search.safe import kept
from airflock.search.study import Study
from airflock.support.errors import StudyError

SCORE = Batch("score", 0, 0)


def conclude(
    study: Study,
    store: Store,
    executor: Executor,
    centres: Sequence[NDArray[np.float64]],
    folder: Path,
    note: Callable[[bool], None] | None = None,
) -> Result:
    """Re-evaluate, choose, and write result.toml, best.toml and the tables into the study's folder.

    centres : final mean of each run, points of the unit cube
    note    : called after each flight, with whether it is a new one

    Raises StudyError where every candidate of the search failed.
    """
    first = study.objectives[0]
    table = tables.candidates(store, [objective.name for objective in study.objectives])
    sound = _sound_candidates(study, store, table, folder)
    evaluator = Evaluator(study, store, executor, note)
    points, origins = finalists(evaluator, sound, centres)
    rows, i = fly_finalists(evaluator, points)
    winner = study.space.parameters(points[i])
    unbiased = [study.seed(2, j) for j in range(study.whole("final_seeds"))]
    evaluator.evaluate(SCORE, points[i : i + 1], seeds=[unbiased])
    flown = store.flown(SCORE)
    values, each = _scored(study, flown)
    mean, sd, low, high = interval(values)
    safe = _safe(study, sound)
    good = _as_good(study, safe, mean)
    result = Result(
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
        candidates=len(table),
        failed=int(table[first.name].isna().sum()),
        finalists=finalist_table(study, points, origins, rows),
        dead=_dead(study, flown),
        scenarios=each,
        limits=tuple(kept(study, [flown[0, r] for r in range(len(unbiased) * len(study.scenarios))])),
    )
    write(folder / RESULT, result.document(), "What the study found; parameters and ranges in SI units.")
    if not result.dead:
        for place, name in enumerate(best_files(study)):
            document = scenario_document(study, winner, result, folder, place)
            write(folder / name, document, "The winner of a study, ready to fly.")
    tables.export(store, folder, study.labels)
    return result


def _sound_candidates(study: Study, store: Store, table: pd.DataFrame, folder: Path) -> pd.DataFrame:
    """Candidates of whole flights that did not fail, the best first; with limits also how far each is from them."""
    first = study.objectives[0]
    whole = tables.whole_flights(table, study.search.flights == "growing")
    if study.limits:
        whole = whole.assign(**{EXCESS: excesses(study, store, whole)})
    sound = tables.best_first(whole, first.name, first.maximise)
    if not len(sound):
        reason = store.rows("SELECT reason FROM flight WHERE reason <> '' LIMIT 1")
        raise StudyError(f"{folder}: every candidate failed; the first one: {reason[0][0] if reason else 'unknown'}")
    return sound


def _safe(study: Study, sound: pd.DataFrame) -> pd.DataFrame:
    """Candidates that keep all limits; all of them where there are no limits, or nobody keeps them."""
    if study.limits and (sound[EXCESS] == 0.0).any():
        return sound[sound[EXCESS] == 0.0]
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
    each = {label: interval(table[:, place].tolist()) for place, label in enumerate(study.labels)}
    means = table.mean(axis=0) * (1.0 if first.maximise else -1.0)
    values = table[:, int(np.argmin(means))] if study.over_scenarios == "worst" else table.mean(axis=1)
    return values.tolist(), {label: (mean, low, high) for label, (mean, _, low, high) in each.items()}


def _dead(study: Study, flown: Mapping[tuple[int, int], Mapping[str, Any] | None]) -> str:
    """Why the winner does not fly, in the first scenario in which it does not; else empty."""
    n = len(study.scenarios)
    for place, label in enumerate(study.labels):
        rows = [scores for (_, repeat), scores in flown.items() if repeat % n == place]
        if found := dead(study, rows):
            return found if n == 1 else f"{label}: {found}"
    return ""
