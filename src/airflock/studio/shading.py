"""Shading: what the colours of the agents on a page stand for: their motion, clusters, groups, faults, own numbers."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.view.stage import shades
from airflock.view.stage.clusters import clusters, reach_of
from airflock.view.stage.shades import MOTION, Shade, own_numbers

if TYPE_CHECKING:
    from airflock.studio.drawing import Flock

EVERY = 6  # frames; what changes slowly is looked at so often
MEASURED = {"nearest agent": "m", "position error": "m"}  # numbers of every flock, with their units
DRAG = "induced drag"
ROWS = ("shared_power_drag", "shared_model_drag")  # where a driver keeps it


class Shading:
    """The way in which agents are coloured.

    way : its name, one of `ways`; shown : the last shade, whose key stands on the page
    """

    def __init__(self) -> None:
        self.way, self.shown = "speed", shades.of_agents(0)
        self._age = 0

    def of(self, flocks: Sequence["Flock"], velocity: NDArray[Any], top: float, height: tuple[float, float]) -> Shade:
        """The shade of the agents of all flocks; velocity (agent, 3), m/s; top : of the scale of speeds, m/s."""
        way = self.way
        own = np.vstack([flock.position for flock in flocks])
        if way in MOTION:
            self.shown = shades.of_motion(way, own, velocity, top, height)
            return self.shown
        self._age += 1
        if self._age % EVERY and self.shown.name == way and len(self.shown.values) == len(own):
            return self.shown
        parts = [self._of(way, flock) for flock in flocks]
        if any(part is None for part in parts):  # another flight has no such value
            self.way = "speed"
            return self.of(flocks, velocity, top, height)
        self.shown = together([part for part in parts if part is not None])
        return self.shown

    def _of(self, way: str, flock: "Flock") -> Shade | None:
        """The shade of one flock; None where it has no such value."""
        side, count = flock.side, len(flock.position)
        flight, scenario = side.flight, side.scenario
        if way == "agent":
            return shades.of_agents(count)
        if way == "cluster":
            box = None if flock.period is None else np.array([length or 1e9 for length in flock.period])
            return shades.of_clusters(clusters(flock.position, reach_of(scenario), box))
        if way == "group":
            return shades.of_groups(scenario.groups, count)
        if way == "fault":
            return shades.of_faults(flight.faults, flight.time, count)
        if way == "nearest agent":
            return shades.of_numbers(way, flock.pairs.apart(), "m") if count > 1 else None
        if way == "position error":
            off = (flight.measured - flight.state)[: scenario.dimensions]
            return shades.of_numbers(way, np.sqrt((off**2).sum(axis=0)), "m")
        if way == DRAG:
            memory = flight.snapshot().state
            known = [row for row in ROWS if row in memory.driver.ROWS]
            return shades.of_numbers(way, memory.rows(known[:1])[0].astype(float), "N") if known else None
        return shades.of_own(scenario, way, flight.seed) if way in own_numbers(scenario) else None


def ways(flocks: Sequence["Flock"]) -> tuple[str, ...]:
    """Names of what may colour the agents of flocks."""
    found = [*MOTION, "agent", "cluster", *(["group"] if all(f.side.scenario.groups for f in flocks) else []), "fault"]
    found += [way for way in MEASURED if all(len(f.position) > 1 for f in flocks)]
    if all(set(ROWS) & set(f.side.flight.snapshot().state.driver.ROWS) for f in flocks):
        found.append(DRAG)
    numbers = [own_numbers(flock.side.scenario) for flock in flocks]
    return (*found, *(key for key in numbers[0] if all(key in own for own in numbers)))


def together(parts: Sequence[Shade]) -> Shade:
    """The same shade of several flocks as one: on one scale, with one list of names."""
    first = parts[0]
    if len(parts) == 1:
        return first
    names = tuple(dict.fromkeys(name for part in parts for name in part.names))
    values = [np.asarray(part.values) for part in parts]
    if names:
        values = [np.array([names.index(part.names[v]) if v >= 0 else -1 for v in part.values]) for part in parts]
    return first._replace(
        values=np.concatenate(values), names=names, low=min(part.low for part in parts),
        high=max(part.high for part in parts), told=" and ".join(dict.fromkeys(part.told for part in parts)),
    )  # fmt: skip
