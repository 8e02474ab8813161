"""Table S1 from the optima that ship: what the evolution's sentences say of its result, without evolving again.

The presets vasarhelyi_2018/evolved_*ms hold our optimum of each column. A search that stops at an end or in the middle
of its space is a change under which those sentences must turn red (`search.stops`); what is said of the luckiest
candidate, and of several runs, needs the evolution itself (part s1).
"""

from collections.abc import Mapping
from typing import NamedTuple

import pandas as pd

from airflock.runs import with_parameters
from airflock.scenarios import Scenario, load
from airflock.search import load_study
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018.published import SPEEDS
from airflock_papers.vasarhelyi_2018.table_s1 import COLUMNS, FLIGHTS, exponent, means_tested, of_optimum

STOPS: Mapping[str, float] = {"low": 0.0, "middle": 0.5, "high": 1.0}  # places in the space, as shares of each axis


class Data(NamedTuple):
    """Optima by speed, and their flights."""

    optima: Mapping[int, Mapping[str, float]]
    flown: Mapping[int, pd.DataFrame]


def evolved(v: int, stops: str | None = None) -> Scenario:
    """Our optimum of a column, or where a search stops in its space: at its low or high ends, or in its middle."""
    optimum = load(f"vasarhelyi_2018/evolved_{v}ms")
    if stops is None:
        return optimum
    at = {
        axis.key: axis.low + STOPS[stops] * (axis.high - axis.low)
        for axis in load_study(f"vasarhelyi_2018/{v}ms").space.axes
    }
    return with_parameters(optimum, at)


def fly(flights: Flights) -> Data:
    """The optima with their flights."""
    scenarios = {v: flights.as_changed(evolved(v, flights.changes.get("search.stops"))) for v in SPEEDS}
    flown = flights.score("Table S1, our optima", scenarios, flights.count(FLIGHTS, 20))
    optima = {v: {name: getattr(scenarios[v].parameters, name) for name in COLUMNS} for v in SPEEDS}
    return Data(optima, {v: flown.loc[v] for v in SPEEDS})


def measured(data: Data) -> list[Measured]:
    """Everything that is said of an optimum."""
    found = [exponent(data.optima, name) for name in ("r0_rep", "v_shill")]
    return found + means_tested([each for v in SPEEDS for each in of_optimum(v, data.optima[v], data.flown[v])])
