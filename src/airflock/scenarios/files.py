"""Scenario files: TOML with units and sources, presets by name, and keys changed from outside."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from airflock.core import Fault, fault
from airflock.scenarios import formats
from airflock.scenarios.document import settings_dict
from airflock.scenarios.extends import extend_document
from airflock.scenarios.families import PART_KINDS, CallerParts, PartKind
from airflock.scenarios.ground import with_field
from airflock.scenarios.laws import law_from_caller
from airflock.scenarios.making import build_scenario
from airflock.scenarios.scenario import Scenario
from airflock.support import FormatError, ScenarioError, as_error, expand_path, is_file, read_toml, suggest

IMPORTED = "not a scenario; airflock import makes a recording of it (in Python: airflock.load_tracks)"
NO_SCENARIO = {  # files that stand beside scenarios, by their ending: what they are, and what takes them
    ".py": "code, not a scenario; a law flies a scenario: airflock run PRESET --law FILE.py (in Python: law=)",
    ".nc": "a recording, not a scenario; airflock score measures it (in Python: airflock.load_recording)",
    ".json": "JSON, not a scenario (TOML); airflock watch shows the fleet of a flight card",
    **dict.fromkeys((".csv", ".tsv", ".parquet"), f"a table, {IMPORTED}"),
    **dict.fromkeys((".ulg", ".bin", ".tlog"), f"a flight log, {IMPORTED}"),
    **dict.fromkeys((".h5", ".hdf5", ".npy", ".npz"), f"arrays, {IMPORTED}"),
}


def presets() -> dict[str, Path]:
    """Name and file of every preset that comes with the package.

    Returns
    -------
    dict
        Name such as "vasarhelyi_2018/4ms" → path of its file.

    Examples
    --------
    >>> import airflock
    >>> "vicsek_1995/ordered" in airflock.presets()
    True
    """
    return dict(_shipped())


@cache
def _shipped() -> tuple[tuple[str, Path], ...]:
    """Name and file of every preset: what is installed does not change while a process runs."""
    root = Path(str(resources.files("airflock"))) / "scenarios" / "presets"
    return tuple((str(path.relative_to(root).with_suffix("")), path) for path in sorted(root.rglob("*.toml")))


def load(
    name: str | os.PathLike[str],
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    *,
    metrics: Any = None,
    body: Any = None,
    sensor: Any = None,
    radio: Any = None,
    topology: Any = None,
    faults: Any = None,
    laws: Any = None,
    trust: bool = False,
) -> Scenario:
    """Scenario from a preset's name or a file.

    Parameters
    ----------
    name : str or path
        A preset's name or a scenario file (TOML).
    settings : mapping, optional
        Keys with the values that replace the file's: whole keys such as "model.p_rep", or their last word where only
        one section has it. A value may carry a unit: {"delay": "400 ms"}. What is read otherwise than it is written
        stands in the scenario's `notes`.
    law : optional
        A flocking law of your own (a module, a class, a mapping such as globals(), or a Model) flies instead of the
        file's, or one by its name or its file. Its parameters start from their defaults.
    metrics : optional
        Order parameters of your own measure the flight: a `MetricSet`, a metric, a list of metrics and of names of
        ours, or a namespace such as globals(); likewise the name of a set or a file.
    body : optional
        A body of your own carries the agents: a `Body`, a namespace, or a name or file.
    sensor : optional
        A sensor of your own by which agents know themselves: a `Sensor`, a namespace, or a name or file.
    radio : optional
        A radio of your own by which agents hear each other: a `Radio`, a namespace, or a name or file.
    topology : optional
        A topology of your own, which says whom of those that they hear agents meet: a namespace, or a name or file.
    faults : optional
        Kinds of fault of your own, which entries of [[faults]] may name: a namespace such as a module, what
        `airflock.fault` gives, or a list of these.
    laws : optional
        Laws of your own, which groups may name as their model.kind: a namespace such as a module, what
        `airflock.model` gives, or a list of these.
    trust : bool
        Whether code that the file names, or a file that it extends, may run: a law, also of a group, a body, a sensor,
        a radio, a topology, order parameters.

    Returns
    -------
    Scenario
        Everything about a flight but the seed, in SI units.

    Raises
    ------
    ScenarioError
        With one line per fault: file, key, value, unit, allowed range, and the nearest right key.
    RuleError
        If a law or another part of your own breaks the contract of its kind.

    Examples
    --------
    >>> import airflock
    >>> scenario = airflock.load("vasarhelyi_2018/4ms", {"delay": "400 ms", "agents": 30})
    >>> scenario.radio.delay, scenario.agents
    (0.4, 30)
    >>> airflock.load("vasarhelyi_2018/4ms", {"radio.delay": 60.0})
    Traceback (most recent call last):
    airflock.support.errors.ScenarioError: vasarhelyi_2018/4ms: radio.delay = 60 s lies outside [0, 30] s
    """
    text = str(name)
    where = text if text in presets() else str(expand_path(text))
    with as_error(where):
        document, folder = _read(where, None)
        document, base = extend_document(document, where, folder, _read)
        document, given = _with_given(document, zip(PART_KINDS, (metrics, body, sensor, radio, topology), strict=True))
        flown = None if law is None else law_from_caller(law)
        of_groups = {own.name: own for own in map(law_from_caller, _several(laws))}
        given = replace(given, law=flown, fault_kinds=_kinds(faults), laws=of_groups)
        notes = (f"extends {base}: what is not given here is taken from there",) if base else ()
        document, settings, told, wrong = with_field(document, settings_dict(settings, where), folder)
        if flown is not None:
            kind = str(expand_path(law).absolute()) if str(law).endswith(".py") else flown.name
            document = {**document, "model": {"kind": kind}, "published": {}}
        return build_scenario(
            document,
            where,
            settings,
            folder=folder,
            caller_parts=given,
            notes=notes + told,
            known_errors=wrong,
            trust=trust,
        )


def _read(name: str, folder: Path | None) -> tuple[dict[str, Any], Path]:
    """Document of a preset or of a file, looked for in a folder, in today's format, and the folder that it lies in."""
    known = presets()
    path = known.get(name) or (expand_path(name) if folder is None else folder / expand_path(name))
    if not is_file(path):
        # the name of a file is meant as a preset only where the two are much alike
        word, alike = (name, 0.4) if path.suffix != ".toml" else (name.removesuffix(".toml"), 0.7)
        hint = suggest(word, known, "; airflock presets lists the presets", lead="; ", cutoff=alike)
        raise ScenarioError([f"{name}: no such file or preset{hint}"])
    if path.suffix.lower() in NO_SCENARIO:
        raise ScenarioError([f"{name}: is {NO_SCENARIO[path.suffix.lower()]}"])
    with as_error(name):
        try:
            document = read_toml(path)
        except FormatError as fault:
            raise ScenarioError([f"{name}: is not a scenario file (TOML): {fault}"]) from fault
    if tells_of_study(document) and not {"model", "extends"} & set(document):
        raise ScenarioError([f"{name}: is a study, not a scenario; check it with airflock validate, or evolve it"])
    return {**formats.to_current_format(document, name), formats.KEY: formats.FORMAT}, path.parent


