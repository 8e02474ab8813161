"""Saving: the scenario as it was tuned, and the flight with all that was done to it."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
import xarray as xr

from airflock.engine import Flight
from airflock.recordings import simulate
from airflock.scenarios import entry_of_key, is_fault_key, is_group_key, presets, split_key, with_old_spread
from airflock.support import FlightError


def tuned_toml(
    source: str,
    settings: Mapping[str, Any],
    recorded_document: Mapping[str, Any] | None = None,
    full_document: Mapping[str, Any] | None = None,
) -> str:
    """Text of a preset or scenario file with keys set anew; comments, units and sources of the others stay.

    given : the scenario of a recording, instead of a file
    whole : what the scenario consists of with all that it extends, for groups and faults that the file does not write
    """
    path = presets().get(source) or Path(source)
    text = path.read_text(encoding="utf-8") if recorded_document is None else tomlkit.dumps(recorded_document)
    document: Any = tomlkit.parse(text)
    for key, value in settings.items():
        table, name = _table_and_name(document, key, full_document or {})
        known = table.get(name)
        if is_group_key(key) and not isinstance(value, Mapping):
            table[name] = with_old_spread(known, value)
        elif isinstance(known, Mapping) and "value" in known and not isinstance(value, Mapping):
            known["value"] = value  # type: ignore[index]
            known.pop("unit", None)  # type: ignore[attr-defined]
            known["source"] = f"tuned by hand; before: {known.get('source', 'not given')}"  # type: ignore[index]
        else:
            table[name] = value
    document.pop("published", None)  # those figures belong to the untouched scenario
    return tomlkit.dumps(document)


def _table_and_name(document: Any, key: str, full_document: Mapping[str, Any]) -> tuple[Any, str]:
    """The table of a document that holds a key, which is made if need be, and the key's name in it."""
    section, _, name = key.partition(".")
    if not name:
        return document, section
    if not (is_group_key(key) or is_fault_key(key)):
        return document.setdefault(section, tomlkit.table()), name
    if section not in document:
        document[section] = [dict(entry) for entry in full_document.get(section, ())]
    if is_fault_key(key):
        number, name = entry_of_key(document[section], key)
        return document[section][number], name
    group, part, name = split_key(key)
    names = [entry.get("name", f"group_{number}") for number, entry in enumerate(document[section])]
    return document[section][names.index(group)].setdefault(part, tomlkit.inline_table()), name


def free_path(path: Path) -> Path:
    """A name that is not taken: flight.nc, flight-2.nc, ..."""
    found, number = path, 2
    while found.exists():
        found, number = path.with_name(f"{path.stem}-{number}{path.suffix}"), number + 1
    return found


def refly(flight: Flight) -> xr.Dataset:
    """Recording of an open flight, flown again without a page from its scenario, seed and events.

    Raises FlightError where the end of it has other bits than the flight at hand.
    """
    if flight.step < 1:
        raise FlightError("nothing has been flown yet")
    scenario, seed, precision, start = flight.origin
    document = {**scenario.document, "duration": flight.time}
    short = replace(scenario, flight=replace(scenario.flight, duration=flight.time), document=document)
    events = [event for event in flight.events if event.step < flight.step]
    again = Flight(short, seed, precision=precision, start=start, events=events)
    again.advance(steps=flight.step)
    if len(events) == len(flight.events) and not np.array_equal(again.state, flight.state, equal_nan=True):
        raise FlightError(f"{scenario.name}: flown again, the positions at t = {flight.time:g} s differ")
    return simulate(short, seed, precision=precision, start=start, events=events)
