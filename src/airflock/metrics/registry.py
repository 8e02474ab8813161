"""The order parameters that flights are scored with: sets of metrics by the key metrics.kind."""

from typing import Any

from airflock.core.contract import Metric, metric
from airflock.metrics import (
    avoidance,
    collisions,
    correlation,
    environment,
    excursion,
    fitness_dimock,
    fitness_kidger,
    fitness_vasarhelyi,
    flocked,
    groups,
    marks,
    milling,
    nearest,
    polarisation,
    power,
    quality,
    rotation,
    shape,
    speed,
    steadiness,
    swarms,
)

STANDARD = tuple(
    metric(module) for module in (speed, correlation, nearest, collisions, excursion, rotation, polarisation)
)
ORDER = tuple(metric(module) for module in (speed, polarisation, milling, shape))
ZAPOTECATL = (metric(quality), metric(polarisation))
KIDGER = tuple(
    metric(module) for module in (flocked, swarms, polarisation, nearest, collisions, environment, avoidance, speed)
)
DIMOCK = (metric(power), metric(steadiness), metric(collisions))
SETS: dict[str, tuple[Metric, ...]] = {
    "vasarhelyi": STANDARD,
    "zapotecatl": ZAPOTECATL,
    "groups": (*ZAPOTECATL, metric(groups), metric(shape)),
    "order": ORDER,
    "kidger": KIDGER,
    "dimock": DIMOCK,
}
COUNTS: dict[str, Metric] = {"each": metric(quality), "program": metric(marks)}  # by the key metrics.count


def metrics_of(q: Any) -> tuple[Metric, ...]:
    """Metrics of a scenario from its parameters `metrics.*`: the set of kind, its collisions counted as count says."""
    return tuple(COUNTS[q.count] if found.name == "quality" else found for found in SETS[q.kind])


# what the engine itself keeps of a flight with goals
GOALS = {
    "goals_reached": ("", "goals reached by the flock's centre"),
    "goals": ("", "goals given"),
    "time_to_goal": ("s", "when each was reached"),
}

FITNESS: dict[str, dict[str, tuple[str, str]]] = {
    "vasarhelyi": fitness_vasarhelyi.REPORTS,
    "kidger": fitness_kidger.REPORTS,
    "dimock": fitness_dimock.REPORTS,
}


def numbers_of(q: Any, goals: bool = False) -> tuple[str, ...]:
    """Names of the order parameters that are one number, of flights scored by `metrics.*`, with goals or not.

    Partial fitnesses and fitness come last; time_to_goal, one number for each goal, is left out.
    """
    found = [name for each in metrics_of(q) for name in each.reports]
    found += [name for name in GOALS if goals and name != "time_to_goal"]
    return tuple(dict.fromkeys((*found, *FITNESS.get(q.kind, {}))))


def reports(kind: str) -> dict[str, tuple[str, str]]:
    """Unit and meaning of every order parameter that flights with a key metrics.kind report."""
    found = {name: about for each in SETS[kind] for name, about in each.reports.items()}
    return found | FITNESS.get(kind, {}) | GOALS
