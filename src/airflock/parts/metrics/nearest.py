"""Distance to the nearest neighbour, and agents out of everybody's radio range (Vásárhelyi et al. 2018, Methods)."""

import math
from typing import NamedTuple

from airflock.core import FAR

REPORTS = {
    "r_min_mean": ("m", "mean distance to the nearest neighbour"),
    "r_min": ("m", "smallest distance between two agents"),
    "n_disc": ("", "number of disconnected agents"),
}
FORMULAS = {
    "r_min_mean": (r"\left\langle \frac{1}{N}\sum_i \min_{j \ne i} r_{ij} \right\rangle_t", "0 and more"),
    "r_min": (
        r"\min_t \min_{i \ne j} r_{ij}",
        "0 and more",
        "The smallest distance that any two agents had at a sample.",
    ),
    "n_disc": (
        r"\left\langle \sum_i \Theta(\min_{j \ne i} r_{ij} - r_{comm}) \right\rangle_t",
        "0 to N",
        "Agents with nobody in radio range.",
    ),
}
NEEDS = {"n_disc": ("r_comm",)}

REDUCE = {"nearest2": "min", "least": "min"}  # of Pair, and of Agent
OVER_TIME = {"r_min": "min"}
PAIRED = ("r_min_mean", "r_min")  # undefined for one agent


class Pair(NamedTuple):
    """Squared distance to the nearest other agent, m²: the root is drawn once per agent, not once per pair."""

    nearest2: float


class Agent(NamedTuple):
    """Sum and minimum of the nearest distances, m; disconnected agents."""

    spacing: float
    least: float
    disconnected: float


class Sample(NamedTuple):
    """Mean and minimum of the nearest distances, m; number of disconnected agents."""

    r_min_mean: float
    r_min: float
    n_disc: float


def pair(r2):
    """Squared distance of one other agent, m²."""
    return Pair(r2)


def settled(pair, beyond):
    """Return True if no agent beyond this distance (m) can be the nearest one."""
    return pair.nearest2 <= beyond * beyond


def agent(pair, q):
    """Nearest distance (m) and whether it exceeds the radio range."""
    nearest = math.sqrt(pair.nearest2)
    alone = 1.0 if nearest > q.r_comm else 0.0
    return Agent(nearest if pair.nearest2 < FAR else 0.0, nearest, alone)


def sample(agents, n):
    """Mean and minimum over the n agents."""
    return Sample(agents.spacing / n, agents.least, agents.disconnected)


def total(over_time):
    """Nan where there never was a pair: one agent has no nearest neighbour."""
    if over_time["r_min"] < 0.5 * math.sqrt(FAR):
        return dict(over_time)
    return {**over_time, **dict.fromkeys(PAIRED, math.nan)}
