"""Flights: what a page flies, one flight or two side by side; what a hand does to them and what is saved of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine import Flight, Snapshot
from airflock.recordings.files import save
from airflock.scenarios.scenario import Scenario
from airflock.studio.origin import Origin
from airflock.studio.saving import flown_again, toml_of
from airflock.studio.side import Side
from airflock.support import atomic
from airflock.support.errors import StudioError
from airflock.view.replays import replay


@dataclass(frozen=True)
class FlightRequest:
    """What a page is to fly.

    where    : preset, scenario file or recording, which is flown again with its events
    settings : keys changed from outside
    seed     : of the first flight; a recording brings its own
    law      : a law that flies instead of the file's; trust : whether code that the file names may run
    against  : what is flown beside it, with the same seed and noise: another preset or file, or keys of this one
    at_once  : fly interpreted until the driver is compiled
    """

    where: str
    settings: Mapping[str, Any] | None = None
    seed: int = 0
    law: Any = None
    trust: bool = False
    against: str | Mapping[str, Any] | None = None
    at_once: bool = False

    def origins(self) -> list[Origin]:
        """Where the flights come from, one or two; raises RecordingError for a recording that cannot be flown again."""
        first = Origin.of(self.where, self.settings, self.law, trust=self.trust)
        if isinstance(self.against, str):
            return [first, Origin.of(self.against, self.settings, trust=self.trust)]
        return [first, replace(first, settings={**first.settings, **self.against})] if self.against else [first]


class Flights:
    """One flight of a scenario, or two side by side. They know no clock: `Player` flies them.

    Attributes: origins, where they come from; sides, as they fly; hand, which of them the controls act on; note, what
    was done last, for the page; fault, called with everything that was refused.
    """

    def __init__(self, request: FlightRequest):
        self.origins = request.origins()
        recording = self.origins[0].recording
        self.seed = request.seed if recording is None else int(recording.attrs["airflock_seed"])
        self.hand, self.note = 0, ""
        self.fault: Callable[[str], None] = lambda line: None
        self._at_once = request.at_once
        self._open()

    def _open(self, start: bool = False) -> None:
        """Begin the flights of all origins, agents placed if `start`. Raises AirflockError, and changes nothing."""
        sides = [Side(origin, self.seed, self._at_once) for origin in self.origins]
        if len(sides) == 2 and sides[0].scenario.dimensions != sides[1].scenario.dimensions:
            flown = [f"{side.origin.where} in {side.scenario.dimensions}" for side in sides]
            raise StudioError(f"two flights side by side share one scene: {flown[0]} and {flown[1]} dimensions do not")
        for side in sides if start else ():
            _ = side.motion
        self.sides, self.hand = sides, min(self.hand, len(sides) - 1)

    def start(self) -> None:
        """Place the agents; compiles what has not been compiled yet, unless an interpreted flight stands for it."""
        for side in self.sides:
            _ = side.motion

    @property
    def compiling(self) -> bool:
        """Whether interpreted flights stand for those that are being compiled."""
        return any(side.compiling for side in self.sides)

    def settle(self) -> list[Snapshot | None]:
        """Go on as compiled flights, once they are compiled: their starts; None for those that are compiled already."""
        return [side.hand_over() for side in self.sides]

    @property
    def time(self) -> float:
        """The one clock, s."""
        return self.sides[0].flight.time

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

    # ---------------------------------------------------------------------------------------------- beginning

    def reset(self, seed: int | None = None, settings: Mapping[str, Any] | None = None) -> None:
        """Another flight: of the same or another seed, or with other keys, such as the number of agents.

        A fork ends with its flight; two that were opened side by side begin anew.
        """
        known = self.seed, self.origins
        self.seed = self.seed if seed is None else seed
        self.origins = [replace(o, settings={**o.settings, **(settings or {})}) for o in self.origins]
        try:
            self._open()
        except Exception:
            self.seed, self.origins = known
            raise
        self.note = ""

    def open(self, where: str) -> None:
        """Another scenario, of the same seed: a preset, or a file whose code may not run. A comparison ends.

        Raises AirflockError, and flies on as before.
        """
        known = self.origins
        self.origins = [Origin.of(where, {})]
        try:
            self._open(start=True)
        except Exception:
            self.origins = known
            raise
        self.note = f"opened {where}"

    # ---------------------------------------------------------------------------------------------- comparing

    def fork(self) -> None:
        """Fly a second flight beside this one from here on, with the same noise, and let the controls act on it.

        A second flight that there was already ends.
        """
        self.settle()
        self.origins, self.sides = [self.side.origin], [self.side, self.side.fork()]
        self.hand = 1
        self.note = f"forked at t = {self.time:g} s: the controls act on B"

    def join(self) -> None:
        """End the comparison: the side that the controls act on flies on alone."""
        self.origins = [self.side.origin]
        self.sides, self.hand = [self.side], 0
        self.note = ""

    # ------------------------------------------------------------------------------------------------- acting

    def change(self, key: str, value: Any) -> None:
        """Set a key of the scenario from now on; what must be compiled comes into force when that is done."""
        self.side.change({key: value})
        self.note = ""

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
        atomic.write(path, toml_of(origin.where, self.side.settings, origin.document, self.side.preset.document))
        return path

    def save_recording(self, path: Path) -> Path:
        """Fly the flight again from its start with all that was done to it, and save it. Raises where bits differ."""
        self.settle()
        return save(flown_again(self.flight), path)

    def save_replay(self, path: Path) -> Path:
        """Write the flight up to now as one HTML file that plays it."""
        self.settle()
        return replay(flown_again(self.flight)).save(path)
