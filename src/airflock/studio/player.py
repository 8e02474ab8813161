"""Player: one or two open flights on one clock, played, tuned, pushed and taken back; it knows no page."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock import atomic
from airflock.engine import Flight
from airflock.errors import AirflockError, StudioError
from airflock.recordings.files import save
from airflock.replays import replay
from airflock.scenarios.scenario import Scenario
from airflock.studio.asked import Asked
from airflock.studio.moments import Moments
from airflock.studio.pace import Pace
from airflock.studio.saving import flown_again, toml_of
from airflock.studio.side import Origin, Side

MOST_BUSY = 0.05  # s of real time flown at most before the page is answered again


class Player:
    """One flight after another of a scenario, or of two side by side: what a page shows and what its controls do.

    `ask` may be called from any thread; everything else belongs to the thread that calls `tick`.

    where    : preset, scenario file or recording, which is flown again with its events
    settings : keys changed from outside
    seed     : of the first flight; a recording brings its own
    law      : a law that flies instead of the file's; trust : whether code that the file names may run
    against  : what is flown beside it, with the same seed and noise: another preset or file, or keys of this one
    at_once  : fly interpreted until the driver is compiled
    """

    def __init__(
        self,
        where: str,
        settings: Mapping[str, Any] | None = None,
        seed: int = 0,
        *,
        law: Any = None,
        trust: bool = False,
        against: str | Mapping[str, Any] | None = None,
        at_once: bool = False,
    ):
        first = Origin.of(where, settings, law, trust=trust)
        self.origins = [first]
        if isinstance(against, str):
            self.origins.append(Origin.of(against, settings, trust=trust))
        elif against:
            self.origins.append(replace(first, settings={**first.settings, **against}))
        self.seed = seed if first.recording is None else int(first.recording.attrs["airflock_seed"])
        self.paused, self.note, self.failure = False, "", ""
        self._at_once = at_once
        self.hand = 0  # which side the controls act on
        self._rate = 1e4  # motion steps per second, as measured
        self.fault: Callable[[str], None] = lambda line: None  # is told of everything that was refused
        self._asked = Asked()
        self._open()

    def _open(self) -> None:
        sides = [Side(origin, self.seed, self._at_once) for origin in self.origins]
        if len(sides) == 2 and sides[0].scenario.dimensions != sides[1].scenario.dimensions:
            flown = [f"{side.origin.where} in {side.scenario.dimensions}" for side in sides]
            raise StudioError(f"two flights side by side share one scene: {flown[0]} and {flown[1]} dimensions do not")
        self.sides, self.hand = sides, min(self.hand, len(sides) - 1)
        self.pace = Pace(sides[0].preset.flight.dt, getattr(self, "pace", Pace(1.0)).speed)
        self.moments, self.failure = Moments(), ""

    def start(self) -> None:
        """Place the agents; compiles what has not been compiled yet, unless an interpreted flight stands for it."""
        for side in self.sides:
            _ = side.motion

    @property
    def compiling(self) -> bool:
        """Whether interpreted flights stand for those that are being compiled."""
        return any(side.compiling for side in self.sides)

    def settle(self) -> None:
        """Go on as compiled flights, once they are compiled; of the moments to go back to the start is left."""
        if not self.compiling:
            return
        starts = [side.hand_over() for side in self.sides]
        self.moments = Moments()
        if None not in starts:
            self.moments.keep(0.0, tuple(start for start in starts if start is not None))

    # ------------------------------------------------------------------------------------------------- state

    @property
    def side(self) -> Side:
        """The side that the controls act on."""
        return self.sides[self.hand]

    @property
    def flight(self) -> Flight:
        """The flight of that side."""
        return self.side.flight

    @property
    def scenario(self) -> Scenario:
        """The scenario in force on that side."""
        return self.side.scenario

    @property
    def preset(self) -> Scenario:
        """The scenario that it started from."""
        return self.side.preset

    @property
    def changed(self) -> dict[str, Any]:
        """Keys that differ from it, with their values."""
        return self.side.changed

    @property
    def where(self) -> str:
        """What is flown, in words."""
        first, *others = self.origins
        return " | ".join([first.where, *(other.beside(first) for other in others)])

    @property
    def motion(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Positions (agent, 3) in m and velocities (agent, 3) in m/s of that side."""
        return self.side.motion

    @property
    def time(self) -> float:
        """The one clock, s."""
        return self.sides[0].flight.time

    @property
    def status(self) -> str:
        """What a page says while it waits, or why it stopped; empty while all is well."""
        if self.failure:
            return self.failure
        if self.compiling:
            return "compiling … (flying interpreted meanwhile, with other rounding)"
        return "compiling …" if any(side.flight.waiting for side in self.sides) else self.note

    # ------------------------------------------------------------------------------------------------ playing

    def ask(self, action: Callable[[], None]) -> None:
        """Do something before the next frame; from any thread."""
        self._asked.put(action)

    def wait(self, seconds: float) -> bool:
        """Wait for some seconds of real time, or until something was asked for and done. Whether it was."""
        return self._asked.rung(seconds) and self._asked.answer(self._safely)

    def tick(self, elapsed: float) -> bool:
        """Do what was asked for, then fly what is due after `elapsed` s of real time. Whether anything moved."""
        asked = self._asked.answer(self._safely)
        if self.compiling and all(side.compiled for side in self.sides):
            asked = self._settled() or asked
        if self.paused or self.failure or any(side.flight.over for side in self.sides):
            return asked
        steps = min(self.pace.due(elapsed), max(1, int(self._rate * MOST_BUSY)))
        if not steps:
            return asked
        began, moved = perf_counter(), self.fly(steps)
        self._rate = steps / max(perf_counter() - began, 1e-6)
        return moved or asked

    def _settled(self) -> bool:
        try:
            self.settle()
        except AirflockError as fault:
            self.failure = f"stopped: {fault}"
            self.fault(self.failure)
        return True

    def _safely(self, action: Callable[[], None]) -> None:
        """Do something; a fault of the user's is a note on the page and a line in the terminal, and nothing else."""
        try:
            action()
        except AirflockError as fault:
            self.note = str(fault)
            self.fault(self.note)

    def fly(self, steps: int) -> bool:
        """Fly so many steps, and keep a moment where one is due; a flight that fails stops and says why."""
        if self.moments.due(self.time):
            self.moments.keep(self.time, tuple(side.flight.snapshot() for side in self.sides))
        clock = self.sides[0]
        end = (clock.flight.step + steps) * clock.scenario.flight.dt
        try:
            for side in self.sides:
                side.fly_to(end)
        except AirflockError as fault:
            self.failure = f"stopped: {fault}"
            self.fault(self.failure)
            return False
        return True

    def step(self) -> None:
        """Pause, and fly to the next decision: one step of the flock."""
        self.paused = True
        scenario, flight = self.sides[0].scenario, self.sides[0].flight
        every = max(1, round(scenario.sensors.period / scenario.flight.dt))
        self.fly(every - flight.step % every)

    def toggle(self) -> None:
        """Pause, or fly on."""
        self.paused = not self.paused

    def back(self, time: float) -> None:
        """Go back to a time, s, and wait there; what came after it is given up. Of a failed flight, to a moment before.

        Before a fork there is one flight again.
        """
        time = min(max(time, 0.0), self.time)
        moment = self.moments.at(time)
        if moment is None:
            return
        del self.sides[len(moment) :]
        self.hand = min(self.hand, len(self.sides) - 1)
        for side, kept in zip(self.sides, moment, strict=True):
            if self.failure:
                side.restore(kept)
            else:
                side.again(kept, time)
        self.moments.forget_after(time + 1e-6)
        self.failure, self.note, self.paused = "", f"back at t = {self.time:g} s", True

    def reset(self, seed: int | None = None, settings: Mapping[str, Any] | None = None) -> None:
        """Another flight: of the same or another seed, or with other keys, such as the number of agents.

        A fork ends with its flight; two that were opened side by side begin anew.
        """
        known = self.seed, self.origins
        self.seed = self.seed if seed is None else seed
        self.origins = [replace(o, settings={**o.settings, **(settings or {})}) for o in self.origins]
        try:
            self._open()
        except AirflockError:
            self.seed, self.origins = known
            raise
        self.note = ""

    def open(self, where: str) -> None:
        """Another scenario, of the same seed: a preset, or a file whose code may not run. A comparison ends.

        Raises AirflockError, and flies on as before.
        """
        known, sides = self.origins, self.sides
        self.origins = [Origin.of(where, {})]
        try:
            self._open()
            self.start()
        except AirflockError:
            self.origins, self.sides = known, sides
            raise
        self.note = f"opened {where}"

    # ---------------------------------------------------------------------------------------------- comparing

    def fork(self) -> None:
        """Fly a second flight beside this one from here on, with the same noise, and let the controls act on it.

        A second flight that there was already ends.
        """
        self.settle()
        if len(self.sides) > 1:
            self.moments = Moments()
        self.origins, self.sides = [self.side.origin], [self.side, self.side.fork()]
        self.hand = 1
        self.note = f"forked at t = {self.time:g} s: the controls act on B"

    def join(self) -> None:
        """End the comparison: the side that the controls act on flies on alone."""
        self.origins = [self.side.origin]
        self.sides, self.hand = [self.side], 0
        self.moments, self.note = Moments(), ""

    # ------------------------------------------------------------------------------------------------- tuning

    def change(self, key: str, value: Any) -> None:
        """Set a key of the scenario from now on; what must be compiled comes into force when that is done."""
        self.side.change({key: value})
        self.note = ""

    # -------------------------------------------------------------------------------------------------- acting

    def push(self, agent: int, speed: float, side: int = 0) -> None:
        """Push an agent of a side sideways, m/s: at a right angle to its velocity, to its left."""
        pushed = self.sides[side]
        _, velocity = pushed.motion
        vx, vy = float(velocity[agent, 0]), float(velocity[agent, 1])
        fast = max(float(np.hypot(vx, vy)), 1e-9)
        left = [-vy / fast * speed, vx / fast * speed, 0.0] if fast > 1e-6 else [0.0, speed, 0.0]
        pushed.flight.push(agent, left[: pushed.scenario.dimensions])

    def gust(self, east: float, north: float, seconds: float) -> None:
        """Let the wind blow stronger by so much (m/s) for some seconds, on all sides."""
        for side in self.sides:
            side.gust(east, north, seconds)

    def throw(self, x: float, y: float, width: float) -> None:
        """Throw a square obstacle of a width, m, into the worlds of all sides; refused where an agent is."""
        for name, side in zip("AB", self.sides, strict=False):
            side.clear_of(x, y, width, name if len(self.sides) > 1 else "")
        for side in self.sides:
            side.throw(x, y, width)

    def move_goal(self, number: int, place: Sequence[float]) -> None:
        """Put a goal somewhere else, m, on all sides that have it."""
        for side in self.sides:
            side.move_goal(number, place)

    # ------------------------------------------------------------------------------------------------- saving

    @property
    def command(self) -> str:
        """The command that opens the present scenario again."""
        return self.side.command(self.seed)

    def save_toml(self, path: Path) -> Path:
        """Write the preset's file with the keys changed here, its comments and sources kept."""
        origin = self.side.origin
        atomic.write(path, toml_of(origin.where, self.side.settings, origin.document))
        return path

    def save_recording(self, path: Path) -> Path:
        """Fly the flight again from its start with all that was done to it, and save it. Raises where bits differ."""
        self.settle()
        return save(flown_again(self.flight), path)

    def save_replay(self, path: Path) -> Path:
        """Write the flight up to now as one HTML file that plays it."""
        self.settle()
        return replay(flown_again(self.flight)).save(path)
