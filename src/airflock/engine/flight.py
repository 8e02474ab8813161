"""Flight: a flight that can be advanced, read, changed, kept and branched. Cuts change no bit of it."""

import pickle
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import Future
from copy import copy
from dataclasses import dataclass
from html import escape
from numbers import Integral
from typing import Any, NamedTuple, NoReturn, Self

import numpy as np
from numpy.typing import NDArray

from airflock import __version__
from airflock.core import COMMANDS, AgentView
from airflock.engine import cpu
from airflock.engine.absence_and_faults import add_agent, remove_agents, replace_faults
from airflock.engine.closed_flights import (
    first_bad_step,
    flight_plan,
    no_place_message,
    not_finite_message,
    open_state,
)
from airflock.engine.driver_state import DriverState, hand_over
from airflock.engine.drivers import compile_messages, device_of, is_compiled
from airflock.engine.look import agent_view
from airflock.engine.plan import NO_PACKET_TIME, Plan
from airflock.parts.metrics import reported_values
from airflock.scenarios import (
    Event,
    FaultOnset,
    Scenario,
    are_several,
    begun_faults,
    check_agent,
    check_agents,
    check_seed,
    draw_onsets,
    format_number,
    html_table,
    load_if_named,
    merge_onsets,
    named_fault_entries,
    position_error,
    settings_dict,
    step_counts,
    to_events,
    to_vector,
    to_vectors,
    with_faults_starting,
    with_settings,
    wrap_start,
)
from airflock.support import FlightError, run_in_background


@dataclass(frozen=True)
class Window:
    """A stretch of a flight under one scenario: its order parameters belong to it alone.

    begin, end : s; scores : order parameters and fitness
    """

    scenario: Scenario
    begin: float
    end: float
    scores: dict[str, Any]


class Percepts(NamedTuple):
    """What all agents have measured and heard at a decision, by number; parts of one table, (agent, column).

    velocity : own, as measured, m/s, (agent, axis); goal : offset to it, m, (agent, axis), no axes
               without goals
    free     : free way along each ray, at most 100 m, evenly around from east on, in space then up
               and down
    offset, closing : to the nearest that it hears and meets, m, and their velocities beside its
                      own, m/s, nearest first, (agent, neighbour, axis)
    age, heard      : how old that is, s, and 1; all four are 0 where it hears fewer, (agent,
                      neighbour)
    """

    velocity: NDArray[Any]
    goal: NDArray[Any]
    free: NDArray[Any]
    offset: NDArray[Any]
    closing: NDArray[Any]
    age: NDArray[Any]
    heard: NDArray[Any]
    table: NDArray[Any]

    @classmethod
    def of(cls, plan: Plan, table: NDArray[Any]) -> "Percepts":
        """Parts of a table (..., agent, column), as views."""
        velocity, goal, free, rest = (table[..., columns.start : columns.stop] for columns in plan.observed.values())
        each, d = rest.reshape(*rest.shape[:-1], plan.observe[0], 2 * plan.dimensions + 2), plan.dimensions
        parts = each[..., :d], each[..., d : 2 * d], each[..., 2 * d], each[..., 2 * d + 1]
        return cls(velocity, goal, free, *parts, table)


