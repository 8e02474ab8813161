"""Rows, columns and files of a tiny evolve study, a certify campaign and a sweep, computed as on a Haswell.

Floats are hexadecimal. What tells of the machine and of the code (times, host, versions, workers) is left out.
"""

import csv
import hashlib
import json
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any

from haswell import airflock

BY_PROCESSOR = True
STUDY = (
    "evolve vasarhelyi_2018/6ms --out study --population 4 --generations 2 --agents 5 --duration 5 --seeds 2 --quiet"
)
CAMPAIGN = (
    "certify vasarhelyi_2018/real_6ms --limit r_min<20@at@50% --flights 12 --agents 4 --duration 5"
    " --out certificate.toml"
)
SWEEP = (
    "sweep vasarhelyi_2018/4ms --over radio.delay=0:1:2 --over radio.range=40,80 --agents 5 --duration 5 --seeds 2"
    " --table sweep.csv"
)
MACHINE = ("began", "host", "versions", "duration", "worker", "session")  # columns that tell of the machine
FULL = 24  # rows of a table that are kept in full; of all rows there is a digest


def plain(value: Any) -> Any:
    """Return a value of a row with floats in hexadecimal; texts that hold JSON are parsed."""
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [plain(one) for one in value]
    if isinstance(value, str) and value[:1] in ("[", "{"):
        return plain(json.loads(value))
    return value


def _table(columns: list[str], rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the columns of a table, how many rows it has, a digest of all and the first ones."""
    kept = [{key: plain(value) for key, value in row.items() if key not in MACHINE} for row in rows]
    text = "\n".join(json.dumps(row, sort_keys=True) for row in kept)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return {"columns": columns, "rows": len(kept), "sha256": digest, "first": kept[:FULL]}


def _database(path: Path) -> dict[str, Any]:
    """Return the tables of a store, its rows in the order of its keys."""
    with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
        schema = connection.execute("SELECT name, sql FROM sqlite_master WHERE type='table' ORDER BY name").fetchall()
        found = {}
        for name, sql in schema:
            cursor = connection.execute(f"SELECT * FROM {name}")
            columns = [each[0] for each in cursor.description]
            rows = [dict(zip(columns, row, strict=True)) for row in cursor]
            keys = [key for key in ("stage", "run", "generation", "candidate", "repeat") if key in columns]
            rows.sort(key=lambda row, keys=keys: [(isinstance(row[key], str), row[key]) for key in keys])
            found[name] = {"schema": " ".join(sql.split())} | _table(columns, rows)
    return found


def _csv(path: Path) -> dict[str, Any]:
    """Return the rows of a CSV file; numbers are floats by their bits."""

    def number(text: str) -> Any:
        try:
            return float(text)
        except ValueError:
            return text

    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        rows = [{key: number(value) for key, value in row.items()} for row in reader]
        return _table(list(reader.fieldnames or ()), rows)


def _keys(path: Path) -> list[str]:
    """Return the keys of a TOML file: its lines up to their equal signs, and its headers of tables."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [line.partition(" = ")[0] for line in lines if line.strip() and not line.startswith((" ", "]", "#", "'"))]


def _contents(folder: Path) -> list[str]:
    """Return the names of the files in a folder."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def take() -> dict[str, Any]:
    """Return rows, columns and files."""
    with tempfile.TemporaryDirectory() as name:
        folder, found = Path(name), {}
        for kind, words in (("study", STUDY), ("campaign", CAMPAIGN), ("sweep", SWEEP)):
            before = set(_contents(folder))
            done = airflock(folder, *(word.replace("@", " ") for word in words.split()))
            found[kind] = {"status": done.returncode, "files": sorted(set(_contents(folder)) - before)}
        for kind in ("study", "campaign"):
            (store,) = (folder / path for path in found[kind]["files"] if path.endswith(".sqlite"))
            found[kind] |= _database(store)
            tables = [path for path in found[kind]["files"] if path.endswith(".toml")]
            found[kind]["keys"] = {path: _keys(folder / path) for path in tables}
        found["study"]["evaluations.csv"] = _csv(folder / "study" / "evaluations.csv")
        found["sweep"] |= _csv(folder / "sweep.csv")
        return found
