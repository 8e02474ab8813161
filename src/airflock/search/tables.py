"""A study as tidy tables: one row a flight, or one row a candidate; and their export to CSV and parquet."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from airflock.runs import FlightStore, parse_values
from airflock.support import FormatError, StudyError, as_error, atomic, parse_json

DURATION_COLUMN = "duration"  # key of the scenario that short flights set, column of their table
FLOWN = "duration_flown"  # that column beside `duration`, the time that a flight took
KEY = ["stage", "run", "generation", "candidate"]


def candidate_table(store: FlightStore, objectives: Sequence[str], stage: str = "search") -> pd.DataFrame:
    """One row a candidate: its parameters by key, then its fitness, one column for each objective; nan: failed."""
    rows = store.rows(
        "SELECT run, generation, candidate, parameters, fitness FROM candidate WHERE stage=? AND fitness IS NOT NULL "
        "ORDER BY run, generation, candidate",
        (stage,),
    )
    found = []
    for run, generation, candidate, parameters, fitness in rows:
        place = {"run": run, "generation": generation, "candidate": candidate}
        with as_error(f"{store.path}: candidate {candidate} of generation {generation}", StudyError):
            told = dict(zip(objectives, _fitness(fitness, len(objectives)), strict=True))
            found.append({**place, **parse_values(parameters), **told})
    return pd.DataFrame(found)


def flight_table(store: FlightStore, stage: str | None = None) -> pd.DataFrame:
    """One row a flight: parameters by key, seed, order parameters, why it failed, duration (s), worker, versions.

    A flight of another length than the scenario's tells it as `duration_flown` (s, simulated).
    """
    rows = store.rows(
        "SELECT f.stage, f.run, f.generation, f.candidate, f.repeat, f.seed, c.parameters, f.scores, f.reason, "
        "f.duration, f.worker, s.versions FROM flight f JOIN candidate c USING (stage, run, generation, candidate) "
        "LEFT JOIN session s USING (session) WHERE ? IS NULL OR f.stage=? "
        "ORDER BY f.stage, f.run, f.generation, f.candidate, f.repeat",
        (stage, stage),
    )
    found = []
    for *key, parameters, scores, reason, duration, worker, versions in rows:
        place = dict(zip([*KEY, "repeat", "seed"], key, strict=True))
        about = {"reason": reason, "duration": duration, "worker": worker, "versions": versions}
        with as_error(f"{store.path}: a flight of {' '.join(map(str, key))}", StudyError):
            values = {name: v for name, v in parse_values(scores or "{}").items() if not isinstance(v, list)}
            given = {FLOWN if key == DURATION_COLUMN else key: value for key, value in parse_values(parameters).items()}
            found.append({**place, **given, **values, **about})
    return pd.DataFrame(found)


def _fitness(text: Any, count: int) -> list[float]:
    """Fitness of a row, one number for each objective; nan: failed."""
    found = parse_json(text)
    sound = isinstance(found, list) and len(found) == count
    if not sound or not all(value is None or isinstance(value, (int, float)) for value in found):
        raise FormatError(f"fitness is not a list of {count} numbers")
    return [math.nan if value is None else float(value) for value in found]


def export(store: FlightStore, folder: Path, scenarios: Sequence[str] = ()) -> list[Path]:
    """Write all flights as evaluations.csv, and as evaluations.parquet where pyarrow is installed.

    scenarios : what those of the study are called; of several, each flight tells its own
    """
    table = flight_table(store)
    if len(scenarios) > 1:
        table["scenario"] = [scenarios[repeat % len(scenarios)] for repeat in table["repeat"]]
    written = [folder / "evaluations.csv"]
    try:
        atomic.write_file(written[0], table.to_csv(index=False))
        if _has_parquet():
            written.append(folder / "evaluations.parquet")
            with atomic.atomic_path(written[1]) as temporary:
                table.to_parquet(temporary, index=False)
    except OSError as fault:
        raise StudyError(f"{folder}: tables cannot be written: {fault.strerror or fault}") from fault
    return written


def _has_parquet() -> bool:
    try:
        import pyarrow  # noqa: F401
    except ModuleNotFoundError:
        return False
    return True


def sort_by_fitness(table: pd.DataFrame, objective: str, maximise: bool) -> Any:
    """Candidates without the failed ones, the best first; of equals the earlier."""
    sound = table[table[objective].notna()]
    return sound.sort_values(objective, ascending=not maximise, kind="stable")


def full_length_candidates(table: pd.DataFrame, growing: bool) -> pd.DataFrame:
    """Candidates that flew as long as the scenario says; those of a search's short flights compare with each other."""
    return table[table[DURATION_COLUMN].isna()] if growing and DURATION_COLUMN in table else table
