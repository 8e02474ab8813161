"""Store: every flight of a study, on disk as soon as it has landed, in one SQLite file in WAL mode.

The unit is a flight: its row is committed when it lands, so that a process that is killed loses
only flights in the air. Nothing depends on the order in which flights land. Readers may look on
while a study runs; a second writer is refused by a lock that the system gives back however the
first one ends.
"""

import json
import math
import os
import platform
import sqlite3
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from airflock.runs.executors import Executor, Flight, FlightResult
from airflock.support import FlightError, FormatError, StudyError, as_error, locks, parse_json, parse_json_object

FILE, LOCK = "evaluations.sqlite", "writer.lock"
# Tables have no row numbers, so contents do not depend on the order in which flights land. One
# flight is the unit: a kill loses only what is in the air.
SCHEMA = """
CREATE TABLE IF NOT EXISTS session (
  session INTEGER PRIMARY KEY, began TEXT, host TEXT, versions TEXT
);
CREATE TABLE IF NOT EXISTS candidate (
  stage TEXT, run INTEGER, generation INTEGER, candidate INTEGER,
  point TEXT, parameters TEXT, fitness TEXT,
  PRIMARY KEY (stage, run, generation, candidate)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS flight (
  stage TEXT, run INTEGER, generation INTEGER, candidate INTEGER, repeat INTEGER,
  seed INTEGER, scores TEXT, reason TEXT, duration REAL, worker TEXT, session INTEGER,
  PRIMARY KEY (stage, run, generation, candidate, repeat)
) WITHOUT ROWID;
"""
WALL = ("duration", "worker", "session")  # columns that describe the machine and not the study


class CandidateBatch(NamedTuple):
    """Batch of candidates: a generation of the search, or a later stage."""

    stage: str
    run: int
    generation: int


