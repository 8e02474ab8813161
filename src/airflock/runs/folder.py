"""The folder of a run: its request, every flight as it lands, its result; begun or continued.

A run is a study, a campaign of a certificate, a tuning, a hardening or a sweep. `request.toml` is
written once, before anything flies, and compared with what a later call requests.
"""

import hashlib
import os
import platform
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

from airflock import __version__
from airflock.runs.executors import Executor
from airflock.runs.flight_store import FlightStore
from airflock.scenarios import Scenario, build_scenario
from airflock.support import StudyError, as_error, atomic, expand_path, processor_name, read_toml

REQUEST_FILE, RESULT_FILE = "request.toml", "result.toml"
# names of the request in folders from before all runs had one format
OLD_FILES = {"study.toml": "study", "campaign.toml": "campaign", "tune.toml": "tuning"}
GONE = {"racing": "none", "growth": 1}  # keys of the search in older folders → the value at which they did nothing
PACKAGES = ("numpy", "numba", "cma", "pymoo")
FITNESS_TEXT = re.compile(r"objective\[\d+\]\.own = ")  # a difference of two studies that may go on in one folder
OF_PROGRAM = ("layout", "airflock", "rules")  # keys that no option sets


class Interrupted(StudyError):
    """Ctrl-C: everything that had landed is stored."""


class Work(Protocol):
    """Work that is done in a folder and can be resumed there."""

    @property
    def kind(self) -> str:
        """Noun for messages: study, campaign, tuning, hardening or sweep."""

    @property
    def also(self) -> Mapping[str, Any]:
        """What the request holds besides, which is not compared."""

    def document(self) -> dict[str, Any]:
        """Return everything that decides its result, as plain values."""


def unpublished(scenario: Scenario) -> dict[str, Any]:
    """Return what a request holds of a scenario: its document without the published values of a paper."""
    return {key: value for key, value in scenario.document.items() if key != "published"}


def requested_scenario(document: Mapping[str, Any], name: str, *, trust: bool) -> Scenario:
    """Return the scenario of a request; files that it names lie beside the file `name`."""
    return build_scenario(document, name, folder=Path(name).parent, trust=trust)


def read_request(folder: Path, kind: str, *, resume: bool | None = None) -> dict[str, Any] | None:
    """Return the request in a folder, None if it holds none.

    resume : as `open_folder` takes it
    Raises StudyError for a run of another kind, and for a folder that may not be begun or
    continued.
    """
    held = _request(folder, kind)
    if held is not None and resume is False:
        raise already_there(folder, kind)
    if held is None and resume:
        raise StudyError(f"{folder}: holds no {kind} to resume ({REQUEST_FILE} is missing)")
    # hidden files: what a process that was killed had begun to write
    if held is None and folder.is_dir() and any(not path.name.startswith(".") for path in folder.iterdir()):
        raise StudyError(f"{folder}: is not empty and holds no {REQUEST_FILE}; give a new folder")
    return held


def already_there(folder: Path, kind: str) -> StudyError:
    """Return the error for a run that is there, though no `resume` says that it is to go on."""
    return StudyError(f"{folder}: already holds a {kind}; continue it with --resume, or give another --out")


def _request(folder: Path, kind: str) -> dict[str, Any] | None:
    for name in (REQUEST_FILE, *OLD_FILES):
        if (folder / name).is_file():
            held = read_toml_file(folder / name)
            of = held.pop("run", OLD_FILES.get(name))
            if of != kind:
                raise StudyError(f"{folder}: holds a {of} and no {kind}; give another --out")
            search = held.get("search", {})
            for key, usual in GONE.items():
                if isinstance(search, dict) and search.get(key) == usual:
                    del search[key]
            return held
    return None


