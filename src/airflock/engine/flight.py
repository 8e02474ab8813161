"""Flight: a flight that can be advanced, looked at, changed, kept and branched. Whatever the cuts, the same bits."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from airflock.core.view import View
from airflock.engine import failure
from airflock.engine.beginnings import NEVER
from airflock.engine.course import Course
from airflock.engine.look import view
from airflock.engine.moments import Snapshot, Window
from airflock.engine.presence import join, leave
from airflock.engine.state import State
from airflock.errors import FlightError
from airflock.scenarios.change import changed, named
from airflock.scenarios.events import Event, agent_number, events_of, vector
from airflock.scenarios.files import loaded
from airflock.scenarios.onsets import told
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.seeds import sound_seed

COMMANDS = {"velocity": "m/s", "acceleration": "m/s^2", "heading": ""}


class Flight:
    """One flight of a scenario, open: it goes on when it is told to, and may be changed on its way.

    Its bits are those of the closed flight, whatever the parts in which it is advanced. A change is a scenario: checked
    whole, in force from the next step or decision on, and the beginning of a new window of scores.

    scenario  : a Scenario, the name of a preset or a scenario file
    seed      : any integer from 0 to 2^64 - 1; the same seed gives the same bits
    precision : 32 or 64 bits per number
    record    : keep a frame every metrics.period
    start     : positions and velocities to start from, (component, agent) in m and m/s, instead of random ones
    device    : cpu, or python: the same stages uncompiled, for debuggers, in double precision
    world     : which of 2^32 independent streams of random numbers of this seed
    events    : what is done to the flight on its way, as `events` of an earlier flight holds it

    Raises ScenarioError and FlightError, one line per fault.

    Examples
    --------
    >>> import airflock
    >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
    >>> flight.advance(0.5).change({"model.p_rep": 0.2}).advance(0.5).time
    1.0
    """

    DEVICES = ("cpu", "python")

    def __init__(
        self,
        scenario: Any,
        seed: int = 0,
        *,
        precision: int = 32,
        record: bool = False,
        start: Any = None,
        world: int = 0,
        device: str = "cpu",
        events: Sequence[Event | Mapping[str, Any]] = (),
    ):
        if device not in self.DEVICES:
            raise FlightError(f"device = {device!r}: an open flight flies on {' or '.join(self.DEVICES)}")
        seed = sound_seed(seed)
        self._course = Course(loaded(scenario).in_flight(seed), seed, precision, record, start, device)
        self._planned = events_of(events)
        if world:
            self._course.to_world(world)
        while self._planned and self._planned[0].step == 0 and self._planned[0].kind == "branch":
            self._course.to_world(self._planned.pop(0).data.get("world"))  # before the start is drawn

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

    # ------------------------------------------------------------------------------------------------- time

    @property
    def agents(self) -> int:
        """Number of agents."""
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
        return self._course.step >= self._course.steps or self._state.ended

    @property
    def state(self) -> NDArray[Any]:
        """Positions (m) and velocities (m/s) of all agents, (component, agent); a copy."""
        self._course.begin()
        return self._state.motion

    @property
    def measured(self) -> NDArray[Any]:
        """Positions (m) and velocities (m/s) as agents last measured their own, (component, agent); a copy."""
        self._course.begin()
        names = [*self._state.plan.axes, *(f"v{axis}" for axis in self._state.plan.axes)]
        return self._state.rows([f"m{name}" if f"m{name}" in self._state.driver.ROWS else name for name in names])

    @property
    def sent(self) -> NDArray[Any]:
        """Over two lossy links: when the newest packet that each agent has of each other was sent, s; nan: none yet."""
        stamps = self._state.arrays["store"][2 * self._state.plan.dimensions, :, : self.agents].astype(float)
        return np.where(stamps > NEVER / 10.0, stamps, np.nan)

    @property
    def ready(self) -> bool:
        """Whether it flies at once; otherwise its driver is compiled first."""
        return self._course.ready

    def compile(self) -> "Flight":
        """Have its driver compiled, and fly nothing; in any thread, while nothing else is asked of it. Returns it."""
        self._course.compile()
        return self

    def advance(self, seconds: float | None = None, *, steps: int | None = None) -> "Flight":
        """Fly on by some seconds or motion steps, at most to the end of the flight. Returns the flight.

        Raises FlightError where the flight is over, where the agents find no place at the start, and where a state
        stops being finite.
        """
        count = self._count(seconds, steps)
        if self.over:
            raise FlightError(f"{self.scenario.name}: the flight is over at t = {self.time:g} s; finish() closes it")
        self._fly_to(min(self.step + count, self._course.steps))
        return self

    def _count(self, seconds: float | None, steps: int | None) -> int:
        """Steps to fly."""
        if (seconds is None) == (steps is None):
            raise FlightError("advance: give seconds or steps")
        dt = self.scenario.flight.dt
        try:
            count = int(steps) if steps is not None else round(float(seconds) / dt)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            count = 0
        if count < 1:
            asked = f"steps = {steps!r}" if steps is not None else f"seconds = {seconds!r}"
            raise FlightError(f"advance: {asked} is not at least one motion step of {dt:g} s")
        return count

    def _fly_to(self, last: int) -> None:
        """Fly all steps before `last`, with what is planned on the way."""
        while self._planned and self._planned[0].step < last:
            event = self._planned.pop(0)
            self._advance(event.step)
            self.event(event.kind, **event.data)
        self._advance(last)

    @property
    def _state(self) -> State:
        """Of the driver in force."""
        return self._course.state

    def _advance(self, last: int) -> None:
        first = self.step
        self._course.advance(last)
        if self.step > first and not self._state.finite:
            self._fail(first)

    def _fail(self, first: int) -> NoReturn:
        """Say which agent stopped being finite, and at which step from `first` on."""
        state = self._state
        bad = int(np.flatnonzero(~np.isfinite(state.motion).all(axis=0) & state.present)[0])
        twin = self.again()
        twin._fly_to(first)
        for event in twin._planned:
            twin.event(event.kind, **event.data)
        step = failure.first_bad_step(twin._state, first, self.step, 1 if twin._course.sensed else 0)
        raise FlightError(failure.not_finite(self.scenario, self.seed, bad, step))

    def finish(self) -> dict[str, Any]:
        """Fly to the end, take the last sample, and return the scores of the last window.

        Of a flight that was never changed these are the scores of the closed flight.
        """
        if not self.over:
            self._fly_to(self._course.steps)
        if self.step == self._course.steps and not self._state.ended:
            self._advance(self._course.steps + 1)
        return self.scores()

    # ---------------------------------------------------------------------------------------------- looking

    def scores(self) -> dict[str, Any]:
        """Order parameters and fitness of the window since the last change, up to now."""
        return self.scenario.judged(self._state.values())

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

    def look(self, agent: int) -> View:
        """What an agent perceives, and the parts of its command.

        Before a decision (`decides`), what it would decide on now; otherwise what its last decision was made from.
        """
        self._course.take_over()
        self._course.begin()
        number = self._there(agent)
        if not self.decides or self._course.sensed or self._state.plan.sequential:
            return view(self.scenario, self._state, number, self.step, self.seed, self.world)
        kept = self._state.buffer.copy()
        self._state.advance(self.step, self.step + 1, 2)
        found = view(self.scenario, self._state, number, self.step, self.seed, self.world)
        self._state.buffer[:] = kept
        return found

    @property
    def decides(self) -> bool:
        """Whether the agents decide at the next step to be flown."""
        return self.step % self._state.whole("decide_every") == 0

    # ------------------------------------------------------------------------------------- sensing and acting

    def sense(self) -> "Flight":
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

    @property
    def commands(self) -> NDArray[Any]:
        """Commands of all agents as last decided, (component, agent), in the unit of the law's command; a copy."""
        return self._state.rows([f"c{axis}" for axis in self._state.plan.axes])

    def command(self, agent: int, value: Any) -> "Flight":
        """Overrule what an agent decided at this step, until its next decision.

        value : one number per axis, m/s, m/s² or a direction, as the law commands
        """
        number, unit = self._there(agent), COMMANDS.get(self.scenario.model.command, "")
        given = vector("command", value, self.scenario.dimensions, unit)
        self.sense()
        self._course.put("c", number, given)
        self._course.note("command", agent=number, value=given)
        return self

    # ----------------------------------------------------------------------------------------------- changing

    def change(self, settings: Mapping[str, Any], *, wait: bool = True) -> "Flight":
        """Set keys of the scenario anew, such as {"model.p_rep": 0.2}; from the next step or decision on.

        Everything that a scenario file says may change but agents, dimensions, dt and start. A new window of scores
        begins. Where other text must be compiled, `wait` says whether to wait for it; if not, the flight goes on under
        the old scenario until the next `advance` after the new one is ready.
        Raises ScenarioError, and the flight is as it was.
        """
        return self._change(settings, Event(self.step, "change", dict(settings)), wait)

    def _change(self, settings: Mapping[str, Any], event: Event, wait: bool) -> "Flight":
        """Set keys of the scenario anew, as an event says."""
        if self._course.ended:
            raise FlightError(f"{self.scenario.name}: the flight has ended at t = {self.time:g} s; nothing can change")
        self._course.change(changed(self._course.latest, settings), event, wait)
        return self

    @property
    def waiting(self) -> bool:
        """Whether a change waits for its compiler."""
        return self._course.waiting

    def push(self, agent: int, velocity: Any) -> "Flight":
        """Add to an agent's velocity, m/s, one number per axis: a gust, a collision, a hand."""
        number = self._there(agent)
        given = vector("velocity", velocity, self.scenario.dimensions, "m/s")
        self._course.begin()
        self._course.put("v", number, given, add=True)
        self._course.note("push", agent=number, velocity=given)
        return self

    def place(self, agent: int, position: Any) -> "Flight":
        """Put an agent somewhere else, m, one number per axis."""
        number = self._there(agent)
        given = vector("position", position, self.scenario.dimensions, "m")
        self._course.begin()
        self._course.put("", number, given)
        self._state.look_at_pairs()
        self._course.note("place", agent=number, position=given)
        return self

    # -------------------------------------------------------------------------------------------- single agents

    @property
    def present(self) -> NDArray[np.bool_]:
        """Of each agent whether it is there."""
        return self._state.present

    @property
    def faults(self) -> list[dict[str, Any]]:
        """Faults that have begun: kind, agent, and when they begin and end (s; None: never)."""
        return told(self._state.tables.due, self.step, self.scenario.flight.dt)

    def fault(
        self, kind: str, agents: Sequence[int] | int | None = None, *, wait: bool = True, **numbers: Any
    ) -> "Flight":
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

    def remove(self, agent: int, reason: str = "") -> "Flight":
        """Let an agent drop out: it has landed or failed. From now on nobody meets, hears, feels or counts it.

        reason : for the list of events
        """
        number = self._there(agent)
        self._course.begin()
        self._course.let_come_and_go()
        leave(self._state, [number])
        self._course.note("remove", agent=number, **({"reason": str(reason)} if reason else {}))
        return self

    def add(self, agent: int, position: Any, velocity: Any = None) -> "Flight":
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

    def _there(self, agent: Any) -> int:
        """Number of an agent that is there. Raises FlightError in one line."""
        number = agent_number(agent, self.agents)
        if not self.present[number]:
            raise FlightError(f"agent = {number}: it is absent at t = {self.time:g} s")
        return number

    def event(self, kind: str, /, **data: Any) -> "Flight":
        """Do what an event says: the method of the same name."""
        if kind == "change":
            return self.change(data)
        if kind == "fault":
            return self.fault(**{"kind": "", **data})
        if kind == "branch":
            self._course.to_world(data.get("world"))
            return self
        (event,) = events_of([Event(self.step, kind, data)])
        try:
            done: Flight = getattr(self, event.kind)(**data)
        except TypeError as fault:
            raise FlightError(f"event {kind}: {', '.join(data)} are not what it needs") from fault
        return done

    # ------------------------------------------------------------------------------------------------ branching

    def snapshot(self) -> Snapshot:
        """Keep the present moment, to go back to with `restore`."""
        return self._course.snapshot()

    def restore(self, snapshot: Snapshot) -> "Flight":
        """Go back (or on) to a moment of this flight or of a branch of it.

        Raises FlightError for a moment of another scenario, seed, precision, start or version.
        """
        self._course.restore(snapshot)
        self._planned = []
        return self

    def branch(self, world: int | None = None) -> "Flight":
        """Another flight that goes on from here.

        world : the same (default) meets the same noise, another one an independent future
        """
        twin = object.__new__(Flight)
        twin._course, twin._planned = self._course.twin(), list(self._planned)
        if world is not None and world != self.world:
            twin._course.to_world(world)
        return twin

    def again(self) -> "Flight":
        """The same flight from its start, with the same events to come."""
        scenario, seed, precision, start = self.origin
        return Flight(
            scenario,
            seed,
            precision=precision,
            record=self.records,
            start=start,
            events=self.events,
            device=self.device,
        )
