"""Novel type of phase transition in a system of self-driven particles (Vicsek et al. 1995), Eqs 1-2.

Each particle flies at constant speed in the mean direction of all within r of it, itself included,
turned by a uniform random angle of width eta. At low noise and high density all fly alike; at high
noise nobody does. Used in a periodic square with positions that move by the old velocity (Eq. 1:
body.integration = "old", body.speed = v).

Differences
-----------
The paper's lengths and times have no units; here r = 1 m and dt = 1 s. The random angle turns about
the vertical; in 3-D, which the paper does not have, a climb is averaged and kept.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, quantity, unit

COMMAND = "heading"
TERMS = {"": ("heading of the neighbour", "")}


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Radius and noise."""

    r: float = quantity(1.0, "m", low=0.0, high=1e6, source="the unit of length", meaning="radius of alignment")
    eta: float = quantity(
        0.1, "rad", low=0.0, high=6.2831854, source="Fig. 1 (d)", meaning="width of the noise: from -eta/2 to eta/2"
    )


class Sums(NamedTuple):
    """Sum of the headings of the neighbours."""

    x: float
    y: float
    z: float


def reach(p):
    """Radius of alignment, m."""
    return p.r


def neighbour(nhx, nhy, nhz):
    """Heading of one neighbour."""
    return Sums(nhx, nhy, nhz)


def decide(own, sums, percept, p):
    """New heading: the mean one, turned by a random angle (Eq. 2)."""
    x, y, z = unit(sums.x + own.hx, sums.y + own.hy, sums.z + own.hz)
    angle = p.eta * (percept.uniform(0) - 0.5)
    c = math.cos(angle)
    s = math.sin(angle)
    return c * x - s * y, s * x + c * y, z
