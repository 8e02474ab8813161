"""The negative goal: it repels, and a shepherd that steers its place herds a flock to where it shall go."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from airflock.recordings import simulate
from airflock.scenarios import load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

SEEDS = 20
POINTS = [[150.0, 0.0, 20.0], [150.0, 150.0, 20.0], [-100.0, 100.0, 20.0], [0.0, 0.0, 20.0]]
OPEN = {"scene.density": 0.0, "goals.kind": "points", "goals.speed": 0.0}


class Flown(NamedTuple):
    """How much farther from the goal a flock is after 10 s, m, by scale and seed; order parameters when herded."""

    farther: dict[float, list[float]]
    herded: pd.DataFrame


def fly(flights: Flights) -> Flown:
    """Fly away from a standing goal, and in front of a shepherd."""
    seeds = flights.count(SEEDS, 3)
    still = {**OPEN, "goals.points": [[80.0, 0.0, 40.0]], "duration": 10.0, "goals.radius": 0.01}
    farther: dict[float, list[float]] = {}
    for scale in (-0.25, 0.25):
        scenario = flights.as_changed(load("kidger/city", {**still, "model.s_goal": scale}))
        goal = scenario.waypoints()[0]
        farther[scale] = []
        for seed in range(seeds):
            centre = simulate(scenario, seed)["position"].values[[0, -1], :, 0, :].mean(axis=2)
            start, end = np.linalg.norm(centre - goal, axis=1)
            farther[scale].append(float(end - start))
    herd = {"model.s_goal": -0.25, "goals.role": "herd", "goals.points": POINTS, "goals.speed": 120.0}
    return Flown(farther, flights.score("Herding", {"herd": load("kidger/city", {**OPEN, **herd})}, seeds))


def measured(flown: Flown) -> list[Measured]:
    """The goal repels; the shepherd succeeds."""
    away, near = (statistics.mean(flown.farther[scale]) for scale in (-0.25, 0.25))
    share = statistics.mean(flown.herded["goals_reached"] / flown.herded["goals"])
    return [
        Measured(
            "shepherd.repels",
            "distance to the goal",
            "change in 10 s, goal scale -0.25",
            away,
            f"with the positive scale {near.ours:.3g} m",
        ),
        Measured(
            "shepherd.herds",
            "goals reached",
            "share of four points in 120 s",
            share,
            f"flocked {flown.herded['flocked'].mean():.3g} of the time",
        ),
    ]
