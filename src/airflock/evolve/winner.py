"""The winner of a search: who is best when luck is taken out, and which parameters work.

The best of 15,000 noisy evaluations is the luckiest as much as the best. The final mean of each run and the top
candidates (of a race, `airflock.evolve.race`) fly again on the same fresh seeds, the winner once more on other fresh
seeds for an unbiased score; working ranges are those of Table S1: where candidates of the search reached at least the
winner's mean.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airflock import atomic
from airflock.errors import StudyError
from airflock.evolve import portrait, tables
from airflock.evolve.evaluator import Evaluator
from airflock.evolve.folder import plain, write
from airflock.evolve.intervals import interval
from airflock.evolve.landscape import dead
from airflock.evolve.nondominated import front
from airflock.evolve.race import race
from airflock.evolve.safe import excess_of, kept, safe_first
from airflock.evolve.space import with_parameters
from airflock.evolve.store import Batch, Store
from airflock.evolve.study import Study
from airflock.executors import Executor
from airflock.scenarios import formats
from airflock.scenarios.scenario import Scenario

FINAL, AGAIN, SCORE = Batch("final", 0, 0), Batch("again", 0, 0), Batch("score", 0, 0)
EXCESS = "excess"  # column: how far a candidate is from keeping all limits
RESULT, BEST = "result.toml", "best.toml"


@dataclass(frozen=True)
class Result:
    """What a study found.

    parameters : of the winner, by key; scenario : with these parameters
    fitness, sd, low, high, seeds : of the winner on fresh seeds, with Student's 95 % interval of the mean
    largest    : best candidate of the search, luck included
    origin     : "mean" or "top": what the winner was
    ranges     : key → (low, high) over the `above` candidates of the search that reach the winner's fitness
    finalists  : one row each: origin, parameters, fitness on fresh seeds
    failed     : candidates of the search that failed
    scenarios  : of several: what each is called → mean, low and high of the winner's fitness in it
    limits     : what the winner's fresh flights say of each limit: events, flights, estimated and allowed probability
    dead       : why nothing flies, in words; then no best.toml is written; empty if something flies
    """

    folder: Path
    scenario: Scenario
    parameters: dict[str, float]
    fitness: float
    sd: float
    low: float
    high: float
    seeds: int
    largest: float
    origin: str
    ranges: dict[str, tuple[float, float]]
    above: int
    candidates: int
    failed: int
    finalists: pd.DataFrame
    dead: str = ""
    scenarios: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    limits: tuple[Mapping[str, Any], ...] = ()

    def __repr__(self) -> str:
        return f"<{portrait.result_sentence(self)}>"

    def _repr_html_(self) -> str:
        """A table of the winner's parameters, for a notebook."""
        return portrait.result_html(self)

    def document(self) -> dict[str, Any]:
        """The result as plain values, for result.toml and --json.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
        >>> vary = {"model": {"p_rep": {"low": 0.0, "high": 1.0}}}
        >>> few = {"population": 4, "generations": 2, "pool": 2, "top": 1, "final_seeds": 2}
        >>> airflock.evolve(short, "study", space=vary, **few).document()["fitness"]["seeds"]
        2
        """
        return {
            "scenario": self.scenario.name,
            "fitness": {
                "mean": self.fitness,
                "sd": self.sd,
                "low": self.low,
                "high": self.high,
                "seeds": self.seeds,
                "largest_in_search": self.largest,
            },
            "origin": self.origin,
            **({"dead": self.dead} if self.dead else {}),
            "parameters": self.parameters,
            **({"limits": [dict(entry) for entry in self.limits]} if self.limits else {}),
            **({"scenarios": [_told(name, *span) for name, span in self.scenarios.items()]} if self.scenarios else {}),
            "working_ranges": {
                "candidates": self.candidates,
                "failed": self.failed,
                "above_mean": self.above,
                "range": {key: list(span) for key, span in self.ranges.items()},
            },
        }


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
    rows, i = _fly_finalists(evaluator, points)
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
        finalists=_finalist_table(study, points, origins, rows),
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
        whole = whole.assign(**{EXCESS: _excess(study, store, whole)})
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


def _fly_finalists(evaluator: Evaluator, points: NDArray[np.float64]) -> tuple[Sequence[Sequence[float | None]], int]:
    """Fitness of each finalist on the same fresh seeds, by objective, and the index of the best."""
    study = evaluator.study
    fresh = [study.seed(1, j) for j in range(study.whole("final_seeds"))]
    rows = evaluator.evaluate(FINAL, points, seeds=[fresh] * len(points))
    if study.whole("again"):
        return flown_again(evaluator, points, rows)
    return rows, _winner(study, rows, excess_of(study, evaluator.store, FINAL) if study.limits else None)


def _finalist_table(
    study: Study, points: NDArray[np.float64], origins: Sequence[str], rows: Sequence[Sequence[float | None]]
) -> pd.DataFrame:
    """Finalists as a table: origin, parameters, fitness on fresh seeds."""
    names = [objective.name for objective in study.objectives]
    return pd.DataFrame(
        [
            {"origin": origin, **study.space.parameters(point), **dict(zip(names, row, strict=True))}
            for origin, point, row in zip(origins, points, rows, strict=True)
        ]
    )


