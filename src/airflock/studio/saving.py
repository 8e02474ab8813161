"""Saving: the scenario as it was tuned, and the flight with all that was done to it."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
import xarray as xr

from airflock.engine import Flight
from airflock.errors import FlightError
from airflock.recordings.flights import simulate
from airflock.scenarios.files import presets


def toml_of(where: str, settings: Mapping[str, Any], given: Mapping[str, Any] | None = None) -> str:
    """Text of a preset or scenario file with keys set anew; comments, units and sources of the others stay.

    given : the scenario of a recording, instead of a file
    """
    path = presets().get(where) or Path(where)
    text = path.read_text(encoding="utf-8") if given is None else tomlkit.dumps(given)
    document: Any = tomlkit.parse(text)
    for key, value in settings.items():
        section, _, name = key.partition(".")
        if not name:
            table, name = document, section
        else:
            table = document.setdefault(section, tomlkit.table())
        known = table.get(name)
        if isinstance(known, Mapping) and "value" in known and not isinstance(value, Mapping):
            known["value"] = value  # type: ignore[index]
            known["source"] = f"tuned by hand; before: {known.get('source', 'not given')}"  # type: ignore[index]
        else:
            table[name] = value
    document.pop("published", None)  # those figures belong to the untouched scenario
    return tomlkit.dumps(document)


def free(path: Path) -> Path:
    """A name that is not taken: flight.nc, flight-2.nc, ..."""
    found, number = path, 2
    while found.exists():
        found, number = path.with_name(f"{path.stem}-{number}{path.suffix}"), number + 1
    return found


def flown_again(flight: Flight) -> xr.Dataset:
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
