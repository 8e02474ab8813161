"""How far agents are spread along the east."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

REPORTS = {"spread": ("m", "mean distance to the centre, east"), "fitness": ("", "narrow is good")}
METRICS = ["speed"]


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One length."""

    width: float = airflock.quantity(10.0, "m", low=0.1, high=1e3, meaning="a narrow flock")


class Agent(NamedTuple):
    """Distance, m."""

    offset: float


class Sample(NamedTuple):
    """Mean, m."""

    spread: float


def agent(x, mean):
    """Distance of one agent, m."""
    return Agent(abs(x - mean.x))


def sample(agents, n):
    """Mean, m."""
    return Sample(agents.offset / n)


def fitness(values, agents, q):
    """Narrow is good."""
    return {"fitness": q.width / (q.width + values["spread"]) * (agents / 4.0)}
