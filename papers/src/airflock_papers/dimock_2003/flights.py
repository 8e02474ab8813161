"""Flights of five birds: many controllers and starts, side by side on all cores."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.engine import compile_for, fly_world
from airflock.scenarios import Scenario, load
from airflock.support import FlightError, run_in_threads
from airflock_papers.dimock_2003.units import FOOT, SPAN, Gains
from airflock_papers.flights import with_changes
from airflock_papers.progress import Progress

V_SETTLE = 0.5  # m/s; a formation that moves less has settled, twice what the noise in flight makes of it


class Start(NamedTuple):
    """How birds start: kind, spacings (ft), and the jitter of their places (ft); flat: they stay in a plane."""

    kind: str = "vee"
    sx: float = 5.0
    sy: float = 6.5
    sz: float = 0.0
    jitter: float = 0.0
    flat: bool = False


class Task(NamedTuple):
    """One flight: gains, start, seed."""

    gains: Gains
    start: Start = Start()
    seed: int = 0


class Flight(NamedTuple):
    """What came of it: order parameters (SI), frames (time, component, bird)."""

    values: dict[str, Any]
    frames: NDArray[Any]

    @property
    def power(self) -> float:
        """Mean power per bird, W."""
        return float(self.values["power"])

    @property
    def collided(self) -> bool:
        """Whether two birds met."""
        return bool(self.values["n_coll"] > 0.5)


@dataclass
class Birds:
    """How flights are flown; changes : keys that are set in every flight, for `airflock_papers.breaks`."""

    threads: int | None = None
    progress: Progress | None = None
    changes: Mapping[str, Any] = field(default_factory=dict)

    def fly(
        self,
        title: str,
        tasks: Sequence[Task],
        duration: float = 20.0,
        noise: float = 0.0,
        *,
        scatter: bool = False,
        **readings: str | float,
    ) -> list[Flight]:
        """Fly tasks in the paper's air; `readings` are keys of the scenario; those without a dot are the model's.

        noise   : diffusion constant of the birds' positions in flight, m²/s
        scatter : birds that leave the finite numbers are a flight that is not finite, instead of an error
        """
        named = {key if "." in key else f"model.{key}": value for key, value in readings.items()}
        chosen = tuple(sorted(({"model.gradient": "cells_frozen"} | named).items()))
        flats = {task.start.flat for task in tasks}
        bases = {flat: with_changes(_base(chosen, duration, noise, flat), self.changes) for flat in flats}
        for base in bases.values():
            compile_for(base)  # once, before threads ask for it
        count = 0

        def done() -> None:
            nonlocal count
            count += 1
            if self.progress and title:
                self.progress(title, count, len(tasks))

        def job(task: Task) -> Callable[[], Flight]:
            return lambda: _flown(bases[task.start.flat], task, self.changes, scatter)

        return list(run_in_threads([job(task) for task in tasks], self.threads, done))


@cache
def _base(readings: tuple[tuple[str, Any], ...], duration: float, noise: float, flat: bool) -> Scenario:
    jostled = {"body.kind": "jostled", "body.noise": noise} if noise > 0.0 else {}
    settled = {"metrics.t_settle": 0.5 * duration, "metrics.v_settle": V_SETTLE}
    plane = {"world.dimensions": "2"} if flat else {}
    return load("dimock_2003/published", {"duration": duration, **jostled, **settled, **plane, **dict(readings)})


def _flown(base: Scenario, task: Task, changed: Collection[str], scatter: bool) -> Flight:
    """One flight of a base that has its changes; what they set (keys) is not of the task."""
    s = task.start
    begin: dict[str, Any] = {
        "kind": s.kind, "spacing_x": s.sx * FOOT, "spacing_y": s.sy * FOOT, "spacing_z": s.sz * FOOT,
        "jitter": s.jitter * FOOT, "side": s.sx * FOOT if s.kind == "box" else base.start.side,
        "separation": s.sy * FOOT if s.kind == "box" else None,
    }  # fmt: skip
    begin = {name: value for name, value in begin.items() if f"start.{name}" not in changed}
    gains = {name: value for name, value in task.gains.si().items() if f"model.{name}" not in changed}
    scenario = replace(base, parameters=replace(base.parameters, **gains), start=replace(base.start, **begin))
    try:
        found = fly_world(scenario, task.seed, record=True)
    except FlightError:
        if not scatter:
            raise
        return Flight({"power": math.nan, "n_coll": 0.0}, np.full((1, 3, base.agents), math.nan))
    assert found.frames is not None
    return Flight(found.values, found.frames)


def spacing(flight: Flight, last: float = 5.0, dt: float = 0.1) -> tuple[float, float]:
    """Mean distance aside of neighbours in a V of five (spans are 5 ft), ft, and how far birds swing aside, ft.

    Over the last seconds; the swing is the mean over birds of the distance between their outermost places.
    """
    y = flight.frames[-round(last / dt) :, 1, :] / FOOT
    ranks = np.sort(y, axis=1)
    return float(np.diff(ranks, axis=1).mean()), float(np.ptp(y - y.mean(axis=1, keepdims=True), axis=0).mean())


def holds_vee(flight: Flight) -> bool:
    """Whether at the end the birds of each side are still one behind the other and a span or so aside."""
    x, y = flight.frames[-1, 0] / FOOT, flight.frames[-1, 1] / FOOT
    gaps = np.diff(np.sort(y))
    behind = x[1:3].max() <= x[0] + 1.0 and x[3:5].max() <= x[1:3].min() + 1.0
    return bool(behind and gaps.min() > 2.5 and gaps.max() < 10.0)


def in_row(flight: Flight) -> bool:
    """Whether at the end the birds fly in a row: nobody more than a span aside of another, and longer than wide."""
    x, y = flight.frames[-1, 0] / FOOT, flight.frames[-1, 1] / FOOT
    return bool(np.ptp(y) <= SPAN and np.ptp(x) > np.ptp(y))


def median(values: Iterable[float]) -> float:
    """Median of some numbers."""
    return float(np.median(list(values)))
