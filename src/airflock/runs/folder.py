"""The folder of a study: made or opened again, its study.toml compared before anything is written."""

import hashlib
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

from airflock import __version__
from airflock.scenarios import Scenario
from airflock.support import StudyError, as_error, atomic, processor_name, read_toml

STUDY_FILE = "study.toml"
PACKAGES = ("numpy", "numba", "cma", "pymoo")


class Interrupted(StudyError):
    """Ctrl-C: everything that had landed is stored."""


class HasDocument(Protocol):
    """Work that is done in a folder and can be resumed there: a study, or a campaign of certify."""

    def document(self) -> dict[str, Any]:
        """Return everything that decides its result, as plain values."""


def open_folder(folder: Path, study: HasDocument, *, resume: bool, kind: str = "study") -> None:
    """Make a study's folder, or check that it holds this very study; likewise for another kind, such as a campaign.

    Raises StudyError where the folder holds another study, or this one and `resume` is False.
    """
    found = folder / f"{kind}.toml"
    if found.is_file():
        same_or_refuse(folder, read_toml_file(found), to_toml_values(study.document()), kind)
        if not resume:
            raise StudyError(f"{folder}: already holds this {kind}; continue it with --resume, or give another --out")
        return
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
        elif before != after:
            found.append(f"{where} = {_shown(before)} there, {_shown(after)} now")
    return found


def _shown(value: Any) -> str:
    return "missing" if value is None else str(value) if len(str(value)) < 60 else f"{str(value)[:57]}..."


def same_or_refuse(folder: Path, old: Mapping[str, Any], new: Mapping[str, Any], kind: str = "study") -> None:
    """Raise StudyError, naming what differs, if a folder holds another study than the requested one."""
    found = differences(old, new)
    if not found:
        return
    shown = found[:8] + ([f"and {len(found) - 8} more"] if len(found) > 8 else [])
    raise StudyError(
        f"{folder}: holds another {kind}: {'; '.join(shown)}; give another --out, or ask for what it holds"
    )
