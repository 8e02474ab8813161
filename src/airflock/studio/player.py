"""Player: an open flight that is played, tuned, pushed and taken back; it knows no page."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue
from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock import atomic
from airflock.engine.flight import Flight
from airflock.errors import AirflockError, RecordingError
from airflock.recordings import attributes
from airflock.recordings.files import load_recording, save
from airflock.recordings.scores import scenario_of
from airflock.replays import replay
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario
from airflock.studio.controls import fields
from airflock.studio.moments import Moments
from airflock.studio.pace import Pace
from airflock.studio.saving import flown_again, toml_of

LONGEST = 1e6  # s; an open page has no end of its own
MOST_BUSY = 0.05  # s of real time flown at most before the page is answered again


class Player:
    """One flight after another of a scenario: what a page shows and what its controls do.

    `ask` may be called from any thread; everything else belongs to the thread that calls `tick`.

    where    : preset, scenario file or recording, which is flown again with its events
    settings : keys changed from outside
    seed     : of the first flight; a recording brings its own
    law      : a law that flies instead of the file's; trust : whether code that the file names may run
    """

    def __init__(
        self,
        where: str,
        settings: Mapping[str, Any] | None = None,
        seed: int = 0,
        *,
        law: Any = None,
        trust: bool = False,
    ):
        self.where, self.given, self.seed = where, dict(settings or {}), seed
        self.law, self.trust = law, trust
        self.source = recorded(where) if where.lower().endswith(".nc") else None
        if self.source is not None:
            self.seed = int(self.source.attrs["airflock_seed"])
        self.paused, self.note, self.failure = False, "", ""
        self._rate = 1e4  # motion steps per second, as measured
        self.fault: Callable[[str], None] = lambda line: None  # is told of everything that was refused
        self._asked: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._open()

    def _open(self) -> None:
        if self.source is None:
            self.preset = endless(load(self.where, self.given, self.law, trust=self.trust))
            self.flight = Flight(self.preset, self.seed)
        else:
            self.preset = endless(scenario_of(self.source, self.given))
            same = not self.given and self.seed == int(self.source.attrs["airflock_seed"])
            events = attributes.events(self.source) if same else []
            precision = int(self.source.attrs["airflock_precision"])
            self.flight = Flight(self.preset, self.seed, precision=precision, events=events)
        self.pace = Pace(self.preset.flight.dt, getattr(self, "pace", Pace(1.0)).speed)
        self.moments, self.failure = Moments(), ""
        self.changed: dict[str, Any] = {}
        self._before: list[dict[str, Any]] = []

    def start(self) -> None:
        """Place the agents; compiles what has not been compiled yet."""
        _ = self.motion

    # ------------------------------------------------------------------------------------------------- state

    @property
    def scenario(self) -> Scenario:
        """The scenario in force."""
        return self.flight.scenario

    @property
    def motion(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Positions (agent, 3) in m and velocities (agent, 3) in m/s; the third axis of a plane is 0."""
        return in_space(self.flight.state, self.scenario.dimensions)

    @property
    def status(self) -> str:
        """What a page says while it waits, or why it stopped; empty while all is well."""
        if self.failure:
            return self.failure
        return "compiling …" if self.flight.waiting else self.note

    # ------------------------------------------------------------------------------------------------ playing

    def ask(self, action: Callable[[], None]) -> None:
        """Do something before the next frame; from any thread."""
        self._asked.put(action)

    def tick(self, elapsed: float) -> bool:
        """Do what was asked for, then fly what is due after `elapsed` s of real time. Whether anything moved."""
        asked = self._answer()
        if self.paused or self.failure or self.flight.over:
            return asked
        steps = min(self.pace.due(elapsed), max(1, int(self._rate * MOST_BUSY)))
        if not steps:
            return asked
        began, moved = perf_counter(), self.fly(steps)
        self._rate = steps / max(perf_counter() - began, 1e-6)
        return moved or asked

    def _answer(self) -> bool:
        done = False
        while True:
            try:
                action = self._asked.get_nowait()
            except Empty:
                return done
            done = True
            self._safely(action)

    def _safely(self, action: Callable[[], None]) -> None:
        """Do something; a fault of the user's is a note on the page and a line in the terminal, and nothing else."""
        try:
            action()
        except AirflockError as fault:
            self.note = str(fault)
            self.fault(self.note)

    def fly(self, steps: int) -> bool:
        """Fly so many steps, and keep a moment where one is due; a flight that fails stops and says why."""
        if self.moments.due(self.flight.time):
            self.moments.keep(self.flight.time, self.flight.snapshot())
        try:
            self.flight.advance(steps=steps)
        except AirflockError as fault:
            self.failure = f"stopped: {fault}"
            self.fault(self.failure)
            return False
        return True

    def step(self) -> None:
        """Pause, and fly to the next decision: one step of the flock."""
        self.paused = True
        every = max(1, round(self.scenario.sensors.period / self.scenario.flight.dt))
        self.fly(every - self.flight.step % every)

    def toggle(self) -> None:
        """Pause, or fly on."""
        self.paused = not self.paused

    def back(self, time: float) -> None:
        """Go back to the last moment kept up to a time, s, and wait there."""
        moment = self.moments.at(time)
        if moment is None:
            return
        self.flight.restore(moment)
        self.failure, self.note, self.paused = "", f"back at t = {self.flight.time:g} s", True
        self.changed = _changes(self.flight)

    def reset(self, seed: int | None = None, settings: Mapping[str, Any] | None = None) -> None:
        """Another flight: of the same or another seed, or with other keys, such as the number of agents."""
        known = self.seed, self.given
        self.seed = self.seed if seed is None else seed
        self.given = {**self.given, **(settings or {})}
        try:
            self._open()
        except AirflockError:
            self.seed, self.given = known
            raise
        self.note = ""

    # ------------------------------------------------------------------------------------------------- tuning

    def change(self, key: str, value: Any) -> None:
        """Set a key of the scenario from now on; what must be compiled comes into force when that is done."""
        self.flight.change({key: value}, wait=False)
        self._before.append(dict(self.changed))
        self.changed = {**self.changed, key: value}
        self.note = ""

    def undo(self) -> dict[str, Any]:
        """Take the last change back, as a further change. Returns the keys set, with their values."""
        if not self._before:
            return {}
        earlier = self._before.pop()
        return self._return_to(earlier)

    def to_preset(self) -> dict[str, Any]:
        """Set everything that was changed back to the preset. Returns the keys set, with their values."""
        self._before.append(dict(self.changed))
        return self._return_to({})

    def _return_to(self, wanted: dict[str, Any]) -> dict[str, Any]:
        keys = [key for key in self.changed if wanted.get(key) != self.changed[key]]
        values = {key: wanted[key] if key in wanted else value_of(self.preset, key) for key in keys}
        if values:
            self.flight.change(values, wait=False)
        self.changed = dict(wanted)
        return values

    def push(self, agent: int, speed: float) -> None:
        """Push an agent sideways, m/s: at a right angle to its velocity, to its left."""
        _, velocity = self.motion
        vx, vy = float(velocity[agent, 0]), float(velocity[agent, 1])
        fast = max(float(np.hypot(vx, vy)), 1e-9)
        left = [-vy / fast * speed, vx / fast * speed, 0.0] if fast > 1e-6 else [0.0, speed, 0.0]
        self.flight.push(agent, left[: self.scenario.dimensions])

    # ------------------------------------------------------------------------------------------------- saving

    @property
    def command(self) -> str:
        """The command that opens the present scenario again."""
        parts = ["airflock watch", self.where, fields({**self.given, **self.changed}), f"--seed {self.seed}"]
        return " ".join(part for part in parts if part)

    def save_toml(self, path: Path) -> Path:
        """Write the preset's file with the keys changed here, its comments and sources kept."""
        document = None if self.source is None else attributes.scenario_document(self.source)
        atomic.write(path, toml_of(self.where, {**self.given, **self.changed}, document))
        return path

    def save_recording(self, path: Path) -> Path:
        """Fly the flight again from its start with all that was done to it, and save it. Raises where bits differ."""
        return save(flown_again(self.flight), path)

    def save_replay(self, path: Path) -> Path:
        """Write the flight up to now as one HTML file that plays it."""
        return replay(flown_again(self.flight)).save(path)


