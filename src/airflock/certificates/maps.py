"""Maps: bounds over a grid of two numbers of the scenario, each cell judged as `tolerance` judges a value."""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

from airflock.certificates.flyer import Flyer
from airflock.certificates.seeds import MAP
from airflock.certificates.tolerance import Screen, batch_of, level_of
from airflock.runs.space import declared
from airflock.scenarios.scenario import Scenario
from airflock.support.errors import ScenarioError
from airflock.support.spelling import meant

MOST = 400  # cells


def sound_axes(scenario: Scenario, axes: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    """The two axes of a map; ScenarioError with everything that is wrong with them."""
    known, faults = declared(scenario), []
    if len(axes) != 2:
        faults.append(f"map: needs two keys, not {len(axes)}")
    for key, values in axes.items():
        if key not in known:
            faults.append(f"map: {key} is not a number of {scenario.name}{meant(key, known, lead='; ')}")
            continue
        how = known[key][0]
        for value in values:
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not how.low <= value <= how.high:
                faults.append(f"map: {key} = {value!r} lies outside {how.span}")
        if len(set(values)) < 2 or sorted(values) != list(values):
            faults.append(f"map: {key}: give at least two values that grow")
    if math.prod(len(values) for values in axes.values()) > MOST:
        faults.append(f"map: more than {MOST} cells")
    if faults:
        raise ScenarioError(faults)
    return {key: [float(value) for value in values] for key, values in axes.items()}


def bounds_over(flyer: Flyer, axes: Mapping[str, Sequence[float]]) -> dict[str, Any]:
    """Verdict and bounds of every cell, on seeds that all cells share.

    Returns plain values: level, keys, their units, values, and for each cell values, verdict, low, high (per flight),
    flights.
    """
    screen = Screen(flyer, level_of(flyer.campaign), MAP)
    cells = []
    for number, values in enumerate(product(*axes.values())):
        flyer.say(f"map: cell {number + 1} of {math.prod(len(v) for v in axes.values())}")
        parameters = dict(zip(axes, values, strict=True))
        batch = batch_of("map", parameters)
        flyer.store.ask(batch, [list(values)], [parameters])
        verdict, found = screen.judged(batch, parameters)
        cell: dict[str, Any] = {"values": list(values), "verdict": verdict, "low": 0.0, "high": 1.0, "flights": 0}
        if found is not None:
            cell |= {"low": found.low, "high": found.high, "flights": found.flights, "events": found.events}
        cells.append(cell)
    units = [declared(flyer.campaign.scenario)[key][0].unit for key in axes]
    told: dict[str, Any] = {"level": screen.level, "keys": list(axes), "units": units}
    return told | {"axes": [list(values) for values in axes.values()], "cell": cells}
