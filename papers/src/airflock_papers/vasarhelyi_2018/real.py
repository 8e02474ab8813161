"""Two sentences about the real drones: their shill agents (Table S4), and the wind that they bore.

Table S4 has slower shill agents that act farther from the walls. The magnitude of the wall term is that of Eqs 8 and 9
at the drones' own positions and velocities, taken every second over those drones that any wall acts on; the set of
Table S4 is compared with the same set with v_shill and r0_shill of Table S1, on the same seeds. A flight bears the wind
if no two drones come within r_coll and nobody gets more than 10 m out of the arena.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from xarray import Dataset

from airflock.parts.laws import vasarhelyi_2018 as law
from airflock.recordings import simulate
from airflock.scenarios import Scenario, load
from airflock.support import run_in_threads
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018.published import optimum

SPEEDS = (6, 8)  # m/s, where Table S4 has a larger r0_shill than Table S1
RECORDED, FLIGHTS = 10, 20
EVERY = 5  # samples of 0.2 s
WIND = 40.0 / 3.6  # m/s: 40 km/h
OUTSIDE = 10.0  # m


class Flown(NamedTuple):
    """Wall terms, m/s, by speed and side (s4 or s1), seed by seed; order parameters of the flights in wind."""

    walls: dict[tuple[int, str], list[float]]
    wind: pd.DataFrame


def wall_term(recording: Dataset, scenario: Scenario) -> float:
    """Mean magnitude of the wall term (Eqs 8-9) over drones that any wall acts on, m/s; a square of given side."""
    half, p = 0.5 * scenario.world.side, scenario.parameters
    every = slice(None, None, EVERY)
    places = recording["position"].values[every, :, 0, :].transpose(0, 2, 1).reshape(-1, 2).astype(float)
    speeds = recording["velocity"].values[every, :, 0, :].transpose(0, 2, 1).reshape(-1, 2).astype(float)
    found = []
    for (x, y), (vx, vy) in zip(places.tolist(), speeds.tolist(), strict=True):
        east = law.boundary(half - abs(x), -1.0 if x > 0.0 else 1.0, 0.0, 0.0, vx, vy, 0.0, p)
        north = law.boundary(half - abs(y), 0.0, -1.0 if y > 0.0 else 1.0, 0.0, vx, vy, 0.0, p)
        found.append(np.hypot(east.x + north.x, east.y + north.y))
    term = np.array(found)
    return float(term[term > 0.0].mean()) if (term > 0.0).any() else 0.0


def sides(v: int) -> dict[str, Scenario]:
    """The set of Table S4, and the same with the shill agents of Table S1."""
    s1 = optimum(v).parameters
    settings = {"model.v_shill": s1.v_shill, "model.r0_shill": s1.r0_shill}
    return {"s4": load(f"vasarhelyi_2018/real_{v}ms"), "s1": load(f"vasarhelyi_2018/real_{v}ms", settings)}


def fly(flights: Flights) -> Flown:
    """Record both sides at each speed, and fly in the wind."""
    seeds = min(flights.count(RECORDED, 3), RECORDED)
    cases = {(v, name): flights.as_changed(s) for v in SPEEDS for name, s in sides(v).items()}

    def job(scenario: Scenario, seed: int) -> Callable[[], float]:
        return lambda: wall_term(simulate(scenario, seed), scenario)

    count = flights.counter("Table S4, wall terms", len(cases) * seeds)
    walls = {
        k: list(run_in_threads([job(s, i) for i in range(seeds)], flights.threads, count)) for k, s in cases.items()
    }
    windy: dict[Any, Scenario] = {"6 m/s": load("vasarhelyi_2018/real_6ms", {"wind.east": WIND})}
    return Flown(walls, flights.score("Wind of 40 km/h", windy, flights.count(FLIGHTS, 4)).loc["6 m/s"])


def measured(flown: Flown) -> list[Measured]:
    """Differences of the wall terms, and the share of flights that bear the wind."""
    found = []
    for v in SPEEDS:
        a, b = (np.array(flown.walls[v, name]) for name in ("s4", "s1"))
        note = f"{a.mean():.3g} m/s against {b.mean():.3g} m/s"
        at = f"{v} m/s, Table S4 less the same with the shill agents of Table S1"
        found.append(Measured(f"model.shill_terms.{v}ms", "wall term", at, statistics.mean(a - b), note))
    wind = flown.wind
    good = (wind["n_coll"] < 0.5) & (wind["clearance"] > -OUTSIDE)
    note = f"{wind['n_coll'].mean():.3g} collisions a flight, {-wind['clearance'].min():.3g} m outside at the most"
    share = statistics.mean(good.astype(float))
    return [*found, Measured("drones.wind", "tolerated", "30 drones, 6 m/s, wind of 11.1 m/s", share, note)]
