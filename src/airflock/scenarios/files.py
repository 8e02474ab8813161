"""Scenario files: TOML with units and sources, presets by name, files that extend others, fields from map files."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from airflock.core import Fault, Kind, PacketParameters, fault, number_names, without_replaced
from airflock.parts import default_body
from airflock.parts.laws import network_weights
from airflock.scenarios import formats, schema
from airflock.scenarios.named_code import find_law, law_from_caller
from airflock.scenarios.part_kinds import PART_KINDS, CallerParts, kept_keys, part_from_caller
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.scenario_builder import build_scenario, rebuilt
from airflock.scenarios.schema import value_of
from airflock.scenarios.settings import settings_dict
from airflock.support import (
    AirflockError,
    ErrorCollector,
    FormatError,
    ScenarioError,
    as_error,
    expand_path,
    is_file,
    parse_json,
    read_text,
    read_toml,
    suggest,
)
from airflock.world import arena, load_field

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
    """Return name and file of every preset that comes with the package.

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
    return dict(files_of_laws("presets"))


@cache
def files_of_laws(folder: str) -> Mapping[str, Path]:
    """Return name → file of what the laws of the package bring in a folder: "presets" or "studies".

    The name is LAW/FILE; one in a folder within is named by that, as a publication that flies
    another's law.
    """
    found = {}
    for path in Path(str(resources.files("airflock.parts.laws"))).glob(f"*/{folder}/**/*.toml"):
        owner = path.parent if path.parent.name != folder else path.parents[1]
        found[f"{owner.name}/{path.stem}"] = path
    return {name: found[name] for name in sorted(found, key=lambda name: Path(f"{name}.toml"))}


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
    """Load a scenario from a preset's name or a file.

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
        file's, or one by its name or its file. Its parameters start from their defaults; by the name of a preset they
        are those of that preset.
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
        A topology of your own, which selects the neighbours that agents meet: a namespace, or a name or file.
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
        With one line per error: file, key, value, unit, allowed range, and the nearest right key.
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
        document, base = extend_document(document, where, folder)
        document, caller_parts = _with_given(
            document, zip(PART_KINDS, (metrics, body, sensor, radio, topology), strict=True)
        )
        errors = ErrorCollector()
        errors.notes += [f"extends {base}: what is not given here is taken from there"] if base else []
        taken: dict[str, Any] = {}
        if isinstance(law, str) and law in presets():
            preset, place = _read(law, None)
            preset, _ = extend_document(preset, law, place)
            errors.notes.append(f"law = {law}: [model] and [steer] are those of that preset, and nothing else is")
            taken, law = {key: preset[key] for key in ("model", "steer") if key in preset}, preset["model"]["kind"]
        own_law = None if law is None else law_from_caller(law)
        of_groups = {own.name: own for own in map(law_from_caller, _several(laws))}
        caller_parts = replace(caller_parts, law=own_law, fault_kinds=_kinds(faults), laws=of_groups)
        document, settings = with_field(document, settings_dict(settings, where), folder, errors)
        if own_law is not None:
            document = _with_robot_of(document, where, settings, folder, caller_parts, trust)
            kind = str(expand_path(law).absolute()) if str(law).endswith(".py") else own_law.name
            document = {**document, "model": {"kind": kind}, "published": {}, **taken}
        document, settings = _with_columns(document, settings, folder, errors)
        return build_scenario(
            document, where, settings, folder=folder, caller_parts=caller_parts, errors=errors, trust=trust
        )


def _with_columns(
    document: dict[str, Any], settings: Mapping[str, Any], folder: Path | None, errors: ErrorCollector
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Replace JSON files that keys of [model] name by the numbers that they hold, so that no recording names a file.

    Layers, [[weights, bias], ...], become the column of the law `network`.
    """

    def read(table: Mapping[str, Any], beside: Path | None) -> dict[str, Any]:
        found = dict(table)
        for key, name in table.items():
            if key.startswith("model.") and isinstance(name, str) and name.endswith(".json"):
                del found[key]
                path = expand_path(name) if is_file(name) or beside is None else beside / expand_path(name)
                with errors.collecting(f"{key} = {name!r}: "):
                    found[key] = column_of_file(path)
        return found

    model = document.get("model")
    if isinstance(model, Mapping):
        whole = read({f"model.{key}": value for key, value in model.items()}, folder)
        document = {**document, "model": {key[6:]: value for key, value in whole.items()}}
    return document, read(settings, None)