def held_request(folder: str | os.PathLike[str] | None, kind: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the request of a run that is continued from its folder alone.

    given : options that the folder holds itself
    Raises StudyError for one that is given all the same, and for a folder that holds no such run.
    """
    held = None if folder is None else read_request(expand_path(folder), kind)
    if held is None:
        where = f"no scenario and no folder to resume: a {kind}" if folder is None else f"{folder}: holds no {kind}: it"
        raise StudyError(f"{where} needs a scenario")
    if beside := [key for key, value in given.items() if value]:
        raise StudyError(f"{', '.join(beside)}: {folder} holds this itself; leave it out, or name the scenario, too")
    return held


def open_folder(folder: Path, work: Work, *, resume: bool | None = None, also: Mapping[str, Any] | None = None) -> str:
    """Make the folder of a run, or check that it holds this very run.

    resume : False refuses a folder that holds it already, True a new one; None begins or continues
    also   : options of this call that decide what is done besides; kept in the request, but not
             compared

    A fitness of the user's own may have been mended since: flights that are stored are judged by
    it. Returns a note of that, or "". Raises StudyError where the folder holds something else.
    """
    kind, held = work.kind, read_request(folder, work.kind, resume=resume or None)
    also = {**work.also, **(also or {})}
    now, note, comment = to_toml_values(work.document()), "", "Written once, when it began."
    if held is not None:
        before = held.pop("also", {})
        changed = differences(held, now)
        mended = resume is not False and bool(changed) and all(FITNESS_TEXT.match(line) for line in changed)
        if not mended:
            same_or_refuse(folder, held, now, kind)
        if resume is False:
            raise already_there(folder, kind)
        also = before | also
        if mended:
            with FlightStore(folder) as store:
                store.judge_again()
            comment = "Its fitness was changed after it had begun."
            shown = "; ".join(changed)
            note = f"the fitness has changed ({shown}): flights of {folder} are judged by the one of now"
        elif to_toml_values(also) == before:
            return ""
    document = {"run": kind, **now, **({"also": also} if also else {})}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_toml_file(folder / REQUEST_FILE, document, f"A {kind} of Airflock. {comment}")
    except OSError as error:
        raise StudyError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return note


def run_place(out: str | os.PathLike[str] | None) -> Path:
    """Return the folder of a run that needs one. Raises StudyError where none is given."""
    if out is None:
        raise StudyError("out is missing; give the folder of the run: --out DIR")
    return expand_path(out)


@contextmanager
def run_folder(folder: str | os.PathLike[str] | None) -> Iterator[Path]:
    """Yield the folder of a run: the given one, or a temporary one."""
    if folder is not None:
        yield expand_path(folder)
        return
    with tempfile.TemporaryDirectory(prefix="airflock-") as made:
        yield Path(made)


@contextmanager
def open_run(folder: Path, executor: Executor, *, is_stored: bool = True) -> Iterator[FlightStore]:
    """Yield the store of a folder that `open_folder` has accepted; close the executor in the end.

    is_stored : True if the folder stays
    Raises Interrupted at Ctrl-C.
    """
    try:
        with FlightStore(folder) as store:
            store.begin(program_versions())
            remove_unfinished(folder)
            try:
                yield store
            except KeyboardInterrupt as stop:
                done = f"interrupted: {store.count():,} flights are"
                if is_stored:
                    raise Interrupted(f"{done} stored in {folder}; continue with --resume") from stop
                raise Interrupted(f"{done} not kept; with --out (in Python: folder=) they are, for --resume") from stop
    finally:
        executor.close()


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


def list_differences(found: Sequence[str]) -> str:
    """Return the first few differences in one line."""
    return "; ".join([*found[:8], *([f"and {len(found) - 8} more"] if len(found) > 8 else [])])


def same_or_refuse(folder: Path, old: Mapping[str, Any], new: Mapping[str, Any], kind: str) -> None:
    """Raise StudyError, naming what differs, if a folder holds another run than the requested one."""
    found = differences(old, new)
    if not found:
        return
    # Flights of other rules must not be mixed with those of now, whatever the options say.
    other = any(line.startswith(tuple(f"{key} = " for key in OF_PROGRAM)) for line in found)
    advice = "continue it with the version that began it" if other else "ask for what it holds"
    raise StudyError(f"{folder}: holds another {kind}: {list_differences(found)}; give another --out, or {advice}")
