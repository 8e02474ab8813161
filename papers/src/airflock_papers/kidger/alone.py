"""What one rule does by itself or is missed for, boids out of sight of the others, swarms that split in the plane.

Alignment, cohesion or the goal alone is compared with boids that fly by none of the four rules, over the same seeds;
gravity with boids without it, and the final set with one that avoids no obstacles. A boid is stuck if it flies slower
than a tenth of the drone speed throughout the last ten seconds. A straggler is a boid with nobody within `r_cohes`, the
farthest that it sees others; its focus is the cosine between its heading and the way to the goal, while it is more than
a second's flight away from it.
"""

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
from airflock_papers.kidger.conduct import GOAL, OPEN, SHORT, STILL

SEEDS = 20
NONE = {**OPEN, **SHORT, **dict.fromkeys(("model.s_sep", "model.s_align", "model.s_cohes", "model.s_goal"), 0.0)}
SCORED: dict[str, tuple[str, dict[str, Any]]] = {
    "none": ("kidger/city", NONE),
    "alignment": ("kidger/city", {**NONE, "model.s_align": 0.125}),
    "cohesion": ("kidger/city", {**NONE, "model.s_cohes": 0.25}),
    "goal": ("kidger/city", {**NONE, "model.s_goal": 0.25}),
    "avoidance": ("kidger/city", SHORT),
    "no avoidance": ("kidger/city", {**SHORT, "model.s_obst": 0.0}),
    "plane": ("kidger/final_2d", {"metrics.r_cluster": 40.0}),
    "plane without obstacles": ("kidger/final_2d", {**OPEN, "metrics.r_cluster": 40.0}),
}
WIDE = {**OPEN, **SHORT, "model.s_goal": 0.0, "start.side": 300.0}  # without a goal, and most out of sight
RECORDED: dict[str, tuple[str, dict[str, Any]]] = {
    "gravity": ("kidger/inspector", {**OPEN, **SHORT, "model.gravity": 3.0}),
    "no gravity": ("kidger/inspector", {**OPEN, **SHORT, "model.gravity": 0.0}),
    "low goal": ("kidger/city", {**STILL, **SHORT, "model.s_goal": 0.0625, "start.side": 300.0}),
    "no information": ("kidger/city", WIDE),
    "slow start": ("kidger/city", {**WIDE, "start.speed": 0.6}),
}
SLOW, LAST = 0.1, 10.0  # of the drone speed, and seconds at the end, of a boid that is stuck
FAST = 0.95  # quantile of the vertical speeds
FAR = 60.0  # m, a second's flight at the speed limit


class Flown(NamedTuple):
    """Order parameters by (case, seed); measures by case and seed."""

    scored: pd.DataFrame
    recorded: dict[str, list[dict[str, float]]]


def measures(recording: Dataset, sight: float, top: float) -> dict[str, float]:
    """Measures of a recording; sight: how far boids see each other, m; top: the drone speed, m/s.

    climb, fall : m/s, 95 % quantiles of the speeds upwards and downwards
    focus       : focus of stragglers less that of the others; nan if there are none of either
    alone       : share of boids with nobody in sight; stuck: share of boids that are stuck at the end
    """
    velocity, position = (recording[name].values[:, :, 0, :].astype(float) for name in ("velocity", "position"))
    rising = velocity[:, 2]
    apart = np.linalg.norm(position[:, :, :, None] - position[:, :, None, :], axis=1)
    alone = (apart < sight).sum(axis=2) == 1  # nobody but oneself: (time, boid)
    away = np.asarray(GOAL)[None, :, None] - position
    distance = np.linalg.norm(away, axis=1)
    speed = np.linalg.norm(velocity, axis=1)
    focus = (velocity * away).sum(axis=1) / np.maximum(speed * distance, 1e-9)
    stragglers, others = (focus[which & (distance > FAR)] for which in (alone, ~alone))
    time = recording["time"].values
    stuck = (speed[time >= time[-1] - LAST] < SLOW * top).all(axis=0)
    both = stragglers.size and others.size
    return {
        "climb": float(np.quantile(np.maximum(rising, 0.0), FAST)),
        "fall": float(np.quantile(np.maximum(-rising, 0.0), FAST)),
        "focus": float(stragglers.mean() - others.mean()) if both else float("nan"),
        "alone": float(alone.mean()),
        "stuck": float(stuck.mean()),
    }


def fly(flights: Flights) -> Flown:
    """Fly every case."""
    seeds = flights.count(SEEDS, 4)
    cases = {name: flights.as_changed(load(preset, keys)) for name, (preset, keys) in RECORDED.items()}

    def job(scenario: Scenario, seed: int) -> Callable[[], dict[str, float]]:
        p = scenario.parameters
        return lambda: measures(simulate(scenario, seed), p.r_cohes, p.speed)

    scored = flights.score(
        "One rule alone", {name: load(preset, keys) for name, (preset, keys) in SCORED.items()}, seeds
    )
    count = flights.counter("Gravity and stragglers", len(cases) * seeds)
    rows = {
        n: list(run_in_threads([job(s, k) for k in range(seeds)], flights.threads, count)) for n, s in cases.items()
    }
    return Flown(scored, rows)


def measured(flown: Flown) -> list[Measured]:
    """Differences on the same seeds."""
    pairs = (
        ("only.alignment", "polarisation", "alignment", "none"),
        ("only.cohesion", "flocked", "cohesion", "none"),
        ("only.goal", "goals_reached", "goal", "none"),
        ("tuning.split.plane", "n_clusters", "plane", "plane without obstacles"),
    )
    found = []
    for name, column, a, b in pairs:
        x, y = (flown.scored.loc[case, column] for case in (a, b))
        note = f"{column} {x.mean():.3g} against {y.mean():.3g}"
        found.append(Measured(name, column, f"{a} less {b}", statistics.mean(x - y), note))
    x, y = (flown.scored.loc[case, "n_env_coll"] for case in ("no avoidance", "avoidance"))
    note = f"{x.mean():.3g} against {y.mean():.3g} in {SHORT['duration']:g} s"
    at = "city, no obstacle avoidance less the final set"
    found.append(Measured("only.rules", "n_env_coll", at, statistics.mean(x - y), note))
    for name, case, start in (("previous", "no information", ""), ("acceleration", "slow start", " at 0.6 m/s")):
        rows = flown.recorded[case]
        note = f"{np.mean([row['alone'] for row in rows]):.0%} of boids alone"
        at = f"no goal, start in a box of 300 m{start}"
        found.append(Measured(f"only.{name}", "stuck", at, statistics.mean([row["stuck"] for row in rows]), note))
    for name, column in (("only.gravity", "climb"), ("only.gravity.fall", "fall")):
        x, y = (np.array([row[column] for row in flown.recorded[case]]) for case in ("gravity", "no gravity"))
        note = f"{column} {x.mean():.3g} m/s against {y.mean():.3g} m/s"
        at = "open air, gravity of 3 m/s less none"
        found.append(Measured(name, column, at, statistics.mean(x - y), note))
    low = flown.recorded["low goal"]
    focus = [row["focus"] for row in low if np.isfinite(row["focus"])]
    note = f"{len(focus)} of {len(low)} flights have both; {np.mean([row['alone'] for row in low]):.0%} of boids alone"
    if len(focus) > 1:
        at = "open air, start in a box of 300 m, s_goal = 0.0625, stragglers less others"
        found.append(Measured("tuning.stragglers", "focus on the goal", at, statistics.mean(focus), note))
    return found
