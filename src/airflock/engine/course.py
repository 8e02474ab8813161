"""Course: where a flight stands, what it has behind it, and the driver that flies it on; `Flight` is its face."""

from collections.abc import Collection, Sequence
from concurrent.futures import Future
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock import __version__
from airflock.engine import cpu, failure
from airflock.engine.background_compile import compile_in_background
from airflock.engine.drivers import compile_messages, device_of, is_compiled
from airflock.engine.fault_columns import replace_faults
from airflock.engine.handover import hand_over
from airflock.engine.simulate import flight_plan, open_state
from airflock.engine.snapshots import Snapshot, Window, check_sendable
from airflock.engine.state import DriverState
from airflock.scenarios import Event, FaultOnset, Scenario, draw_onsets, merge_onsets, step_counts, with_faults_starting
from airflock.support import FlightError, run_in_background


class FlightState:
    """A flight as its drivers see it: steps flown one after another, whatever is asked of it between them.

    scenario : in force now; seed, precision, record, device, absence : of the whole flight
    start    : positions and velocities to start from, (component, agent), or None
    state    : of the driver in force; steps : how many the flight has
    step     : the next to be flown; sensed : whether its agents have perceived and decided already
    since    : step since which the present window is scored
    events   : done so far; windows : scored so far
    """

    def __init__(
        self, scenario: Scenario, seed: int, precision: int, record: bool, start: Any, device: str, absence: bool
    ):  # fmt: skip
        self.scenario, self.seed, self.world = scenario, seed, 0
        self.precision, self.record, self.device, self.absence = precision, record, device, absence
        self.state = open_state(scenario, seed, precision, record, start, device=device, absence=absence)
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
        """Whether nothing more can be flown, not even the last sample."""
        return self.state.has_ended or self.step > self.steps

    # ------------------------------------------------------------------------------------------------- flying

    def begin(self) -> None:
        """Place the agents, where that has not been done: the driver draws the start."""
        if not self.state.begun:
            self.call(self.step, self.step)

    def call(self, first: int, last: int, half: int = 0) -> None:
        """One call of the driver, for what is not a part of the flight itself."""
        with compile_messages(self.state.driver, self.scenario.model.name):
            self._placed(self.state.advance(first, last, half))

    @property
    def is_ready(self) -> bool:
        """Whether the driver in force flies at once."""
        return is_compiled(self.state.driver)

    def compile(self, in_background: bool = False) -> None:
        """Have it compiled, here or by another process."""
        if in_background:
            compile_in_background(self.state)
        else:
            self.state.compile()

    def advance(self, last: int) -> None:
        """Fly all steps before `last`, and keep their samples."""
        self.apply_pending_change()
        if last <= self.step:
            return
        state, first, every = self.state, self.step, self.state.whole("sample_every")
        frames = None
        if self.record:
            count = -(-last // every) - -(-first // every)
            frames = np.full((count, 3 * state.plan.dimensions, state.agents), np.nan, state.tables.row.dtype)
        with compile_messages(state.driver, self.scenario.model.name):
            done = self._placed(cpu.advance_in_chunks(state, first, last, frames, 1 if self.has_sensed else 0))
        self.step, self.has_sensed = done, False
        if frames is not None:
            frames = frames[: -(-done // every) - -(-first // every)] if state.has_ended else frames
            self._frames.append(frames)
            self._sampled.append((-(-first // every) + np.arange(len(frames))) * every * self.scenario.flight.dt)

    def _placed(self, done: int) -> int:
        """What a driver returned. Raises FlightError if that is an agent that found no place."""
        if done < 0:
            raise FlightError(failure.no_place_message(self.scenario, self.seed, -done - 1))
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

    # ----------------------------------------------------------------------------------------------- changing

    @property
    def waiting(self) -> bool:
        """Whether a change waits for its compiler."""
        return self._coming is not None

    @property
    def latest_scenario(self) -> Scenario:
        """The scenario last asked for: one that waits for its compiler, or the one in force."""
        return self._coming[0] if self._coming else self.scenario

    def change(self, new: Scenario, event: Event, wait: bool) -> None:
        """Go on as another scenario: now, or once its driver has been compiled. Raises FlightError."""
        said = [*(self._coming[1] if self._coming else []), event]
        old = self.state.plan
        if step_counts(new)["steps"] < self.step:
            raise FlightError(f"duration = {new.flight.duration:g} s: the flight is at t = {self.time:g} s already")
        plan = flight_plan(
            new, self.precision, self.record, given_start=old.given_start, absence=old.absence, device=self.device
        )
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
        return run_in_background(lambda: compile_in_background(self._opened(scenario, absence)))

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

    # ---------------------------------------------------------------------------------------------- branching

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
        twin.state, twin._coming = self.state.copy(), None
        twin.events, twin.windows = list(self.events), list(self.windows)
        twin._frames, twin._sampled = list(self._frames), list(self._sampled)
        return twin

    def __getstate__(self) -> dict[str, Any]:
        """What is pickled. Raises FlightError where a change is on its way, or another process has not the code."""
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
        if self.state.plan.faults:
            self._expect(self.state, draw_onsets(self.scenario, self.seed, world), range(len(self.scenario.faults)))
        self.note("branch", world=world)


def _same(origin: tuple[Scenario, int, int, Any], other: tuple[Scenario, int, int, Any]) -> bool:
    """Whether two flights began alike: by the same scenario, seed and precision, at the same start."""
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
