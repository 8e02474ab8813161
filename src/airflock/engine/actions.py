"""Actions: what is done to an open flight on its way. Each act is noted as an event, to be done again."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

import numpy as np

from airflock.core import COMMANDS
from airflock.engine.presence import add_agent, remove_agents
from airflock.engine.readings import FlightObservations
from airflock.scenarios import (
    Event,
    are_several,
    check_agent,
    named_fault_entries,
    position_error,
    settings_dict,
    to_vector,
    to_vectors,
    with_settings,
    wrap_start,
)
from airflock.support import FlightError

FARTHEST = 1e6  # m from the centre: the largest arena; beyond it single precision does not hold a step of motion
FASTEST = 1e3  # m/s; our choice: faster than anything that these bodies are made for


class FlightActions(FlightObservations):
    """A flight whose agents are overruled, changed, hit, taken out and put back."""

    def sense(self) -> Self:
        """Let all agents perceive and decide at the present step without moving; `command` may then overrule them.

        Raises FlightError between decisions, and where agents decide and move one after another.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.sense().commands.shape  # all have decided, and nobody has moved
        (2, 100)
        """
        if self._state.plan.sequential:
            raise FlightError("sense: with update = 'sequential' each agent moves before the next one perceives")
        if self.over:
            raise FlightError(f"sense: the flight is over at t = {self.time:g} s")
        every = self._state.whole("decide_every")
        if not self.decides:
            coming = -(-self.step // every) * every
            raise FlightError(
                f"sense: agents decide every {every} steps; the next decision is at step {coming}, this is {self.step}"
            )
        self._course.apply_pending_change()
        if not self._course.has_sensed:
            self._course.call(self.step, self.step + 1, 2)
            self._course.has_sensed = True
        return self

    def command(self, agent: int | Sequence[int], value: Any) -> Self:
        """Overrule what an agent, or each of several, decided at this step, until its next decision.

        value : one number per axis, m/s, m/s² or a direction, as the law commands; for several agents one such row
                for all of them, or one for each: (agent, axis)

        Raises FlightError for an agent that is not there, for another number of numbers, and where `sense` does.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.command(0, [3.0, 0.0]).commands[:, 0].tolist()
        [3.0, 0.0]
        """
        numbers, unit = self._those(agent), COMMANDS[self.scenario.model.command]
        given = to_vectors("command", value, len(numbers), self.scenario.dimensions, unit)
        self.sense()
        self._course.set_rows("c", numbers, given)
        self._course.note("command", agent=_said(agent, numbers), value=given)
        return self

    def change(self, settings: Mapping[str, Any], *, wait: bool = True) -> Self:
        """Set keys of the scenario anew by `settings`, such as {"model.p_rep": 0.2}; from the next step or decision on.

        Everything that a scenario file says may change but agents, dimensions, dt and start. A new window of scores
        begins. Where other text must be compiled, `wait` says whether to wait for it; if not, the flight goes on under
        the old scenario until the next `advance` after the new one is ready.
        Raises ScenarioError, or FlightError once the flight has ended; the flight is as it was.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.advance(0.5).change({"model.p_rep": 0.2}).scenario.parameters.p_rep
        0.2
        """
        settings = settings_dict(settings, self.scenario.name)
        return self._change(settings, Event(self.step, "change", settings), wait)

    def _change(self, settings: Mapping[str, Any], event: Event, wait: bool) -> Self:
        """Set keys of the scenario anew, as an event says."""
        if self._course.has_ended:
            raise FlightError(f"{self.scenario.name}: the flight has ended at t = {self.time:g} s; nothing can change")
        self._course.change(with_settings(self._course.latest_scenario, settings), event, wait)
        return self

    def push(self, agent: int | Sequence[int], velocity: Any) -> Self:
        """Add to the velocity of an agent, or of several: a gust, a collision, a hand.

        velocity : m/s, one number per axis, at most 1000; for several agents one such row for all, or one for each

        Raises FlightError for an agent that is not there, and for a velocity that is none or too large.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> before = flight.advance(0.5).state
        >>> [round(float(v), 3) for v in (flight.push(0, [1.0, 0.0]).state - before)[2:, 0]]
        [1.0, 0.0]
        """
        numbers = self._those(agent)
        given = to_vectors("velocity", velocity, len(numbers), self.scenario.dimensions, "m/s")
        _within("velocity", given, FASTEST, "m/s", "a push is at most so much")
        self._course.begin()
        self._course.set_rows("v", numbers, given, add=True)
        self._course.note("push", agent=_said(agent, numbers), velocity=given)
        return self

    def place(self, agent: int | Sequence[int], position: Any) -> Self:
        """Put an agent, or several, somewhere else: outside of soft walls, too, but not beyond faces that bounce.

        position : m, one number per axis, up to 1e6; for several agents one row for each: (agent, axis)

        Raises FlightError for a place inside what stands in the scene. A periodic box holds every place.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.place(0, [10.0, -20.0]).state[:2, 0].tolist()
        [10.0, -20.0]
        """
        numbers = self._those(agent)
        given = to_vectors("position", position, len(numbers), self.scenario.dimensions, "m")
        if len(numbers) > 1 and not isinstance(given[0], list):
            raise FlightError(f"position = {given}: {len(numbers)} agents in one place; give one row for each")
        spots = self._free("place", numbers, given)
        self._course.begin()
        self._course.set_rows("", numbers, spots)
        self._state.reset_pair_distances()
        self._course.note("place", agent=_said(agent, numbers), position=given)
        return self

    def _free(self, what: str, numbers: list[int], given: list[Any]) -> Any:
        """Places (agent, axis) as they are in a periodic box. Raises FlightError where an agent cannot be there."""
        _within("position", given, FARTHEST, "m", "that is the largest arena")
        spots = np.broadcast_to(np.array(given, float), (len(numbers), self.scenario.dimensions)).T
        fault = position_error(self.scenario, spots, numbers)
        if fault:
            raise FlightError(f"{what}: {fault}")
        return wrap_start(self.scenario, spots).T

    def fault(self, kind: str, agents: Sequence[int] | int | None = None, *, wait: bool = True, **numbers: Any) -> Self:
        """Let a fault begin, as an entry of [[faults]] with at = now does. A new window of scores begins.

        kind   : such as "motor"; agents : whom it hits
        numbers : of the kind, such as share=0.2; lasts (s), number (how many, drawn); or group instead of agents
        wait   : as in `change`
        Raises ScenarioError, or FlightError once the flight has ended; the flight is as it was.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.advance(0.5).fault("motor", agents=3, share=0.2).advance(0.5).faults[0]["agent"]
        3
        """
        whom = {} if agents is None else {"agents": [*agents] if isinstance(agents, Iterable) else [agents]}
        given = settings_dict({"kind": kind, **whom, **numbers}, self.scenario.name)
        base = self._course.latest_scenario
        at = (self.step + (1 if self._course.has_sensed else 0)) * self.scenario.flight.dt
        entry = {"at": at, **given}
        return self._change({"faults": [*named_fault_entries(base), entry]}, Event(self.step, "fault", given), wait)

    def remove(self, agent: int | Sequence[int], reason: str = "") -> Self:
        """Let an agent, or several, drop out: landed or failed. From now on nobody meets, hears, feels or counts them.

        reason : for the list of events

        Raises FlightError for an agent that is not there.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> int(flight.remove(3, "landed").present.sum())
        99
        """
        numbers = self._those(agent)
        self._course.begin()
        self._course.allow_absence()
        remove_agents(self._state, numbers)
        self._course.note("remove", agent=_said(agent, numbers), **({"reason": str(reason)} if reason else {}))
        return self

    def add(self, agent: int, position: Any, velocity: Any = None) -> Self:
        """Let an agent that is absent join, as agents join at the start: the others know at once where it is.

        position, velocity : one number per axis, m and m/s; by default at rest

        Raises FlightError for an agent that is there already, and for a place where it cannot be.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> int(flight.remove(3).add(3, [0.0, 0.0]).present.sum())
        100
        """
        number = check_agent(agent, self.agents)
        if self.present[number]:
            raise FlightError(f"add: agent {number} is there already")
        dims = self.scenario.dimensions
        at = to_vector("position", position, dims, "m")
        spot = self._free("add", [number], at)[0].tolist()
        v = to_vector("velocity", [0.0] * dims if velocity is None else velocity, dims, "m/s")
        _within("velocity", v, FASTEST, "m/s", "an agent joins at most so fast")
        add_agent(self._state, number, spot, v)
        self._course.note("add", agent=number, position=at, velocity=v)
        return self


def _said(agent: Any, numbers: list[int]) -> int | list[int]:
    """Agents as an event holds them: the number of one that was named by itself, or a list."""
    return numbers if are_several(agent) else numbers[0]


def _within(what: str, given: list[Any], most: float, unit: str, why: str) -> None:
    """Raise FlightError for a vector whose components are not all within +- most."""
    for row in np.atleast_2d(np.array(given, float)).tolist():
        if max(map(abs, row)) > most:
            raise FlightError(f"{what} = {row} {unit} lies outside [-{most:g}, {most:g}] {unit} per axis; {why}")
