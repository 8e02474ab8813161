"""The document of a scenario before it is judged: another kind, keys set from outside, vectors as their components."""

from collections.abc import Mapping
from typing import Any

from airflock.core import declarations, expand_vectors, without_replaced
from airflock.scenarios.families import PART_KINDS
from airflock.scenarios.schema import value_of
from airflock.scenarios.sections import SECTIONS
from airflock.support import ScenarioError, suggest

TOP_LEVEL_KEYS = ("model", *SECTIONS, "groups", "faults", "agents", "duration", "dt", "update", "published", "title")


def with_kinds(document: Mapping[str, Any], settings: Mapping[str, Any]) -> tuple[Mapping[str, Any], tuple[str, ...]]:
    """A document without the numbers of its law, body, sensor, radio or topology where settings name another; notes.

    With its law goes what a paper published of it.
    """
    notes: list[str] = []
    for family in PART_KINDS:
        section = family.section
        given, key = document.get(section, {}), f"{section}.kind"
        if key not in settings or not isinstance(given, Mapping):
            continue
        kept = family.kept(given, str(settings[key]))
        if set(given) - {"kind", *kept}:
            notes.append(f"{key} = {settings[key]!r}: the numbers of the file's {family.kind(document)} are left out")
        document = {**document, section: kept}
    law = document.get("model", {})
    before = value_of(law.get("kind")) if isinstance(law, Mapping) else None
    if "model.kind" in settings and before not in (None, settings["model.kind"]):
        if set(law) - {"kind"}:
            notes.append(f"model.kind = {settings['model.kind']!r}: the numbers of the file's {before} are left out")
        document = {**document, "model": {}, "published": {}}
    return document, tuple(notes)


def settings_dict(settings: Any, where: str) -> dict[str, Any]:
    """Settings as a dict of keys and plain values; none for None. Raises ScenarioError for anything else."""
    if settings is None:
        return {}
    if not isinstance(settings, Mapping) or not all(isinstance(key, str) for key in settings):
        raise ScenarioError([f"{where}: settings {settings!r} are no keys with values, such as {{'dt': '10 ms'}}"])
    return {key: _plain(value) for key, value in settings.items()}


def _plain(value: Any) -> Any:
    """A value without NumPy's types at any depth, as a file holds it: a recording writes it down as JSON."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    return type(value)(map(_plain, value)) if type(value) in (list, tuple) else value


def with_settings(document: Mapping[str, Any], settings: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """A copy of a document with keys like "model.p_rep" set, and the keys that nobody knows."""
    made: dict[str, Any] = {k: dict(v) if isinstance(v, Mapping) else v for k, v in document.items()}
    faults: list[str] = []
    for key, value in settings.items():
        section, _, name = key.partition(".")
        if name and not isinstance(made.setdefault(section, {}), dict):
            faults.append(f"{key}: unknown key")
        elif name:
            made[section] = {**without_replaced(made[section], {name: value}), name: value}
        else:
            made[section] = value
    return made, faults + [_unknown(key, value) for key, value in made.items() if key not in TOP_LEVEL_KEYS]


def _unknown(key: str, value: object) -> str:
    """A line about a key that no scenario has; of a section, such as `flight`, in which a key of the top stands."""
    above = next((name for name in value if name in TOP_LEVEL_KEYS), None) if isinstance(value, Mapping) else None
    if above is not None:
        return f"{key}.{above}: unknown key; did you mean {above}?"
    return f"{key}: unknown key; {suggest(key, TOP_LEVEL_KEYS, 'known: ' + ', '.join(TOP_LEVEL_KEYS))}"


def without_unknown_numbers(document: dict[str, Any], section: str, record: type) -> dict[str, Any]:
    """A document without the numbers of a section whose kind cannot be had; its stand-in judges those that it knows."""
    known = {name for name, _, _ in declarations(record)} | {"kind"}
    given = document.get(section, {})
    if not isinstance(given, Mapping):
        return document
    return {**document, section: {key: value for key, value in given.items() if key in known}}


def with_vector_components(document: dict[str, Any], records: Mapping[str, type]) -> tuple[dict[str, Any], list[str]]:
    """A document in which each vector is its components, and what is wrong with those that are given whole."""
    faults: list[str] = []
    for section, record in records.items():
        if isinstance(given := document.get(section), Mapping) and getattr(record, "VECTORS", None):
            document[section], more = expand_vectors(section, given, record)
            faults += more
    return document, faults


def model_table(document: Mapping[str, Any]) -> tuple[Mapping[str, Any], list[str]]:
    """The section of the law; empty, and why, where it is none."""
    table = document.get("model", {})
    if isinstance(table, Mapping):
        return table, []
    return {}, [f"model = {table!r} is not a table; write model.kind = {table!r}"]
