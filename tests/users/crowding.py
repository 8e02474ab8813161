"""How many others are near each agent."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

REPORTS = {"crowding": ("", "mean number of others within `near`")}
METRICS = ["polarisation"]


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One length."""

    near: float = airflock.quantity(15.0, "m", low=0.1, high=1e3, meaning="what is near")


class Pair(NamedTuple):
    """1.0 if a pair is near."""

    near: float


class Agent(NamedTuple):
    """How many are near."""

    near: float


class Sample(NamedTuple):
    """Mean."""

    crowding: float


def pair(r2, q):
    """One pair."""
    return Pair(1.0 if r2 < q.near * q.near else 0.0)


def agent(pair):
    """One agent."""
    return Agent(pair.near)


def sample(agents, n):
    """One instant."""
    return Sample(agents.near / n)
