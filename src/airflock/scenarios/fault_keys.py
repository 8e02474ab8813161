"""Keys of faults: `faults.KIND.KEY` or `faults.NUMBER.KEY`, by which settings and sweeps change an entry."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from airflock.scenarios.schema import value_of
from airflock.spelling import as_name, meant

FIRST = "faults."
FORM = "write faults.KIND.KEY or faults.NUMBER.KEY, for instance faults.motor.share"


def with_faults(
    document: Mapping[str, Any], settings: Mapping[str, Any]
) -> tuple[Mapping[str, Any], dict[str, Any], list[str]]:
    """A document with the keys of its faults set, the other settings, and what is wrong with these keys."""
    wanted = {key: value for key, value in settings.items() if key.startswith(FIRST)}
    others = {key: value for key, value in settings.items() if key not in wanted}
    if not wanted:
        return document, others, []
    given = others.get("faults", document.get("faults", ()))
    if not given or not isinstance(given, (list, tuple)) or not all(isinstance(table, Mapping) for table in given):
        return document, others, [f"{key}: the scenario has no [[faults]]; write them in a file" for key in wanted]
    tables = [dict(table) for table in given]
    faults = []
    for key, value in wanted.items():
        entry, _, name = key.removeprefix(FIRST).rpartition(".")
        number, fault = _entry(entry, name, tables)
        if number is None:
            faults.append(f"{key}: {fault}")
        else:
            tables[number][name] = value
    return {**document, "faults": tables}, {key: v for key, v in others.items() if key != "faults"}, faults


def _entry(entry: str, name: str, tables: Sequence[Mapping[str, Any]]) -> tuple[int | None, str]:
    """Number of the entry that a key names, by its kind or its number; or None, and what is wrong with the key."""
    if not entry or not name:
        return None, f"unknown key; {FORM}"
    if entry.isascii() and entry.isdecimal():
        if int(entry) < len(tables):
            return int(entry), ""
        return None, f"there is no fault {entry[:20]}; the scenario has the faults 0 to {len(tables) - 1}"
    kinds = [_name(value_of(table.get("kind"))) for table in tables]
    numbers = [number for number, kind in enumerate(kinds) if kind == entry]
    if len(numbers) == 1:
        return numbers[0], ""
    if numbers:
        several = ", ".join(f"{FIRST}{number}.{name}" for number in numbers[:3])
        return None, f"{len(numbers)} faults are of this kind; write one of {several}"
    return None, f"the scenario has no fault {entry!r}; {meant(entry, kinds, 'known: ' + ', '.join(kinds))}"


def _name(kind: Any) -> str:
    """What a kind is called in a key: that of a file by the file's name."""
    return as_name(Path(kind).stem) if isinstance(kind, str) and kind.endswith(".py") else str(kind)
