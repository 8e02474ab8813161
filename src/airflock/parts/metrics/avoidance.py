"""Avoidance: how often agents avoid what is ahead, and its cost in rays (Kidger, section 4.6.2).

An agent avoids when its ray ahead is not free, so that it casts more than one.
"""

from typing import NamedTuple

REPORTS = {
    "avoiding": ("", "share of agents whose way ahead is not free"),
    "n_avoid": ("", "number of avoidances begun, per agent"),
    "rays": ("", "rays cast per agent and decision"),
}

OVER_TIME = {"n_avoid": "sum"}


class Memory(NamedTuple):
    """1.0 while the agent avoids."""

    avoiding: float = 0.0


class Agent(NamedTuple):
    """1.0 while avoiding; 1.0 when it begins; rays cast."""

    avoiding: float
    event: float
    rays: float


class Sample(NamedTuple):
    """Share of agents that avoid; new avoidances per agent; rays per agent and decision."""

    avoiding: float
    n_avoid: float
    rays: float


def agent(rays, memory):
    """Avoidance of one agent."""
    now = 1.0 if rays > 1.5 else 0.0
    return Agent(now, now * (1.0 - memory.avoiding), rays), Memory(now)


def sample(agents, n):
    """Per agent at this instant."""
    return Sample(agents.avoiding / n, agents.event / n, agents.rays / n)
