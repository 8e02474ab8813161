"""Contacts with walls, obstacles and the scene, of any law: agents are spheres of radius q.r_body.

A contact begins when a sphere first reaches beyond where flying is allowed, and counts once until
it is free again. Our definition. Looked at every metrics.collision_period, so that a short touch is
not missed. Where and with what contacts happened is reported by
`airflock.recordings.measures.contacts` from a recording.
"""

from typing import NamedTuple

REPORTS = {
    "n_contacts": ("", "contacts with walls, obstacles and the scene"),
    "touching": ("", "share of agents and instants in contact"),
}
FORMULAS = {
    "n_contacts": (
        r"\textrm{number of contacts with walls, obstacles and the scene that begin}",
        "0 and more",
        "Agents are spheres of radius metrics.r_body. A lasting contact counts once, and again only after a "
        "separation.",
    ),
    "touching": (
        r"\left\langle \frac{1}{N}\sum_i \Theta(e_i + r_{body}) \right\rangle_t",
        "0 to 1",
        "Share of agents and instants in contact ($e_i$ is the excursion, m).",
    ),
}
NEEDS = {"n_contacts": ("r_body",), "touching": ("r_body",)}

CLOCK = "collision"
OVER_TIME = {"n_contacts": "sum"}


class Memory(NamedTuple):
    """1.0 while the agent touches."""

    touching: float = 0.0


class Agent(NamedTuple):
    """1.0 when a contact begins; 1.0 during one."""

    event: float
    touching: float


class Sample(NamedTuple):
    """New contacts; share of agents in contact."""

    n_contacts: float
    touching: float


def agent(excursion, memory, q):
    """Contact of one agent whose centre lies `excursion` (m) outside; negative where flying is allowed."""
    now = 1.0 if excursion > -q.r_body else 0.0
    return Agent(now * (1.0 - memory.touching), now), Memory(now)


def sample(agents, n):
    """Contacts of this instant."""
    return Sample(agents.event, agents.touching / n)
