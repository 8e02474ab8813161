"""Pressure: collisions and distances as the flock grows from 30 to 1000 drones, with and without obstacles."""

import math

import pandas as pd

from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.papers.vasarhelyi_2018.published import optimum
from airflock.scenarios.scenario import Scenario

FLIGHTS = {30: 20, 100: 20, 300: 10, 1000: 6}  # number of drones: flights
PITCH, HALF = 125.0, 10.0  # m: our obstacles are squares of 20 m, one per 125 m by 125 m
SOURCE = "Results, scalability in agent number (no statistics printed; movie S3)"


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


def claims(found: pd.DataFrame) -> list[Claim]:
    """All claims about pressure."""
    sizes = sorted(set(found.index.get_level_values("agents")))
    most = sizes[-1]
    per_drone = {(n, o): found.loc[(n, o)]["n_coll"] / n for n in sizes for o in (False, True)}
    growth = statistics.ratio(per_drone[most, False], per_drone[100, False])
    relief = statistics.ratio(found.loc[(most, True)]["n_coll"], found.loc[(most, False)]["n_coll"])
    free = [float(found.loc[(n, False)]["r_min"].mean()) for n in sizes]
    falls = all(a > b for a, b in zip(free, free[1:], strict=False))
    result = [
        Claim(
            id="pressure.grows",
            statement=f"collisions per drone with {most} drones over those with 100, no obstacles: pressure grows",
            source=SOURCE,
            test="95 % interval of the ratio above 1",
            **growth.fields(),
            **judged(growth.low > 1.0, _listed(per_drone, "collisions per drone")),
        ),
        Claim(
            id="pressure.distance",
            statement=f"smallest distance of a flight with {most} drones, no obstacles, m: it falls with N",
            source=SOURCE,
            test="means in falling order from 30 drones on",
            **statistics.mean(found.loc[(most, False)]["r_min"]).fields(),
            **judged(
                falls,
                _listed(
                    {(n, o): found.loc[(n, o)]["r_min"] for n in sizes for o in (False, True)}, "smallest distance, m"
                ),
            ),
        ),
        Claim(
            id="pressure.obstacles",
            statement=f"collisions of {most} drones with obstacles over those without: obstacles relieve the pressure",
            source=SOURCE,
            test="95 % interval of the ratio below 1",
            **relief.fields(),
            **judged(relief.high < 1.0, _listed(per_drone, "collisions per drone")),
        ),
    ]
    for n in sizes[:-1]:
        pair = " with and ".join(f"{found.loc[(n, o)]['n_coll'].mean():.2f}" for o in (True, False))
        value = statistics.difference(found.loc[(n, True)]["n_coll"], found.loc[(n, False)]["n_coll"])
        result.append(
            Claim(
                id=f"pressure.obstacles.{n}",
                statement=f"collisions of {n} drones with obstacles minus those without",
                source=SOURCE,
                test="no number to agree with",
                **value.fields(),
                verdict="finding",
                reason=f"{pair} without; the obstacles are ours (squares of 20 m, one per 125 m by 125 m).",
            )
        )
    return result


def _listed(values: dict[tuple[int, bool], pd.Series], words: str) -> str:
    sizes = sorted({n for n, _ in values})
    parts = [f"{n}: {values[n, False].mean():.3g} / {values[n, True].mean():.3g}" for n in sizes]
    return f"Mean {words}, by number of drones, without / with obstacles: {'; '.join(parts)}."
