"""How boids behave: collisions in four scenes, separation 1 with few and many, erratic and slow flights."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from xarray import Dataset

from airflock.recordings import simulate
from airflock.scenarios import Scenario, load
from airflock.support import run_in_threads
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

SEEDS = 20
OPEN = {"scene.density": 0.0}
SCENES: dict[str, tuple[str, dict[str, Any]]] = {
    "open_air": ("kidger/city", OPEN),
    "city": ("kidger/city", {}),
    "forest": ("kidger/forest", {}),
    "plane": ("kidger/final_2d", {}),
}
SHORT = {"duration": 30.0}
GOAL = (300.0, 300.0, 40.0)  # m
STILL: dict[str, Any] = {
    **OPEN,
    "goals.kind": "points",
    "goals.speed": 0.0,
    "goals.points": [list(GOAL)],
    "goals.radius": 0.01,
}
TURN = {**OPEN, **SHORT, "model.method": "turn"}
# what is scored and what is recorded: preset and keys
FINAL: dict[str, tuple[str, dict[str, Any]]] = {"final": ("kidger/city", {**OPEN, **SHORT})}
TURNED: dict[str, tuple[str, dict[str, Any]]] = {
    "method 1, 3 boids": ("kidger/city", {**TURN, "agents": 3}),
    "method 1, 40 boids": ("kidger/city", {**TURN, "agents": 40}),
}
SCORED = {**TURNED, "method 1": ("kidger/city", TURN), **FINAL}
RECORDED = {
    **TURNED,
    **FINAL,
    "s_sep = 4": ("kidger/city", {**OPEN, **SHORT, "model.s_sep": 4.0}),
    "s_cohes = 4": ("kidger/city", {**OPEN, **SHORT, "model.s_cohes": 4.0}),
    "goal, final": ("kidger/city", {**STILL, **SHORT}),
    "goal, s_goal = 0.0625": ("kidger/city", {**STILL, **SHORT, "model.s_goal": 0.0625}),
}
TOWARDS = 30.0  # deg, within which a boid heads for its goal


class Flown(NamedTuple):
    """Order parameters by (scene, seed) and of both separations by (case, seed); measures by case and seed."""

    scenes: pd.DataFrame
    turned: pd.DataFrame
    recorded: dict[str, list[dict[str, float]]]


def measures(recording: Dataset) -> dict[str, float]:
    """Measures of a recording.

    turning : rad/s, mean rate at which headings turn
    towards : s, mean time until a boid heads for the goal within 30°; the whole flight if it never does
    """
    velocity, position = (recording[name].values[:, :, 0, :].astype(float) for name in ("velocity", "position"))
    time = recording["time"].values
    heading = velocity / np.maximum(np.linalg.norm(velocity, axis=1, keepdims=True), 1e-9)
    dots = np.clip((heading[1:] * heading[:-1]).sum(axis=1), -1.0, 1.0)
    away = np.asarray(GOAL)[None, :, None] - position
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    ahead = (heading * away).sum(axis=1) > np.cos(np.radians(TOWARDS))  # (time, boid)
    first = np.where(ahead.any(axis=0), time[ahead.argmax(axis=0)], time[-1])
    return {"turning": float(np.arccos(dots).mean() / (time[1] - time[0])), "towards": float(first.mean())}


def fly(flights: Flights) -> Flown:
    """Fly the final set in four scenes, and record the cases."""
    seeds = flights.count(SEEDS, 3)
    short = {"duration": 20.0} if flights.quick else {}
    scenes = {name: load(preset, {**keys, **short}) for name, (preset, keys) in SCENES.items()}
    cases = {name: flights.as_changed(load(preset, keys)) for name, (preset, keys) in RECORDED.items()}

    def job(scenario: Scenario, seed: int) -> Callable[[], dict[str, float]]:
        return lambda: measures(simulate(scenario, seed))

    table = flights.score("Four scenes", scenes, seeds)
    turned = flights.score("Separations", {name: load(preset, keys) for name, (preset, keys) in SCORED.items()}, seeds)
    count = flights.counter("Recorded boids", len(cases) * seeds)
    rows = {
        n: list(run_in_threads([job(s, k) for k in range(seeds)], flights.threads, count)) for n, s in cases.items()
    }
    return Flown(table, turned, rows)


def measured(flown: Flown) -> list[Measured]:
    """Collisions by scene, and differences of the recorded cases."""
    found = []
    for name in SCENES:
        rows = flown.scenes.loc[name]
        note = f"share of pairs in contact {rows['phi_coll'].mean():.3g}, flocked {rows['flocked'].mean():.3g}"
        found.append(
            Measured(f"conduct.n_coll.{name}", "n_coll", f"{name}, final set", statistics.mean(rows["n_coll"]), note)
        )
        if name != "open_air":  # where there is nothing to meet
            contacts = statistics.mean(rows["n_env_coll"])
            found.append(Measured(f"conduct.n_env_coll.{name}", "n_env_coll", f"{name}, final set", contacts))
    few, many = ("method 1, 3 boids", "method 1, 40 boids")
    found.append(
        Measured(
            "conduct.method1.few",
            "n_coll of a method",
            f"open air, {few}",
            statistics.mean(flown.turned.loc[few, "n_coll"]),
            f"{flown.turned.loc[many, 'n_coll'].mean():.3g} with 40 boids",
        )
    )
    x, y = (flown.turned.loc[case, "n_coll"] for case in ("method 1", "final"))
    found.append(
        Measured(
            "conduct.method1.less",
            "n_coll of a method",
            "open air, ten boids, method 1 less method 2",
            statistics.difference(x, y),
            f"{x.mean():.3g} against {y.mean():.3g} in {SHORT['duration']:g} s",
        )
    )
    pairs = (
        ("method1.many", "erratic", "turning", many, few),
        ("s_sep.high", "erratic", "turning", "s_sep = 4", "final"),
        ("s_cohes.high", "erratic", "turning", "s_cohes = 4", "final"),
        ("s_goal.low", "bank", "towards", "goal, s_goal = 0.0625", "goal, final"),
    )
    for name, quantity, column, a, b in pairs:
        x, y = ([row[column] for row in flown.recorded[case]] for case in (a, b))
        note = f"{column} {np.mean(x):.3g} against {np.mean(y):.3g}"
        found.append(
            Measured(f"conduct.{name}", quantity, f"open air, {a} less {b}", statistics.difference(x, y), note)
        )
    return found
