"""Excursion beyond walls and into obstacles (Vásárhelyi et al. 2018, Eq. 15), and clearance, the room that is left.

phi_wall is the mean over those outside, and 0 if nobody is: it says nothing about flights that
stayed inside. The smallest clearance says how near the nearest of them came; it is below 0 where
somebody was outside.
"""

import math
from typing import NamedTuple

from airflock.core import FAR

REPORTS = {
    "phi_wall": ("m", "mean excursion of agents that are outside"),
    "clearance": ("m", "smallest distance to walls and obstacles; below 0: outside"),
}
FORMULAS = {
    "phi_wall": (
        r"\frac{\sum_t \sum_i \max(e_i, 0)}{\sum_t \sum_i \Theta(e_i)}",
        "0 and more",
        "How far outside the agents outside are ($e_i$, m). It does not say how many are outside.",
    ),
    "clearance": (
        r"\min_t \min_i (-e_i)",
        "any; below 0 if an agent was outside",
        "How near the nearest agent came to a wall or an obstacle ($e_i$ is the excursion, m), at a sample. It "
        "distinguishes flights in which phi_wall is 0, so a search can keep a limit such as `clearance<0 at 0.01/h`.",
    ),
}
COURSES = {"out": ("m", "sum of the distances of those outside"), "outside": ("", "number of agents outside")}

REDUCE = {"clearance": "min"}
OVER_TIME = {"out": "sum", "outside": "sum", "clearance": "min"}


class Agent(NamedTuple):
    """Distance outside, m; 1.0 if outside; distance to the nearest wall or obstacle, m."""

    out: float
    outside: float
    clearance: float


class Sample(NamedTuple):
    """Sum of the distances outside, m; number of agents outside; smallest clearance, m."""

    out: float
    outside: float
    clearance: float


def agent(excursion):
    """Distance outside (m) of one agent, and its clearance (m)."""
    # The clearance is a distance so that a search can see how near a flight came: contacts are 0 in
    # every good flight.
    return Agent(max(excursion, 0.0), 1.0 if excursion > 0.0 else 0.0, -excursion)


def sample(agents):
    """Numerator and denominator of Eq. 15 at one instant, and the smallest clearance."""
    return Sample(agents.out, agents.outside, agents.clearance)


def total(over_time):
    """phi_wall and clearance, m, from the sums and the least over time; nan where nothing stands."""
    outside, clearance = over_time["outside"], over_time["clearance"]
    return {
        "phi_wall": over_time["out"] / outside if outside > 0.0 else 0.0,
        "clearance": clearance if clearance < 0.5 * math.sqrt(FAR) else math.nan,
    }