def column_of_file(path: Path) -> list[float]:
    """Read a JSON file of numbers, or of layers for the law `network`. Raises ScenarioError, ParameterError."""
    if not is_file(path):
        raise ScenarioError(["no such file"])
    found = parse_json(read_text(path))
    if not isinstance(found, list) or not found:
        raise ScenarioError(["holds neither a list of numbers nor of layers, [[weights, bias], ...]"])
    return network_weights(found) if isinstance(found[0], list) else found


def _with_robot_of(
    document: dict[str, Any], where: str, settings: Mapping[str, Any], folder: Path | None, parts: CallerParts,
    trust: bool,
) -> dict[str, Any]:  # fmt: skip
    """Return a document for the caller's law that names the body of the one which it replaces, and its preferred speed.

    The speed counts only where the caller's law prefers none.
    """
    assert parts.law is not None
    model, body, steer = (document.get(section, {}) for section in ("model", "body", "steer"))
    # What is set for the law or the body is meant for those that fly.
    others = {key: value for key, value in settings.items() if not key.startswith(("model.", "body.", "steer."))}
    try:
        before = build_scenario(
            document, where, others, folder=folder, caller_parts=replace(parts, law=None), trust=trust
        )
    except AirflockError:
        # What is wrong is said with the new law; but a body that is not named is that of the old one.
        kind = model.get("kind") if isinstance(model, Mapping) else None
        try:
            usual = default_body(find_law(kind, folder, trust=trust).command)
        except AirflockError:
            return document
        return {**document, "body": {"kind": usual, **body}} if isinstance(body, Mapping) else document
    speed = 0.0 if parts.law.preferred_speed is not None else before.model.speed(before.parameters)
    body = {"kind": before.body.rule.name, **body}
    return {**document, "body": body, "steer": {"speed": speed, **steer} if speed else steer}


def _read(name: str, folder: Path | None) -> tuple[dict[str, Any], Path]:
    """Read a preset or a file; return its document in the current format, and its folder."""
    known = presets()
    path = known.get(name) or (expand_path(name) if folder is None else folder / expand_path(name))
    if not is_file(path):
        # a file name is a misspelt preset only where the two are very similar
        word, cutoff = (name, 0.4) if path.suffix != ".toml" else (name.removesuffix(".toml"), 0.7)
        hint = suggest(word, known, "; airflock presets lists the presets", lead="; ", cutoff=cutoff)
        raise ScenarioError([f"{name}: no such file or preset{hint}"])
    if path.suffix.lower() in NO_SCENARIO:
        raise ScenarioError([f"{name}: is {NO_SCENARIO[path.suffix.lower()]}"])
    with as_error(name):
        try:
            document = read_toml(path)
        except FormatError as error:
            raise ScenarioError([f"{name}: is not a scenario file (TOML): {error}"]) from error
    # A study read as a scenario would give one error per key.
    if tells_of_study(document) and not {"model", "extends"} & set(document):
        raise ScenarioError([f"{name}: is a study, not a scenario; check it with airflock validate, or evolve it"])
    return formats.numbered(formats.to_current_format(document, name)), path.parent


def _with_given(
    document: Mapping[str, Any], given: Iterable[tuple[Kind[Any], Any]]
) -> tuple[dict[str, Any], CallerParts]:
    """Put the caller's parts into a document; return it, and the parts that are not found by their names alone.

    Giving a part is consent to run it. Raises ScenarioError.
    """
    document, errors = dict(document), ErrorCollector()
    rules: dict[str, Any] = {}
    for family, part in given:
        if part is None:
            continue
        table, kind = document.get(family.section, {}), str(part)
        # A name of the package needs no object: the document finds it by the name.
        if not (isinstance(part, str) and part in family):
            own_part, more = part_from_caller(family, part)
            errors.add(*more)
            if own_part is None:
                continue
            rules[family.section], kind = own_part, own_part.name
        document[family.section] = {**kept_keys(family, table, kind), "kind": kind}
    if errors:
        raise ScenarioError(errors.errors)
    return document, CallerParts(**rules)


