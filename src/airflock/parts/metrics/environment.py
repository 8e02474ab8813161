"""Collisions with the environment: spheres of radius q.r_body that touch what stands in the scene (Kidger).

The way between two looks is swept, so that nothing thin is missed. A contact counts once, and again
only after a separation.
"""

from typing import NamedTuple

REPORTS = {"n_env_coll": ("", "collisions with the environment")}
FORMULAS = {
    "n_env_coll": (r"\textrm{number of contacts with the scene that begin}", "0 and more"),
}
NEEDS = {"n_env_coll": ("r_body",)}

CLOCK = "collision"
OVER_TIME = {"n_env_coll": "sum"}


class Memory(NamedTuple):
    """1.0 while the agent touches."""

    touching: float = 0.0


class Agent(NamedTuple):
    """1.0 when a contact begins."""

    event: float


class Sample(NamedTuple):
    """New contacts."""

    n_env_coll: float


def agent(touches, memory):
    """Event of one agent."""
    return Agent(1.0 if (touches > 0.5) & (memory.touching < 0.5) else 0.0), Memory(touches)


def sample(agents):
    """Events of this instant."""
    return Sample(agents.event)