@dataclass(frozen=True)
class Snapshot:
    """A moment of a flight: all that it had carried so far, as one block of bytes, and what had been noted of it."""

    version: str
    origin: tuple[Scenario, int, int, Any]
    scenario: Scenario
    state: DriverState
    bytes: NDArray[np.uint8]
    step: int
    has_sensed: bool
    begin: int
    events: tuple[Event, ...]
    windows: tuple[Window, ...]
    frames: tuple[NDArray[Any], ...]
    sampled_values: tuple[NDArray[Any], ...]
    due: tuple[FaultOnset, ...]

    def __repr__(self) -> str:
        """Of which flight it is, and when."""
        time = self.step * self.scenario.flight.dt
        return f"<Snapshot of {self.origin[0].name}, seed {self.origin[1]}, at {time:g} s>"

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle. Raises FlightError where another process could not import a law."""
        check_sendable(self.origin[0], self.scenario)
        return vars(self)


def check_sendable(*scenarios: Scenario) -> None:
    """Raise FlightError where a scenario has code of its own, which another process could not import."""
    for scenario in scenarios:
        try:
            pickle.dumps(scenario)
        except (pickle.PicklingError, AttributeError, TypeError) as fault:  # as pickle says it of functions and classes
            raise FlightError(
                f"{scenario.name}: its own code cannot be sent to another process; open it there by its file, "
                "with the seed and the events of this flight, which then has the same bits"
            ) from fault


class FlightState:
    """A flight as its drivers see it: steps flown one after another, whatever is read between them.

    scenario : in force now; seed, precision, record, device, absence, observe : of the whole flight
    start    : positions and velocities to start from, (component, agent), or None
    state    : of the driver in force; steps : how many the flight has
    step     : the next to be flown; sensed : whether its agents have perceived and decided already
    since    : step since which the present window is scored
    events   : done so far; windows : scored so far
    """

    def __init__(
        self, scenario: Scenario, seed: int, precision: int, record: bool, start: Any, device: str, absence: bool,
        observe: tuple[int, int] = (0, 0),
    ):  # fmt: skip
        if device not in Flight.DEVICES:
            raise FlightError(f"device = {device!r}: an open flight flies on {' or '.join(Flight.DEVICES)}")
        self.scenario, self.seed, self.world = scenario, seed, 0
        self.precision, self.record, self.device, self.absence = precision, record, device, absence
        self.observe = observe
        self.state = open_state(
            scenario, seed, precision, record, start, device=device, absence=absence, observe=observe
        )
        self.origin = (scenario, seed, precision, None if start is None else np.array(start))
        self.steps, self.step, self.window_start, self.has_sensed = self.state.whole("steps"), 0, 0, False
        self.events: list[Event] = []
        self.windows: list[Window] = []
        self._frames: list[NDArray[Any]] = []
        self._sampled: list[NDArray[Any]] = []
        self._coming: tuple[Scenario, list[Event], Future[DriverState]] | None = None

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return min(self.step, self.steps) * self.scenario.flight.dt

    @property
    def has_ended(self) -> bool:
        """Return True if nothing more can be flown, not even the last sample."""
        return self.state.has_ended or self.step > self.steps

    def begin(self) -> None:
        """Place the agents, where that has not been done: the driver draws the start."""
        if not self.state.begun:
            self.call(self.step, self.step)

    def call(self, first: int, last: int, half: int = 0) -> None:
        """One call of the driver, for what is not a part of the flight itself."""
        with compile_messages(self.state.driver.advance, self.scenario.model.name):
            self._placed(self.state.advance(first, last, half))

    @property
    def is_ready(self) -> bool:
        """Return True if the driver in force flies at once."""
        return is_compiled(self.state.driver)

    def compile(self, in_background: bool = False) -> None:
        """Have it compiled, here or by another process."""
        if in_background:
            self.state.compile_in_background()
        else:
            self.state.compile()

    def advance(self, last: int) -> None:
        """Fly all steps before `last`, and keep their samples."""
        self.apply_pending_change()
        if last <= self.step:
            return
        first, every = self.step, self.state.whole("sample_every")
        done, frames = cpu.fly_steps(self.state, first, last, self.record, 1 if self.has_sensed else 0)
        self.step, self.has_sensed = self._placed(done), False
        if frames is not None:
            self._frames.append(frames)
            self._sampled.append((-(-first // every) + np.arange(len(frames))) * every * self.scenario.flight.dt)

    def _placed(self, done: int) -> int:
        """Return the step that a driver returned. Raises FlightError if it names an agent that found no place."""
        if done < 0:
            raise FlightError(no_place_message(self.scenario, self.seed, -done - 1))
        return done

    @property
    def frame_times(self) -> NDArray[Any]:
        """Times of the samples, s."""
        return np.concatenate([np.zeros(0), *self._sampled])

    @property
    def frames(self) -> NDArray[Any]:
        """Samples, (time, component, agent)."""
        shape = (0, 3 * self.state.plan.dimensions, self.state.agents)
        return np.concatenate([np.zeros(shape, self.state.tables.row.dtype), *self._frames])

    @property
    def waiting(self) -> bool:
        """Return True if a change waits for its compiler."""
        return self._coming is not None

    @property
    def latest_scenario(self) -> Scenario:
        """Return the latest scenario: one that waits for its compiler, or the one in force."""
        return self._coming[0] if self._coming else self.scenario

    def change(self, new: Scenario, event: Event, wait: bool) -> None:
        """Go on as another scenario: now, or once its driver has been compiled. Raises FlightError."""
        said = [*(self._coming[1] if self._coming else []), event]
        old = self.state.plan
        if step_counts(new)["steps"] < self.step:
            raise FlightError(f"duration = {new.flight.duration:g} s: the flight is at t = {self.time:g} s already")
        plan = flight_plan(
            new, self.precision, self.record, given_start=old.given_start, absence=old.absence, device=self.device,
            observe=self.observe,
        )  # fmt: skip
        # The same plan flies by the same driver, so there is nothing to wait for: only numbers
        # change.
        if wait or plan == old:
            state = self._opened(new, old.absence)
            self._coming = None
            self._take(new, said, state)
        else:
            self._coming = (new, said, self._made(new, old.absence))

    def _made(self, scenario: Scenario, absence: bool) -> "Future[DriverState]":
        """The state that is to take over, written and compiled aside; interpreted, it is written at once."""
        if self.device == "python":
            return run_in_background(self._opened(scenario, absence).compile)
        return run_in_background(lambda: self._opened(scenario, absence).compile_in_background())

    def apply_pending_change(self) -> None:
        """Take the change over that has been compiled meanwhile."""
        if self._coming and self._coming[2].done():
            (new, said, compiled), self._coming = self._coming, None
            self._take(new, said, compiled.result())

    def _take(self, scenario: Scenario, events: Sequence[Event], state: DriverState) -> None:
        """Go on as another scenario, in a new window of scores. Faults that have waited for a compiler begin now."""
        self.begin()
        now = (self.step + (1 if self.has_sensed else 0)) * scenario.flight.dt
        on_time = with_faults_starting(scenario, _faults_at_the_end(events), now)
        if on_time is not scenario:
            scenario, state = on_time, self._opened(on_time, state.plan.absence)
        if self.state.plan.absence and not state.plan.absence:  # somebody left while the change waited
            state = self._opened(scenario, absence=True)
        # Of two changes at one step the first leaves no window: of no time there is no mean.
        if self.step > self.window_start:
            begin = self.window_start * self.scenario.flight.dt
            scores = self.scenario.judged(self.state.values())
            self.windows.append(Window(self.scenario, begin, self.time, scores))
        hand_over(self.state, state, self.step)
        self._expect(state, state.tables.due, [n for n, e in enumerate(self.scenario.faults) if e in scenario.faults])
        replace_faults(state, state.tables.due)
        for event in events:
            self.note(event.kind, **event.data)
        self.scenario, self.state, self.steps, self.window_start = scenario, state, state.whole("steps"), self.step

    def _opened(self, scenario: Scenario, absence: bool) -> DriverState:
        """State of this flight under a scenario; nothing is in it yet."""
        return open_state(
            scenario, self.seed, self.precision, self.record, world=self.world, device=self.device,
            given_start=self.state.plan.given_start, absence=absence,
            observe=self.observe,
        )  # fmt: skip

    def _expect(self, state: DriverState, coming: Sequence[FaultOnset], lasting: Collection[int]) -> None:
        """Have a state expect these faults from now on; `lasting` as of `onsets.merge_onsets`."""
        now = self.step + (1 if self.has_sensed else 0)
        state.set_onsets(merge_onsets(self.state.tables.due, coming, now, lasting))

    def allow_absence(self) -> None:
        """Go on with a driver that knows who is absent; in the same window of scores."""
        if self.state.plan.absence:
            return
        old, state = self.state, self._opened(self.scenario, absence=True)
        hand_over(old, state, self.step)
        state.set_onsets(old.tables.due)
        for name in ("sums", "values"):
            state.arrays[name][:] = old.arrays[name]
        # Agent-steps of this window, those that were there and all: so far everybody was there.
        state.arrays["there"][:] = (self.step - self.window_start) * state.agents
        self.state = state

    def set_rows(self, prefix: str, agents: Sequence[int], values: Sequence[Any], add: bool = False) -> None:
        """Set the rows that begin with `prefix`, one per axis, of some agents; `add` to what they hold.

        values : one number per axis for all of them, or one such row for each
        """
        names = [f"{prefix}{axis}" for axis in self.state.plan.axes]
        rows = self.state.rows(names)
        each = np.broadcast_to(np.array(values, rows.dtype), (len(agents), len(names))).T
        rows[:, agents] = each + (rows[:, agents] if add else 0)
        self.state.set_rows(names, rows)

    def note(self, kind: str, /, **data: Any) -> None:
        """Write down what was done before the next step."""
        self.events.append(Event(self.step, kind, data))

    def snapshot(self) -> Snapshot:
        """The present moment."""
        return Snapshot(
            __version__, self.origin, self.scenario, self.state, self.state.buffer.copy(), self.step, self.has_sensed,
            self.window_start, tuple(self.events), tuple(self.windows), tuple(self._frames), tuple(self._sampled),
            self.state.tables.due,
        )  # fmt: skip

    def restore(self, moment: Snapshot) -> None:
        """Go back (or on) to a moment of this course or of a twin of it. Raises FlightError for any other."""
        if not isinstance(moment, Snapshot):
            raise FlightError(f"snapshot = {moment!r} is not what snapshot() of a flight returns")
        # Rows of the buffer have places and no names: another version may lay them out in another
        # way.
        if moment.version != __version__:
            raise FlightError(f"snapshot: made by version {moment.version}, this is {__version__}")
        device, record = device_of(moment.state.driver), moment.state.plan.record
        if not _same(moment.origin, self.origin) or (device, record) != (self.device, self.record):
            theirs, seed, precision, _ = moment.origin
            raise FlightError(
                f"snapshot: of {theirs.name}, seed {seed}, precision = {precision}, device = {device}, "
                f"record = {record}; not of this flight"
            )
        self._coming = None
        # The moment keeps the driver's state of its time. A twin, or this flight after a change,
        # flies on by a copy, so that others can still go back to it.
        if self.state is not moment.state:
            self.state = moment.state.copy()
        self.state.buffer[:] = moment.bytes
        self.state.set_onsets(moment.due)
        self.scenario, self.step, self.has_sensed = moment.scenario, moment.step, moment.has_sensed
        self.window_start, self.steps, self.world = moment.begin, self.state.whole("steps"), self.state.whole("world")
        self.events, self.windows = list(moment.events), list(moment.windows)
        self._frames, self._sampled = list(moment.frames), list(moment.sampled_values)

    def copy(self) -> "FlightState":
        """Another course that goes on from here."""
        twin = object.__new__(FlightState)
        vars(twin).update(vars(self))
        # A change that waits for its compiler stays with the first flight: its state can be taken
        # over once.
        twin.state, twin._coming = self.state.copy(), None
        twin.events, twin.windows = list(self.events), list(self.windows)
        twin._frames, twin._sampled = list(self._frames), list(self._sampled)
        return twin

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle. Raises FlightError while a change compiles or where code cannot be imported."""
        if self.waiting:
            raise FlightError("a change waits for its compiler; let it come into force before the flight is pickled")
        check_sendable(self.origin[0], self.scenario)
        return vars(self)

    def switch_world(self, world: Any) -> None:
        """Draw from another world's random numbers from now on. Raises FlightError."""
        if isinstance(world, bool) or not isinstance(world, Integral) or not 0 <= int(world) < 2**32:
            raise FlightError(f"world = {world!r} is not a whole number from 0 to 2^32 - 1")
        self.world = world = int(world)
        self.state.set_integer("world", world)
        # Faults are drawn by the world, too. All entries last, so that a fault which has begun goes
        # on in every branch.
        if self.state.plan.faults:
            self._expect(self.state, draw_onsets(self.scenario, self.seed, world), range(len(self.scenario.faults)))
        self.note("branch", world=world)


