"""Fitness of formations: of Dimock & Selig 2003 (Eq. 10), and one that its winners cannot cheat so easily.

paper : minus the mean power per bird, or a fixed low value after a collision.
sound : minus the power and, in units of a lone bird's power, penalties for closeness (graded), collisions, steady
        oscillation and a formation that has not settled; to be averaged over several starts of 60 s or more.
"""

import math
from collections.abc import Mapping

COLLIDED = -1000.0
CLOSE = 10.0  # lone powers per unit of crowding: half of r_safe costs 2.5
UNSTABLE = 0.25  # lone powers for a formation that has not settled
REPORTS = {"fitness": ("W", "minus the mean power per bird, less penalties (metrics.fitness)")}


def fitness(score: Mapping[str, float], kind: str = "paper") -> dict[str, float]:
    """Fitness from the order parameters of one flight; kind: "paper" or "sound"."""
    if kind == "paper":
        return {"fitness": COLLIDED if score["n_coll"] > 0.5 else -score["power"]}
    unrest = 1.0 if math.isnan(score["unrest"]) else min(score["unrest"], 1.0)  # of 1 m/s
    lost = CLOSE * score["crowding"] + score["n_coll"] + unrest + UNSTABLE * (1.0 - score["stable"])
    return {"fitness": -(score["power"] + lost * score["power_solo"])}