def _kinds(given: Any) -> dict[str, Fault]:
    """Return the kinds of fault that the caller gives, by name."""
    kinds = [kind if isinstance(kind, Fault) else fault(kind) for kind in _several(given)]
    return {kind.name: kind for kind in kinds}


def _several(given: Any) -> list[Any]:
    """Return one object as a list, and a list or None as it is."""
    return [] if given is None else list(given) if isinstance(given, (list, tuple)) else [given]


def load_if_named(scenario: Any) -> Scenario:
    """Return a scenario as it is, or load the one that a name stands for."""
    if isinstance(scenario, Scenario):
        return scenario
    if isinstance(scenario, (str, os.PathLike)):
        return load(scenario)
    kind = type(scenario).__name__
    tracks = "; airflock.load_tracks makes a recording of tracks" if hasattr(scenario, "shape") else ""
    raise ScenarioError([f"{kind} is not a scenario; give a Scenario, a preset's name or a scenario file{tracks}"])


def tells_of_study(document: Mapping[str, Any]) -> bool:
    """Return True if a document has a table or key that only studies have."""
    return bool({"space", "scenario", "scenarios", "objective", "search"} & set(document))


def scenario_variant(
    scenario: Scenario | str | os.PathLike[str],
    settings: Mapping[str, Any] | None,
    law: Any = None,
    *,
    trust: bool = False,
) -> Scenario:
    """Return a scenario, or load the one that a name or file stands for, with keys changed; arguments as in `load`."""
    if not isinstance(scenario, (Scenario, str, os.PathLike)):
        return load_if_named(scenario)
    if not isinstance(scenario, Scenario):
        return load(scenario, settings, law, trust=trust)
    if law is not None:
        raise ScenarioError([f"{scenario.name}: is a Scenario already; give its law to load(name, law=...)"])
    return rebuilt(scenario, settings) if settings else scenario


OF_ITS_OWN = ("published", "title")  # what a paper published of a file and what the file is called: not of another
LONGEST = 10  # files in a chain of extends
# sections in which another kind means other keys
SECTIONS_WITH_KINDS = ("model", "body", "sensors", "radio", "scene", "goals", "start")
SHARED_KEYS = {"sensors": ("period",), "radio": number_names(PacketParameters)}  # but for these, which every kind has


def extend_document(
    document: Mapping[str, Any], where: str, folder: Path | None, chain: tuple[str, ...] = ()
) -> tuple[dict[str, Any], str]:
    """Merge a document over the file that it extends; return it, and the name of that file ("" for none).

    Keys of the document replace those of the file. Where it names another kind of model, body,
    sensor, radio, scene, goals or start, that section's other keys are not taken over. Neither are
    the published values of the file, nor its title.

    where  : name of the document, for errors
    folder : where files are looked for; chain : names of the documents that extend this one
    """
    chain = (*chain, where)
    # The keys are copied and the link is gone: a recording must not change when a preset does.
    own = dict(document)
    name = own.pop("extends", None)
    if name is None:
        return own, ""
    if not isinstance(name, str):
        raise ScenarioError([f"{where}: extends = {name!r} is not a name; give a preset or a scenario file"])
    if name in chain or len(chain) > LONGEST:
        raise ScenarioError([f"{where}: extends = {name!r} leads back to itself: {' → '.join((*chain, name))}"])
    try:
        base, place = _read(name, folder)
    except ScenarioError as error:
        raise ScenarioError([f"{where}: extends = {name!r}: {line}" for line in error.errors]) from error
    # The base's own files are named relative to the base, so they become absolute before the merge.
    base, _ = extend_document(_with_paths(base, place), name, place, chain)
    for key in OF_ITS_OWN:
        base.pop(key, None)
    return {**base, **{key: _merge_section(key, base.get(key), value) for key, value in own.items()}}, name


def _merge_section(key: str, base: Any, own: Any) -> Any:
    """Merge one section: the document's keys over the file's, unless their kinds differ."""
    # A value with its unit is a table, too, and is replaced as one.
    if not isinstance(base, Mapping) or not isinstance(own, Mapping) or (set(own) & {"value", "unit"} and key != "set"):
        return own
    kinds = (value_of(own.get("kind", base.get("kind"))), value_of(base.get("kind")))
    other = key in SECTIONS_WITH_KINDS and kinds[0] != kinds[1]
    if key == "topology":  # ours share their numbers; a file has its own
        other = kinds[0] != kinds[1] and any(isinstance(kind, str) and kind.endswith(".py") for kind in kinds)
    kept = {name: base[name] for name in SHARED_KEYS.get(key, ()) if name in base} if other else base
    return {**without_replaced(kept, own), **own}


