"""Finalists of a search: who flies again on fresh seeds, and which of them is the best there."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airflock.runs import CandidateBatch, FlightStore
from airflock.search import tables
from airflock.search.evaluator import Evaluator
from airflock.search.nondominated import pareto_front
from airflock.search.race import race_candidates
from airflock.search.safe import batch_excess, rank_by_excess
from airflock.search.study import Study
from airflock.support import StudyError

FINAL, HALF, AGAIN = CandidateBatch("final", 0, 0), CandidateBatch("final", 0, 1), CandidateBatch("again", 0, 0)
EXCESS_COLUMN = "excess"  # column: how far a candidate is from keeping all limits


def select_finalists(
    evaluator: Evaluator, candidates: pd.DataFrame, centres: Sequence[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], list[str]]:
    """Points (candidate, axis) that fly again: the mean of each run, then the top of the search or its front."""
    study, store = evaluator.study, evaluator.store
    names, top = [objective.name for objective in study.objectives], study.whole("top")
    signs = np.array([-1.0 if objective.maximise else 1.0 for objective in study.objectives])
    known = candidates[candidates[names].notna().all(axis=1)].drop_duplicates(list(study.space.keys))
    losses = known[names].to_numpy() * signs
    if study.limits:
        losses = rank_by_excess(losses, known[EXCESS_COLUMN].to_numpy())
        order = np.argsort(losses[:, 0], kind="stable")
        known, losses = known.iloc[order], losses[order]
    if len(names) > 1:
        best = pareto_front(losses)
        best = best[np.argsort(losses[best, 0], kind="stable")]
        chosen = best[np.unique(np.linspace(0, len(best) - 1, min(top, len(best))).round().astype(int))]
    elif study.whole("pool") > top > 0:
        chosen = race_candidates(evaluator, _points(store, known), losses[:, 0])
    else:
        chosen = np.arange(min(top, len(known)))
    if not len(chosen) and not centres:
        raise StudyError("search.top = 0 leaves no candidate to fly again; give at least 1")
    return np.array([*centres, *_points(store, known.iloc[chosen])]), ["mean"] * len(centres) + ["top"] * len(chosen)


def fly_finalists(evaluator: Evaluator, points: NDArray[np.float64]) -> tuple[Sequence[Sequence[float | None]], int]:
    """Fitness of each finalist on the same fresh seeds, by objective, and the index of the best."""
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

    Returns the fitness of all finalists, of each over all its flights, and the index of the best of the last round.
    """
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
    """Indices of the best that have not failed, the best first."""
    sign = -1.0 if study.objectives[0].maximise else 1.0
    sound = [k for k in among if values[k] is not None]
    return sorted(sound, key=lambda k: sign * float(values[k] or 0.0))[:most]


def finalist_table(
    study: Study, points: NDArray[np.float64], origins: Sequence[str], fitness_rows: Sequence[Sequence[float | None]]
) -> pd.DataFrame:
    """Finalists as a table: origin, parameters, fitness on fresh seeds."""
    names = [objective.name for objective in study.objectives]
    return pd.DataFrame(
        [
            {"origin": origin, **study.space.parameters(point), **dict(zip(names, row, strict=True))}
            for origin, point, row in zip(origins, points, fitness_rows, strict=True)
        ]
    )


def _winner(study: Study, rows: Sequence[Sequence[float | None]], excess: NDArray[np.float64] | None = None) -> int:
    """Index of the best finalist; of several objectives, the one nearest to the best of each.

    excess : how far each is from keeping all limits; the one that is nearest wins, of equals the fittest
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
    away = ((best - table) / np.where(best > worst, best - worst, 1.0)) ** 2
    return int(np.argmin(np.where(sound, away.sum(axis=1), np.inf)))


def _points(store: FlightStore, table: pd.DataFrame) -> NDArray[np.float64]:
    """Points (candidate, axis) of candidates of the search, as they were asked for."""
    pairs = {(int(run), int(g)) for run, g in zip(table["run"], table["generation"], strict=True)}
    batches = {pair: store.asked(CandidateBatch("search", *pair)) for pair in pairs}
    places = zip(table["run"], table["generation"], table["candidate"], strict=True)
    return np.array([batches[run, generation][candidate] for run, generation, candidate in places])


def candidate_excesses(study: Study, store: FlightStore, table: pd.DataFrame) -> NDArray[np.float64]:
    """How far each candidate of the search is from keeping all limits, in the order of the table."""
    found: dict[tuple[int, int], NDArray[np.float64]] = {}
    durations = table[tables.DURATION_COLUMN] if tables.DURATION_COLUMN in table else pd.Series(np.nan, table.index)
    for run, generation, flown in zip(table["run"], table["generation"], durations, strict=True):
        if (run, generation) not in found:
            share = 1.0 if np.isnan(flown) else float(flown) / study.scenario.flight.duration
            found[run, generation] = batch_excess(
                study, store, CandidateBatch("search", int(run), int(generation)), share
            )
    places = zip(table["run"], table["generation"], table["candidate"], strict=True)
    return np.array([found[run, generation][candidate] for run, generation, candidate in places])