def _same(origin: tuple[Scenario, int, int, Any], other: tuple[Scenario, int, int, Any]) -> bool:
    """Return True if two flights have the same beginning: the same scenario, seed and precision, at the same start."""
    return origin is other or (origin[:3] == other[:3] and np.array_equal(origin[3], other[3]))


def _faults_at_the_end(events: Sequence[Event]) -> int:
    """How many of a scenario's last faults these events have added."""
    count = 0
    for event in events:
        if event.kind == "fault":
            count += 1
        elif event.kind == "change" and "faults" in event.data:
            count = 0
    return count


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
        """Return the scenario, seed, precision and start with which it was opened."""
        return self._course.origin

    @property
    def records(self) -> bool:
        """Return True if it keeps frames."""
        return self._course.record

    @property
    def events(self) -> list[Event]:
        """Return the events so far, in order."""
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
        """Return True if the flight has reached its duration, or has ended at a collision."""
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
        """Return True if the agents decide at the next step to be flown."""
        return self.step % self._state.whole("decide_every") == 0

    @property
    def commands(self) -> NDArray[Any]:
        """Commands of all agents as last decided, (component, agent), in the unit of the law's command; a copy."""
        return self._state.rows([f"c{axis}" for axis in self._state.plan.axes])

    @property
    def waiting(self) -> bool:
        """Return True if a change waits for its compiler."""
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
        """Return the percept of an agent, and the parts of its command.

        Before a decision (`decides`), what it would decide on now; otherwise what its last decision
        was made from.

        Raises FlightError for an agent that is not there, and RuleError for a rule that needs what
        is not known outside of the flight.

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
        # The first half of the step is flown and taken back: the percept is that of the coming
        # decision, and the flight keeps its bits.
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


# What can be changed; each action is noted as an event, so that it can be repeated.

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

    def perceived(self) -> Percepts:
        """Let all agents perceive and decide as `sense` does, and return what they have measured and heard, as arrays.

        Raises FlightError as `sense` does, and for a flight that was opened without `neighbours` and `rays`.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1, neighbours=7, rays=8)
        >>> percepts = flight.perceived()
        >>> percepts.offset.shape, percepts.free.shape
        ((100, 7, 2), (100, 8))
        """
        if not self._state.plan.observes:
            raise FlightError(f"{self.scenario.name}: nobody observes; open the flight with neighbours=7, say")
        self.sense()
        return Percepts.of(self._state.plan, observed_rows(self._state).T.copy())

    def command(self, agent: int | Sequence[int], value: Any) -> Self:
        """Overrule what an agent, or each of several, decided at this step, until its next decision.

        value : one number per axis, m/s, m/s² or a direction, as the law commands; for several agents one such row
                for all of them, or one for each: (agent, axis)

        Raises FlightError for an agent that is not there, for another number of numbers, and where
        `sense` does.

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
        """Change keys of the scenario by `settings`, such as {"model.p_rep": 0.2}; from the next step or decision on.

        Everything that a scenario file says may change but agents, dimensions, dt and start. A new
        window of scores begins. Where other text must be compiled, `wait` says whether to wait for
        it; if not, the flight goes on under the old scenario until the next `advance` after the new
        one is ready. Raises ScenarioError, or FlightError once the flight has ended; the flight is
        as it was.

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
        """Change keys of the scenario, as an event says."""
        if self._course.has_ended:
            raise FlightError(f"{self.scenario.name}: the flight has ended at t = {self.time:g} s; nothing can change")
        self._course.change(with_settings(self._course.latest_scenario, settings), event, wait)
        return self

    def push(self, agent: int | Sequence[int], velocity: Any) -> Self:
        """Add to the velocity of an agent, or of several: a gust, a collision, a hand.

        velocity : m/s, one number per axis, at most 1000; for several agents one such row for all, or one for each

        Raises FlightError for an agent that is not there, and for a velocity that is none or too
        large.

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

        Raises FlightError for a place inside what stands in the scene. A periodic box holds every
        place.

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

        kind   : such as "motor"; agents : those affected
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
        affected = {} if agents is None else {"agents": [*agents] if isinstance(agents, Iterable) else [agents]}
        given = settings_dict({"kind": kind, **affected, **numbers}, self.scenario.name)
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


