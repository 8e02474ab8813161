"""Keys of groups: `groups.NAME.SECTION.KEY`, by which settings, sliders and open flights change a group.

A tolerance is the key of its number and `.spread`.
"""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Any

from airflock.core import Declaration, declarations
from airflock.scenarios.groups import LETTERS
from airflock.support import suggest

FIRST, SPREAD = "groups.", "spread"
FORM = "write groups.NAME.SECTION.KEY, for instance groups.heavy.body.tau"


def is_group_key(key: str) -> bool:
    """Whether a key names something of a group."""
    return key.startswith(FIRST)


def split_key(key: str) -> tuple[str, str, str]:
    """Group, section and name that a key consists of, the name with `.spread`; empty words where it has too few."""
    rest = key.removeprefix(FIRST).rsplit(".", 3)
    if len(rest) == 4 and rest[1] in LETTERS and rest[3] == SPREAD:
        return rest[0], rest[1], f"{rest[2]}.{SPREAD}"
    return (".".join(rest[:-2]), rest[-2], rest[-1]) if len(rest) > 2 else ("", "", "")


def with_group_keys(
    document: Mapping[str, Any], settings: Mapping[str, Any]
) -> tuple[Mapping[str, Any], dict[str, Any], list[str]]:
    """A document with the keys of its groups set, the other settings, and what is wrong with these keys."""
    wanted = {key: value for key, value in settings.items() if is_group_key(key)}
    others = {key: value for key, value in settings.items() if key not in wanted}
    given = others.get("groups", document.get("groups", ()))
    if (
        not wanted
        or not given
        or not isinstance(given, (list, tuple))
        or not all(isinstance(table, Mapping) for table in given)
    ):
        return document, others, [f"{key}: the scenario has no [[groups]]; write them in a file" for key in wanted]
    tables = [dict(table) for table in given]
    names = [table.get("name", f"group_{number}") for number, table in enumerate(tables)]
    faults = []
    for key, value in wanted.items():
        group, section, name = split_key(key)
        if section not in LETTERS and _of_the_file(key, names):
            faults.append(
                f"{key}: a setting changes only {', '.join(LETTERS)} of a group; write it in the file's [[groups]]"
            )
        elif section not in LETTERS or not name:
            hint = _advice(key, document, dict(zip(map(str, names), tables, strict=True)))
            faults.append(f"{key}: unknown key; {hint}")
        elif group not in names:
            hint = suggest(group, [str(known) for known in names], f"known: {', '.join(map(str, names))}")
            faults.append(f"{key}: unknown group {group!r}; {hint}")
        else:
            table = tables[names.index(group)]
            own, (name, _, spread) = table.get(section, {}), name.partition(".")
            if isinstance(own, Mapping):
                before = own.get(name)
                table[section] = {
                    **own,
                    name: _spread_anew(before, value) if spread else with_old_spread(before, value),
                }
    return {**document, "groups": tables}, {key: v for key, v in others.items() if key != "groups"}, faults


def _of_the_file(key: str, names: list[str]) -> bool:
    """Whether a key is a group's name or its agents, which only the file tells."""
    group, _, word = key.removeprefix(FIRST).rpartition(".")
    return word in ("name", "agents") and group in names


def _advice(key: str, document: Mapping[str, Any], tables: Mapping[str, Mapping[str, Any]]) -> str:
    """What to write instead of a key without a section: the nearest group, and the word at the end of the key.

    Known are the words that the file writes for the flock or for the group; of any other the section stays open.
    """
    rest, _, word = key.removeprefix(FIRST).rpartition(".")
    group = next(iter(get_close_matches(rest, list(tables), n=1, cutoff=0.5)), "")
    sections = f"sections: {', '.join(LETTERS)}"
    if not rest or not group:
        return f"{FORM}; {sections}"
    places: dict[str, str] = {}
    for section in LETTERS:
        for table in (document.get(section), tables[group].get(section)):
            places |= {name: section for name in table} if isinstance(table, Mapping) else {}
    near = next(iter(get_close_matches(word, list(places), n=1)), "")
    if not near:
        return f"did you mean {FIRST}{group}.SECTION.{word}; {sections}"
    return f"did you mean {FIRST}{group}.{places[near]}.{near}?"


def with_old_spread(before: Any, value: Any) -> Any:
    """A value with the spread that the number had before, which keeps its unit."""
    if not isinstance(before, Mapping) or "spread" not in before or isinstance(value, Mapping):
        return value
    unit = {"unit": before["unit"]} if "unit" in before else {}
    return {"value": {"value": value} if unit else value, "spread": before["spread"], **unit}


def _spread_anew(before: Any, spread: Any) -> dict[str, Any]:
    """What a group has of a number, with another spread; the value keeps its unit."""
    if not isinstance(before, Mapping):
        return {"spread": spread} if before is None else {"value": before, "spread": spread}
    if "value" not in before:
        return {"spread": spread}
    value = {"value": before["value"], "unit": before["unit"]} if "unit" in before else before["value"]
    return {"value": value, "spread": spread}


def group_declarations(scenario: Any) -> Iterator[tuple[str, Declaration, Any]]:
    """Key, declaration and value of what groups have of their own: numbers, and all of a law that only they have."""
    for group in scenario.groups:
        for section, letter in LETTERS.items():
            law = group.law if section == "model" else None
            record = law[1] if law else scenario.records[section]
            for name, declared, _ in declarations(record):
                if law or (letter, name) in group.numbers or (letter, name) in group.spread:
                    value = group.numbers.get((letter, name), getattr(record, name))
                    yield f"{FIRST}{group.name}.{section}.{name}", declared, value


def group_key_value(scenario: Any, key: str) -> Any:
    """Value of a key of a group; that of the flock where the group has none of its own."""
    group, section, name = split_key(key)
    found = next(each for each in scenario.groups if each.name == group)
    record = found.law[1] if found.law and section == "model" else scenario.records[section]
    return found.numbers.get((LETTERS[section], name), getattr(record, name))
