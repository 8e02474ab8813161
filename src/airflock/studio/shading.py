"""Shading: what the colours of the agents on a page stand for: their motion, clusters, groups, faults, own numbers."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.view import MOTION_COLOURINGS, AgentColours, cluster_distance, cluster_labels, shades, varied_number_units

if TYPE_CHECKING:
    from airflock.studio.drawing import DrawnFlock

UPDATE_FRAMES = 6  # frames; what changes slowly is looked at so often
MEASURED_COLOURINGS = {"nearest agent": "m", "position error": "m"}  # numbers of every flock, with their units
DRAG_COLOURING = "induced drag"
DRAG_ROWS = ("shared_power_drag", "shared_model_drag")  # where a driver keeps it


class AgentColouring:
    """The way in which agents are coloured.

    way : its name, one of `available_colourings`; shown : the last shade, whose key stands on the page
    """

    def __init__(self) -> None:
        self.name, self.shown = "speed", shades.individual_colours(0)
        self._frames = 0

    def of(
        self, flocks: Sequence["DrawnFlock"], velocity: NDArray[Any], max_speed: float, height: tuple[float, float]
    ) -> AgentColours:
        """The shade of the agents of all flocks; velocity (agent, 3), m/s; top : of the scale of speeds, m/s."""
        way = self.name
        own = np.vstack([flock.position for flock in flocks])
        if way in MOTION_COLOURINGS:
            self.shown = shades.motion_colours(way, own, velocity, max_speed, height)
            return self.shown
        self._frames += 1
        if self._frames % UPDATE_FRAMES and self.shown.name == way and len(self.shown.values) == len(own):
            return self.shown
        parts = [self._flock_colours(way, flock) for flock in flocks]
        if any(part is None for part in parts):  # another flight has no such value
            self.name = "speed"
            return self.of(flocks, velocity, max_speed, height)
        self.shown = joined_colours([part for part in parts if part is not None])
        return self.shown

    def _flock_colours(self, name: str, flock: "DrawnFlock") -> AgentColours | None:
        """The shade of one flock; None where it has no such value."""
        side, count = flock.side, len(flock.position)
        flight, scenario = side.flight, side.scenario
        if name == "agent":
            return shades.individual_colours(count)
        if name == "cluster":
            box = None if flock.period is None else np.array([length or 1e9 for length in flock.period])
            return shades.cluster_colours(cluster_labels(flock.position, cluster_distance(scenario), box))
        if name == "group":
            return shades.group_colours(scenario.groups, count)
        if name == "fault":
            return shades.fault_colours(flight.faults, flight.time, count)
        if name == "nearest agent":
            return shades.number_colours(name, flock.pairs.apart(), "m") if count > 1 else None
        if name == "position error":
            off = (flight.measured - flight.state)[: scenario.dimensions]
            return shades.number_colours(name, np.sqrt((off**2).sum(axis=0)), "m")
        if name == DRAG_COLOURING:
            memory = flight.snapshot().state
            known = [row for row in DRAG_ROWS if row in memory.driver.ROWS]
            return shades.number_colours(name, memory.rows(known[:1])[0].astype(float), "N") if known else None
        return shades.varied_colours(scenario, name, flight.seed) if name in varied_number_units(scenario) else None


def available_colourings(flocks: Sequence["DrawnFlock"]) -> tuple[str, ...]:
    """Names of what may colour the agents of flocks."""
    found = [
        *MOTION_COLOURINGS,
        "agent",
        "cluster",
        *(["group"] if all(f.side.scenario.groups for f in flocks) else []),
        "fault",
    ]
    found += [way for way in MEASURED_COLOURINGS if all(len(f.position) > 1 for f in flocks)]
    if all(set(DRAG_ROWS) & set(f.side.flight.snapshot().state.driver.ROWS) for f in flocks):
        found.append(DRAG_COLOURING)
    numbers = [varied_number_units(flock.side.scenario) for flock in flocks]
    return (*found, *(key for key in numbers[0] if all(key in own for own in numbers)))


def joined_colours(parts: Sequence[AgentColours]) -> AgentColours:
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
