"""Acting: what is done to an open flight on its way. Each act is noted as an event, to be done again."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

from airflock.engine.presence import join, leave
from airflock.engine.standing import Standing
from airflock.errors import FlightError
from airflock.scenarios.change import changed, named
from airflock.scenarios.document import keyed
from airflock.scenarios.events import Event, agent_number, vector

COMMANDS = {"velocity": "m/s", "acceleration": "m/s^2", "heading": ""}


class Acting(Standing):
    """A flight whose agents are overruled, changed, hit, taken out and put back."""

    def sense(self) -> Self:
        """Let all agents perceive and decide at the present step without moving; `command` may then overrule them.

        Raises FlightError between decisions, and where agents decide and move one after another.
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
        self._course.take_over()
        if not self._course.sensed:
            self._course.call(self.step, self.step + 1, 2)
            self._course.sensed = True
        return self

    def command(self, agent: int, value: Any) -> Self:
        """Overrule what an agent decided at this step, until its next decision.

        value : one number per axis, m/s, m/s² or a direction, as the law commands
        """
        number, unit = self._there(agent), COMMANDS.get(self.scenario.model.command, "")
        given = vector("command", value, self.scenario.dimensions, unit)
        self.sense()
        self._course.put("c", number, given)
        self._course.note("command", agent=number, value=given)
        return self

    def change(self, settings: Mapping[str, Any], *, wait: bool = True) -> Self:
        """Set keys of the scenario anew, such as {"model.p_rep": 0.2}; from the next step or decision on.

        Everything that a scenario file says may change but agents, dimensions, dt and start. A new window of scores
        begins. Where other text must be compiled, `wait` says whether to wait for it; if not, the flight goes on under
        the old scenario until the next `advance` after the new one is ready.
        Raises ScenarioError, and the flight is as it was.
        """
        settings = keyed(settings, self.scenario.name)
        return self._change(settings, Event(self.step, "change", settings), wait)

    def _change(self, settings: Mapping[str, Any], event: Event, wait: bool) -> Self:
        """Set keys of the scenario anew, as an event says."""
        if self._course.ended:
            raise FlightError(f"{self.scenario.name}: the flight has ended at t = {self.time:g} s; nothing can change")
        self._course.change(changed(self._course.latest, settings), event, wait)
        return self

    def push(self, agent: int, velocity: Any) -> Self:
        """Add to an agent's velocity, m/s, one number per axis: a gust, a collision, a hand."""
        number = self._there(agent)
        given = vector("velocity", velocity, self.scenario.dimensions, "m/s")
        self._course.begin()
        self._course.put("v", number, given, add=True)
        self._course.note("push", agent=number, velocity=given)
        return self

    def place(self, agent: int, position: Any) -> Self:
        """Put an agent somewhere else, m, one number per axis."""
        number = self._there(agent)
        given = vector("position", position, self.scenario.dimensions, "m")
        self._course.begin()
        self._course.put("", number, given)
        self._state.look_at_pairs()
        self._course.note("place", agent=number, position=given)
        return self

    def fault(self, kind: str, agents: Sequence[int] | int | None = None, *, wait: bool = True, **numbers: Any) -> Self:
        """Let a fault begin, as an entry of [[faults]] with at = now does. A new window of scores begins.

        kind   : such as "motor"; agents : whom it hits
        numbers : of the kind, such as share=0.2; lasts (s), number (how many, drawn); or group instead of agents
        wait   : as in `change`
        Raises ScenarioError, and the flight is as it was.
        """
        given = {} if agents is None else {"agents": [*agents] if isinstance(agents, Iterable) else [agents]}
        base = self._course.latest
        at = (self.step + (1 if self._course.sensed else 0)) * self.scenario.flight.dt
        entry = {"kind": kind, "at": at, **given, **numbers}
        data = {"kind": kind, **given, **numbers}
        return self._change({"faults": [*named(base), entry]}, Event(self.step, "fault", data), wait)

    def remove(self, agent: int, reason: str = "") -> Self:
        """Let an agent drop out: it has landed or failed. From now on nobody meets, hears, feels or counts it.

        reason : for the list of events
        """
        number = self._there(agent)
        self._course.begin()
        self._course.let_come_and_go()
        leave(self._state, [number])
        self._course.note("remove", agent=number, **({"reason": str(reason)} if reason else {}))
        return self

    def add(self, agent: int, position: Any, velocity: Any = None) -> Self:
        """Let an agent that is absent join, as agents join at the start: the others know at once where it is.

        position, velocity : one number per axis, m and m/s; by default at rest
        """
        number = agent_number(agent, self.agents)
        if self.present[number]:
            raise FlightError(f"add: agent {number} is there already")
        dims = self.scenario.dimensions
        at = vector("position", position, dims, "m")
        v = vector("velocity", [0.0] * dims if velocity is None else velocity, dims, "m/s")
        join(self._state, number, at, v)
        self._course.note("add", agent=number, position=at, velocity=v)
        return self
