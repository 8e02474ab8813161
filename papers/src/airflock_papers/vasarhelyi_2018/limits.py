"""Limits: what the Results say keeps the fitness below 1: turns at walls, delay and noise, density, a small arena.

Pairs fly the same seeds. In turns: of each recorded flight the quarter of instants in which the flock's mean velocity
turns fastest, less the quarter in which it turns slowest.
"""

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from xarray import Dataset

from airflock.recordings.flights import simulate
from airflock.recordings.scores import over_time
from airflock.threads import in_threads
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
# claim: the two cases that are compared, and the order parameters in which they differ
PAIRS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "delay": ("as it is", "no delay", ("phi_corr",)),
    "noise": ("as it is", "no noise", ("phi_corr",)),
    "dense": ("as it is", "sparser", ("phi_corr", "n_coll")),
}


class Flown(NamedTuple):
    """Order parameters by (case, speed, seed); by speed what every recorded flight loses in turns."""

    scored: pd.DataFrame
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


def fly(flights: Flights) -> Flown:
    """Fly both sides of every pair, and record the optima."""
    scored, recorded = flights.count(SEEDS, 6), flights.count(RECORDED, 6)
    optima = {v: optimum(v) for v in SPEEDS}
    cases = {(name, v): optimum(v, keys) for name, keys in CASES.items() for v in SPEEDS}
    cases |= {("sparser", v): optimum(v, {"model.r0_rep": SPARSER * optima[v].parameters.r0_rep}) for v in SPEEDS}
    cases |= {("as it is", v): optimum(v, APART) for v in FASTER}
    cases |= {("smaller arena", v): optimum(v, {**APART, "world.side": BEFORE}) for v in FASTER}
    count = flights.counter("What turns cost", len(optima) * recorded)
    changed = {v: flights.as_changed(scenario) for v, scenario in optima.items()}
    turns = {
        v: list(
            in_threads(
                [lambda s=scenario, seed=seed: in_turns(simulate(s, seed)) for seed in range(recorded)],
                flights.threads,
                count,
            )
        )
        for v, scenario in changed.items()
    }
    return Flown(flights.score("What keeps the fitness below 1", cases, scored).sort_index(), turns)


def measured(flown: Flown) -> list[Measured]:
    """Paired differences, the optimum less the other; in turns; in a smaller arena."""
    found = []
    for name, (one, other, columns) in PAIRS.items():
        for v in SPEEDS:
            for column in columns:
                a, b = (flown.scored.loc[(case, v), column] for case in (one, other))
                note = f"{a.mean():.4g} {one}, {b.mean():.4g} {other}"
                at = f"{v} m/s, {one} less {other}"
                found.append(Measured(f"limits.{name}.{column}.{v}ms", column, at, statistics.mean(a - b), note))
    for v, rows in flown.turns.items():
        for column in IN_TURNS:
            lost = statistics.mean([row[column] for row in rows])
            at = f"{v} m/s, the quarter of instants that turns fastest less the slowest"
            found.append(Measured(f"limits.turns.{column}.{v}ms", f"{column} in turns", at, lost))
    for v in FASTER:
        small, large = (flown.scored.loc[(case, v), "fitness"] for case in ("smaller arena", "as it is"))
        note = f"{small.mean():.4g} against {large.mean():.4g}"
        at = f"{v} m/s, arena of {BEFORE:g} m less the one of Table S2"
        gap = statistics.mean(small - large)
        found.append(Measured(f"limits.arena.fitness.{v}ms", "fitness in a smaller arena", at, gap, note))
    return found