class FlightStore:
    """Evaluations of one study folder. Use as a context; `write=False` only reads."""

    def __init__(self, folder: Path, *, write: bool = True):
        """Open or create; `landed` counts the flights that this process has stored.

        Raises StudyError where another process is writing, or where the file is no store.
        """
        self.path, self.lock_handle, self.session, self.landed = folder / FILE, -1, 0, 0
        if not write and not self.path.is_file():
            raise StudyError(f"{folder}: holds no study ({FILE} is missing)")
        if write:
            self.lock_handle = _lock(folder)
        try:
            with as_study_error(self.path):
                uri = f"{self.path.absolute().as_uri()}?mode={'rwc' if write else 'ro'}"
                self.connection = sqlite3.connect(uri, uri=True, isolation_level=None, timeout=10.0)
                if write:
                    # NORMAL: what is committed survives the end of the process at any moment
                    self.connection.execute("PRAGMA journal_mode = WAL")
                    self.connection.execute("PRAGMA synchronous = NORMAL")
                    self.connection.executescript(SCHEMA)
                else:
                    self.connection.execute("SELECT count(*) FROM flight")
        except BaseException:
            self._unlock()
            raise

    def __enter__(self) -> "FlightStore":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Fold the journal into the file and give the lock back."""
        self.connection.close()
        self._unlock()

    def _unlock(self) -> None:
        if self.lock_handle >= 0:
            os.close(self.lock_handle)
            self.lock_handle = -1

    def begin(self, versions: Mapping[str, str]) -> None:
        """Store that a process begins to write: time, host and versions."""
        row = (time.strftime("%Y-%m-%dT%H:%M:%S%z"), platform.node(), json.dumps(dict(versions)))
        with as_study_error(self.path):
            cursor = self.connection.execute("INSERT INTO session (began, host, versions) VALUES (?, ?, ?)", row)
            self.session = int(cursor.lastrowid or 0)

    def asked(self, batch: CandidateBatch) -> list[list[float]]:
        """Return the points of a batch's candidates in the store, in their order."""
        found = self.rows(
            "SELECT point FROM candidate WHERE stage=? AND run=? AND generation=? ORDER BY candidate", batch
        )
        with as_error(f"{self.path}: a point of {' '.join(map(str, batch))}", StudyError):
            points = [_point(point) for (point,) in found]
            if len({len(point) for point in points}) > 1:
                raise FormatError("has another number of parameters than the others")
        return points

    def ask(
        self, batch: CandidateBatch, points: Sequence[Sequence[float]], parameters: Sequence[Mapping[str, float]]
    ) -> None:
        """Store candidates, all of a batch at once; a candidate that is there already stays."""
        rows = [
            (*batch, i, _encode([float(x) for x in point]), _encode(dict(values)))
            for i, (point, values) in enumerate(zip(points, parameters, strict=True))
        ]
        self._many(
            "INSERT OR IGNORE INTO candidate (stage, run, generation, candidate, point, parameters) "
            "VALUES (?, ?, ?, ?, ?, ?)",
            rows,
        )

    def land(self, batch: CandidateBatch, result: FlightResult) -> None:
        """Store one flight, at once; one that is there already stays, so that nothing counts twice."""
        f = result.flight
        scores = None if result.values is None else _text(result.values)
        row = (
            *batch,
            f.candidate_index,
            f.repeat,
            f.seed,
            scores,
            result.reason,
            result.duration,
            result.worker,
            self.session,
        )
        with as_study_error(self.path):
            self.connection.execute("INSERT OR IGNORE INTO flight VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
        self.landed += 1

    def fly(self, executor: Executor, batch: CandidateBatch, flights: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield each flight as soon as it is over and stored."""
        for landed in executor.fly(flights):
            self.land(batch, landed)
            yield landed

    def fly_missing(
        self, executor: Executor, batch: CandidateBatch, flights: Sequence[Flight], on_done: Callable[[], None] | None
    ) -> dict[tuple[int, int], Mapping[str, Any]]:
        """Fly those flights of a batch that the store does not hold; return the scores of all, as it holds them.

        on_done : called for each flight, those of the store included
        Raises FlightError for a flight that failed, now or before.
        """
        flown = self.flown(batch)
        missing = [each for each in flights if (each.candidate_index, each.repeat) not in flown]
        if on_done:
            for _ in range(len(flights) - len(missing)):
                on_done()
        for landed in self.fly(executor, batch, missing):
            if landed.values is None:
                break
            if on_done:
                on_done()
        of_batch = "SELECT reason FROM flight WHERE stage=? AND run=? AND generation=?"
        failed = self.rows(f"{of_batch} AND scores IS NULL", batch)
        if failed:
            raise FlightError(str(failed[0][0]))
        return {key: row or {} for key, row in self.flown(batch).items()}

    def flown(self, batch: CandidateBatch) -> dict[tuple[int, int], Mapping[str, Any] | None]:
        """(candidate, repeat) → order parameters of the flights that the store holds, None of those that failed."""
        found = self.rows(
            "SELECT candidate, repeat, scores FROM flight WHERE stage=? AND run=? AND generation=?", batch
        )
        with as_error(f"{self.path}: scores of {' '.join(map(str, batch))}", StudyError):
            return {(c, r): None if scores is None else parse_values(scores) for c, r, scores in found}

    def tell(self, batch: CandidateBatch, fitness: Sequence[Sequence[float | None]]) -> None:
        """Store the fitness of all candidates of a batch, one number for each objective."""
        rows = [(json.dumps(list(values)), *batch, i) for i, values in enumerate(fitness)]
        self._many("UPDATE candidate SET fitness=? WHERE stage=? AND run=? AND generation=? AND candidate=?", rows)

    def judge_again(self) -> None:
        """Note that fitness has changed: what was found by it goes, and the search may ask for other candidates."""
        with as_study_error(self.path):
            self.connection.execute("PRAGMA user_version = 1")
            self.connection.execute("DELETE FROM flight WHERE stage <> 'search'")
            self.connection.execute("DELETE FROM candidate WHERE stage <> 'search'")
            self.connection.execute("UPDATE flight SET reason = '' WHERE scores IS NOT NULL")

    def forget_from(self, batch: CandidateBatch) -> bool:
        """Remove a generation of the search and all after it, if fitness has changed; else return False."""
        if not self.rows("PRAGMA user_version")[0][0]:
            return False
        for table in ("flight", "candidate"):
            later = f"DELETE FROM {table} WHERE stage = ? AND (run, generation) >= (?, ?)"
            with as_study_error(self.path):
                self.connection.execute(later, batch)
        return True

    def reasons(self) -> dict[str, int]:
        """Return why flights of the search failed, and how many each, the most frequent reason first."""
        found = self.rows(
            "SELECT reason, count(*) FROM flight WHERE stage='search' AND reason <> '' "
            "GROUP BY reason ORDER BY 2 DESC, 1"
        )
        return {str(reason): int(count) for reason, count in found}

    def count(self) -> int:
        """Flights of all stages."""
        return int(self.rows("SELECT count(*) FROM flight")[0][0])

    def rows(self, sql: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """All rows of a query."""
        with as_study_error(self.path):
            return self.connection.execute(sql, tuple(values)).fetchall()

    def _many(self, sql: str, rows: Sequence[Sequence[Any]]) -> None:
        """Many rows in one transaction."""
        with as_study_error(self.path):
            self.connection.execute("BEGIN IMMEDIATE")
            try:
                self.connection.executemany(sql, rows)
                self.connection.execute("COMMIT")
            except BaseException:
                if self.connection.in_transaction:  # a full disk has ended it already
                    self.connection.execute("ROLLBACK")
                raise


def _lock(folder: Path) -> int:
    """Handle of the lock that one writer at a time holds; it names its process for others to read."""
    path = folder / LOCK
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        locks.lock(handle)
    except OSError as error:
        holder = os.read(handle, 200).decode(errors="replace").strip()
        os.close(handle)
        raise StudyError(f"{folder}: another process ({holder or 'unknown'}) is writing this study") from error
    os.ftruncate(handle, 0)
    os.write(handle, f"process {os.getpid()} on {platform.node()}\n".encode())
    return handle


@contextmanager
def as_study_error(path: Path) -> Iterator[None]:
    """SQLite's complaints as one line that names the file."""
    try:
        yield
    except sqlite3.DatabaseError as error:
        lost = "file is not a database" in str(error)
        kept = "its flights cannot be read" if lost else "what was stored before is kept"
        raise StudyError(f"{path}: {error}; {kept}") from error


_encode = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode


def _text(values: Mapping[str, Any]) -> str:
    try:
        return _encode(values)
    except (ValueError, TypeError):  # not finite, or no plain number
        return _encode(_finite(values))


def _finite(value: Any) -> Any:
    """Plain values that JSON knows: what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    if isinstance(value, (int, str)) or value is None:
        return value
    return float(value) if math.isfinite(value) else None


def parse_values(text: Any) -> dict[str, Any]:
    """Values by name of a row's JSON, nan for null; raises FormatError where a row was tampered with."""
    return {key: math.nan if value is None else value for key, value in parse_json_object(text).items()}


def _point(text: Any) -> list[float]:
    found = parse_json(text)
    if not isinstance(found, list) or not all(isinstance(x, (int, float)) and math.isfinite(x) for x in found):
        raise FormatError("is not a list of finite numbers")
    return [float(x) for x in found]
