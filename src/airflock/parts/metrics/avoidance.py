"""Avoidance: how often agents avoid what is ahead, and its cost in rays (Kidger, section 4.6.2).

An agent avoids when its ray ahead is not free, so that it casts more than one.
"""

from typing import NamedTuple

REPORTS = {
    "avoiding": ("", "share of agents whose way ahead is not free"),
    "n_avoid": ("", "number of avoidances begun, per agent"),
    "rays": ("", "rays cast per agent and decision"),
}
FORMULAS = {
    "avoiding": (r"\left\langle \frac{1}{N} |\{i : \textrm{the way ahead is not free}\}| \right\rangle_t", "0 to 1"),
    "n_avoid": (r"\frac{1}{N} \cdot \textrm{number of avoidances that begin}", "0 and more"),
    "rays": (r"\left\langle \frac{1}{N}\sum_i \textrm{rays}_i \right\rangle_t", "1 to model.rays"),
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
