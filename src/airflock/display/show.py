"""A show: drones fly from shape to shape; a master assigns points, again when drones fail or are pushed away."""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.core import random
from airflock.display.assignment import assign, better
from airflock.engine import fly
from airflock.errors import AirflockError
from airflock.recordings.flights import plain
from airflock.recordings.layout import dataset
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
class Drones:
    """Those in the air: numbers, state (6, drone) in m and m/s, the point of each; hulls of those that hover (hull, 3)
    and bodies of those that fall, each with position and velocity (6,).
    """

    who: NDArray[np.int64]
    state: Frames
    target: NDArray[np.int64]
    hulls: list[NDArray[np.float64]] = field(default_factory=list)
    falling: list[NDArray[np.float64]] = field(default_factory=list)


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
    last frame of each shape; the scenario and the seed.
    """

    formed: list[Formed]
    frames: Frames
    period: float
    ends: list[int]
    scenario: Scenario
    seed: int


def recording_of(show: Show) -> xr.Dataset:
    """A show as a recording; drones that failed are missing from then on."""
    dims = show.frames.shape[1] // 2
    frames = np.concatenate([show.frames, np.full_like(show.frames[:, :dims], np.nan)], axis=1)
    about = {
        "airflock_scenario": json.dumps(plain(show.scenario.document)),
        "airflock_name": "display",
        "airflock_seed": show.seed,
        "random_start": 0,
    }
    return dataset(frames, dims, show.period, about, show.scenario.model.command)


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
    scenario = scenario_of(drones, settings)
    rng = np.random.default_rng([seed, 3])
    flock = Drones(np.arange(drones), np.zeros((6, drones)), np.arange(drones))
    flock.state[:3] = ranks(drones).T
    doomed = rng.permutation(drones)[: round(failing * drones)]
    legs = np.array_split(doomed, len(shapes))
    kinds = {int(who): FAILURES[i % 2] if failure == "both" else failure for i, who in enumerate(doomed)}
    formed: list[Formed] = []
    frames: list[Frames] = []
    ends: list[int] = []
    for number, points in enumerate(shapes):
        leg = _Leg(scenario, flock, points, drones, (seed, number))
        formed.append(leg.fly([(int(who), kinds[int(who)], float(rng.uniform())) for who in legs[number]]))
        frames += leg.frames
        ends.append(sum(map(len, frames)) - 1)
    return Show(formed, np.concatenate(frames), scenario.metrics.period, ends, scenario, seed)


def segment_seed(seed: int, leg: int, segment: int) -> int:
    """Seed of one segment of a leg: by a stream, so that no two segments of any shows fly the same noise."""
    low, high, *_ = random.words(seed, random.SHOW, 0, leg, segment)
    return int(low | high << 32)


class _Leg:
    """The way to one shape."""

    def __init__(self, scenario: Scenario, flock: Drones, points: Frames, drones: int, leg: tuple[int, int]):
        self.scenario, self.flock, self.points, self.total, self.leg = scenario, flock, points, drones, leg
        self.frames: list[Frames] = []
        self.collisions = self.struck = self.hulls = self.reassigned = self.segments = 0
        self.placed: float | None = None
        self.now = 0.0
        self._assign()

    def fly(self, failures: list[tuple[int, str, float]]) -> Formed:
        """Fly until the shape stands; failures: who, how, and when as a share of the way."""
        planned = self._under_way()
        for who, how, share in sorted(failures, key=lambda f: f[2]):
            self._segment(max(share * planned - self.now, 0.0))
            self._fail(who, how)
        self._segment(max(self._under_way(), 1.0))
        until = self.now + PATIENCE
        while self.now < until and not self._stands():
            changed = self._assign()
            self._segment(self._under_way() + CHECK if changed else CHECK)
        far = self._distances(self.flock.state)
        return Formed(
            self.placed if self.placed is not None else float("nan"), float(far.mean()), float(far.max()),
            len(self.flock.who), self.collisions, self.struck, self.hulls, self.reassigned,
        )  # fmt: skip

    def _assign(self) -> bool:
        """Give points anew where that saves way; whether it did."""
        flock, first = self.flock, self.now == 0.0
        blocked = np.zeros(len(self.points), bool)
        for hull in flock.hulls:
            blocked |= np.linalg.norm(self.points - hull, axis=1) < CLEAR
        found = assign(flock.state[:3].T, self.points, blocked)
        taken = not first and bool(blocked[flock.target].any())
        if not (first or taken or better(flock.state[:3].T, self.points, flock.target, found)):
            return False
        self.reassigned += 0 if first else 1
        flock.target = found
        return True

    def _under_way(self) -> float:
        """How long all are under way to their points, s."""
        far = float(self._distances(self.flock.state).max())
        return 1.5 * far / self.scenario.goals.speed + 4.0

    def _distances(self, state: Frames) -> Frames:
        return np.asarray(np.linalg.norm(state[:3].T - self.points[self.flock.target], axis=1))

    def _stands(self) -> bool:
        return bool(self._distances(self.flock.state).max() <= NEAR)

    def _fail(self, who: int, how: str) -> None:
        """Take one drone out of the flock: it falls, or stands in the way; the others get points anew."""
        flock = self.flock
        (place,) = np.flatnonzero(flock.who == who)
        state = flock.state[:, place].copy()
        if how == "hover":
            flock.hulls.append(state[:3])
        else:
            flock.falling.append(state)
        keep = flock.who != who
        flock.who, flock.state, flock.target = flock.who[keep], flock.state[:, keep], flock.target[keep]
        self._assign()

    def _segment(self, seconds: float) -> None:
        """Fly for a while with what is in the air as it is."""
        period = self.scenario.metrics.period
        steps = round(seconds / period)
        if steps < 1:
            return
        flock, seed = self.flock, segment_seed(*self.leg, self.segments)
        self.segments += 1
        boxes = tuple((*(hull - HALF), *(hull + HALF), 0.0) for hull in flock.hulls)
        aims = tuple(tuple(map(float, self.points[k])) for k in flock.target)
        part = replace(
            self.scenario,
            flight=replace(self.scenario.flight, agents=float(len(flock.who)), duration=steps * period),
            goals=replace(self.scenario.goals, points=aims),
            scene=replace(self.scenario.scene, boxes=boxes),
        )
        flown = fly(part, seed, precision=64, record=True, start=flock.state, device="cpu")
        assert flown.frames is not None
        self.collisions += int(flown.values["n_coll"])
        self.hulls += int(flown.values["n_env_coll"])
        seen = flown.frames[1:, :6]
        self._drop(seen, period)
        whole = np.full((len(seen), 6, self.total), np.nan)
        whole[:, :, flock.who] = seen
        self.frames.append(whole)
        for k, state in enumerate(seen):
            inside = self._distances(state).max() <= NEAR
            self.placed = (self.placed if self.placed is not None else self.now + (k + 1) * period) if inside else None
        self.now += steps * period
        flock.state = seen[-1].copy()

    def _drop(self, seen: Frames, period: float) -> None:
        """Let fall who falls, and count whom it strikes."""
        reach, left = self.scenario.metrics.r_coll, []
        for body in self.flock.falling:
            touching = np.zeros(seen.shape[2], bool)
            for state in seen:
                for _ in range(10):  # a fall of 10 m/s takes 10 cm in a tenth of a frame
                    body[5] -= GRAVITY * 0.1 * period
                    body[:3] += 0.1 * period * body[3:]
                    near = np.linalg.norm(state[:3].T - body[:3], axis=1) < reach
                    self.struck += int((near & ~touching).sum())
                    touching = near
            if body[2] > 0.0:
                left.append(body)
        self.flock.falling = left
