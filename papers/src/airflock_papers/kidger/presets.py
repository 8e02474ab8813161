"""The presets: the final set, a natural and a poor tuning, the inspector's set, and the flight in a plane."""

import pandas as pd

from airflock.scenarios import load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

SEEDS = 20
NAMES = ("city", "natural", "poor", "inspector", "final_2d")
POOR = ("flocked", "n_coll", "goals_reached")
NATURAL = ("flocked", "polarisation", "n_coll", "n_env_coll", "goals_reached")


def fly(flights: Flights) -> pd.DataFrame:
    """Order parameters by (preset, seed)."""
    short = {"duration": 20.0} if flights.quick else {}
    scenarios = {name: load(f"kidger/{name}", short) for name in NAMES}
    return flights.score("Presets", scenarios, flights.count(SEEDS, 3))


def measured(table: pd.DataFrame) -> list[Measured]:
    """What a poor tuning, which is our choice, does; and what the others are like."""
    found = [
        Measured(
            f"presets.poor.{column}",
            column,
            "our poor tuning less the final set, city",
            statistics.difference(table.loc["poor", column], table.loc["city", column]),
            f"{table.loc['poor', column].mean():.3g} against {table.loc['city', column].mean():.3g}",
        )
        for column in POOR
    ]
    for name in ("natural", "inspector", "final_2d"):
        for column in NATURAL:
            note = f"of the final set in the city {table.loc['city', column].mean():.3g}"
            found.append(
                Measured(
                    f"presets.{name}.{column}", column, f"kidger/{name}", statistics.mean(table.loc[name, column]), note
                )
            )
    return found