def _with_paths(document: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return a document in which relative files of rules or meshes have absolute paths."""
    result = dict(document)
    # Relative names are relative to the file that has them, which is lost when documents are
    # merged.
    for section in ("model", "body", "sensors", "radio", "topology", "metrics", "scene"):
        if section in result:
            result[section] = _with_path(result[section], folder, "file" if section == "scene" else "kind")
    if "model" in result:
        result["model"] = _with_path(result["model"], folder, "weights")
    if isinstance(faults := result.get("faults"), list):
        result["faults"] = [_with_path(entry, folder) for entry in faults]
    if isinstance(groups := result.get("groups"), list):
        result["groups"] = [
            {**entry, "model": _with_path(entry["model"], folder)}
            if isinstance(entry, Mapping) and "model" in entry
            else entry
            for entry in groups
        ]
    return result


def _with_path(table: Any, folder: Path, key: str = "kind") -> Any:
    """Return a table in which the file of code or the mesh of a key has its absolute path."""
    name = value_of(table.get(key)) if isinstance(table, Mapping) else None
    if not isinstance(name, str) or not name or not (key == "file" or name.endswith((".py", ".json"))):
        return table
    is_beside = not expand_path(name).is_absolute() and is_file(folder / name)
    return {**table, key: str((folder / name).absolute())} if is_beside else table


FROM_FILE = ("world.file", "world.simplify")
GIVEN = ("corners", "obstacles", "heights", "latitude", "longitude")  # come from the map file
INSTEAD = {"arena": "square", "side": 1e6}  # of a file that cannot be read, so that all else is judged in wide room


def with_field(
    document: Mapping[str, Any], settings: Mapping[str, Any], folder: Path | None, errors: ErrorCollector
) -> tuple[dict[str, Any], Mapping[str, Any]]:
    """Replace world.file by the keys of [world] that the map file stands for; return document and settings without it.

    It is read when a person loads a scenario, and nowhere else: neither a recording nor an event of
    one names a file.

    folder : of the scenario file, where its files are looked for
    """
    table = document.get("world", {})
    if not isinstance(table, Mapping):
        return dict(document), settings
    world = {**table, **{key[6:]: value for key, value in settings.items() if key.startswith("world.")}}
    name = value_of(world.get("file", ""))
    if not isinstance(name, str) or not name:
        return dict(document), settings
    wrong = ErrorCollector()
    twice = [f"world.{key}" for key in GIVEN if key in world]
    shape = value_of(settings.get("world.arena", "polygon"))
    twice += [] if shape == "polygon" else [f"world.arena = {shape!r}"]
    wrong.add(*(f"{key}: is given, and world.file as well; take one of them out" for key in twice))
    path = expand_path(name) if is_file(name) or folder is None else folder / expand_path(name)
    if not is_file(path):
        wrong.add(f"world.file = {name!r}: no such file")
    outlines = {key: value for key, value in world.items() if key == "simplify"}
    numbers, _ = schema.read_section("world", outlines, arena.Parameters, wrong)
    errors.notes += wrong.notes
    kept = {key: value for key, value in table.items() if key not in ("file", "simplify", "arena", "walls")}
    rest = {key: value for key, value in settings.items() if key not in FROM_FILE}
    if not wrong:
        space = str(value_of(world.get("dimensions", "2"))) == "3"
        with wrong.collecting():
            field = load_field(path, simplify=numbers.simplify, space=space)
            errors.notes.append(field.note)
            return {**document, "world": {**field.keys, **kept}}, rest
    errors.add(*wrong.errors)
    # A very large square stands in for the unreadable field, so that no further error about the
    # arena follows.
    kept = {key: value for key, value in kept.items() if key not in GIVEN} | INSTEAD
    rest = {key: value for key, value in rest.items() if key.removeprefix("world.") not in (*GIVEN, *INSTEAD, "walls")}
    return {**document, "world": kept}, rest
