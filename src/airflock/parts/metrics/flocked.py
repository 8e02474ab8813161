"""Share of agents that are flocked, and the time until all are (Kidger, section 5.1).

Flocked means within q.r_flock of the centre of mass; the thesis halves a diameter.
"""

import math
from typing import NamedTuple

from airflock.core import FAR

REPORTS = {
    "flocked": ("", "share of agents within metrics.r_flock of the flock's centre"),
    "time_to_flock": ("s", "time until all agents are flocked for the first time"),
}
FORMULAS = {
    "flocked": (r"\left\langle \frac{1}{N} |\{i : |x_i - \bar x| \le r_{flock}\}| \right\rangle_t", "0 to 1"),
    "time_to_flock": (r"\min\{t : \textrm{all are flocked}\}", "0 to the duration; nan if never"),
}
NEEDS = {"flocked": ("r_flock",), "time_to_flock": ("r_flock",)}

OVER_TIME = {"time_to_flock": "min"}


class Agent(NamedTuple):
    """1.0 if flocked."""

    inside: float


class Sample(NamedTuple):
    """Share of the flock that is flocked; this instant (s) if all are, else FAR."""

    flocked: float
    time_to_flock: float


def agent(x, y, z, mean, q):
    """Count one agent if it is within q.r_flock of the centre of mass."""
    dx = x - mean.x
    dy = y - mean.y
    dz = z - mean.z
    return Agent(1.0 if dx * dx + dy * dy + dz * dz <= q.r_flock * q.r_flock else 0.0)


def sample(agents, n, time):
    """Share of this instant."""
    return Sample(agents.inside / n, time if agents.inside > n - 0.5 else FAR)


def total(over_time):
    """Nan where the flock was never complete."""
    time = over_time["time_to_flock"]
    return {**over_time, "time_to_flock": time if time < 0.5 * FAR else math.nan}
