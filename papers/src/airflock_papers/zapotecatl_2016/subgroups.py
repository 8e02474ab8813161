"""Boids all over the pond, and subgroups all over the pond: what the paper's measures make of either.

The paper sets up neither case, so places are drawn: boids one by one anywhere in the pond, or groups of ten with their
centres anywhere in it, members within 20 cm. Headings are drawn for each boid, or for each group; each nobody touches
anybody. Every draw is one frame of a recording, scored as any other.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airflock.recordings import over_time, simulate
from airflock.scenarios import Scenario, load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

DRAWS = 400
GROUP = 10  # boids
RADIUS = 0.2  # m, of a group
COMPANY = 0.3  # m: boids nearer than this are of one group for the measures that tell groups
Vectors = NDArray[np.float64]  # (agent, axis)


def directions(rng: np.random.Generator, count: int) -> Vectors:
    """Unit vectors, evenly over the sphere."""
    v = rng.normal(size=(count, 3))
    found: Vectors = v / np.linalg.norm(v, axis=1, keepdims=True)
    return found


def draw(rng: np.random.Generator, scenario: Scenario, grouped: bool) -> tuple[Vectors, Vectors]:
    """Places (m) and headings of all boids, nearest neighbours farther apart than the distance of a collision."""
    n, size = int(scenario.agents), GROUP if grouped else 1
    half = 0.5 * np.array([scenario.world.side, scenario.world.side, scenario.world.height])
    while True:
        centres = np.repeat(rng.uniform(-half, half, (-(-n // size), 3)), size, axis=0)[:n]
        headings = np.repeat(directions(rng, -(-n // size)), size, axis=0)[:n]
        scatter = RADIUS * grouped * directions(rng, n) * rng.random((n, 1)) ** (1.0 / 3.0)
        places = centres + scatter
        apart = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(n)
        if apart.min() > scenario.metrics.r_b:
            return places, headings


def fly(flights: Flights) -> dict[str, pd.DataFrame]:
    """Measures of every draw, dispersed and grouped."""
    keys = {"metrics.kind": "groups", "metrics.count": "each", "metrics.r_cluster": COMPANY}
    draws = flights.count(DRAWS, 60)
    scenario = flights.as_changed(load("zapotecatl_2016/best", {**keys, "duration": 0.0009 * (draws - 1)}))
    recording = simulate(scenario, 0)
    found = {}
    for name, grouped in (("dispersed", False), ("subgroups", True)):
        rng = np.random.default_rng(1)
        drawn = [draw(rng, scenario, grouped) for _ in range(recording.sizes["time"])]
        frames = recording.copy(deep=True)
        for key, k, scale in (("position", 0, 1.0), ("velocity", 1, scenario.start.speed)):
            frames[key].values[:, :, 0, :] = scale * np.array([each[k].T for each in drawn])
        found[name] = over_time(frames)
    return found


def measured(found: dict[str, pd.DataFrame]) -> list[Measured]:
    """Quality of subgroups less that of boids that are all dispersed, and what measures of groups make of it."""
    a, b = found["subgroups"], found["dispersed"]
    others = ("cns_ext", "cns_pol", "cns_ext_groups", "quality_groups")
    note = "; ".join(f"{name} {a[name].mean():.3g} against {b[name].mean():.3g}" for name in ("quality", *others))
    at = f"groups of {GROUP} boids less single boids, all over the pond"
    value = statistics.difference(a["quality"], b["quality"])
    return [Measured("metric.subgroups", "quality as evaluated", at, value, note)]
