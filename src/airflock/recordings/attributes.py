"""Attributes of a recording, read as text from outside: the scenario, numbers, the format, the checksum.

Format 1 is that of version 0.1. Format 2 names no file of code: a law of the user's own is its bare
name and a hash, and `airflock_checksum` shows changes since Airflock wrote the file.
"""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from airflock.parts import FAULTS as KINDS
from airflock.recordings.dataset import EAST_NORTH_UP, FRAME_ATTRIBUTE, check_dataset
from airflock.scenarios import MODELS, PART_KINDS
from airflock.support import RecordingError, as_error, is_number, parse_json_object, shortened

# A file is data from outside: every attribute is read as text and checked, and none of it is
# executed.
RECORDING_FORMAT = 2
FORMAT_ATTRIBUTE, CHECKSUM_ATTRIBUTE, LAW_ATTRIBUTE = "airflock_format", "airflock_checksum", "airflock_law"
EVENTS, FAULTS_ATTRIBUTE = "airflock_events", "airflock_faults"


def check_format(recording: xr.Dataset, where: str = "recording") -> None:
    """Raise RecordingError for what is no dataset, and for a format that only a newer Airflock knows."""
    check_dataset(recording, where)
    found = read_integer(recording, FORMAT_ATTRIBUTE, 1, where)
    if not 1 <= found <= RECORDING_FORMAT:
        raise RecordingError(f"{where}: is of format {found}; this Airflock reads formats 1 to {RECORDING_FORMAT}")


def read_integer(recording: xr.Dataset, name: str, default: int | None = None, where: str = "recording") -> int:
    """Return a whole number of the attributes, or `default`; raise RecordingError for anything else."""
    value: Any = recording.attrs.get(name, default)
    if isinstance(value, (float, np.floating)) and np.isfinite(value) and value == int(value):
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not -(2**64) < int(value) < 2**64:
        problem = "is missing" if value is None else f"= {shortened(repr(value), 60)} is not a whole number"
        raise RecordingError(f"{where}: attribute {name} {problem}")
    return int(value)


def scenario_document(recording: xr.Dataset) -> dict[str, Any] | None:
    """Return the scenario of a recording as plain values, None for tracks; raise RecordingError if damaged."""
    found = _object(recording, "airflock_scenario")
    if found is not None and not isinstance(found.get("model", {}), Mapping):
        raise RecordingError("recording: attribute airflock_scenario is damaged: model is not a table")
    return found


def recording_name(recording: xr.Dataset) -> str:
    """Return a name for a recording: that of its scenario, or of the file that its tracks came from."""
    files = str(recording.attrs.get("source_file") or "").split(", ")
    first = files[0].rpartition("/")[2].rpartition(".")[0] or files[0]
    more = f" and {len(files) - 1} more" if len(files) > 1 else ""
    return str(recording.attrs.get("airflock_name") or f"{shortened(first, 60) or 'recording'}{more}")


def axis_names(recording: xr.Dataset) -> tuple[str, str, str]:
    """Return names of the axes: east, north, up of flights and of tracks on the ground; else x, y, z, as in a tank."""
    known = recording.attrs.get("airflock_scenario") or recording.attrs.get(FRAME_ATTRIBUTE) == EAST_NORTH_UP
    return ("east", "north", "up") if known else ("x", "y", "z")


def metrics_settings(recording: xr.Dataset) -> dict[str, Any]:
    """Return the section [metrics] that a flight was measured by, with all its values."""
    return _object(recording, "airflock_metrics") or {}


def _object(recording: xr.Dataset, name: str) -> dict[str, Any] | None:
    text = recording.attrs.get(name)
    if text is None or (isinstance(text, str) and not text):
        return None
    with as_error(f"recording: attribute {name} is damaged", RecordingError):
        return parse_json_object(text)


def recorded_events(recording: xr.Dataset) -> list[Any]:
    """Return the events of a flight as `simulate(..., events=...)` takes them."""
    found = (_object(recording, EVENTS) or {}).get("events", [])
    if not isinstance(found, list):
        raise RecordingError(f"recording: attribute {EVENTS} is damaged: it holds no list of events")
    return found


