"""Player: flights on one clock, played, stopped and taken back; independent of any page."""

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine import Flight, Snapshot
from airflock.recordings import save
from airflock.scenarios import Scenario, user_error_line
from airflock.studio.flight_pane import FlightPane, FlightSource, refly, tuned_toml
from airflock.support import AirflockError, StudioError, atomic, describe_error, os_error_message
from airflock.view import replay

MAX_CATCH_UP = 0.25  # s of real time that are given up at most, rather than flown in one leap


class PageClock:
    """Steps that are due, at a speed in flight seconds per second.

    dt    : motion step of the flight, s
    speed : times real time
    """

    def __init__(self, dt: float, speed: float = 1.0):
        self.dt, self.speed, self._owed_steps = dt, speed, 0.0

    def due(self, elapsed: float) -> int:
        """Return the whole steps due after `elapsed` s of real time; the rest is added to the next call.

        Of a page that was held up for longer than a quarter of a second only so much is caught up.
        """
        self._owed_steps += min(max(elapsed, 0.0), MAX_CATCH_UP) * self.speed / self.dt
        steps = int(self._owed_steps + 1e-9)
        self._owed_steps -= steps
        return steps


class ActionQueue:
    """Queue of actions: the flying thread waits for the next frame or the next action, whichever comes first."""

    def __init__(self) -> None:
        self._actions: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self.put = self._actions.put  # from any thread

    def answer(self, run: Callable[[Callable[[], None]], None], seconds: float = 0.0) -> bool:
        """Wait some seconds of real time, or until an action is queued; run all. Return True if there was any."""
        done = False
        try:
            action = self._actions.get(seconds > 0.0, seconds or None)
            while True:
                done = True
                run(action)
                action = self._actions.get_nowait()
        except Empty:
            return done


MAX_BYTES = 256 * 2**20  # bytes of all moments together
MAX_SNAPSHOTS = 400  # moments at most


class KeptSnapshots:
    """Snapshots in the order of their time; when there are too many, every second one is dropped.

    every : flight seconds between two of them; doubles whenever they are thinned
    """

    def __init__(self, every: float = 2.0):
        self.interval = every
        self._kept: list[tuple[Snapshot, ...]] = []
        self._times: list[float] = []

    def __len__(self) -> int:
        return len(self._kept)

    def due(self, time: float) -> bool:
        """Return True if a snapshot should be kept at this time, s."""
        return not self._times or time >= self._times[-1] + self.interval - 1e-9

    def keep(self, time: float, snapshots: tuple[Snapshot, ...]) -> None:
        """Keep the snapshots of a time, s, one a flight, and drop later ones: their past no longer exists."""
        self.forget_after(time)
        self._kept.append(snapshots)
        self._times.append(time)
        if len(self._kept) > MAX_SNAPSHOTS or sum(len(s.bytes) for moment in self._kept for s in moment) > MAX_BYTES:
            self._kept, self._times = self._kept[::2], self._times[::2]
            self.interval *= 2.0

    def forget_after(self, time: float) -> None:
        """Drop all moments at or after a time, s."""
        count = bisect_right(self._times, time - 1e-9)
        del self._kept[count:], self._times[count:]

    def at(self, time: float) -> tuple[Snapshot, ...] | None:
        """Return the last snapshots up to a time, s; the first of all if there are none before."""
        if not self._kept:
            return None
        return self._kept[max(bisect_right(self._times, time + 1e-9) - 1, 0)]


@dataclass(frozen=True)
class FlightRequest:
    """Request of a page: which flights it shows.

    where    : preset, scenario file or recording, which is flown again with its events
    settings : keys changed from outside
    seed     : of the first flight; a recording brings its own
    law      : a law that flies instead of the file's; trust : whether code that the file names may
               run
    against  : what is flown beside it, with the same seed and noise: another preset or file, or
               keys of this one
    at_once  : fly interpreted until the driver is compiled
    """

    where: str
    settings: Mapping[str, Any] | None = None
    seed: int = 0
    law: Any = None
    trust: bool = False
    compared_with: str | Mapping[str, Any] | None = None
    interpret_first: bool = False

    def sources(self) -> list[FlightSource]:
        """Return the sources of one or two flights; raises RecordingError for a recording that cannot be flown
        again.
        """
        first = FlightSource.of(self.where, self.settings, self.law, trust=self.trust)
        if isinstance(self.compared_with, str):
            return [first, FlightSource.of(self.compared_with, self.settings, trust=self.trust)]
        return (
            [first, replace(first, settings={**first.settings, **self.compared_with})]
            if self.compared_with
            else [first]
        )


