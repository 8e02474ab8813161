"""Pressure: collisions and distances as the flock grows from 30 to 1000 drones, with and without obstacles."""

import math

import pandas as pd

from airflock.scenarios import Scenario
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018.published import optimum

FLIGHTS = {30: 20, 100: 20, 300: 10, 1000: 6}  # number of drones: flights
PITCH, HALF = 125.0, 10.0  # m: our obstacles are squares of 20 m, one per 125 m by 125 m


def scene(agents: int, obstacles: bool) -> Scenario:
    """The optimum of 4 m/s with more or fewer drones at the same density."""
    side = 250.0 * math.sqrt(agents / 100.0)
    settings: dict[str, object] = {"agents": agents, "world.side": side}
    if obstacles:
        k = max(1, round(side / PITCH))
        centres = [(i + 0.5) * side / k - 0.5 * side for i in range(k)]
        corners = ((-HALF, -HALF), (HALF, -HALF), (HALF, HALF), (-HALF, HALF))
        settings["world.obstacles"] = [[[x + a, y + b] for a, b in corners] for x in centres for y in centres]
    return optimum(4, settings)


def fly(flights: Flights) -> pd.DataFrame:
    """Order parameters by number of drones, obstacles (True or False) and seed."""
    sizes = [n for n in FLIGHTS if n <= 300] if flights.quick else list(FLIGHTS)
    scenes = {(n, o): scene(n, o) for n in sizes for o in (False, True)}
    seeds = {(n, o): flights.seeds or (3 if flights.quick else FLIGHTS[n]) for n, o in scenes}
    return flights.score("Pressure", scenes, seeds).rename_axis(["agents", "obstacles", "seed"])


def measured(found: pd.DataFrame) -> list[Measured]:
    """Everything that is said of larger flocks."""
    sizes = sorted(set(found.index.get_level_values("agents")))
    most = sizes[-1]
    per_drone = {(n, o): found.loc[(n, o)]["n_coll"] / n for n in sizes for o in (False, True)}
    least = {(n, o): found.loc[(n, o)]["r_min"] for n in sizes for o in (False, True)}
    crowd, crowded = found.loc[(most, False)], found.loc[(most, True)]
    return [
        Measured(
            "pressure.grows",
            "n_coll per drone",
            "4 m/s, most drones over 100, no obstacles",
            statistics.ratio(per_drone[most, False], per_drone[100, False]),
            _listed(per_drone, "collisions per drone"),
        ),
        Measured(
            "pressure.distance",
            "r_min",
            "4 m/s, most drones less 30, no obstacles",
            statistics.difference(least[most, False], least[30, False]),
            _listed(least, "smallest distance, m"),
        ),
        Measured(
            "pressure.relief",
            "n_coll per drone",
            "4 m/s, most drones, with obstacles over without",
            statistics.ratio(crowded["n_coll"], crowd["n_coll"]),
            f"{most} drones",
        ),
        Measured(
            "pressure.free",
            "n_coll",
            "4 m/s, most drones, with obstacles",
            statistics.mean(crowded["n_coll"]),
            f"{most} drones; the obstacles are ours: squares of 20 m, one per 125 m by 125 m",
        ),
        *(
            Measured(
                f"pressure.free.{n}",
                "n_coll",
                f"4 m/s, {n} drones, with obstacles",
                statistics.mean(found.loc[(n, True)]["n_coll"]),
                f"{found.loc[(n, False)]['n_coll'].mean():.3g} without",
            )
            for n in sizes[:-1]
        ),
    ]


def _listed(values: dict[tuple[int, bool], pd.Series], words: str) -> str:
    sizes = sorted({n for n, _ in values})
    parts = [f"{n}: {values[n, False].mean():.3g} / {values[n, True].mean():.3g}" for n in sizes]
    return f"mean {words}, by number of drones, without / with obstacles: {'; '.join(parts)}"
