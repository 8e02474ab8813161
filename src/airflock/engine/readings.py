"""Readings: what can be read of an open flight: where it stands, who is there, what has happened."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import AgentView
from airflock.engine.course import FlightState
from airflock.engine.look import agent_view
from airflock.engine.plan import NO_PACKET_TIME
from airflock.engine.snapshots import Window
from airflock.engine.state import DriverState
from airflock.scenarios import Event, Scenario, begun_faults, check_agent, check_agents
from airflock.support import FlightError


class FlightObservations:
    """A flight on its course, to be read."""

    _course: FlightState

    @property
    def scenario(self) -> Scenario:
        """The scenario in force, with what was changed so far."""
        return self._course.scenario

    @property
    def seed(self) -> int:
        """Seed of the flight."""
        return self._course.seed

    @property
    def world(self) -> int:
        """Which of the independent streams of random numbers of the seed it meets now."""
        return self._course.world

    @property
    def precision(self) -> int:
        """Bits per number."""
        return self._course.precision

    @property
    def device(self) -> str:
        """On what it flies."""
        return self._course.device

    @property
    def origin(self) -> tuple[Scenario, int, int, Any]:
        """What it was opened with: scenario, seed, precision and start."""
        return self._course.origin

    @property
    def records(self) -> bool:
        """Whether it keeps frames."""
        return self._course.record

    @property
    def events(self) -> list[Event]:
        """What was done to it so far, in order."""
        return self._course.events

    @property
    def windows(self) -> list[Window]:
        """Stretches that changes have ended, each with its scenario and scores."""
        return self._course.windows

    @property
    def agents(self) -> int:
        """Number of agents, those that are absent included."""
        return int(self.scenario.agents)

    @property
    def step(self) -> int:
        """Number of motion steps flown, which is that of the next one."""
        return self._course.step

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self._course.time

    @property
    def over(self) -> bool:
        """Whether the flight has reached its duration, or has ended at a collision."""
        return self._course.step >= self._course.steps or self._state.has_ended

    @property
    def state(self) -> NDArray[Any]:
        """Positions (m) and velocities (m/s) of all agents, (component, agent); a copy."""
        self._course.begin()
        return self._state.motion

    @property
    def measured(self) -> NDArray[Any]:
        """Positions (m) and velocities (m/s) as agents last measured their own, (component, agent); a copy."""
        self._course.begin()
        had, names = self._state.driver.ROWS, self._state.plan.motion
        return self._state.rows([f"m{name}" if f"m{name}" in had else name for name in names])

    @property
    def sent(self) -> NDArray[Any]:
        """Over two lossy links: when the newest packet of each pair was sent, s (receiver, sender); nan: none."""
        stamps = self._state.arrays["store"][2 * self._state.plan.dimensions, :, : self.agents].astype(float)
        return np.where(stamps > NO_PACKET_TIME / 10.0, stamps, np.nan)

    @property
    def _state(self) -> DriverState:
        """Of the driver in force."""
        return self._course.state

    @property
    def frame_times(self) -> NDArray[Any]:
        """Times of the samples in `frames`, s."""
        return self._course.frame_times

    @property
    def frames(self) -> NDArray[Any]:
        """Samples flown so far, (time, component, agent): positions, velocities, commands. Needs record=True."""
        if not self.records:
            raise FlightError(f"{self.scenario.name}: the flight keeps no frames; open it with record=True")
        return self._course.frames

    @property
    def decides(self) -> bool:
        """Whether the agents decide at the next step to be flown."""
        return self.step % self._state.whole("decide_every") == 0

    @property
    def commands(self) -> NDArray[Any]:
        """Commands of all agents as last decided, (component, agent), in the unit of the law's command; a copy."""
        return self._state.rows([f"c{axis}" for axis in self._state.plan.axes])

    @property
    def waiting(self) -> bool:
        """Whether a change waits for its compiler."""
        return self._course.waiting

    @property
    def present(self) -> NDArray[np.bool_]:
        """Of each agent whether it is there (agent,)."""
        return self._state.present

    @property
    def faults(self) -> list[dict[str, Any]]:
        """Faults that have begun: kind, agent, and when they begin and end (s; None: never)."""
        return begun_faults(self._state.tables.due, self.step, self.scenario.flight.dt)

    def scores(self) -> dict[str, Any]:
        """Order parameters and fitness of the window since the last change, up to now.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.advance(1.0).scores()["n_coll"]
        0.0
        """
        return self.scenario.judged(self._state.values())

    def look(self, agent: int) -> AgentView:
        """What an agent perceives, and the parts of its command.

        Before a decision (`decides`), what it would decide on now; otherwise what its last decision was made from.

        Raises FlightError for an agent that is not there, and RuleError for a rule that asks for what cannot be told
        outside of the flight.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> view = flight.advance(1.0).look(3)
        >>> view.agent, len(view.heard) == len(view.met)
        (3, True)
        """
        self._course.apply_pending_change()
        self._course.begin()
        number = self._there(agent)
        if not self.decides or self._course.has_sensed or self._state.plan.sequential:
            return agent_view(self.scenario, self._state, number, self.step, self.seed, self.world)
        kept = self._state.buffer.copy()
        self._state.advance(self.step, self.step + 1, 2)
        found = agent_view(self.scenario, self._state, number, self.step, self.seed, self.world)
        self._state.buffer[:] = kept
        return found

    def _there(self, agent: Any) -> int:
        """Number of an agent that is there. Raises FlightError in one line."""
        number = check_agent(agent, self.agents)
        return self._those(number)[0]

    def _those(self, agents: Any) -> list[int]:
        """Numbers of one agent or several that are there. Raises FlightError in one line."""
        numbers, there = check_agents(agents, self.agents), self.present
        for number in numbers:
            if not there[number]:
                raise FlightError(f"agent = {number}: it is absent at t = {self.time:g} s")
        return numbers
