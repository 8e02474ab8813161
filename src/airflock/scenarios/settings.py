"""Settings: keys that a caller sets from outside, applied to a document before it is checked.

A key is whole ("radio.delay"), or names a number of a group (`groups.NAME.SECTION.KEY`, a tolerance
with `.spread` behind it) or of a fault (`faults.KIND.KEY` or `faults.NUMBER.KEY`). `delay` stands
for `radio.delay` where only one section has a delay.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from airflock.core import Declaration, Quantity, declarations, without_replaced
from airflock.parts import LAWS
from airflock.scenarios.groups import LETTERS
from airflock.scenarios.part_kinds import PART_KINDS, kept_keys, named_kind
from airflock.scenarios.schema import value_of
from airflock.scenarios.sections import SECTIONS
from airflock.support import ErrorCollector, ScenarioError, suggest, to_identifier

TOP_LEVEL_KEYS = ("model", *SECTIONS, "groups", "faults", "agents", "duration", "dt", "update", "published", "title")


STEERED = {"speed_max": "speed", "speed": "speed", "turn": "turn"}  # number of a body → number of [steer]


def with_kinds(document: Mapping[str, Any], settings: Mapping[str, Any], errors: ErrorCollector) -> Mapping[str, Any]:
    """Return a document without the numbers of each part for which settings name another kind, which is noted.

    The published values of a law go with its numbers.
    """
    document = {**document}
    for family in (*PART_KINDS, LAWS):
        section, key = family.section, f"{family.section}.kind"
        table = document.get(section, {})
        if key not in settings or not isinstance(table, Mapping):
            continue
        before = value_of(table.get("kind")) if family is LAWS else named_kind(family, document)
        if family is LAWS and before in (None, settings[key]):
            continue
        kept = {} if family is LAWS else kept_keys(family, table, str(settings[key]))
        if set(table) - {"kind", *kept}:
            errors.notes.append(f"{key} = {settings[key]!r}: the numbers of the file's {before} are left out")
        document |= {section: kept} | ({"published": {}} if family is LAWS else {})
        # How fast a body flew and turned by itself is how a law's command is converted for another one.
        gone = set(table) - set(kept) if section == "body" else set()
        moved = {name: table[own] for own, name in STEERED.items() if own in gone}
        if moved and isinstance(document.get("steer", {}), Mapping):
            document["steer"] = moved | document.get("steer", {})
    return document


def settings_dict(settings: Any, where: str) -> dict[str, Any]:
    """Return settings as a dict of plain values, empty for None. Raises ScenarioError for anything else."""
    if settings is None:
        return {}
    if not isinstance(settings, Mapping) or not all(isinstance(key, str) for key in settings):
        raise ScenarioError([f"{where}: settings {settings!r} are no keys with values, such as {{'dt': '10 ms'}}"])
    return {key: _plain(value) for key, value in settings.items()}


def _plain(value: Any) -> Any:
    """Convert NumPy's types to Python's at any depth, as a file holds them: a recording stores settings as JSON."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    # Subclasses of list and tuple (named tuples) are left alone: their constructors take other
    # arguments.
    return type(value)(map(_plain, value)) if type(value) in (list, tuple) else value


def apply_settings(document: Mapping[str, Any], settings: Mapping[str, Any], errors: ErrorCollector) -> dict[str, Any]:
    """Return a copy of a document with keys set: whole ones such as "model.p_rep", and those of groups and faults."""
    result: dict[str, Any] = {k: dict(v) if isinstance(v, Mapping) else v for k, v in document.items()}
    # Keys of entries come last: whole lists of them may be set, too.
    for key, value in sorted(settings.items(), key=lambda item: is_group_key(item[0]) or is_fault_key(item[0])):
        section, _, name = key.partition(".")
        if is_group_key(key) or is_fault_key(key):
            entries = _entries(result, section)
            if not entries:
                errors.add(f"{key}: the scenario has no [[{section}]]; write them in a file")
                continue
            result[section] = entries
            of_group = section == "groups"
            error = _set_of_group(key, value, entries, document) if of_group else _set_of_fault(key, value, entries)
            errors.add(*([f"{key}: {error}"] if error else []))
        elif not name:
            result[section] = value
        elif isinstance(result.setdefault(section, {}), dict):
            result[section] = {**without_replaced(result[section], {name: value}), name: value}
        else:
            errors.add(f"{key}: unknown key")
    errors.add(*(_unknown(key, value) for key, value in result.items() if key not in TOP_LEVEL_KEYS))
    return result


