"""Flights: what a page flies, one flight or two side by side; what a hand does to them and what is saved of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine import Flight, Snapshot
from airflock.recordings import save
from airflock.scenarios import Scenario
from airflock.studio.origin import FlightSource
from airflock.studio.saving import refly, tuned_toml
from airflock.studio.side import FlightPane
from airflock.support import StudioError, atomic
from airflock.view import replay


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
    compared_with: str | Mapping[str, Any] | None = None
    interpret_first: bool = False

    def sources(self) -> list[FlightSource]:
        """Where the flights come from, one or two; raises RecordingError for a recording that cannot be flown again."""
        first = FlightSource.of(self.where, self.settings, self.law, trust=self.trust)
        if isinstance(self.compared_with, str):
            return [first, FlightSource.of(self.compared_with, self.settings, trust=self.trust)]
        return (
            [first, replace(first, settings={**first.settings, **self.compared_with})]
            if self.compared_with
            else [first]
        )


class ComparedFlights:
    """One flight of a scenario, or two side by side. They know no clock: `Player` flies them.

    Attributes: origins, where they come from; sides, as they fly; hand, which of them the controls act on; note, what
    was done last, for the page; fault, called with everything that was refused.
    """

    def __init__(self, request: FlightRequest):
        self.sources = request.sources()
        recording = self.sources[0].recording
        self.seed = request.seed if recording is None else int(recording.attrs["airflock_seed"])
        self.hand, self.note = 0, ""
        self.fault: Callable[[str], None] = lambda line: None
        self._interpret_first = request.interpret_first
        self._open()

    def _open(self, place_agents: bool = False) -> None:
        """Begin the flights of all origins, agents placed if `start`. Raises AirflockError, and changes nothing."""
        sides = [FlightPane(origin, self.seed, self._interpret_first) for origin in self.sources]
        if len(sides) == 2 and sides[0].scenario.dimensions != sides[1].scenario.dimensions:
            flown = [f"{side.origin.where} in {side.scenario.dimensions}" for side in sides]
            raise StudioError(f"two flights side by side share one scene: {flown[0]} and {flown[1]} dimensions do not")
        for side in sides if place_agents else ():
            _ = side.motion
        self.sides, self.hand = sides, min(self.hand, len(sides) - 1)

    def start(self) -> None:
        """Place the agents; compiles what has not been compiled yet, unless an interpreted flight stands for it."""
        for side in self.sides:
            _ = side.motion

    @property
    def is_compiling(self) -> bool:
        """Whether interpreted flights stand for those that are being compiled."""
        return any(side.is_compiling for side in self.sides)

    def switch_to_compiled(self) -> list[Snapshot | None]:
        """Go on as compiled flights, once they are compiled: their starts; None for those that are compiled already."""
        return [side.switch_to_compiled() for side in self.sides]

    @property
    def time(self) -> float:
        """The one clock, s."""
        return self.sides[0].flight.time

    @property
    def side(self) -> FlightPane:
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
        first, *others = self.sources
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
        """Another scenario, of the same seed: a preset, or a file whose code may not run. A comparison ends.

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

    # ---------------------------------------------------------------------------------------------- comparing

    def fork(self) -> None:
        """Fly a second flight beside this one from here on, with the same noise, and let the controls act on it.

        A second flight that there was already ends.
        """
        self.switch_to_compiled()
        self.sources, self.sides = [self.side.origin], [self.side, self.side.fork()]
        self.hand = 1
        self.note = f"forked at t = {self.time:g} s: the controls act on B"

    def join(self) -> None:
        """End the comparison: the side that the controls act on flies on alone."""
        self.sources = [self.side.origin]
        self.sides, self.hand = [self.side], 0
        self.note = ""

    # ------------------------------------------------------------------------------------------------- acting

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

    # ------------------------------------------------------------------------------------------------- saving

    @property
    def command(self) -> str:
        """The command that opens the present scenario again."""
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
