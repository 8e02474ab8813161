"""A show: drones fly from shape to shape; a master assigns points, again when drones fail or are pushed away."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.display.assignment import assign, better
from airflock.engine import Flight
from airflock.errors import AirflockError
from airflock.recordings.flights import recording_of as recorded
from airflock.scenarios.change import remade
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario

FILE = Path(__file__).parent / "display.toml"
FAILURES = ("fall", "hover", "both")
NEAR = 1.0  # m; a drone is placed within
GRAVITY = 9.81  # m/s²
CHECK = 5.0  # s; how often the master looks once all should be there
PATIENCE = 60.0  # s; how long it waits for a shape at most
HALF = 0.35  # m; half side of the box that stands for a drone that hovers
CLEAR = 1.6  # m; a point nearer than this to a drone that hovers is given to nobody

Frames = NDArray[np.float64]


@dataclass
class Formed:
    """How one shape was formed.

    time     : until every surviving drone was within 1 m of its point, s; nan if never
    error, worst : mean and largest distance of a surviving drone from its point at the end, m
    drones   : surviving; collisions : of two drones; struck : by one that falls; hulls : with one that hovers
    reassigned : how often points were given anew
    """

    time: float
    error: float
    worst: float
    drones: int
    collisions: int
    struck: int
    hulls: int
    reassigned: int


@dataclass
class Show:
    """What was flown: each shape's figures; frames (time, 6, drone; nan once failed), the time between them, s, and the
    last frame of each shape; the scenario, the seed, and the flight, which is one from the first shape to the last.
    """

    formed: list[Formed]
    frames: Frames
    period: float
    ends: list[int]
    scenario: Scenario
    seed: int
    flight: Flight


def recording_of(show: Show) -> xr.Dataset:
    """A show as a recording with its events; drones that failed are missing from then on."""
    return recorded(show.flight)


def scenario_of(drones: int, settings: dict[str, Any] | None = None) -> Scenario:
    """Scenario of a display, with keys changed."""
    there = [[3.0 * i, 0.0, 10.0] for i in range(drones)]
    return load(FILE, {"agents": drones, "goals.points": there, **(settings or {})})


def ranks(count: int, spacing: float = 3.0, height: float = 10.0) -> Frames:
    """Where drones wait before the first shape: points (count, 3) of a level square, m."""
    side = int(np.ceil(np.sqrt(count)))
    number = np.arange(count)
    x, y = (number % side - 0.5 * (side - 1)) * spacing, (number // side - 0.5 * (side - 1)) * spacing
    return np.column_stack([x, y, np.full(count, height)])


def fly_show(
    shapes: list[NDArray[np.float64]],
    drones: int,
    failing: float = 0.0,
    failure: str = "both",
    seed: int = 0,
    settings: dict[str, Any] | None = None,
) -> Show:
    """Fly a display and measure it.

    shapes  : points (point, 3) of each, m; failing : share of the drones that fail on the way, evenly over the shapes
    failure : "fall" out of the sky, "hover" where it is and hear nothing more, or "both" in turns
    settings : keys of the scenario, for instance {"wind.gust": 2.0}

    Raises AirflockError where a shape has fewer points than there are drones.
    """
    if failure not in FAILURES:
        raise AirflockError(f"failure = {failure!r} is none of {', '.join(FAILURES)}")
    if not 0.0 <= failing < 1.0:
        raise AirflockError(f"failing = {failing:g} lies outside [0, 1)")
    for number, points in enumerate(shapes):
        if len(points) < drones:
            raise AirflockError(f"shape {number + 1} has {len(points)} points, fewer than {drones} drones")
    rng = np.random.default_rng([seed, 3])
    doomed = rng.permutation(drones)[: round(failing * drones)]
    legs = np.array_split(doomed, len(shapes))
    kinds = {int(who): FAILURES[i % 2] if failure == "both" else failure for i, who in enumerate(doomed)}
    show = _Master(scenario_of(drones, settings), shapes[0], drones, seed, comes_and_goes=bool(len(doomed)))
    ends = []
    for points, failures in zip(shapes, legs, strict=True):
        show.form(points, [(int(who), kinds[int(who)], float(rng.uniform())) for who in failures])
        ends.append(round(show.flight.time / show.period))
    return Show(show.closed(), show.flight.frames[:, :6], show.period, ends, show.scenario, seed, show.flight)


class _Master:
    """Who gives the drones their points, and sees what becomes of them.

    flight  : of all drones, from the first shape to the last
    target  : of each drone the number of its point, also of those that have failed
    hulls   : places of those that hover; falling : position and velocity (6,) of those that fall
    """

    def __init__(self, scenario: Scenario, points: Frames, drones: int, seed: int, *, comes_and_goes: bool):
        self.scenario, self.period, self.points = scenario, scenario.metrics.period, points
        self.target = assign(ranks(drones), points, np.zeros(len(points), bool))
        self.hulls: list[NDArray[np.float64]] = []
        self.falling: list[NDArray[np.float64]] = []
        self.formed: list[Formed] = []
        self.marks: list[int] = []  # how many windows of scores had been closed when a shape was begun
        start = np.zeros((6, drones))
        start[:3] = ranks(drones).T
        keys: dict[str, Any] = {"goals.points": self._aims(), "duration": PATIENCE}
        if comes_and_goes:  # one driver for the whole show
            keys["faults"] = [*scenario.document.get("faults", ()), {"kind": "fails", "per_hour": 0.0}]
        self.flight = Flight(remade(scenario, keys), seed, precision=64, record=True, start=start)

    def form(self, points: Frames, failures: list[tuple[int, str, float]]) -> None:
        """Fly until the shape stands; failures: who, how, and when as a share of the way."""
        self.points, self.begun, self.placed = points, self.flight.time, float("nan")
        self.struck = self.reassigned = 0
        if self.formed:
            self._assign(first=True)
        self.marks.append(len(self.flight.windows))
        planned = self._under_way()
        for who, how, share in sorted(failures, key=lambda f: f[2]):
            self._fly(max(share * planned - (self.flight.time - self.begun), 0.0))
            self._fail(who, how)
        self._fly(max(self._under_way(), 1.0))
        until = self.flight.time + PATIENCE
        while self.flight.time < until and not self._stands():
            self._fly(self._under_way() + CHECK if self._assign() else CHECK)
        far = self._distances()
        self.formed.append(
            Formed(self.placed, float(far.mean()), float(far.max()), len(far), 0, self.struck, 0, self.reassigned)
        )

    def closed(self) -> list[Formed]:
        """End the flight with its last sample; the figures of all shapes, with the collisions of their windows."""
        self.flight.change({"duration": self.flight.time})
        scores = [window.scores for window in self.flight.windows] + [self.flight.finish()]
        for formed, first, last in zip(self.formed, self.marks, [*self.marks[1:], len(scores)], strict=True):
            formed.collisions = int(sum(found["n_coll"] for found in scores[first:last]))
            formed.hulls = int(sum(found["n_env_coll"] for found in scores[first:last]))
        return self.formed

    def _assign(self, *, first: bool = False, failed: bool = False) -> bool:
        """Give points anew where that saves way; whether it did. What stands in the way is told in any case."""
        there, blocked = self.flight.present, np.zeros(len(self.points), bool)
        for hull in self.hulls:
            blocked |= np.linalg.norm(self.points - hull, axis=1) < CLEAR
        places = self.flight.state[:3, there].T
        found = assign(places, self.points, blocked)
        anew = first or bool(blocked[self.target[there]].any())
        anew = anew or better(places, self.points, self.target[there], found)
        if anew:
            self.reassigned += 0 if first else 1
            self.target[there] = found
        self.target[~there] = self.target[there][0]  # who has failed goes nowhere: any point that is free will do
        if anew or failed:
            boxes = [[*(hull - HALF), *(hull + HALF), 0.0] for hull in self.hulls]
            self.flight.change({"goals.points": self._aims(), "scene.boxes": boxes})
        return anew

    def _aims(self) -> list[list[float]]:
        """The point of each drone."""
        return [list(map(float, self.points[k])) for k in self.target]

    def _under_way(self) -> float:
        """How long all are under way to their points, s."""
        return 1.5 * float(self._distances().max()) / self.scenario.goals.speed + 4.0

    def _distances(self) -> Frames:
        there = self.flight.present
        away = self.flight.state[:3, there].T - self.points[self.target[there]]
        return np.asarray(np.linalg.norm(away, axis=1))

    def _stands(self) -> bool:
        return bool(self._distances().max() <= NEAR)

    def _fail(self, who: int, how: str) -> None:
        """Take one drone out of the flock: it falls, or stands in the way; the others get points anew."""
        state = self.flight.state[:, who].copy()
        self.flight.remove(who, f"fails: {how}")
        if how == "hover":
            self.hulls.append(state[:3])
        else:
            self.falling.append(state)
        self._assign(failed=how == "hover")

    def _fly(self, seconds: float) -> None:
        """Fly for a while, and look at each sample."""
        flight = self.flight
        samples = round(seconds / self.period)
        if flight.time + samples * self.period > flight.scenario.flight.duration:
            flight.change({"duration": flight.time + samples * self.period + PATIENCE})
        for _ in range(samples):
            flight.advance(self.period)
            self._drop(flight.state[:3, flight.present])
            if not self._stands():
                self.placed = float("nan")
            elif np.isnan(self.placed):
                self.placed = flight.time - self.begun

    def _drop(self, places: Frames) -> None:
        """Let fall who falls, and count whom it strikes; places (3, drone) of those that fly."""
        reach, left = self.scenario.metrics.r_coll, []
        for body in self.falling:
            touching = np.zeros(places.shape[1], bool)
            for _ in range(10):  # a fall of 10 m/s takes 10 cm in a tenth of a frame
                body[5] -= GRAVITY * 0.1 * self.period
                body[:3] += 0.1 * self.period * body[3:]
                near = np.linalg.norm(places.T - body[:3], axis=1) < reach
                self.struck += int((near & ~touching).sum())
                touching = near
            if body[2] > 0.0:
                left.append(body)
        self.falling = left