def _unknown(key: str, value: object) -> str:
    """Return the error line for a key that no scenario has, also where a key of the top stands in a section."""
    above = next((name for name in value if name in TOP_LEVEL_KEYS), None) if isinstance(value, Mapping) else None
    if above is not None:
        return f"{key}.{above}: unknown key; did you mean {above}?"
    return f"{key}: unknown key; {suggest(key, TOP_LEVEL_KEYS, 'known: ' + ', '.join(TOP_LEVEL_KEYS))}"


def _entries(document: Mapping[str, Any], section: str) -> list[dict[str, Any]]:
    """Return copies of the entries of a list of tables; none where it is no such list."""
    entries = document.get(section, ())
    tables = isinstance(entries, (list, tuple)) and all(isinstance(table, Mapping) for table in entries)
    return [dict(table) for table in entries] if tables else []


# keys that only files have: what to do instead
IN_FILES = {
    "extends": "only a file has it; name the preset or file that it extends in place of this one",
    "format": "only a file has it; leave it out",
}


def keys_by_last_word(records: Mapping[str, type]) -> dict[str, list[str]]:
    """Return last word → whole keys of all sections that have it.

    A key of `metrics` that is taken from the scenario by default (such as metrics.v_flock) gives
    way to a key of the model with the same name.
    """
    keys: dict[str, list[str]] = {}
    for section, record in records.items():
        for name, declared, _ in declarations(record):
            # `delay` alone was the radio's before bodies had one, and stays it.
            if section and (section, name) != ("body", "delay"):
                # Optional numbers of metrics default to the scenario's own; without this rule
                # `v_flock` would be ambiguous in every law that has it.
                derived = section == "metrics" and isinstance(declared, Quantity) and declared.optional
                if not (derived and name in keys):
                    keys.setdefault(name, []).append(f"{section}.{name}")
        for name in getattr(record, "VECTORS", {}):
            keys.setdefault(name, []).append(f"{section}.{name}")
    return keys


