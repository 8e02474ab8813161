"""Excursion beyond walls and into obstacles (Vásárhelyi et al. 2018, Eq. 15): mean over those out; 0 if nobody is."""

from typing import NamedTuple

REPORTS = {"phi_wall": ("m", "mean excursion of those outside")}

OVER_TIME = {"out": "sum", "outside": "sum"}


class Agent(NamedTuple):
    """Distance outside, m; 1.0 if outside."""

    out: float
    outside: float


class Sample(NamedTuple):
    """Sum of the distances outside, m; number of agents outside."""

    out: float
    outside: float


def agent(excursion):
    """Distance outside (m) of one agent."""
    return Agent(max(excursion, 0.0), 1.0 if excursion > 0.0 else 0.0)


def sample(agents):
    """Numerator and denominator of Eq. 15 at one instant."""
    return Sample(agents.out, agents.outside)


def total(over_time):
    """phi_wall, m, from the sums over time."""
    return {"phi_wall": over_time["out"] / over_time["outside"] if over_time["outside"] > 0.0 else 0.0}
