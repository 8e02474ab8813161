"""Flight: a flight that can be advanced, looked at, changed, kept and branched. Whatever the cuts, the same bits."""

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any, NoReturn

import numpy as np

from airflock.engine import failure, notebook
from airflock.engine.actions import FlightActions
from airflock.engine.course import FlightState
from airflock.engine.snapshots import Snapshot
from airflock.scenarios import Event, check_seed, load_if_named, to_events
from airflock.support import FlightError


class Flight(FlightActions):
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
    absence   : agents will leave or join: a driver that knows who is there flies from the start, in place of a second
                one that takes over when somebody leaves; the same bits

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
    ):
        if device not in self.DEVICES:
            raise FlightError(f"device = {device!r}: an open flight flies on {' or '.join(self.DEVICES)}")
        seed = check_seed(seed)
        self._course = FlightState(
            load_if_named(scenario).with_drawn_scene(seed), seed, precision, record, start, device, absence
        )
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
        return notebook.flight_html(self)

    @property
    def ready(self) -> bool:
        """Whether it flies at once; otherwise its driver is compiled first."""
        return self._course.is_ready

    def compile(self, *, aside: bool = False) -> "Flight":
        """Have its driver compiled, and fly nothing; in any thread, while nothing else is asked of it. Returns it.

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

        Raises FlightError where the flight is over, where the agents find no place at the start, and where a state
        stops being finite.

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
            asked = f"steps = {steps!r}" if steps is not None else f"seconds = {seconds!r}"
            raise FlightError(f"advance: {asked} is not at least one motion step of {dt:g} s")
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
        step = failure.first_bad_step(twin._state, first, self.step, 1 if twin._course.has_sensed else 0)
        raise FlightError(failure.not_finite_message(self.scenario, self.seed, bad, step))

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

        Raises FlightError for an event that there is not, and what the method raises, such as ScenarioError.

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
        """The same flight from its start, with the same events to come.

        Raises ScenarioError, FlightError and ParameterError as opening it did; so only where files have changed
        meanwhile.

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
        )
