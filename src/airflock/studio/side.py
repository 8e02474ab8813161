"""Side: one open flight that is tuned, and what was changed on it. A page shows one of them, or two side by side."""

import os
import shlex
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine import Flight, Snapshot
from airflock.scenarios import Event, Scenario, fault_key_value, group_key_value, has_fault, is_fault_key, is_group_key
from airflock.studio.controls import set_options
from airflock.studio.origin import FlightSource
from airflock.support import StudioError, run_in_background

ABSENT_HEIGHT, ABSENT_SPACING = -1e7, 1e4  # m; where agents that have left are shown: nowhere
MAX_INTERPRETED_AGENTS = 400  # agents; of more, one interpreted step holds a page up


class FlightPane:
    """One flight of an origin, with a list of what was changed, so that it can be undone.

    at_once : fly interpreted while the driver is compiled, until `switch_to_compiled` (a recording, a large flock:
              compiled)

    Attributes: preset, the scenario at its start; flight; changed, keys that differ from it with their values.
    """

    def __init__(self, origin: FlightSource, seed: int, interpret_first: bool = False):
        self.origin = origin
        self.preset, self.flight = origin.flight(seed)
        self._compiled_flight: Future[Flight] | None = None
        if (
            interpret_first
            and origin.recording is None
            and self.flight.agents <= MAX_INTERPRETED_AGENTS
            and not self.flight.ready
        ):
            self._compiled_flight = run_in_background(partial(self.flight.compile, aside=True))
            _, self.flight = origin.flight(seed, "python")
        self.changed: dict[str, Any] = {}
        self._undo_list: list[dict[str, Any]] = []
        self._manual_fault_values: dict[
            str, Any
        ] = {}  # numbers of faults that were set off by hand, as they were at first
        self._gust: tuple[float, dict[str, Any]] | None = None  # how long it blows, s; what is set back after it
        self._gust_end: float | None = None  # when it ends, s

    @property
    def is_compiling(self) -> bool:
        """Whether an interpreted flight stands for one that is being compiled."""
        return self._compiled_flight is not None

    @property
    def is_compiled(self) -> bool:
        """Whether `switch_to_compiled` has nothing to wait for."""
        return self._compiled_flight is None or self._compiled_flight.done()

    def switch_to_compiled(self) -> Snapshot | None:
        """Go on as the compiled flight, flown again to here with all that was done; waits for it. Returns its start.

        From here on, and in what is saved of it, bits are those of the compiled flight. None where nothing is compiled.
        Raises RuleError.
        """
        if self._compiled_flight is None:
            return None
        interpreted, (self.flight, self._compiled_flight) = self.flight, (self._compiled_flight.result(), None)
        start = self.flight.snapshot()
        self._replay(interpreted.events)
        self._advance_to(interpreted.step * self.scenario.flight.dt)
        return start

    def fork(self) -> "FlightPane":
        """Another side that goes on from here, with the same noise."""
        twin = object.__new__(FlightPane)
        twin.__dict__.update(self.__dict__)
        twin.flight = self.flight.branch()
        twin.changed, twin._undo_list = dict(self.changed), []
        return twin

    @property
    def scenario(self) -> Scenario:
        """The scenario in force."""
        return self.flight.scenario

    @property
    def motion(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Positions (agent, 3) in m and velocities (agent, 3) in m/s; the third axis of a plane is 0.

        Agents that have left are far below, each in a place of its own, at rest.
        """
        position, velocity = positions_and_velocities(self.flight.state, self.scenario.dimensions)
        gone = np.flatnonzero(~self.flight.present)
        position[gone] = np.column_stack([ABSENT_SPACING * gone, 0.0 * gone, np.full(len(gone), ABSENT_HEIGHT)])
        velocity[gone] = 0.0
        return position, velocity

    @property
    def settings(self) -> dict[str, Any]:
        """All keys that differ from the file; not those of faults that were set off by hand, which it does not have."""
        return {**self.origin.settings, **{key: v for key, v in self.changed.items() if not self._is_manual_fault(key)}}

    def command(self, seed: int) -> str:
        """The command that opens the present scenario again."""
        origin = self.origin
        where = f"./{origin.where}" if origin.where.startswith("-") else origin.where  # not an option
        law = f"--law {shlex.quote(str(origin.law))}" if isinstance(origin.law, str | os.PathLike) else ""
        trust = "--trust" if origin.trust else ""
        parts = ["airflock watch", shlex.quote(where), law, trust, set_options(self.settings), f"--seed {seed}"]
        return " ".join(part for part in parts if part)

    # ----------------------------------------------------------------------------------------------- flying

    def fly_to(self, time: float) -> None:
        """Fly to a time, s; a gust that ends on the way is ended there."""
        before = self.flight.time
        self._advance_to(time if self._gust_end is None else min(time, self._gust_end))
        if self._gust is None:
            return
        if self._gust_end is None and not self.flight.waiting:
            self._gust_end = before + self._gust[0]
        if self._gust_end is not None and self.flight.time >= self._gust_end - 1e-9:
            self.flight.change(self._gust[1])  # its driver flew before the gust: nothing is compiled
            self._gust = self._gust_end = None
            self._advance_to(time)

    def _advance_to(self, time: float) -> None:
        steps = round(time / self.scenario.flight.dt) - self.flight.step
        if steps > 0:
            self.flight.advance(steps=steps)

    def again(self, moment: Snapshot, time: float) -> None:
        """Go back to a moment, then fly to a time, s, with all that was done to the flight up to there."""
        done = self.flight.events[len(moment.events) :]
        self.restore(moment)
        last = round(time / self.scenario.flight.dt)
        self._replay([event for event in done if event.step < last])
        self._advance_to(time)
        self.changed = self._current_changes()

    def _replay(self, events: Sequence[Event]) -> None:
        for event in events:
            self._advance_to(event.step * self.scenario.flight.dt)
            self.flight.event(event.kind, **event.data)

    def restore(self, moment: Snapshot) -> None:
        """Go back to a moment of this flight, s; what came after it is given up."""
        self.flight.restore(moment)
        self._gust = self._gust_end = None
        self.changed, self._undo_list = self._current_changes(), []
        self._manual_fault_values = {
            key: value for key, value in self._manual_fault_values.items() if key in self.changed
        }

    def _current_changes(self) -> dict[str, Any]:
        """Keys that are changed at the present moment of the flight, with their values."""
        found: dict[str, Any] = {}
        for event in self.flight.events:
            if event.kind == "change":
                found |= event.data
        return {key: value for key, value in found.items() if value != self._start_value(key)}

    def _start_value(self, key: str) -> Any:
        """Value of a key in the preset; of a fault that was set off by hand its value then."""
        return self._manual_fault_values.get(key) if self._is_manual_fault(key) else scenario_value(self.preset, key)

    def _is_manual_fault(self, key: str) -> bool:
        """Whether a key is of a fault that was set off by hand."""
        return is_fault_key(key) and not has_fault(self.preset, key)

    # ----------------------------------------------------------------------------------------------- tuning

    def change(self, settings: Mapping[str, Any]) -> None:
        """Set keys of the scenario from now on; what must be compiled comes into force when that is done."""
        by_hand = {key: scenario_value(self.scenario, key) for key in settings if self._is_manual_fault(key)}
        self.flight.change(settings, wait=False)
        self._manual_fault_values = {**by_hand, **self._manual_fault_values}
        self._undo_list.append(dict(self.changed))
        self.changed = {**self.changed, **settings}

    def undo(self) -> dict[str, Any]:
        """Take the last change back, as a further change. Returns the keys set, with their values."""
        return self._return_to(self._undo_list.pop()) if self._undo_list else {}

    def undo_all(self) -> dict[str, Any]:
        """Set everything that was changed back to the preset. Returns the keys set, with their values."""
        self._undo_list.append(dict(self.changed))
        return self._return_to({})

    def _return_to(self, target: dict[str, Any]) -> dict[str, Any]:
        keys = [key for key in self.changed if target.get(key) != self.changed[key]]
        values = {key: target[key] if key in target else self._start_value(key) for key in keys}
        if values:
            self.flight.change(values, wait=False)
        self.changed = dict(target)
        return values

    def gust(self, east: float, north: float, seconds: float) -> None:
        """Let the wind blow stronger by so much (m/s) for some seconds, then as it was."""
        wind = self.scenario.wind
        back = {"wind.east": wind.east, "wind.north": wind.north} if self._gust is None else self._gust[1]
        self.flight.change({"wind.east": wind.east + east, "wind.north": wind.north + north}, wait=False)
        self._gust, self._gust_end = (seconds, back), None

    # -------------------------------------------------------------------------------------------------- acting

    def check_free(self, x: float, y: float, width: float, name: str = "") -> None:
        """Raise StudioError where an agent is inside a square around (x, y), m."""
        position, _ = self.motion
        inside = np.flatnonzero((np.abs(position[:, :2] - (x, y)) <= 0.5 * width).all(axis=1))
        if len(inside):
            raise StudioError(f"agent {inside[0]} {f'of {name} ' if name else ''}is where the obstacle would stand")

    def throw_obstacle(self, x: float, y: float, width: float) -> None:
        """Add a square obstacle of a width, m, around (x, y) to the world."""
        half = 0.5 * width
        corners = [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
        known = [[list(corner) for corner in outline] for outline in self.scenario.world.obstacles]
        self.change({"world.obstacles": [*known, corners]})

    def move_goal(self, number: int, position: Sequence[float]) -> None:
        """Put a goal somewhere else, m; goals that the scene gave are points from then on."""
        dims = self.scenario.dimensions
        points = [[float(c) for c in point] for point in self.scenario.waypoints()]
        if number < len(points):
            points[number][:dims] = [float(c) for c in position[:dims]]
            self.change({"goals.kind": "points", "goals.points": points})


def positions_and_velocities(state: NDArray[Any], dimensions: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Positions and velocities (agent, 3) from a state (component, agent) of two or three dimensions."""
    found = np.zeros((2, state.shape[1], 3), np.float32)
    found[0, :, :dimensions], found[1, :, :dimensions] = state[:dimensions].T, state[dimensions : 2 * dimensions].T
    return found[0], found[1]


def scenario_value(scenario: Scenario, key: str) -> Any:
    """Value of a key such as model.p_rep, groups.heavy.body.tau or faults.0.share; None of a fault that it lacks."""
    if is_group_key(key):
        return group_key_value(scenario, key)
    if is_fault_key(key):
        return fault_key_value(scenario, key)
    section, _, name = key.partition(".")
    if not name:
        return getattr(scenario.flight, section)
    return getattr(scenario.parameters if section == "model" else getattr(scenario, section), name)