def recorded(where: str) -> xr.Dataset:
    """A recording that can be flown again. Raises RecordingError for any other, and says what shows it."""
    found = load_recording(where)
    if "airflock_scenario" not in found.attrs or not int(found.attrs.get("random_start", 1)):
        raise RecordingError(f"{where}: was not flown from a scenario and a seed; airflock replay {where} shows it")
    return found


def endless(scenario: Scenario) -> Scenario:
    """The scenario with the longest duration that a flight can have."""
    longest = min(LONGEST, 0.9 * 2**31 * scenario.flight.dt)
    document = {**scenario.document, "duration": longest}
    return replace(scenario, flight=replace(scenario.flight, duration=longest), document=document)


def in_space(state: NDArray[Any], dimensions: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Positions and velocities (agent, 3) from a state (component, agent) of two or three dimensions."""
    found = np.zeros((2, state.shape[1], 3), np.float32)
    found[0, :, :dimensions], found[1, :, :dimensions] = state[:dimensions].T, state[dimensions : 2 * dimensions].T
    return found[0], found[1]


def value_of(scenario: Scenario, key: str) -> Any:
    """Value of a key such as model.p_rep."""
    section, _, name = key.partition(".")
    return getattr(scenario.parameters if section == "model" else getattr(scenario, section), name)


def _changes(flight: Flight) -> dict[str, Any]:
    """Keys that are changed at the present moment of a flight, with their values."""
    found: dict[str, Any] = {}
    for event in flight.events:
        if event.kind == "change":
            found |= event.data
    return found