def recorded_faults(recording: xr.Dataset) -> list[dict[str, Any]]:
    """Return the faults of a flight: kind, agent, begin and end (s; None: it did not end)."""
    found = (_object(recording, FAULTS_ATTRIBUTE) or {}).get("faults", [])
    sound = isinstance(found, list) and all(
        isinstance(entry, Mapping) and {"kind", "agent", "begin", "end"} <= set(entry)
        and is_number(entry["begin"]) and 0.0 <= entry["begin"] < 1e9
        for entry in found
    )  # fmt: skip
    if not sound:
        raise RecordingError(f"recording: attribute {FAULTS_ATTRIBUTE} is damaged: it holds no list of faults")
    return [dict(entry) for entry in found]


MAX_NAMED = 6  # faults of a line


def faults_line(faults: list[dict[str, Any]]) -> str:
    """Return the faults in one line for a person: kind, agent and time."""
    lines = [f"{each['kind']} of agent {each['agent']} at {each['begin']:g} s" for each in faults[:MAX_NAMED]]
    more = f", and {len(faults) - MAX_NAMED} more" if len(faults) > MAX_NAMED else ""
    return f"{len(faults)} fault{'s' if len(faults) > 1 else ''}: {', '.join(lines)}{more}"


def uses_user_law(recording: xr.Dataset) -> bool:
    """Return True if a law or a kind of fault was the user's own, whose code is not in the recording."""
    document = scenario_document(recording)
    if document is None:
        return False
    laws = [str(law.get("kind")) for law in tables_under_key(document, "model")] or [""]
    faults = [str(fault.get("kind")) for fault in tables_under_key(document, "faults")]
    own = any(kind not in MODELS for kind in laws) or any(kind not in KINDS for kind in faults)
    return LAW_ATTRIBUTE in recording.attrs or own or bool(user_group_laws(document))


def user_group_laws(document: Mapping[str, Any]) -> list[str]:
    """Return the names of laws of groups that were the user's own."""
    laws = [law for group in tables_under_key(document, "groups") for law in tables_under_key(group, "model")]
    return [kind for kind in (str(law["kind"]) for law in laws if "kind" in law) if kind not in MODELS]


def part_tables(document: Mapping[str, Any]) -> list[Any]:
    """Return the tables of a scenario whose kind may be a file of the user's own."""
    sections = ("model", "faults", *(family.section for family in PART_KINDS))
    tables = [table for section in sections for table in tables_under_key(document, section)]
    laws = [law for group in tables_under_key(document, "groups") for law in tables_under_key(group, "model")]
    return tables + laws


def tables_under_key(document: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    """Return the tables under a key of an unchecked scenario: one, those of a list, or none."""
    found = document.get(key)
    entries = found if isinstance(found, list) else [found]
    return [entry for entry in entries if isinstance(entry, Mapping)]


def recording_checksum(recording: xr.Dataset) -> str:
    """Return the hash of all arrays and attributes but itself; saving and loading do not change it."""
    found = hashlib.sha256()
    # Sorted, and with shapes: the order of variables in a file may change when other tools copy it.
    for name in sorted(map(str, recording.variables)):
        values = recording[name].values
        # Texts are hashed as JSON, because their type (fixed width or objects) changes between
        # saving and loading.
        plain = values.astype(str) if values.dtype.kind in "OSU" else values
        content = json.dumps(plain.tolist()).encode() if plain.dtype.kind == "U" else np.ascontiguousarray(plain).data
        found.update(f"{name} {recording[name].dims} {plain.shape}\n".encode())
        found.update(content)
    for name in sorted(recording.attrs):
        if name != CHECKSUM_ATTRIBUTE:
            found.update(f"{name} {_plain(recording.attrs[name])!r}\n".encode())
    return found.hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, list, tuple)):
        flat = [_plain(entry) for entry in np.asarray(value).ravel().tolist()]
        return flat[0] if len(flat) == 1 else flat  # a netCDF file holds a list of one as a number
    return value.item() if isinstance(value, np.generic) else value
