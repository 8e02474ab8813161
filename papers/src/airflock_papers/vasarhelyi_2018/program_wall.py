"""Excursion as the authors' program averages it, beside Eq. 15: order parameters with F_wall and fitness by both.

Eq. 15 averages over agents and instants. The program takes the mean over the agents outside at each instant, then the
mean over the instants with somebody outside; before the first exit each instant counts with 0, so that a late exit is
diluted. Agents are sampled every `metrics.period`, where the program looks at each step.
"""

from collections.abc import Mapping
from typing import NamedTuple

from airflock.core import FAR, bell
from airflock.parts.metric_sets import vasarhelyi as fitness_vasarhelyi
from airflock.parts.metrics import Parameters

METRICS = ("speed", "correlation", "nearest", "collisions", "excursion")
REPORTS = {
    "phi_wall_program": ("m", "mean excursion as the authors' program averages it"),
    "f_wall_program": ("", "partial fitness of that excursion"),
    "fitness_program": ("", "product of the partial fitnesses with it"),
    **fitness_vasarhelyi.REPORTS,
}
OVER_TIME = {"mean_out": "sum", "exits": "sum", "instants": "sum", "exit": "min", "first": "min", "last": "max"}
BEST = "fitness"


class Agent(NamedTuple):
    """Distance outside, m; 1.0 if outside."""

    beyond: float
    away: float


class Sample(NamedTuple):
    """Mean distance of those outside, m; 1.0 if there are any; 1.0; time of an exit, time, time again, s."""

    mean_out: float
    exits: float
    instants: float
    exit: float
    first: float
    last: float


def agent(excursion):  # type: ignore[no-untyped-def]
    """Distance outside (m) of one agent."""
    return Agent(max(excursion, 0.0), 1.0 if excursion > 0.0 else 0.0)


def sample(agents, time):  # type: ignore[no-untyped-def]
    """Mean excursion at one instant, and when."""
    some = agents.away > 0.0
    return Sample(agents.beyond / max(agents.away, 1.0), 1.0 if some else 0.0, 1.0, time if some else FAR, time, time)


def total(over_time: Mapping[str, float]) -> dict[str, float]:
    """The program's average, m, from sums and extremes over time."""
    if over_time["exits"] < 0.5:
        return {"phi_wall_program": 0.0}
    pause = (over_time["last"] - over_time["first"]) / max(over_time["instants"] - 1.0, 1.0)
    before = (over_time["exit"] - over_time["first"]) / pause if pause > 0.0 else 0.0
    return {"phi_wall_program": over_time["mean_out"] / (over_time["exits"] + before)}


def fitness(values: Mapping[str, float], agents: int, q: Parameters) -> dict[str, float]:
    """Partial fitnesses and their product with Eq. 15, and F_wall and the product with the program's average."""
    found = fitness_vasarhelyi.fitness(values, agents, q)
    wall = bell(values["phi_wall_program"], q.r_tol)
    others = ("f_speed", "f_coll", "f_disc", "f_cluster", "f_corr")
    product = wall
    for name in others:
        product *= found[name]
    return {**found, "f_wall_program": wall, "fitness_program": product}
