"""Assumptions of a tuning, as rows of its report: what the file says, and defaults that flights read."""

import re
from collections.abc import Collection, Mapping
from typing import Any

from airflock.core import declarations, format_with_unit
from airflock.engine import driver_text
from airflock.runs import declared_numbers
from airflock.scenarios import Scenario

ReportRow = tuple[str, str, str]  # key, value with its unit, source
LEFT_OUT = ("published", "title", "format")
READ_AS = {"body": "b", "sensors": "s", "radio": "k", "wind": "a"}  # section → what a driver calls its numbers
DRYDEN = ("at_6m", "height", "airspeed")  # a driver reads what follows from them
ALWAYS = ("sensors.period", "radio.delay")  # a driver reads them as numbers of steps


def document_rows(scenario: Scenario, searched: Collection[str]) -> list[ReportRow]:
    """Key, value and source of everything that the scenario's file says but the numbers that are searched."""
    rows = []
    for section, table in scenario.document.items():
        if section in LEFT_OUT:
            continue
        single = not isinstance(table, Mapping) or "value" in table
        for name, entry in (("", table),) if single else table.items():
            key = f"{section}.{name}".rstrip(".")
            if key not in searched:
                rows.append(_row(key, entry, _unit(scenario, section, name)))
    return rows


def _row(key: str, entry: Any, unit: str) -> ReportRow:
    """The row of a key; an entry may be a table with value, unit and source."""
    source = ""
    if isinstance(entry, Mapping):
        entry, unit, source = entry.get("value"), str(entry.get("unit", unit)), str(entry.get("source", ""))
    text = str(entry)
    text = text if len(text) < 80 else f"{text[:77]}..."
    return key, text if isinstance(entry, str) else format_with_unit(text, unit), source


def _unit(scenario: Scenario, section: str, name: str) -> str:
    """Unit of a key as its record declares it; none where it is no number."""
    field = {"model": "parameters"}.get(section, section)
    record = getattr(scenario, field, None) if name else scenario.flight
    if not hasattr(record, "__dataclass_fields__"):
        return ""
    units = {key: str(getattr(how, "unit", "")) for key, how, _ in declarations(record)}
    return units.get(name or section, "")


def default_rows(scenario: Scenario) -> list[ReportRow]:
    """Numbers of drones, sensors, radio and wind that the file leaves as they are, are not zero, and are read."""
    read = _read(scenario)
    rows = []
    for key, (how, value) in declared_numbers(scenario).items():
        section, _, name = key.partition(".")
        given = scenario.document.get(section, {})
        if section in READ_AS and value and name not in given and key in read:
            rows.append(
                (key, format_with_unit(f"{value:.4g}", how.unit), f"default: {how.source}" if how.source else "default")
            )
    return rows


def _read(scenario: Scenario) -> set[str]:
    """Keys of drones, sensors, radio and wind that a flight of a scenario reads.

    Where groups have numbers of their own, drivers read these by agent: then all keys of the section count as read.
    """
    text = driver_text(scenario)
    own = {letter for letter, _ in scenario.varied}
    found = set(ALWAYS)
    for section, letter in READ_AS.items():
        names = {name for name, _, _ in declarations(getattr(scenario, section))}
        if letter not in own:
            names &= set(re.findall(rf"\b{letter}\.(\w+)", text))
        found |= {f"{section}.{name}" for name in names}
    if re.search(r"\bair\.", text):
        found |= {f"wind.{name}" for name in DRYDEN}
    return found
