"""Finals of a search: the best candidate without its luck, and the ranges of parameters that work.

The best of 15,000 noisy evaluations is the luckiest as much as the best. The final mean of each run
and the top candidates (of a race, `airflock.search.finals`) fly again on the same fresh seeds, the
winner once more on other fresh seeds for an unbiased score; working ranges are those of Table S1:
where candidates of the search reached at least the winner's mean.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from airflock.runs import (
    CandidateBatch,
    Executor,
    FlightStore,
    OnProgress,
    ProgressTally,
    with_parameters,
    write_toml_file,
)
from airflock.search.generations import Evaluator, dead_reason
from airflock.search.limit_excess import batch_excess, limit_reports, rank_by_excess
from airflock.search.objectives import candidate_losses as losses_of
from airflock.search.optimisers import pareto_front
from airflock.search.study import Study
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

SCORE = CandidateBatch("score", 0, 0)


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
    flights = (study.whole("top") + study.whole("restarts") + 2) * study.whole("final_seeds")
    flights += round(sum(share * seeds for share, seeds in RACE_ROUNDS) * study.whole("pool"))
    tally = ProgressTally("finals", flights * len(study.scenarios), on_progress, "finalists on fresh seeds")
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
        reasons=store.reasons(),
        finalists=finalist_table(study, points, origins, rows),
        dead_reason=_dead(study, flown),
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
        raise StudyError(f"{folder}: every candidate failed; the first one: {reason}")
    return sound


def _safe(study: Study, sound: pd.DataFrame) -> pd.DataFrame:
    """Return the candidates that keep all limits; all candidates if there are no limits or none keeps them."""
    if study.limits and (sound[EXCESS_COLUMN] == 0.0).any():
        return sound[sound[EXCESS_COLUMN] == 0.0]
    return sound


def _as_good(study: Study, candidates: pd.DataFrame, fitness: float) -> pd.DataFrame:
    """Return the candidates of the search that reach a fitness."""
    first = study.objectives[0]
    reached = candidates[first.name] >= fitness if first.maximise else candidates[first.name] <= fitness
    return candidates[reached]


def _scored(
    study: Study, flown: Mapping[tuple[int, int], Mapping[str, Any] | None]
) -> tuple[list[float], dict[str, tuple[float, float, float]]]:
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


def _dead(study: Study, flown: Mapping[tuple[int, int], Mapping[str, Any] | None]) -> str:
    """Return why the winner does not fly in the first such scenario; else empty."""
    n = len(study.scenarios)
    for place, label in enumerate(study.labels):
        rows = [scores for (_, repeat), scores in flown.items() if repeat % n == place]
        if found := dead_reason(study, rows):
            return found if n == 1 else f"{label}: {found}"
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
        chosen = race_candidates(evaluator, _points(store, known), losses[:, 0])
    else:
        chosen = np.arange(min(top, len(known)))
    if not len(chosen) and not centres:
        raise StudyError("search.top = 0 leaves no candidate to fly again; give at least 1")
    return np.array([*centres, *_points(store, known.iloc[chosen])]), ["mean"] * len(centres) + ["top"] * len(chosen)


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
    # Each objective is scaled by its range over the front, so that units do not decide.
    away = ((best - table) / np.where(best > worst, best - worst, 1.0)) ** 2
    return int(np.argmin(np.where(sound, away.sum(axis=1), np.inf)))


def _points(store: FlightStore, table: pd.DataFrame) -> NDArray[np.float64]:
    """Return the points (candidate, axis) of candidates of the search from the store."""
    pairs = {(int(run), int(g)) for run, g in zip(table["run"], table["generation"], strict=True)}
    batches = {pair: store.asked(CandidateBatch("search", *pair)) for pair in pairs}
    places = zip(table["run"], table["generation"], table["candidate"], strict=True)
    return np.array([batches[run, generation][candidate] for run, generation, candidate in places])


def candidate_excesses(study: Study, store: FlightStore, table: pd.DataFrame) -> NDArray[np.float64]:
    """Return how far each candidate of the search is from keeping all limits, in the order of the table."""
    found: dict[tuple[int, int], NDArray[np.float64]] = {}
    durations = table[DURATION_COLUMN] if DURATION_COLUMN in table else pd.Series(np.nan, table.index)
    for run, generation, flown in zip(table["run"], table["generation"], durations, strict=True):
        if (run, generation) not in found:
            share = 1.0 if np.isnan(flown) else float(flown) / study.scenario.flight.duration
            found[run, generation] = batch_excess(
                study, store, CandidateBatch("search", int(run), int(generation)), share
            )
    places = zip(table["run"], table["generation"], table["candidate"], strict=True)
    return np.array([found[run, generation][candidate] for run, generation, candidate in places])


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
        found = losses_of(evaluator.evaluate(batch, points[alive], seeds=numbers), study.objectives)
        if study.limits:
            found = rank_by_excess(found, batch_excess(study, evaluator.store, batch))
        alive = alive[np.argsort(found[:, 0], kind="stable")]
    return alive[:top]
