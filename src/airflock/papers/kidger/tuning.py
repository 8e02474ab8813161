"""Tuning curves: every radius and every scale alone, in open air and in the city, and what the thesis says of them."""

from typing import Any

import pandas as pd

from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario

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
SHOWN = (
    "flocked",
    "time_to_flock",
    "n_clusters",
    "r_min_mean",
    "polarisation",
    "n_coll",
    "n_env_coll",
    "goals_reached",
)

# parameter, value, default, column, +1 if the value shall have more of it, what the thesis says, section
STATEMENTS = (
    ("r_sep", 20.0, 5.0, "r_min_mean", 1, "a larger separation radius spreads the swarm"),
    ("r_align", 40.0, 2.5, "polarisation", 1, "a larger alignment radius aligns it"),
    ("r_cohes", 10.0, 40.0, "n_clusters", 1, "a smaller cohesion radius splits it more"),
    ("r_cohes", 10.0, 40.0, "time_to_flock", 1, "a smaller cohesion radius flocks it later"),
    ("s_sep", 0.0625, 0.25, "n_coll", 1, "a low separation scale collides more"),
    ("s_sep", 0.0625, 0.25, "phi_coll", 1, "a low separation scale is longer in contact"),
    ("s_goal", 4.0, 0.25, "n_coll", 1, "a very high goal scale collides more"),
    ("s_goal", 4.0, 0.25, "phi_coll", 1, "a very high goal scale is longer in contact"),
    ("s_goal", 4.0, 0.25, "flocked", -1, "a very high goal scale flocks less"),
)

CONTACT = "boids that stay in contact meet once, so that fewer meetings are no fewer collisions; phi_coll says how long"
WHY = {  # what stands against a statement that does not show
    ("r_align", "polarisation", "open air"): "in open air almost half of all pairs are in contact in the final set "
    "(tuning.s_sep.phi_coll.open_air): the flock is hardly larger than the smaller radius, and all align with all",
    ("r_cohes", "n_clusters", "open air"): "swarms are told apart at 40 m, and nothing but buildings parts this flock",
    ("s_sep", "n_coll", "open air"): CONTACT,
    ("s_goal", "n_coll", "open air"): CONTACT,
    ("s_goal", "flocked", "city"): "a goal that outweighs separation draws all into one heap, which buildings do not "
    "part (tuning.s_goal.phi_coll.city); flocked is a share within 20 m of the centre and asks for no distance",
}  # fmt: skip


def fly(flights: Flights) -> pd.DataFrame:
    """Order parameters by (place, parameter, value, seed)."""
    short = {"duration": 15.0 if flights.quick else DURATION, "metrics.r_cluster": 40.0}
    scenarios: dict[tuple[str, str, float], Scenario] = {}
    for place, keys in PLACES.items():
        for name, values in (RADII | SCALES).items():
            wanted = {v for key, a, b, *_ in STATEMENTS if key == name for v in (a, b)}
            chosen = sorted(wanted) if flights.quick else values
            scenarios |= {(place, name, v): load("kidger/city", {f"model.{name}": v, **keys, **short}) for v in chosen}
    judged_by = {(name, value) for name, a, b, *_ in STATEMENTS for value in (a, b)}
    many, few = flights.count(SEEDS, 4), flights.count(CURVE, 4)
    seeds = {key: many if key[1:] in judged_by else few for key in scenarios}
    return flights.score("Tuning curves", scenarios, seeds).sort_index()


def claims(table: pd.DataFrame) -> list[Claim]:
    """Each statement as the difference of two tunings, in both places."""
    return [_claim(table, place, *statement) for statement in STATEMENTS for place in PLACES]


def _claim(
    table: pd.DataFrame, place: str, name: str, value: float, other: float, column: str, sign: int, words: str
) -> Claim:
    a, b = (_values(table, place, name, v, column) for v in (value, other))
    gap = statistics.difference(a, b)
    more = gap.low > 0.0 if sign > 0 else gap.high < 0.0
    means = f"{column} {a.mean():.3g} at {name} = {value:g}, {b.mean():.3g} at {other:g}"
    if column == "n_coll":  # it counts how often two meet, not how long they stay
        stay = [_values(table, place, name, v, "phi_coll").mean() for v in (value, other)]
        means += f"; share of pairs in contact {stay[0]:.2g} against {stay[1]:.2g}"
    if not more and (name, column, place) in WHY:
        means += f"; {WHY[name, column, place]}"
    return Claim(
        id=f"tuning.{name}.{column}.{place.replace(' ', '_')}",
        statement=f"{words} ({place}): difference of {column}",
        source="Kidger, section 5.3",
        test=f"95 % interval of the difference {'above' if sign > 0 else 'below'} 0",
        **gap.fields(),
        **judged(bool(more), means),
    )


def _values(table: pd.DataFrame, place: str, name: str, value: float, column: str) -> pd.Series:
    """One order parameter of all seeds; a flock that was never complete counts with the whole flight."""
    found = table.loc[(place, name, value), column]
    return found.fillna(DURATION) if column == "time_to_flock" else found
