"""Keys of faults: `faults.KIND.KEY` or `faults.NUMBER.KEY`, by which settings, sweeps and sliders change an entry."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from airflock.core import Declaration, declarations
from airflock.scenarios.schema import value_of
from airflock.support import suggest, to_identifier

FIRST = "faults."
FORM = "write faults.KIND.KEY or faults.NUMBER.KEY, for instance faults.motor.share"


def with_fault_keys(
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
        elif value is None:  # as it is without
            tables[number].pop(name, None)
        else:
            tables[number][name] = value
    return {**document, "faults": tables}, {key: v for key, v in others.items() if key != "faults"}, faults


def is_fault_key(key: str) -> bool:
    """Whether a key names something of a fault."""
    return key.startswith(FIRST)


def entry_of_key(tables: Sequence[Mapping[str, Any]], key: str) -> tuple[int | None, str]:
    """Number of the entry that a key means, None where there is none, and the name of what it sets."""
    entry, _, name = key.removeprefix(FIRST).rpartition(".")
    return _entry(entry, name, tables)[0], name


def fault_declarations(entries: Sequence[Any]) -> Iterator[tuple[str, str, Declaration, Any]]:
    """Key, kind, declaration and value of the numbers of each fault.

    Keys are those by number: a kind may come again while a flock flies.
    """
    for number, entry in enumerate(entries):
        for name, declared, _ in declarations(entry.numbers):
            yield f"{FIRST}{number}.{name}", entry.fault.name, declared, getattr(entry.numbers, name)


def has_fault(scenario: Any, key: str) -> bool:
    """Whether a scenario has the fault that a key names."""
    return entry_of_key(_kinds(scenario), key)[0] is not None


def fault_key_value(scenario: Any, key: str) -> Any:
    """Value of a key of a fault; None where there is no such fault, or nothing is said of when it begins and ends."""
    number, name = entry_of_key(_kinds(scenario), key)
    if number is None:
        return None
    written = scenario.document["faults"][number].get(name)
    return getattr(scenario.faults[number].numbers, name, written)


def _kinds(scenario: Any) -> list[dict[str, str]]:
    return [{"kind": entry.fault.name} for entry in scenario.faults]


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
    return None, f"the scenario has no fault {entry!r}; {suggest(entry, kinds, 'known: ' + ', '.join(kinds))}"


def _name(kind: Any) -> str:
    """What a kind is called in a key: that of a file by the file's name."""
    return to_identifier(Path(kind).stem) if isinstance(kind, str) and kind.endswith(".py") else str(kind)
