"""Prey that swarm and flee, and predators that hunt them (Chen and Kolokolnikov 2014).

Each prey is driven away from its fellows as 1/r, towards them as r, and away from predators as 1/r.
A predator is drawn to all prey, to those that are near the most. There is no inertia. A weak
predator stops in the middle of a ring of prey, which confuse it; a stronger one chases the swarm,
which opens before it and closes behind it.

Who is prey and who is a predator is said by groups: `role` is a choice, and each takes those of its
own group for its kind and all others for the other kind.

Differences
-----------
The paper's lengths and times have no units; here metres and seconds, and the repulsion has a
strength of its own, which is 1 in the paper. The paper has one predator; of several each drives
prey away by itself, and they do not notice each other. Where the paper divides by the number of all
prey, an agent divides by that of the prey it meets, itself among them. Nobody flies faster than
`v_max`, which the paper does not limit.
"""

from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, choice, quantity, shorten

COMMAND = "velocity"
TERMS = {"t": ("pull of its kind and prey", "m/s"), "f": ("flight from predators", "m/s")}
PAPER = "Chen and Kolokolnikov 2014"
OURS = "our choice"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """The role of an agent, and the strengths of the forces on prey and predators."""

    role: str = choice("prey", ("prey", "predator"), source=PAPER, meaning="whether an agent is hunted or hunts")
    k_rep: float = quantity(1.0, "m^2/s", low=0.0, high=1e6, source=f"{PAPER}: 1", meaning="repulsion between prey")
    k_att: float = quantity(1.0, "1/s", low=0.0, high=1e6, source=OURS, meaning="attraction between prey (a)")
    k_flee: float = quantity(
        0.2, "m^2/s", low=0.0, high=1e6, source=OURS, meaning="repulsion of prey by a predator (b)"
    )
    v_hunt: float = quantity(
        0.4, "m/s", low=0.0, high=1e4, source=OURS, meaning="speed at which prey at r_hunt draws a predator (c)"
    )
    r_hunt: float = quantity(
        1.0, "m", low=1e-6, high=1e6, source="the unit of length", meaning="distance to which v_hunt refers"
    )
    decay: float = quantity(
        3.0,
        "1",
        low=1.0,
        high=10.0,
        source=OURS,
        meaning="how fast the pull of prey falls with distance: as r^(1 - decay) (p)",
    )
    v_max: float = quantity(100.0, "m/s", low=0.0, high=1e4, source=OURS, meaning="largest speed")


class Sums(NamedTuple):
    """Velocity by those who draw or repel an agent as its fellows or its prey, by those it flees, number of prey."""

    tx: float
    ty: float
    tz: float
    fx: float
    fy: float
    fz: float
    n: float


def neighbour(dx, dy, dz, r, r2, kin, p):
    """Effect of one neighbour on prey (its fellows, and predators), or on a predator (prey), m/s."""
    other = 1.0 - kin
    if p.role == "prey":
        k = kin * (p.k_att - p.k_rep / r2)
        f = -other * p.k_flee / r2
        n = kin
    else:
        k = other * p.v_hunt / p.r_hunt * (r / p.r_hunt) ** -p.decay
        f = 0.0
        n = other
    return Sums(k * dx, k * dy, k * dz, f * dx, f * dy, f * dz, n)


def decide(sums, p):
    """Velocity: the mean over prey, and for prey the flight from every predator."""
    share = 1.0 / (sums.n + 1.0 if p.role == "prey" else max(sums.n, 1.0))
    return shorten(
        share * sums.tx + sums.fx,
        share * sums.ty + sums.fy,
        share * sums.tz + sums.fz,
        p.v_max,
    )
