"""The key world.file: a field from a GeoJSON or KML file, as the keys of [world] that it stands for.

It is read when a person loads a scenario, and nowhere else: neither a recording nor an event of one names a file.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from airflock.scenarios import schema, units
from airflock.scenarios.schema import value_of
from airflock.support import ScenarioError, expand_path, is_file
from airflock.world import arena, load_field

FROM_FILE = ("world.file", "world.simplify")
GIVEN = ("corners", "obstacles", "heights")  # what the file says, and the scenario cannot say as well
INSTEAD = {"arena": "square", "side": 1e6}  # of a file that cannot be read, so that all else is judged in wide room


def with_field(
    document: Mapping[str, Any], settings: Mapping[str, Any], folder: Path | None
) -> tuple[dict[str, Any], Mapping[str, Any], tuple[str, ...], tuple[str, ...]]:
    """Document and settings in which a field's file has become its keys, notes, and what is wrong with it.

    folder : where the scenario file lies, in which its files are looked for
    """
    table = document.get("world", {})
    if not isinstance(table, Mapping):
        return dict(document), settings, (), ()
    world = {**table, **{key[6:]: value for key, value in settings.items() if key.startswith("world.")}}
    name = value_of(world.get("file", ""))
    if not isinstance(name, str) or not name:
        return dict(document), settings, (), ()
    faults = [f"world.{key}: is given, and world.file as well; take one of them out" for key in GIVEN if key in world]
    shape = value_of(settings.get("world.arena", "polygon"))
    if shape != "polygon":
        faults.append(f"world.arena = {shape!r}: is given, and world.file as well; take one of them out")
    path = expand_path(name) if is_file(name) or folder is None else folder / expand_path(name)
    faults += [] if is_file(path) else [f"world.file = {name!r}: no such file"]
    simplify, more = _metres(world)
    faults += more
    kept = {key: value for key, value in table.items() if key not in ("file", "simplify", "arena", "walls")}
    rest = {key: value for key, value in settings.items() if key not in FROM_FILE}
    if not faults:
        try:
            space = str(value_of(world.get("dimensions", "2"))) == "3"
            found = load_field(path, simplify=simplify, space=space)
        except ScenarioError as fault:
            faults += str(fault).splitlines()
        else:
            return {**document, "world": {**found.keys, **kept}}, rest, (found.note,), ()
    kept = {key: value for key, value in kept.items() if key not in GIVEN} | INSTEAD
    rest = {key: value for key, value in rest.items() if key.removeprefix("world.") not in (*GIVEN, *INSTEAD, "walls")}
    return {**document, "world": kept}, rest, (), tuple(faults)


def _metres(world: Mapping[str, Any]) -> tuple[float, list[str]]:
    """How far outlines may move, m, and what is wrong with it."""
    given = {"world": {key: value for key, value in world.items() if key == "simplify"}}
    told, _, faults = units.convert_units(given, {"world": arena.Parameters})
    made, more = schema.read_section("world", told["world"], arena.Parameters)
    return (made.simplify if made is not None else 0.0), faults + more


def field_file_errors(world: Any) -> list[str]:
    """Why a record of an arena that still names a file cannot be flown."""
    if world is None or not world.file:
        return []
    return [f"world.file = {world.file!r}: a file is read where a scenario is loaded, and not here"]
