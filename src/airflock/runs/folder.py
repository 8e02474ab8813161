"""The folder of a study: made or opened again, its study.toml compared before anything is written."""

import hashlib
import os
import platform
import re
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

from airflock import __version__
from airflock.runs.flight_store import FlightStore
from airflock.scenarios import Scenario
from airflock.support import StudyError, as_error, atomic, processor_name, read_toml

STUDY_FILE = "study.toml"
PACKAGES = ("numpy", "numba", "cma", "pymoo")

FITNESS_TEXT = re.compile(r"objective\[\d+\]\.own = ")  # a difference of two studies that may go on in one folder


class Interrupted(StudyError):
    """Ctrl-C: everything that had landed is stored."""


class HasDocument(Protocol):
    """Work that is done in a folder and can be resumed there: a study, or a campaign of certify."""

    def document(self) -> dict[str, Any]:
        """Return everything that decides its result, as plain values."""


def open_folder(folder: Path, study: HasDocument, *, resume: bool, kind: str = "study") -> str:
    """Make a study's folder, or check that it holds this very study; likewise for another kind, such as a campaign.

    A fitness of the user's own may have been mended since: flights that are stored are judged by
    it. Returns a note of that, or "".

    Raises StudyError where the folder holds another study, or this one and `resume` is False.
    """
    found = folder / f"{kind}.toml"
    if found.is_file():
        held, now = read_toml_file(found), to_toml_values(study.document())
        changed = differences(held, now)
        mended = resume and bool(changed) and all(FITNESS_TEXT.match(line) for line in changed)
        if not mended:
            same_or_refuse(folder, held, now, kind)
        if not resume:
            raise StudyError(f"{folder}: already holds this {kind}; continue it with --resume, or give another --out")
        if not mended:
            return ""
        with FlightStore(folder) as store:
            store.judge_again()
        write_toml_file(found, study.document(), f"A {kind} of Airflock. Its fitness was changed after it had begun.")
        return f"the fitness has changed ({'; '.join(changed)}): flights of {folder} are judged by the one of now"
    if resume:
        raise StudyError(f"{folder}: holds no {kind} to resume ({found.name} is missing)")
    # hidden files: what a process that was killed had begun to write
    if folder.is_dir() and any(not path.name.startswith(".") for path in folder.iterdir()):
        raise StudyError(f"{folder}: is not empty and holds no {found.name}; give a new folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_toml_file(found, study.document(), f"A {kind} of Airflock. Written once, when it began.")
    except OSError as error:
        raise StudyError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return ""


def remove_unfinished(folder: Path) -> None:
    """Remove what a process that was killed had begun to write; only for the one who holds the writer's lock."""
    for path in folder.glob(".*.*.*"):
        if path.suffix in (".toml", ".csv", ".parquet", ".png"):
            path.unlink(missing_ok=True)


def read_toml_file(path: Path) -> dict[str, Any]:
    """Read a TOML file as a dict."""
    with as_error(path, StudyError):
        return read_toml(path)


def write_toml_file(path: Path, document: Mapping[str, Any], comment: str = "") -> None:
    """Write a nested dict as TOML, complete or not at all."""
    import tomlkit

    # Values that are tables come last: in TOML a plain key after a table would belong to it.
    made = tomlkit.document()
    if comment:
        made.add(tomlkit.comment(comment))
        made.add(tomlkit.nl())
    _fill(made, to_toml_values(document))
    atomic.write_file(path, tomlkit.dumps(made))


def _fill(table: Any, values: Mapping[str, Any]) -> None:
    """Add values to a table: keys first, small tables of numbers in one line, then sections."""
    import tomlkit

    def leaf(value: Any) -> bool:
        return isinstance(value, dict) and bool({"value", "low", "fixed", "tied", "mean"} & set(value))

    for key, value in values.items():
        if leaf(value):
            line = tomlkit.inline_table()
            line.update(value)
            table.add(key, line)
        elif not isinstance(value, dict) and not (isinstance(value, list) and value and isinstance(value[0], dict)):
            table.add(key, value)
    for key, value in values.items():
        if isinstance(value, dict) and not leaf(value):
            section = tomlkit.table()
            _fill(section, value)
            table.add(key, section)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            table.add(key, value)


def to_toml_values(value: Any) -> Any:
    """Convert values to those of TOML: lists instead of tuples, no None."""
    if isinstance(value, Mapping):
        return {str(key): to_toml_values(entry) for key, entry in value.items() if entry is not None}
    return [to_toml_values(entry) for entry in value] if isinstance(value, (list, tuple)) else value


def program_versions() -> dict[str, str]:
    """Return the versions on which the last bits of a study depend, and the processor."""
    found = {"python": platform.python_version(), "cpu": processor_name(), "airflock": __version__}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def fingerprint(scenario: Scenario, precision: int) -> str:
    """Return a hash of everything compiled for a scenario: equal physics gives equal fingerprints."""
    from airflock.engine import driver_text

    return hashlib.sha256(driver_text(scenario, precision=precision).encode()).hexdigest()[:12]


def differences(old: Mapping[str, Any], new: Mapping[str, Any], at: str = "") -> list[str]:
    """Return the differences of two documents, one line each."""
    found = []
    for key in [*old, *(key for key in new if key not in old)]:
        where = f"{at}{key}"
        before, after = old.get(key), new.get(key)
        if isinstance(before, Mapping) and isinstance(after, Mapping):
            found += differences(before, after, f"{where}.")
        elif (
            isinstance(before, list) and isinstance(after, list) and len(before) == len(after)
            and all(isinstance(entry, Mapping) for entry in (*before, *after))
        ):  # fmt: skip
            for place, (one, other) in enumerate(zip(before, after, strict=True)):
                found += differences(one, other, f"{where}[{place}].")
        elif before != after:
            same = len(os.path.commonprefix([str(before), str(after)]))
            found.append(f"{where} = {_shown(before, same)} there, {_shown(after, same)} now")
    return found


def _shown(value: Any, same: int) -> str:
    """Return the text of a value, a long one from some letters before the first that differs."""
    text, first = "missing" if value is None else str(value), max(same - 20, 0)
    if len(text) < 60:
        return text
    return f"{'...' if first else ''}{text[first : first + 54]}{'...' if len(text) > first + 54 else ''}"


def same_or_refuse(folder: Path, old: Mapping[str, Any], new: Mapping[str, Any], kind: str = "study") -> None:
    """Raise StudyError, naming what differs, if a folder holds another study than the requested one."""
    found = differences(old, new)
    if not found:
        return
    shown = found[:8] + ([f"and {len(found) - 8} more"] if len(found) > 8 else [])
    raise StudyError(
        f"{folder}: holds another {kind}: {'; '.join(shown)}; give another --out, or ask for what it holds"
    )
