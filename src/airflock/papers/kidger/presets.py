"""The presets: the final set, a natural and a poor tuning, the inspector's set, and the flight in a plane."""

import pandas as pd

from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.scenarios.files import load

SEEDS = 20
NAMES = ("city", "natural", "poor", "inspector", "final_2d")
POOR = (
    ("flocked", -1, "extremely limited flocking"),
    ("n_coll", 1, "many collisions within the swarm"),
    ("goals_reached", -1, "limited goal acquisition"),
)
NATURAL = ("flocked", "polarisation", "n_coll", "n_env_coll", "goals_reached")


def fly(flights: Flights) -> pd.DataFrame:
    """Order parameters by (preset, seed)."""
    short = {"duration": 20.0} if flights.quick else {}
    scenarios = {name: load(f"kidger/{name}", short) for name in NAMES}
    return flights.score("Presets", scenarios, flights.count(SEEDS, 3))


def claims(table: pd.DataFrame) -> list[Claim]:
    """What a poor tuning does, and what the others are like."""
    found = []
    for column, sign, words in POOR:
        a, b = table.loc["poor", column], table.loc["city", column]
        gap = statistics.difference(a, b)
        found.append(
            Claim(
                id=f"presets.poor.{column}", statement=f"a poor tuning shows {words}: difference of {column} to final",
                source="Kidger, section 5.3, Poor Tuning",
                test=f"95 % interval of the difference {'above' if sign > 0 else 'below'} 0", **gap.fields(),
                **judged(
                    gap.low > 0.0 if sign > 0 else gap.high < 0.0, f"poor {a.mean():.3g}, final {b.mean():.3g}"
                ),
            )
        )  # fmt: skip
    for name in ("natural", "inspector", "final_2d"):
        for column in NATURAL:
            measured = statistics.mean(table.loc[name, column])
            found.append(
                Claim(
                    id=f"presets.{name}.{column}", statement=f"{column} of kidger/{name}", source="ours",
                    test="none: the thesis shows it without numbers", verdict="finding", **measured.fields(),
                    reason=f"{measured.ours:.3g}; of the final set in the city {table.loc['city', column].mean():.3g}",
                )
            )  # fmt: skip
    return found
