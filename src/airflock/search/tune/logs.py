"""Logs as what is tuned: the numbers of these drones are identified first; a stage that is kept like the others."""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from airflock.estimate import IdentifyResult, identify, read_heard
from airflock.runs import write_toml_file
from airflock.scenarios import Scenario, build_scenario, load
from airflock.support import RecordingError, StudyError, as_error, atomic, expand_path, parse_json_object, read_text

SCENARIO, REPORT_FILE = "identified.toml", "identified.json"
Paths = Sequence[str | os.PathLike[str]]


@dataclass(frozen=True)
class IdentifiedFleet:
    """What logs say of a fleet: the scenario with its numbers, its file's content, and what to tell of it.

    told : files with their hashes, the law's scenario, numbers with intervals or the reason why not, notes
    """

    scenario: Scenario
    document: Mapping[str, Any]
    told: Mapping[str, Any]

    def save(self, folder: Path) -> None:
        """Write identified.toml and identified.json, the latter last: it says that the stage is over."""
        write_toml_file(folder / SCENARIO, self.document, "Identified from logs by airflock tune.")
        atomic.write_file(folder / REPORT_FILE, json.dumps(self.told))


def identify_fleet(folder: Path, logs: Paths, like: Scenario, heard: str | os.PathLike[str] | None) -> IdentifiedFleet:
    """What the folder holds of these logs, or what they say now.

    Raises StudyError where the folder holds what other logs said, RecordingError or AirflockError for bad logs.
    """
    asked = _asked(logs, like, heard)
    if (folder / REPORT_FILE).is_file():
        with as_error(folder / REPORT_FILE, StudyError):
            told = parse_json_object(read_text(folder / REPORT_FILE))
        for key, value in asked.items():
            if told.get(key) != value:
                raise StudyError(f"{folder}: holds the tuning of other logs ({key} differs); give another --out")
        return IdentifiedFleet(load(folder / SCENARIO), {}, told)
    found = identify(list(logs), like, heard=None if heard is None else read_heard(heard))
    document = found.document()
    # by the name of the file that it becomes, so that a tuning that is resumed is the same one
    return IdentifiedFleet(build_scenario(document, str(folder / SCENARIO)), document, {**asked, **_told(found)})


def _asked(logs: Paths, like: Scenario, heard: str | os.PathLike[str] | None) -> dict[str, Any]:
    """What decides the outcome, as plain values."""
    files = [*logs, *([] if heard is None else [heard])]
    like_document = {key: value for key, value in like.document.items() if key != "published"}
    return {
        "logs": {Path(path).name: _hash(path) for path in files},
        "like": hashlib.sha256(json.dumps(like_document, sort_keys=True, default=str).encode()).hexdigest()[:12],
    }


def _hash(path: str | os.PathLike[str]) -> str:
    try:
        with expand_path(path).open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()[:12]
    except OSError as fault:
        raise RecordingError(f"{path}: {fault.strerror or fault}") from fault


def _told(found: IdentifyResult) -> dict[str, Any]:
    """Every number with its interval, or the reason why the logs do not tell it; and notes."""
    numbers = [
        {"key": n.key, "value": n.value, "low": n.low, "high": n.high, "origin": n.origin}
        if n.told
        else {"key": n.key, "reason": n.reason or "not found in the logs"}
        for n in found.numbers.values()
    ]
    return {"name": found.like.name, "drones": found.logs.drones, "numbers": numbers, "notes": list(found.notes)}
