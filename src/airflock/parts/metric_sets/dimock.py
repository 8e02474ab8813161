"""Fitness of formations: of Dimock & Selig 2003 (Eq. 10), and one that its winners cannot cheat so easily.

paper : minus the mean power per bird, or a fixed low value after a collision.
sound : minus the power and, in units of a lone bird's power, penalties for closeness (graded),
        collisions, steady oscillation and a formation that has not settled; to be averaged over
        several starts of 60 s or more.
"""

import math
from collections.abc import Mapping

from airflock.parts.metrics.parameters import Parameters

METRICS = ["power", "steadiness", "collisions"]
COLLIDED = -1000.0
CLOSE = 10.0  # lone powers per unit of crowding: half of r_safe costs 2.5
UNSTABLE = 0.25  # lone powers for a formation that has not settled
VIOLATES = {"units": "a collision costs COLLIDED, a number of watts"}
REPORTS = {"fitness": ("W", "minus the mean power per bird, less penalties (metrics.fitness)")}
FORMULAS = {
    "fitness": (
        r"-\left\langle \frac{1}{N}\sum_i P_i \right\rangle_t",
        "below 0",
        "Minus the mean power, W, and after a collision a fixed low value; metrics.fitness may add penalties.",
    ),
}
NEEDS = {"fitness": ("r_coll",)}


def fitness(values: Mapping[str, float], q: Parameters) -> dict[str, float]:
    """Fitness from the order parameters of one flight, as metrics.fitness says."""
    return {"fitness": of_paper(values) if q.fitness == "paper" else sound(values)}


def of_paper(values: Mapping[str, float]) -> float:
    """Minus the mean power per bird, W; a fixed low value after a collision (Eq. 10)."""
    return COLLIDED if values["n_coll"] > 0.5 else -values["power"]


def sound(values: Mapping[str, float]) -> float:
    """Minus the mean power per bird and the penalties, W."""
    unrest = 1.0 if math.isnan(values["unrest"]) else min(values["unrest"], 1.0)  # of 1 m/s
    lost = CLOSE * values["crowding"] + values["n_coll"] + unrest + UNSTABLE * (1.0 - values["stable"])
    return -(values["power"] + lost * values["power_solo"])