def expand_short_keys(
    settings: Mapping[str, Any], records: Mapping[str, type], errors: ErrorCollector, top: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Expand settings by their last words to whole keys; ambiguous and unknown ones are errors.

    settings : keys that are neither whole ("radio.delay") nor at the top of a file ("agents")
    records  : section → record of its parameters, "model" first
    """
    known = keys_by_last_word(records)
    result: dict[str, Any] = {}
    for key, value in settings.items():
        where = known.get(key, [])
        if len(where) == 1:
            result[where[0]] = value
            errors.notes.append(f"{key} is read as {where[0]}")
        elif where:
            meant = (f"{name} ({_meaning(name, records)})" for name in where)
            errors.add(f"{key} is several keys; write {' or '.join(meant)}")
        elif key in IN_FILES:
            errors.add(f"{key}: {IN_FILES[key]}")
        else:
            near = get_close_matches(key, (*top, *known), n=1, cutoff=0.5)
            full = known.get(near[0], near) if near else []
            errors.add(f"{key}: unknown key; {f'did you mean {full[0]}?' if near else 'known: ' + ', '.join(top)}")
    return result


def _meaning(key: str, records: Mapping[str, type]) -> str:
    """Return the meaning of a whole key, up to the first comma or semicolon."""
    section, _, last = key.partition(".")
    declared = next(found for name, found, _ in declarations(records[section]) if name in (last, f"{last}_0"))
    return re.split(r"[;,(]", declared.meaning)[0].strip()


GROUP_PREFIX, SPREAD = "groups.", "spread"
GROUP_FORM = "write groups.NAME.SECTION.KEY, for instance groups.heavy.body.tau"


def is_group_key(key: str) -> bool:
    """Return True if a key begins with `groups.`."""
    return key.startswith(GROUP_PREFIX)


def split_key(key: str) -> tuple[str, str, str]:
    """Split a key of a group into group, section and name (with `.spread`); empty words where it is too short."""
    rest = key.removeprefix(GROUP_PREFIX).rsplit(".", 3)
    if len(rest) == 4 and rest[1] in LETTERS and rest[3] == SPREAD:
        return rest[0], rest[1], f"{rest[2]}.{SPREAD}"
    return (".".join(rest[:-2]), rest[-2], rest[-1]) if len(rest) > 2 else ("", "", "")


def _set_of_group(key: str, value: Any, tables: list[dict[str, Any]], document: Mapping[str, Any]) -> str:
    """Set a key of a group in the entries of [[groups]]; return what is wrong with the key."""
    names = [table.get("name", f"group_{number}") for number, table in enumerate(tables)]
    # Names of groups may hold dots, so a key is split from its end.
    group, section, name = split_key(key)
    if section not in LETTERS and _belongs_to_file(key, names):
        return f"a setting changes only {', '.join(LETTERS)} of a group; write it in the file's [[groups]]"
    if section not in LETTERS or not name:
        return f"unknown key; {_group_key_hint(key, document, dict(zip(map(str, names), tables, strict=True)))}"
    if group not in names:
        return f"unknown group {group!r}; " + suggest(group, map(str, names), f"known: {', '.join(map(str, names))}")
    table = tables[names.index(group)]
    own, (name, _, spread) = table.get(section, {}), name.partition(".")
    if isinstance(own, Mapping):
        before = own.get(name)
        table[section] = {**own, name: _with_spread(before, value) if spread else with_old_spread(before, value)}
    return ""


def _belongs_to_file(key: str, names: list[str]) -> bool:
    """Return True if a key is a group's name or its agents, which only the file may set."""
    group, _, word = key.removeprefix(GROUP_PREFIX).rpartition(".")
    return word in ("name", "agents") and group in names


def _group_key_hint(key: str, document: Mapping[str, Any], tables: Mapping[str, Mapping[str, Any]]) -> str:
    """Return what to write instead of a key without a section: the nearest group, and the word at the end of the key.

    Known are the words that the file writes for the flock or for the group; for any other word the
    section stays open.
    """
    rest, _, word = key.removeprefix(GROUP_PREFIX).rpartition(".")
    group = next(iter(get_close_matches(rest, list(tables), n=1, cutoff=0.5)), "")
    sections = f"sections: {', '.join(LETTERS)}"
    if not rest or not group:
        return f"{GROUP_FORM}; {sections}"
    places: dict[str, str] = {}
    for section in LETTERS:
        for table in (document.get(section), tables[group].get(section)):
            places |= {name: section for name in table} if isinstance(table, Mapping) else {}
    near = next(iter(get_close_matches(word, list(places), n=1)), "")
    if not near:
        return f"did you mean {GROUP_PREFIX}{group}.SECTION.{word}; {sections}"
    return f"did you mean {GROUP_PREFIX}{group}.{places[near]}.{near}?"


def with_old_spread(before: Any, value: Any) -> Any:
    """Return a value with the spread that the number had before, which keeps its unit."""
    if not isinstance(before, Mapping) or "spread" not in before or isinstance(value, Mapping):
        return value
    unit = {"unit": before["unit"]} if "unit" in before else {}
    return {"value": {"value": value} if unit else value, "spread": before["spread"], **unit}


def _with_spread(before: Any, spread: Any) -> dict[str, Any]:
    """Return a group's number with another spread; the value keeps its unit."""
    if not isinstance(before, Mapping):
        return {"spread": spread} if before is None else {"value": before, "spread": spread}
    if "value" not in before:
        return {"spread": spread}
    value = {"value": before["value"], "unit": before["unit"]} if "unit" in before else before["value"]
    return {"value": value, "spread": spread}


def group_declarations(scenario: Any) -> Iterator[tuple[str, Declaration, Any]]:
    """Yield key, declaration and value of the groups' own numbers; all numbers of a law that only groups fly by."""
    for group in scenario.groups:
        for section, letter in LETTERS.items():
            law = group.law if section == "model" else None
            record = law[1] if law else scenario.records[section]
            for name, declared, _ in declarations(record):
                if law or (letter, name) in group.numbers or (letter, name) in group.spread:
                    value = group.numbers.get((letter, name), getattr(record, name))
                    yield f"{GROUP_PREFIX}{group.name}.{section}.{name}", declared, value


def group_key_value(scenario: Any, key: str) -> Any:
    """Return the value of a key of a group; that of the flock where the group has none of its own."""
    group, section, name = split_key(key)
    owner = next(each for each in scenario.groups if each.name == group)
    record = owner.law[1] if owner.law and section == "model" else scenario.records[section]
    return owner.numbers.get((LETTERS[section], name), getattr(record, name))


FAULT_PREFIX = "faults."
FAULT_FORM = "write faults.KIND.KEY or faults.NUMBER.KEY, for instance faults.motor.share"


def _set_of_fault(key: str, value: Any, tables: list[dict[str, Any]]) -> str:
    """Set a key of a fault in the entries of [[faults]]; return what is wrong with the key."""
    entry, _, name = key.removeprefix(FAULT_PREFIX).rpartition(".")
    number, error = _find_entry(entry, name, tables)
    if number is None:
        return error
    # None resets the number to its default, for sliders and sweeps that return to the start.
    if value is None:
        tables[number].pop(name, None)
    else:
        tables[number][name] = value
    return ""


def is_fault_key(key: str) -> bool:
    """Return True if a key begins with `faults.`."""
    return key.startswith(FAULT_PREFIX)


def entry_of_key(tables: Sequence[Mapping[str, Any]], key: str) -> tuple[int | None, str]:
    """Return the number of the entry that a key means, None where there is none, and the name behind it."""
    entry, _, name = key.removeprefix(FAULT_PREFIX).rpartition(".")
    return _find_entry(entry, name, tables)[0], name


def fault_declarations(entries: Sequence[Any]) -> Iterator[tuple[str, str, Declaration, Any]]:
    """Yield key, kind, declaration and value of the numbers of each fault.

    Keys count the entries: a kind may occur again while a flock flies.
    """
    # Keys by number and not by kind, since a kind may occur in several entries.
    for number, entry in enumerate(entries):
        for name, declared, _ in declarations(entry.numbers):
            yield f"{FAULT_PREFIX}{number}.{name}", entry.fault.name, declared, getattr(entry.numbers, name)


def has_fault(scenario: Any, key: str) -> bool:
    """Return True if a scenario has the fault that a key names."""
    return entry_of_key(_kind_tables(scenario), key)[0] is not None


def fault_key_value(scenario: Any, key: str) -> Any:
    """Return the value of a key of a fault; None where there is no such fault, or its begin or end is left open."""
    number, name = entry_of_key(_kind_tables(scenario), key)
    if number is None:
        return None
    written = scenario.document["faults"][number].get(name)
    return getattr(scenario.faults[number].numbers, name, written)


def _kind_tables(scenario: Any) -> list[dict[str, str]]:
    return [{"kind": entry.fault.name} for entry in scenario.faults]


def _find_entry(entry: str, name: str, tables: Sequence[Mapping[str, Any]]) -> tuple[int | None, str]:
    """Return the number of the entry that a key names by its kind or number; or None, and the error."""
    if not entry or not name:
        return None, f"unknown key; {FAULT_FORM}"
    # isdecimal alone accepts digits of other scripts, which a file never means.
    if entry.isascii() and entry.isdecimal():
        if int(entry) < len(tables):
            return int(entry), ""
        return None, f"there is no fault {entry[:20]}; the scenario has the faults 0 to {len(tables) - 1}"
    kinds = [_kind_name(value_of(table.get("kind"))) for table in tables]
    numbers = [number for number, kind in enumerate(kinds) if kind == entry]
    if len(numbers) == 1:
        return numbers[0], ""
    if numbers:
        several = ", ".join(f"{FAULT_PREFIX}{number}.{name}" for number in numbers[:3])
        return None, f"{len(numbers)} faults are of this kind; write one of {several}"
    return None, f"the scenario has no fault {entry!r}; {suggest(entry, kinds, 'known: ' + ', '.join(kinds))}"


def _kind_name(kind: Any) -> str:
    """Return the name of a kind in a key: that of a file is the file's name."""
    return to_identifier(Path(kind).stem) if isinstance(kind, str) and kind.endswith(".py") else str(kind)