def _with_given(
    document: Mapping[str, Any], given: Iterable[tuple[PartKind[Any], Any]]
) -> tuple[dict[str, Any], CallerParts]:
    """A document that names what the caller gives, and the rules of it that are not found by their names alone.

    Giving them is consent to run them. Raises ScenarioError.
    """
    document = dict(document)
    rules: dict[str, Any] = {}
    faults: list[str] = []
    for family, what in given:
        if what is None:
            continue
        table, kind = document.get(family.section, {}), str(what)
        if not (isinstance(what, str) and what in family.shipped):
            found, more = family.from_caller(what)
            faults += more
            if found is None:
                continue
            rules[family.field], kind = found, found.name
        document[family.section] = {**family.kept(table, kind), "kind": kind}
    if faults:
        raise ScenarioError(faults)
    return document, CallerParts(**rules)


def _kinds(given: Any) -> dict[str, Fault]:
    """Kinds of fault that the caller gives, by name."""
    found = [kind if isinstance(kind, Fault) else fault(kind) for kind in _several(given)]
    return {kind.name: kind for kind in found}


def _several(given: Any) -> list[Any]:
    """What a caller gives as one thing, as a list, or not at all."""
    return [] if given is None else list(given) if isinstance(given, (list, tuple)) else [given]


def load_if_named(scenario: Any) -> Scenario:
    """A scenario, or the one that a name stands for."""
    if isinstance(scenario, Scenario):
        return scenario
    if isinstance(scenario, (str, os.PathLike)):
        return load(scenario)
    kind = type(scenario).__name__
    tracks = "; airflock.load_tracks makes a recording of tracks" if hasattr(scenario, "shape") else ""
    raise ScenarioError([f"{kind} is not a scenario; give a Scenario, a preset's name or a scenario file{tracks}"])


def tells_of_study(document: Mapping[str, Any]) -> bool:
    """Whether a document has a table or key that only studies have."""
    return bool({"space", "scenario", "scenarios", "objective", "search"} & set(document))
