"""Scenario files that begin from another: `extends = "vasarhelyi_2018/real_6ms"`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from airflock.core import PacketParameters, number_names, without_replaced
from airflock.scenarios.schema import value_of
from airflock.support import ScenarioError, expand_path, is_file

OF_ITS_OWN = ("published", "title")  # what a paper published of a file and what the file is called: not of another
LONGEST = 10  # files in a chain of extends
# sections in which another kind means other keys
KINDS = ("model", "body", "sensors", "radio", "scene", "goals", "start")
SHARED = {"sensors": ("period",), "radio": number_names(PacketParameters)}  # but for these, which every kind has
ReadDocument = Callable[[str, Path | None], tuple[dict[str, Any], Path]]


def extend_document(
    document: Mapping[str, Any], where: str, folder: Path | None, read: ReadDocument
) -> tuple[dict[str, Any], str]:
    """A document with everything of the file that it extends, and which file that was ("" for none).

    Keys of the document go before those of the file. Where it names another kind of model, body, sensor, radio, scene,
    goals or start, that section's other keys are not taken over. Neither is what a paper published of the file, nor
    its title.

    where  : name of the document, for faults
    folder : where the names of files are looked for
    read   : name of a preset or file, folder → its document and its folder; raises ScenarioError
    """
    return _extended(document, where, folder, read, (where,))


def _extended(
    document: Mapping[str, Any], where: str, folder: Path | None, read: ReadDocument, chain: tuple[str, ...]
) -> tuple[dict[str, Any], str]:
    own = dict(document)
    name = own.pop("extends", None)
    if name is None:
        return own, ""
    if not isinstance(name, str):
        raise ScenarioError([f"{where}: extends = {name!r} is not a name; give a preset or a scenario file"])
    if name in chain or len(chain) > LONGEST:
        raise ScenarioError([f"{where}: extends = {name!r} leads back to itself: {' → '.join((*chain, name))}"])
    try:
        base, place = read(name, folder)
    except ScenarioError as fault:
        raise ScenarioError([f"{where}: extends = {name!r}: {line}" for line in fault.faults]) from fault
    base, _ = _extended(_with_paths(base, place), name, place, read, (*chain, name))
    for key in OF_ITS_OWN:
        base.pop(key, None)
    return {**base, **{key: _section(key, base.get(key), value) for key, value in own.items()}}, name


def _section(key: str, base: Any, own: Any) -> Any:
    """One section: the document's keys over the file's, unless they are of different kinds."""
    if not isinstance(base, Mapping) or not isinstance(own, Mapping) or (set(own) & {"value", "unit"} and key != "set"):
        return own
    kinds = (value_of(own.get("kind", base.get("kind"))), value_of(base.get("kind")))
    other = key in KINDS and kinds[0] != kinds[1]
    if key == "topology":  # ours share their numbers; a file has its own
        other = kinds[0] != kinds[1] and any(isinstance(kind, str) and kind.endswith(".py") for kind in kinds)
    kept = {name: base[name] for name in SHARED.get(key, ()) if name in base} if other else base
    return {**without_replaced(kept, own), **own}


def _with_paths(document: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """A document whose own files, of rules or of a mesh, are named from anywhere."""
    result = dict(document)
    kinds = [(section, "kind") for section in ("model", "body", "sensors", "radio", "topology", "metrics")]
    for section, key in (*kinds, ("scene", "file")):
        table = result.get(section)
        name = value_of(table.get(key)) if isinstance(table, Mapping) else None
        if isinstance(name, str) and name and not expand_path(name).is_absolute() and is_file(folder / name):
            result[section] = {**table, key: str((folder / name).absolute())}  # type: ignore[dict-item]
    faults, groups = result.get("faults"), result.get("groups")
    if isinstance(faults, list):
        result["faults"] = [_kind_with_path(entry, folder) for entry in faults]
    if isinstance(groups, list):
        result["groups"] = [_group_with_path(entry, folder) for entry in groups]
    return result


def _group_with_path(entry: Any, folder: Path) -> Any:
    if not isinstance(entry, Mapping) or "model" not in entry:
        return entry
    return {**entry, "model": _kind_with_path(entry["model"], folder)}


def _kind_with_path(entry: Any, folder: Path) -> Any:
    name = entry.get("kind") if isinstance(entry, Mapping) else None
    if not isinstance(name, str) or not name.endswith(".py") or Path(name).is_absolute() or not is_file(folder / name):
        return entry
    return {**entry, "kind": str((folder / name).absolute())}