MAX_BUSY_SECONDS = 0.05  # s of real time flown at most before the page is answered again


class Player:
    """Flights that are played, one or two side by side: the model behind a page and its controls.

    `ask` may be called from any thread; everything else belongs to the thread that calls `tick`.

    Attributes: sources, where the flights come from; sides, as they fly; hand, which of them the
    controls act on; note, what was done last, for the page; fault, called with everything that was
    refused; clock, how fast they fly; snapshots, to go back to; is_paused; failure_message, why
    they stopped, or nothing.
    """

    def __init__(self, request: FlightRequest):
        self.sources = request.sources()
        recording = self.sources[0].recording
        self.seed = request.seed if recording is None else int(recording.attrs["airflock_seed"])
        self.hand, self.note = 0, ""
        self.fault: Callable[[str], None] = lambda line: None
        self._interpret_first = request.interpret_first
        self.clock, self.is_paused = PageClock(1.0), False
        self._steps_per_second = 1e4  # motion steps per second, as measured
        self._asked = ActionQueue()
        self._open()

    def _open(self, place_agents: bool = False) -> None:
        """Begin the flights of all sources, with agents placed if asked. Raises AirflockError, and changes nothing."""
        sides = [FlightPane(origin, self.seed, self._interpret_first) for origin in self.sources]
        if len(sides) == 2 and sides[0].scenario.dimensions != sides[1].scenario.dimensions:
            flown = [f"{side.origin.where} in {side.scenario.dimensions}" for side in sides]
            raise StudioError(f"two flights side by side share one scene: {flown[0]} and {flown[1]} dimensions do not")
        for side in sides if place_agents else ():
            _ = side.motion
        self.sides, self.hand = sides, min(self.hand, len(sides) - 1)
        self.clock = PageClock(self.preset.flight.dt, self.clock.speed)
        self.snapshots, self.failure_message = KeptSnapshots(), ""

    def start(self) -> None:
        """Place the agents; compiles what has not been compiled yet, unless an interpreted flight stands for it."""
        for side in self.sides:
            _ = side.motion

    @property
    def is_compiling(self) -> bool:
        """True while interpreted flights stand for those that are being compiled."""
        return any(side.is_compiling for side in self.sides)

    def switch_to_compiled(self) -> None:
        """Replace flights by compiled ones, once ready; of the snapshots only the start is kept."""
        if not self.is_compiling:
            return
        starts = [side.switch_to_compiled() for side in self.sides]
        self.snapshots = KeptSnapshots()
        if None not in starts:
            self.snapshots.keep(0.0, tuple(start for start in starts if start is not None))

    @property
    def time(self) -> float:
        """Time of all flights, s."""
        return self.sides[0].flight.time

    @property
    def side(self) -> FlightPane:
        """Active pane: the one that the controls act on."""
        return self.sides[self.hand]

    @property
    def flight(self) -> Flight:
        """Flight of the active pane."""
        return self.side.flight

    @property
    def scenario(self) -> Scenario:
        """Scenario in force on the active pane."""
        return self.side.scenario

    @property
    def preset(self) -> Scenario:
        """Scenario from which the active pane started."""
        return self.side.preset

    @property
    def changed(self) -> dict[str, Any]:
        """Keys that differ from it, with their values."""
        return self.side.changed

    @property
    def where(self) -> str:
        """Name of what flies."""
        first, *others = self.sources
        return " | ".join([first.where, *(other.beside(first) for other in others)])

    @property
    def motion(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return positions (agent, 3) in m and velocities (agent, 3) in m/s of the active pane."""
        return self.side.motion

    def reset(self, seed: int | None = None, settings: Mapping[str, Any] | None = None) -> None:
        """Begin another flight: of the same or another seed, or with other keys, such as the number of agents.

        A fork ends with its flight; two that were opened side by side begin again.
        """
        known = self.seed, self.sources
        self.seed = self.seed if seed is None else seed
        self.sources = [replace(o, settings={**o.settings, **(settings or {})}) for o in self.sources]
        try:
            self._open()
        except Exception:
            self.seed, self.sources = known
            raise
        self.note = ""

    def open(self, name: str) -> None:
        """Open another scenario with the same seed: a preset, or a file whose code may not run. A comparison ends.

        Raises AirflockError, and flies on as before.
        """
        known = self.sources
        self.sources = [FlightSource.of(name, {})]
        try:
            self._open(place_agents=True)
        except Exception:
            self.sources = known
            raise
        self.note = f"opened {name}"

    def fork(self) -> None:
        """Fly a second flight beside this one from here on, with the same noise, and let the controls act on it.

        A second flight that there was already ends, and with it the snapshots of both together.
        """
        self.switch_to_compiled()
        self.snapshots = KeptSnapshots() if len(self.sides) > 1 else self.snapshots
        self.sources, self.sides = [self.side.origin], [self.side, self.side.fork()]
        self.hand = 1
        self.note = f"forked at t = {self.time:g} s: the controls act on B"

    def join(self) -> None:
        """End the comparison: the side that the controls act on flies on alone, and goes back no further than here."""
        self.sources = [self.side.origin]
        self.sides, self.hand = [self.side], 0
        self.snapshots = KeptSnapshots()
        self.note = ""

    def change(self, key: str, value: Any) -> None:
        """Set a key of the scenario from now on; what must be compiled comes into force when that is done."""
        self.side.change({key: value})
        self.note = ""

    def push(self, agent: int, speed: float, pane: int = 0) -> None:
        """Push an agent of a side sideways, m/s: at a right angle to its velocity, to its left."""
        pushed = self.sides[pane]
        _, velocity = pushed.motion
        vx, vy = float(velocity[agent, 0]), float(velocity[agent, 1])
        fast = max(float(np.hypot(vx, vy)), 1e-9)
        left = [-vy / fast * speed, vx / fast * speed, 0.0] if fast > 1e-6 else [0.0, speed, 0.0]
        pushed.flight.push(agent, left[: pushed.scenario.dimensions])

    def gust(self, east: float, north: float, seconds: float) -> None:
        """Let the wind blow stronger by so much (m/s) for some seconds, on all sides."""
        for side in self.sides:
            side.gust(east, north, seconds)

    def throw_obstacle(self, x: float, y: float, width: float) -> None:
        """Throw a square obstacle of a width, m, into the worlds of all sides; refused where an agent is."""
        for name, side in zip("AB", self.sides, strict=False):
            side.check_free(x, y, width, name if len(self.sides) > 1 else "")
        for side in self.sides:
            side.throw_obstacle(x, y, width)

    def move_goal(self, number: int, position: Sequence[float]) -> None:
        """Put a goal somewhere else, m, on all sides that have it."""
        for side in self.sides:
            side.move_goal(number, position)

    @property
    def command(self) -> str:
        """Command that opens the present scenario again."""
        return self.side.command(self.seed)

    def save_toml(self, path: Path) -> Path:
        """Write the preset's file with the keys changed here, its comments and sources kept."""
        origin = self.side.origin
        atomic.write_file(
            path, tuned_toml(origin.where, self.side.settings, origin.document, self.side.preset.document)
        )
        return path

    def save_recording(self, path: Path) -> Path:
        """Fly the flight again from its start with all that was done to it, and save it. Raises where bits differ."""
        self.switch_to_compiled()
        return save(refly(self.flight), path)

    def save_replay(self, path: Path) -> Path:
        """Write the flight up to now as one HTML file that plays it."""
        self.switch_to_compiled()
        return replay(refly(self.flight)).save(path)

    @property
    def status(self) -> str:
        """Message while the page waits, or the reason why it stopped; empty otherwise."""
        if self.failure_message:
            return self.failure_message
        if self.is_compiling:
            return "compiling … (meanwhile flying interpreted, with different rounding)"
        if self.over:
            return f"a page flies at most {self.time:g} s; Reset starts again"
        return "compiling …" if any(side.flight.waiting for side in self.sides) else self.note

    @property
    def over(self) -> bool:
        """True once the longest time that a page flies has been reached."""
        return any(side.flight.over for side in self.sides)

    def ask(self, action: Callable[[], None]) -> None:
        """Queue an action for the next frame; from any thread."""
        # Actions wait for the next frame: no callback of the page touches the flight from its own
        # thread.
        self._asked.put(action)

    def run_actions_within(self, seconds: float) -> bool:
        """Wait some seconds of real time, or until an action ran. Return True if one ran."""
        return self._asked.answer(self._safely, seconds)

    def tick(self, elapsed: float) -> bool:
        """Run queued actions, then fly the steps due after `elapsed` s of real time. Return True if anything
        moved.
        """
        acted = self._asked.answer(self._safely)
        if self.is_compiling and all(side.is_compiled for side in self.sides):
            acted = self._settled() or acted
        if self.is_paused or self.failure_message or self.over:
            return acted
        # A slow flight must not freeze the page: at most the steps that fit into one busy interval,
        # as measured.
        steps = min(self.clock.due(elapsed), max(1, int(self._steps_per_second * MAX_BUSY_SECONDS)))
        if not steps:
            return acted
        began, moved = perf_counter(), self.fly(steps)
        self._steps_per_second = steps / max(perf_counter() - began, 1e-6)
        return moved or acted

    def _settled(self) -> bool:
        try:
            self.switch_to_compiled()
        except AirflockError as error:
            self.failure_message = f"stopped: {error}"
            self.fault(self.failure_message)
        return True

    def _safely(self, action: Callable[[], None]) -> None:
        """Run an action; an error becomes a note on the page and a line in the terminal, and the flight goes on."""
        try:
            action()
        except AirflockError as error:
            self._report_error(str(error))
        except OSError as error:  # a full disk, a folder that is gone
            self._report_error(": ".join(part for part in (error.filename, os_error_message(error)) if part))
        except Exception as error:  # the last resort: somebody's flight must not be lost to one press of a button
            self._report_error(f"unexpected {describe_error(error)}; please report it")

    def _report_error(self, line: str) -> None:
        self.note = line
        self.fault(line)

    def fly(self, steps: int) -> bool:
        """Fly so many steps, and keep a snapshot where one is due; a flight that fails stops with its reason."""
        if self.snapshots.due(self.time):
            self.snapshots.keep(self.time, tuple(side.flight.snapshot() for side in self.sides))
        clock = self.sides[0]
        end = (clock.flight.step + steps) * clock.scenario.flight.dt
        try:
            for side in self.sides:
                side.fly_to(end)
        except Exception as error:  # a rule of the user's own may raise anything, until it is compiled
            message = str(error) if isinstance(error, AirflockError) else user_error_line(error)
            if not message:
                raise
            self.failure_message = f"stopped: {message}"
            self.fault(self.failure_message)
            return False
        return True

    def step(self) -> None:
        """Pause, and fly to the next decision: one step of the flock."""
        self.is_paused = True
        scenario, flight = self.sides[0].scenario, self.sides[0].flight
        # A decision takes several motion steps; up to the next one is what a reader calls one step.
        every = max(1, round(scenario.sensors.period / scenario.flight.dt))
        self.fly(every - flight.step % every)

    def toggle_pause(self) -> None:
        """Pause, or fly on."""
        self.is_paused = not self.is_paused

    def go_back(self, time: float) -> None:
        """Go back to a time, s, and wait there; what came after it is given up. Of a failed flight, to a moment before.

        Before a fork there is one flight again.
        """
        time = min(max(time, 0.0), self.time)
        moment = self.snapshots.at(time)
        if moment is None:
            self.note = "no earlier moment is kept"
            return
        # A snapshot from before a fork holds one flight; the second one did not exist then.
        del self.sides[len(moment) :]
        self.hand = min(self.hand, len(self.sides) - 1)
        failed = self.failure_message
        for side, kept in zip(self.sides, moment, strict=True):
            if failed:
                side.restore(kept)
            else:
                side.again(kept, time)
        self.snapshots.forget_after(time + 1e-6)
        least = "; no earlier moment is kept" if self.time > time + 1e-6 and not failed else ""
        self.failure_message, self.note, self.is_paused = "", f"back at t = {self.time:g} s{least}", True
