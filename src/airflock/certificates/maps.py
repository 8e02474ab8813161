"""Maps: bounds over a grid of two numbers of the scenario, each cell judged as `tolerance` judges a value."""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

from airflock.certificates.flyer import CampaignFlyer
from airflock.certificates.seeds import MAP_PURPOSE
from airflock.certificates.tolerance import ValueScreen, screening_level, value_batch
from airflock.runs import declared_numbers
from airflock.scenarios import Scenario
from airflock.support import ScenarioError, suggest

MOST = 400  # cells


def check_map_axes(scenario: Scenario, axes: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    """The two axes of a map; ScenarioError with everything that is wrong with them."""
    known, faults = declared_numbers(scenario), []
    if len(axes) != 2:
        faults.append(f"map: needs two keys, not {len(axes)}")
    for key, values in axes.items():
        if key not in known:
            faults.append(f"map: {key} is not a number of {scenario.name}{suggest(key, known, lead='; ')}")
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


def map_bounds(flyer: CampaignFlyer, axes: Mapping[str, Sequence[float]]) -> dict[str, Any]:
    """Verdict and bounds of every cell, on seeds that all cells share.

    Returns plain values: level, keys, their units, values, and for each cell values, verdict, low, high (per flight),
    flights.
    """
    screen = ValueScreen(flyer, screening_level(flyer.campaign), MAP_PURPOSE)
    cells = []
    for number, values in enumerate(product(*axes.values())):
        flyer.report(f"map: cell {number + 1} of {math.prod(len(v) for v in axes.values())}")
        parameters = dict(zip(axes, values, strict=True))
        batch = value_batch("map", parameters)
        flyer.store.ask(batch, [list(values)], [parameters])
        verdict, found = screen.judged(batch, parameters)
        cell: dict[str, Any] = {"values": list(values), "verdict": verdict, "low": 0.0, "high": 1.0, "flights": 0}
        if found is not None:
            cell |= {"low": found.low, "high": found.high, "flights": found.flights, "events": found.events}
        cells.append(cell)
    units = [declared_numbers(flyer.campaign.scenario)[key][0].unit for key in axes]
    told: dict[str, Any] = {"level": screen.level, "keys": list(axes), "units": units}
    return told | {"axes": [list(values) for values in axes.values()], "cell": cells}