def flown_again(
    evaluator: Evaluator, points: NDArray[np.float64], rows: Sequence[Sequence[float | None]]
) -> tuple[list[list[float | None]], int]:
    """Let the best finalists fly twice as many further seeds.

    Returns the fitness of all finalists, of these over all their flights, and the index of the best of these.
    """
    study = evaluator.study
    sign, n = (1.0 if study.objectives[0].maximise else -1.0), study.whole("final_seeds")
    sound = [k for k, row in enumerate(rows) if row[0] is not None]
    best = sorted(sound, key=lambda k: -sign * float(rows[k][0] or 0.0))[: study.whole("again")]
    further = [study.seed(1, n + j) for j in range(2 * n)]
    found = evaluator.evaluate(AGAIN, points[best], seeds=[further] * len(best))
    both = [list(row) for row in rows]
    for k, (value,) in zip(best, found, strict=True):
        both[k] = [None if value is None else (float(rows[k][0] or 0.0) + 2.0 * value) / 3.0]
    return both, best[_winner(study, [both[k] for k in best])] if best else _winner(study, rows)


def best_files(study: Study) -> list[str]:
    """Files that hold the winner: best.toml, and best_2.toml and so on for further scenarios."""
    return [BEST, *(f"best_{place}.toml" for place in range(2, len(study.scenarios) + 1))]


def further_best(folder: Path) -> list[Path]:
    """Files of the winner in the further scenarios of a study's folder, in their order."""
    found = (folder / f"best_{place}.toml" for place in itertools.count(2))
    return list(itertools.takewhile(Path.is_file, found))


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


def _told(name: str, mean: float, low: float, high: float) -> dict[str, Any]:
    return {"scenario": name, "mean": mean, "low": low, "high": high}


def finalists(
    evaluator: Evaluator, sound: pd.DataFrame, centres: Sequence[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], list[str]]:
    """Points (candidate, axis) that fly again: the mean of each run, then the top of the search or its front."""
    study, store = evaluator.study, evaluator.store
    names, top = [objective.name for objective in study.objectives], study.whole("top")
    signs = np.array([-1.0 if objective.maximise else 1.0 for objective in study.objectives])
    known = sound[sound[names].notna().all(axis=1)].drop_duplicates(list(study.space.keys))
    losses = known[names].to_numpy() * signs
    if study.limits:
        losses = safe_first(losses, known[EXCESS].to_numpy())
        order = np.argsort(losses[:, 0], kind="stable")
        known, losses = known.iloc[order], losses[order]
    if len(names) > 1:
        best = front(losses)
        best = best[np.argsort(losses[best, 0], kind="stable")]
        chosen = best[np.unique(np.linspace(0, len(best) - 1, min(top, len(best))).round().astype(int))]
    elif study.whole("pool") > top > 0:
        chosen = race(evaluator, _points(store, known), losses[:, 0])
    else:
        chosen = np.arange(min(top, len(known)))
    if not len(chosen) and not centres:
        raise StudyError("search.top = 0 leaves no candidate to fly again; give at least 1")
    return np.array([*centres, *_points(store, known.iloc[chosen])]), ["mean"] * len(centres) + ["top"] * len(chosen)


def _points(store: Store, table: pd.DataFrame) -> NDArray[np.float64]:
    """Points (candidate, axis) of candidates of the search, as they were asked for."""
    pairs = {(int(run), int(g)) for run, g in zip(table["run"], table["generation"], strict=True)}
    batches = {pair: store.asked(Batch("search", *pair)) for pair in pairs}
    places = zip(table["run"], table["generation"], table["candidate"], strict=True)
    return np.array([batches[run, generation][candidate] for run, generation, candidate in places])


def _excess(study: Study, store: Store, table: pd.DataFrame) -> NDArray[np.float64]:
    """How far each candidate of the search is from keeping all limits, in the order of the table."""
    found: dict[tuple[int, int], NDArray[np.float64]] = {}
    durations = table[tables.DURATION] if tables.DURATION in table else pd.Series(np.nan, table.index)
    for run, generation, flown in zip(table["run"], table["generation"], durations, strict=True):
        if (run, generation) not in found:
            share = 1.0 if np.isnan(flown) else float(flown) / study.scenario.flight.duration
            found[run, generation] = excess_of(study, store, Batch("search", int(run), int(generation)), share)
    places = zip(table["run"], table["generation"], table["candidate"], strict=True)
    return np.array([found[run, generation][candidate] for run, generation, candidate in places])


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


def scenario_document(
    study: Study, parameters: dict[str, float], result: Result, folder: Path, place: int = 0
) -> dict[str, Any]:
    """A scenario file with the winner's parameters, each with its source; a law in a file of its own comes along.

    place : which of the study's scenarios
    """
    scenario = study.scenarios[place]
    document = {formats.KEY: formats.FORMAT, **plain(scenario.document)}
    document.pop("published", None)
    law = Path(scenario.name).parent / str(document.get("model", {}).get("kind", ""))
    if law.suffix == ".py" and law.is_file():
        atomic.write(folder / law.name, law.read_bytes())
        document["model"]["kind"] = law.name
    source = f"evolved: {study.search.algorithm}, {result.candidates} evaluations, seed {study.whole('seed')}"
    units = {axis.key: axis.unit for axis in study.space.axes}
    for key, value in parameters.items():
        section, _, name = key.rpartition(".")
        entry: dict[str, Any] = {"value": value, "source": source}
        if key in units:
            entry = {"value": value, "unit": units[key], "source": source}
        (document.setdefault(section, {}) if section else document)[name] = entry
    document["title"] = f"evolved from {scenario.name}: {study.objectives[0].name} {result.fitness:.4f}"
    return dict(document)
