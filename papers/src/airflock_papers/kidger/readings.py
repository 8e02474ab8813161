"""Readings: what the thesis leaves open about separation, cohesion and "flocked", flown in four scenes.

The reading that is the model's default was chosen by a rule that was written down before: the fewest collisions with
one another; among equals the most goals; among equals the largest share flocked. The radius of "flocked" changes no
flight, so both radii are shown for it.
"""

from typing import Any

import pandas as pd

from airflock.scenarios import load
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.kidger.conduct import SCENES

SEEDS = 10
RADII = (20.0, 40.0)  # m, of "flocked"; the thesis sets it in its inspector and prints none
READINGS: dict[str, dict[str, Any]] = {
    "separation and cohesion at the boids' speed": {"model.separation": "normalised"},
    "separation as printed": {"model.separation": "printed"},
    "separation and cohesion as printed": {"model.separation": "printed", "model.cohesion": "printed"},
}
COLUMNS = {
    "n_coll": "collisions",
    "phi_coll": "share of pairs in contact",
    "n_env_coll": "with the scene",
    "r_min_mean": "nearest neighbour, m",
    "goals": "share of goals reached",
    **{f"flocked {radius:g}": f"flocked within {radius:g} m" for radius in RADII},
}


def fly(flights: Flights) -> pd.DataFrame:
    """Order parameters by (reading, scene, seed); flights of 120 s with ten boids."""
    short = {"duration": 20.0} if flights.quick else {}
    seeds = flights.count(SEEDS, 2)
    tables = {}
    for radius in RADII:
        scenarios = {
            (reading, scene): load(preset, {**keys, **short, **choices, "metrics.r_flock": radius})
            for reading, choices in READINGS.items()
            for scene, (preset, keys) in SCENES.items()
        }
        tables[radius] = flights.score(f"Readings, flocked within {radius:g} m", scenarios, seeds)
    found = tables[RADII[0]].assign(**{f"flocked {radius:g}": table["flocked"] for radius, table in tables.items()})
    return found.assign(goals=found["goals_reached"] / found["goals"])


def measured(_: pd.DataFrame) -> list[Measured]:
    """Nothing: the sentences that a reading serves are judged in the other parts, under the default alone."""
    return []


def shown(table: pd.DataFrame) -> str:
    """Means by reading and scene, as a Markdown table."""
    means = table.groupby(level=[0, 1])[list(COLUMNS)].mean()
    head = ["| reading | scene | " + " | ".join(COLUMNS.values()) + " |", "|" + "---|" * (2 + len(COLUMNS))]
    rows = [
        f"| {reading} | {scene} | " + " | ".join(f"{means.loc[(reading, scene), c]:.3g}" for c in COLUMNS) + " |"
        for reading in READINGS
        for scene in SCENES
    ]
    return "\n".join([*head, *rows])
