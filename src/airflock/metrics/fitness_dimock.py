"""Fitness of Dimock & Selig 2003: minus the mean power per bird (Eq. 10), or a fixed low value after a collision."""

from collections.abc import Mapping

COLLIDED = -1000.0
REPORTS = {"fitness": ("W", "minus the mean power per bird; -1000 after a collision")}


def fitness(score: Mapping[str, float]) -> dict[str, float]:
    """Fitness from the order parameters power (W) and n_coll of one flight."""
    return {"fitness": COLLIDED if score["n_coll"] > 0.5 else -score["power"]}