def flight_html(flight: "Flight") -> str:
    """Its sentence, and a table of order parameters since the last change, with units and meanings."""
    done = [event.kind for event in flight.events]
    parts = [f"{done.count(kind)} × {kind}" for kind in dict.fromkeys(done)]
    absent = int((~flight.present).sum())
    parts += [f"{absent} absent"] if absent else []
    beside = f" ({escape(', '.join(parts))})" if parts else ""
    head = f"<p><b>{escape(repr(flight).strip('<>'))}</b>{beside}</p>"
    if not flight.step:
        return f"{head}<p>nothing is flown yet</p>"
    known = reported_values(flight.scenario.metrics.rule)
    scores = {name: value for name, value in flight.scores().items() if isinstance(value, (int, float))}
    rows = [(name, format_number(value), *known.get(name, ("", ""))) for name, value in scores.items()]
    return head + html_table(("order parameter", "value", "unit", "meaning"), rows)


class Flight(FlightActions):
    """One flight of a scenario, open: it goes on at each call of `advance`, and may be changed on its way.

    Its bits are those of the closed flight, whatever the parts in which it is advanced. A change is
    a scenario: checked whole, in force from the next step or decision on, and the beginning of a
    new window of scores.

    scenario  : a Scenario, the name of a preset or a scenario file
    seed      : any integer from 0 to 2^64 - 1; the same seed gives the same bits
    precision : 32 or 64 bits per number
    record    : keep a frame every metrics.period
    start     : positions and velocities to start from, (component, agent) in m and m/s, instead of random ones
    device    : cpu, or python: the same stages uncompiled, for debuggers, in double precision
    world     : which of 2^32 independent streams of random numbers of this seed
    events    : what is done to the flight on its way, as `events` of an earlier flight holds it
    absence   : agents will leave or join: a driver that knows who is there flies from the start, in place of a second
                one that takes over when somebody leaves; the same bits
    neighbours, rays : how many of the nearest that it hears, and ways around it, each agent keeps for `perceived`; the
                       same bits. Faults of commands, and the rule of silence, then act on what `command` says, too

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
        absence: bool = False,
        neighbours: int = 0,
        rays: int = 0,
    ):
        seed = check_seed(seed)
        self._course = FlightState(
            load_if_named(scenario).with_drawn_scene(seed), seed, precision, record, start, device, absence,
            (neighbours, rays),
        )  # fmt: skip
        self._planned = to_events(events)
        if world:
            self._course.switch_world(world)
        while self._planned and self._planned[0].step == 0 and self._planned[0].kind == "branch":
            self._course.switch_world(self._planned.pop(0).data.get("world"))  # before the start is drawn

    def __repr__(self) -> str:
        """Which flight it is, and how far it is."""
        scenario = self.scenario
        flown = f"{self.time:g} of {scenario.flight.duration:g} s"
        return f"<Flight {scenario.name}, seed {self.seed}: {flown}, {scenario.agents} agents>"

    def _repr_html_(self) -> str:
        """Where it stands and its scores so far, for a notebook."""
        return flight_html(self)

    @property
    def ready(self) -> bool:
        """Return True if it flies at once; otherwise its driver is compiled first."""
        return self._course.is_ready

    def compile(self, *, aside: bool = False) -> "Flight":
        """Have its driver compiled, and fly nothing; in any thread, while nothing else uses it. Returns it.

        aside : by another process, so that no other thread of this one is held up meanwhile

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.compile().ready
        True
        """
        self._course.compile(aside)
        return self

    def advance(self, seconds: float | None = None, *, steps: int | None = None) -> "Flight":
        """Fly on by some seconds or motion steps, at most to the end of the flight. Returns the flight.

        seconds : time to fly, s; steps: or motion steps

        Raises FlightError where the flight is over, where the agents find no place at the start,
        and where a state stops being finite.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.advance(0.5).advance(steps=1).step
        51
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
            duration = f"steps = {steps!r}" if steps is not None else f"seconds = {seconds!r}"
            raise FlightError(f"advance: {duration} is not at least one motion step of {dt:g} s")
        return count

    def _fly_to(self, last: int) -> None:
        """Fly all steps before `last`, with what is planned on the way."""
        while self._planned and self._planned[0].step < last:
            event = self._planned.pop(0)
            self._advance(event.step)
            self.event(event.kind, **event.data)
        self._advance(min(last, self._course.steps))  # a change on the way may have made the flight shorter

    def _advance(self, last: int) -> None:
        first = self.step
        self._course.advance(last)
        if self.step > first and not self._state.is_finite:
            self._fail(first)

    def _fail(self, first: int) -> NoReturn:
        """Say which agent stopped being finite, and at which step from `first` on."""
        state = self._state
        bad = int(np.flatnonzero(~np.isfinite(state.motion).all(axis=0) & state.present)[0])
        twin = self.again()
        twin._fly_to(first)
        for event in twin._planned:
            twin.event(event.kind, **event.data)
        step = first_bad_step(twin._state, first, self.step, 1 if twin._course.has_sensed else 0)
        raise FlightError(not_finite_message(self.scenario, self.seed, bad, step))

    def finish(self) -> dict[str, Any]:
        """Fly to the end, take the last sample, and return the scores of the last window.

        Of a flight that was never changed these are the scores of the closed flight.

        Raises FlightError as `advance` does where a state stops being finite.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
        >>> values = airflock.open(short, seed=1).finish()
        >>> bool(values["phi_vel"] == airflock.score(short, seeds=[1])["phi_vel"].iloc[0])
        True
        """
        while not self.over:  # a change on the way may make it longer
            self._fly_to(self._course.steps)
        if self.step == self._course.steps and not self._state.has_ended:
            self._advance(self._course.steps + 1)
        return self.scores()

    def event(self, kind: str, /, **data: Any) -> "Flight":
        """Do what an event says: the method of the same name.

        kind : change, fault, push, place, command, remove, add or branch; data : the arguments of that method

        Raises FlightError for an event that there is not, and what the method raises, such as
        ScenarioError.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.advance(0.5).event("change", **{"model.p_rep": 0.2}).scenario.parameters.p_rep
        0.2
        """
        if kind == "change":
            return self.change(data)
        if kind == "fault":
            return self.fault(**{"kind": "", **data})
        if kind == "branch":
            self._course.switch_world(data.get("world"))
            return self
        (event,) = to_events([Event(self.step, kind, data)])
        try:
            done: Flight = getattr(self, event.kind)(**data)
        except TypeError as fault:
            raise FlightError(f"event {kind}: {', '.join(data)} are not what it needs") from fault
        return done

    def snapshot(self) -> Snapshot:
        """Keep the present moment, to go back to with `restore`.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.advance(0.5).snapshot()
        <Snapshot of vasarhelyi_2018/4ms, seed 1, at 0.5 s>
        """
        return self._course.snapshot()

    def restore(self, snapshot: Snapshot) -> "Flight":
        """Go back (or on) to a moment of this flight or of a branch of it.

        Raises FlightError for a moment of another scenario, seed, precision, start or version.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> moment = flight.advance(0.5).snapshot()
        >>> flight.advance(0.5).restore(moment).time
        0.5
        """
        self._course.restore(snapshot)
        self._planned = []
        return self

    def branch(self, world: int | None = None) -> "Flight":
        """Another flight that goes on from here.

        world : the same (default) meets the same noise, another one an independent future

        Raises FlightError for a `world` that is no whole number from 0 to 2^32 - 1.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> twin = flight.advance(0.5).branch()
        >>> (twin.advance(0.5).state == flight.advance(0.5).state).all()  # the same noise: the same bits
        np.True_
        """
        twin = copy(self)
        twin._course, twin._planned = self._course.copy(), list(self._planned)
        if world is not None and world != self.world:
            twin._course.switch_world(world)
        return twin

    def again(self) -> "Flight":
        """Return this flight from its start, with the same events to come.

        Raises ScenarioError, FlightError and ParameterError as opening it did; so only where files
        have changed meanwhile.

        Examples
        --------
        >>> import airflock
        >>> flight = airflock.open("vasarhelyi_2018/4ms", seed=1)
        >>> flight.advance(0.5).again().time
        0.0
        """
        scenario, seed, precision, start = self.origin
        return Flight(
            scenario,
            seed,
            precision=precision,
            record=self.records,
            start=start,
            events=self.events,
            device=self.device,
            absence=self._course.absence,
            neighbours=self._course.observe[0],
            rays=self._course.observe[1],
        )


def observed_rows(state: DriverState) -> NDArray[Any]:
    """Rows of what agents observe, (column, agent), agents by number; a view where they lie so."""
    first, count = state.driver.ROWS["seen0"], state.plan.observed["neighbours"].stop
    rows: NDArray[Any] = state.arrays["work"][first : first + count, : state.agents]
    return rows if state.slots is None else rows[:, state.slots]
