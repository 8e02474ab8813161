"""Collision risk and number of collisions (Vásárhelyi et al. 2018, Eq. 14).

Theta(r_ij - r_coll) is printed; pairs nearer than r_coll count, as in the authors' program and as
in the text. An event is counted when an agent that was in nobody's reach comes within r_coll of an
agent with a lower index: a contact counts once, and again only after a separation.
"""

from typing import NamedTuple

REPORTS = {"phi_coll": ("", "share of pairs in contact (collision risk)"), "n_coll": ("", "number of collisions")}
FORMULAS = {
    "phi_coll": (
        r"\left\langle \frac{1}{N(N-1)}\sum_{i \ne j} \Theta(r_{coll} - r_{ij}) \right\rangle_t",
        "0 to 1",
        "Share of pairs in contact: the risk, while n_coll counts events.",
    ),
    "n_coll": (
        r"\textrm{number of contacts that begin}",
        "0 and more",
        "A contact begins when an agent with nobody within $r_{coll}$ comes that close to one of a lower index. A "
        "lasting contact counts once, and again only after a separation; an agent that joins a group in contact "
        "counts once. 0 in n flights does not mean never: see the bound under the table.",
    ),
}
NEEDS = {"phi_coll": ("r_coll",), "n_coll": ("r_coll",)}

CLOCK = "collision"
VIOLATES = {"renumbering": "of two that meet, the one with the higher index begins the event, if nobody was near it"}
OVER_TIME = {"n_coll": "sum"}


class Pair(NamedTuple):
    """Agents within r_coll; those among them with a lower index."""

    contacts: float
    lower: float


class Memory(NamedTuple):
    """1.0 while another agent is within r_coll."""

    danger: float = 0.0


class Agent(NamedTuple):
    """Contacts of one agent; 1.0 when a new collision begins."""

    contacts: float
    event: float


class Sample(NamedTuple):
    """Share of all pairs in contact; new collisions."""

    phi_coll: float
    n_coll: float


def within(q):
    """No contact beyond this distance, m."""
    return q.r_coll


def pair(r2, lower, q):
    """Contact with one other agent at a squared distance r2, m²."""
    contact = 1.0 if r2 <= q.r_coll * q.r_coll else 0.0
    return Pair(contact, contact * lower)


def settled(beyond, q):
    """Return True if no agent beyond this distance (m) can be in contact."""
    return q.r_coll <= beyond


def agent(pair, memory):
    """Contacts and events of one agent."""
    now = 1.0 if pair.contacts > 0.5 else 0.0
    event = 1.0 if (pair.lower > 0.5) & (memory.danger < 0.5) else 0.0
    return Agent(pair.contacts, event), Memory(now)


def sample(agents, n):
    """Share of the n (n - 1) ordered pairs in contact; events of this instant."""
    return Sample(agents.contacts / max(n * (n - 1.0), 1.0), agents.event)
