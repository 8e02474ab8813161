"""Tuning curves: every radius and every scale alone, in open air and in the city, and what the thesis says of them."""

from typing import Any

import pandas as pd

from airflock.scenarios import Scenario, load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

SEEDS = 20  # of the points that a statement is about
CURVE = 8  # seeds of the other points of a curve
DURATION = 60.0  # s
RADII: dict[str, tuple[float, ...]] = {
    "r_sep": (2.5, 5.0, 10.0, 20.0, 40.0),
    "r_align": (2.5, 10.0, 20.0, 40.0, 80.0),
    "r_cohes": (5.0, 10.0, 20.0, 40.0, 80.0),
    "r_ray": (5.0, 10.0, 20.0, 40.0, 80.0),
}
SCALES: dict[str, tuple[float, ...]] = {
    "s_obst": (0.25, 0.5, 1.0, 2.0),
    "s_sep": (0.0, 0.0625, 0.25, 1.0, 4.0),
    "s_goal": (0.0, 0.0625, 0.25, 1.0, 4.0),
    "s_align": (0.0, 0.03125, 0.125, 0.5, 2.0),
    "s_cohes": (0.0, 0.0625, 0.25, 1.0, 4.0),
    "s_prev": (0.0, 0.25, 1.0, 4.0),
}
PLACES: dict[str, dict[str, Any]] = {"open air": {"scene.density": 0.0}, "city": {}}
# parameter, value, what it is compared with, column; statements.toml says what the thesis says of it
STATEMENTS = (
    ("r_sep", 20.0, 5.0, "r_min_mean"),
    ("r_align", 40.0, 2.5, "polarisation"),
    ("r_cohes", 10.0, 40.0, "n_clusters"),
    ("r_cohes", 10.0, 40.0, "time_to_flock"),
    ("s_sep", 0.0625, 0.25, "n_coll"),
    ("s_sep", 0.0625, 0.25, "phi_coll"),
    ("s_goal", 0.0625, 0.25, "goals_reached"),
    ("s_goal", 4.0, 0.25, "n_coll"),
    ("s_goal", 4.0, 0.25, "phi_coll"),
    ("s_goal", 4.0, 0.25, "flocked"),
)


def fly(flights: Flights) -> pd.DataFrame:
    """Order parameters by (place, parameter, value, seed)."""
    minute = {"duration": DURATION, "metrics.r_cluster": 40.0}
    scenarios: dict[tuple[str, str, float], Scenario] = {}
    for place, keys in PLACES.items():
        for name, values in (RADII | SCALES).items():
            wanted = {v for key, a, b, _ in STATEMENTS if key == name for v in (a, b)}
            chosen = sorted(wanted) if flights.quick else values
            scenarios |= {(place, name, v): load("kidger/city", {f"model.{name}": v, **keys, **minute}) for v in chosen}
    judged_by = {(name, value) for name, a, b, _ in STATEMENTS for value in (a, b)}
    many, few = flights.count(SEEDS, 4), flights.count(CURVE, 4)
    seeds = {key: many if key[1:] in judged_by else few for key in scenarios}
    return flights.score("Tuning curves", scenarios, seeds).sort_index()


def measured(table: pd.DataFrame) -> list[Measured]:
    """Each statement as the difference of two tunings, in both places; and swarms with and without buildings."""
    found = [_difference(table, place, *statement) for statement in STATEMENTS for place in PLACES]
    city, air = (_values(table, place, "r_cohes", 40.0, "n_clusters") for place in ("city", "open air"))
    gap = statistics.difference(city, air)
    final, other = (_values(table, "city", "s_goal", value, "flocked") for value in (0.25, 4.0))
    return [
        *found,
        Measured(
            "tuning.best",
            "flocked",
            "city, final set less s_goal = 4",
            statistics.difference(final, other),
            f"flocked {final.mean():.3g} against {other.mean():.3g}",
        ),
        Measured(
            "tuning.split.city", "n_clusters", "city less open air", gap, f"{city.mean():.3g} against {air.mean():.3g}"
        ),
    ]


def _difference(table: pd.DataFrame, place: str, name: str, value: float, other: float, column: str) -> Measured:
    a, b = (_values(table, place, name, v, column) for v in (value, other))
    note = f"{column} {a.mean():.3g} at {value:g}, {b.mean():.3g} at {other:g}"
    if column == "n_coll":  # it counts how often two meet, not how long they stay
        stay = [_values(table, place, name, v, "phi_coll").mean() for v in (value, other)]
        note += f"; share of pairs in contact {stay[0]:.2g} against {stay[1]:.2g}"
    at = f"{place}, {name} = {value:g} less {other:g}"
    side = "low" if value < other else "high"
    return Measured(
        f"tuning.{name}.{side}.{column}.{place.replace(' ', '_')}", column, at, statistics.difference(a, b), note
    )


def _values(table: pd.DataFrame, place: str, name: str, value: float, column: str) -> pd.Series:
    """One order parameter of all seeds; a flock that was never complete counts with the whole flight."""
    found = table.loc[(place, name, value), column]
    return found.fillna(DURATION) if column == "time_to_flock" else found
