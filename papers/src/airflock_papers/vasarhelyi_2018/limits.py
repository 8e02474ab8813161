"""Limits: what the Results say keeps the fitness below 1: turns at walls, delay and noise, density, a small arena.

Pairs fly the same seeds. In turns: of each recorded flight the quarter of instants in which the flock's mean velocity
turns fastest, less the quarter in which it turns slowest.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from xarray import Dataset

from airflock.recordings import over_time, simulate
from airflock.scenarios import Scenario
from airflock.support import run_in_threads
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018.published import optimum
from airflock_papers.vasarhelyi_2018.tuning import SETTLED, SMOOTH, SPEEDS

SEEDS, RECORDED = 40, 10  # flights scored a side, and flights recorded for what happens in turns
QUARTER = 0.25
FASTER = (16, 32)  # m/s, speeds that the paper gave larger arenas
BEFORE = 250.0  # m, side of the arena of the lower speeds
APART = {"start.separation": 16.0}  # m, as at 8 m/s, in either arena: as far apart as at 16 m/s they do not fit in
SPARSER = 1.25  # times r0_rep
IN_TURNS = ("phi_vel", "phi_corr")
CASES: dict[str, dict[str, Any]] = {
    "as it is": {},
    "no delay": {"radio.delay": 0.0},
    "no noise": {"sensors.noise": 0.0, "body.noise": 0.0},
}
# claim: the two cases that are compared, the order parameters in which they differ, and speeds, m/s
PAIRS: dict[str, tuple[str, str, tuple[str, ...], tuple[int, ...]]] = {
    "delay": ("as it is", "no delay", ("phi_corr",), SPEEDS),
    "noise": ("as it is", "no noise", ("phi_corr",), SPEEDS),
    "dense": ("as it is", "sparser", ("phi_corr", "n_coll"), SPEEDS),
    "arena": ("smaller arena", "as it is", ("fitness",), FASTER),
}
SAID = {  # quantity and place of a claim, where they are not the order parameter and the two cases
    "arena": ("fitness in a smaller arena", f"arena of {BEFORE:g} m less the one of Table S2"),
    "turns": ("{} in turns", "the quarter of instants that turns fastest less the slowest"),
}


class Flown(NamedTuple):
    """Order parameters by seed of every case and speed (m/s); by speed what every recorded flight loses in turns."""

    scored: dict[tuple[str, int], pd.DataFrame]
    turns: dict[int, list[dict[str, float]]]


def turn_rate(recording: Dataset) -> NDArray[np.float64]:
    """How fast the mean velocity, smoothed over a second, turns at each instant, rad/s."""
    mean = recording["velocity"].values[:, :2, 0, :].astype(np.float64).mean(axis=2)  # (time, axis)
    window = np.ones(SMOOTH) / SMOOTH
    smooth = np.stack([np.convolve(part, window, mode="same") for part in mean.T])
    times = recording["time"].values
    return np.asarray(np.abs(np.gradient(np.unwrap(np.arctan2(smooth[1], smooth[0])), times)))


def in_turns(recording: Dataset) -> dict[str, float]:
    """Order parameters in the quarter that turns fastest, less those in the slowest quarter, from SETTLED on."""
    times, rate = recording["time"].values, turn_rate(recording)
    course = over_time(recording)
    course = course[(course.index >= SETTLED) & (course.index <= times[-1] - SMOOTH * (times[1] - times[0]))]
    turning = np.interp(course.index.to_numpy(), times, rate)
    slow, fast = np.quantile(turning, [QUARTER, 1.0 - QUARTER])
    return {
        name: float(course[name][turning >= fast].mean() - course[name][turning <= slow].mean()) for name in IN_TURNS
    }


def cases() -> dict[tuple[str, int], Scenario]:
    """Every side of every pair, by case and speed (m/s)."""
    found = {(name, v): optimum(v, keys) for name, keys in CASES.items() for v in SPEEDS}
    for v in SPEEDS:
        found["sparser", v] = optimum(v, {"model.r0_rep": SPARSER * found["as it is", v].parameters.r0_rep})
    for v in FASTER:
        found["as it is", v] = optimum(v, APART)
        found["smaller arena", v] = optimum(v, {**APART, "world.side": BEFORE})
    return found


def claims() -> Iterator[tuple[str, str, int]]:
    """Pair, order parameter and speed (m/s) of every claim on a pair."""
    for name, (_, _, columns, speeds) in PAIRS.items():
        yield from ((name, column, v) for v in speeds for column in columns)


def fly(flights: Flights) -> Flown:
    """Fly both sides of every pair, and record the optima; of what is asked for no others."""
    scored, recorded = flights.count(SEEDS, 6), flights.count(RECORDED, 6)
    wanted = flights.wanted
    pairs = [(name, v) for name, column, v in claims() if wanted is None or _id(name, column, v) in wanted]
    needed = {(case, v) for name, v in pairs for case in PAIRS[name][:2]}
    recordings = [v for v in SPEEDS if wanted is None or any(_id("turns", name, v) in wanted for name in IN_TURNS)]
    count = flights.counter("What turns cost", len(recordings) * recorded)

    def job(scenario: Scenario, seed: int) -> Callable[[], dict[str, float]]:
        return lambda: in_turns(simulate(scenario, seed))

    turns = {}
    for v in recordings:
        scenario = flights.as_changed(optimum(v))
        turns[v] = list(run_in_threads([job(scenario, seed) for seed in range(recorded)], flights.threads, count))
    flown = {}
    for key, scenario in cases().items():
        if key in needed:
            name, v = key
            flown[key] = flights.score(f"What limits the fitness, {name}, {v} m/s", {"": scenario}, scored)
    return Flown(flown, turns)


def measured(flown: Flown) -> list[Measured]:
    """Paired differences, in pairs and in turns."""
    found = []
    for name, column, v in claims():
        one, other = ((case, v) for case in PAIRS[name][:2])
        if not {one, other} <= set(flown.scored):
            continue
        a, b = (flown.scored[side][column] for side in (one, other))
        quantity, at = SAID.get(name, (column, f"{one[0]} less {other[0]}"))
        note = f"{a.mean():.4g} {one[0]}, {b.mean():.4g} {other[0]}"
        found.append(Measured(_id(name, column, v), quantity, f"{v} m/s, {at}", statistics.mean(a - b), note))
    quantity, at = SAID["turns"]
    for v, rows in flown.turns.items():
        for column in IN_TURNS:
            lost = statistics.mean([row[column] for row in rows])
            found.append(Measured(_id("turns", column, v), quantity.format(column), f"{v} m/s, {at}", lost))
    return found


def _id(name: str, column: str, v: int) -> str:
    return f"limits.{name}.{column}.{v}ms"
