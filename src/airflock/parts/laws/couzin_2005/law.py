"""Effective leadership and decision-making in animal groups on the move (Couzin et al. 2005).

Who is nearer than alpha is avoided, before everything else. Otherwise an animal turns towards those
within rho and along them and itself, one unit vector each. A few are informed: they add to that a
direction which they prefer, with the weight omega. Nobody knows who is informed. A group is led so,
the more exactly the more are informed, and a large group by a smaller share of them.

Who is informed is said by groups: omega and direction are numbers of theirs, and omega is 0 for all
others.

Differences
-----------
The paper's text was not at hand; numbers are as its model is commonly told. Its lengths have no
unit; here metres. The preferred direction is added where nobody is avoided. The random error of the
direction is a Gaussian of width sigma on each axis, made a unit vector again. Where vectors cancel,
the heading is kept. The turning rate is the body's: body.turn.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, quantity, unit

COMMAND = "heading"
TERMS = {"r": ("avoidance", ""), "o": ("alignment", ""), "a": ("attraction", "")}
PARTS = {"zones": ("alpha", "rho"), "leading": ("omega", "direction"), "error": ("sigma",)}
PAPER = "Couzin et al. 2005, as commonly told"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Radii of avoidance and attraction, the preferred direction of informed animals and its weight, and the error."""

    alpha: float = quantity(
        1.0, "m", low=0.0, high=1e4, source=PAPER, meaning="distance below which a neighbour is avoided"
    )
    rho: float = quantity(
        6.0, "m", low=0.0, high=1e4, source=PAPER, meaning="distance up to which a neighbour is followed"
    )
    omega: float = quantity(
        0.0, "1", low=0.0, high=100.0, usual=(0.0, 1.0), source=PAPER,
        meaning="weight of the preferred direction relative to that of the others; 0 for uninformed animals",
    )  # fmt: skip
    direction: float = quantity(
        0.0, "rad", low=-2.0 * math.pi, high=2.0 * math.pi, source="our choice: east",
        meaning="preferred direction, anticlockwise from east",
    )  # fmt: skip
    sigma: float = quantity(0.01, "rad", low=0.0, high=3.0, source=PAPER, meaning="error of the direction, per axis")


class Sums(NamedTuple):
    """Unit vectors away from those too near; headings of, and unit vectors towards, those in company; how many near."""

    rx: float
    ry: float
    rz: float
    ox: float
    oy: float
    oz: float
    ax: float
    ay: float
    az: float
    close: float


def reach(p):
    """Largest distance at which another one matters, m; who is farther is not avoided either, whatever alpha is."""
    return p.rho


def interaction_range(p):
    """Radius within which agents count as one group, m."""
    return p.rho


def neighbour(dx, dy, dz, r, nhx, nhy, nhz, p):
    """Contribution of one neighbour: avoided within alpha, else followed within rho."""
    close = 1.0 if r < p.alpha else 0.0
    o = 1.0 if (r >= p.alpha) & (r <= p.rho) else 0.0
    k = -close / r
    a = o / r
    return Sums(k * dx, k * dy, k * dz, o * nhx, o * nhy, o * nhz, a * dx, a * dy, a * dz, close)


def decide(own, sums, percept, p):
    """Desired heading: away from who is too near; else towards and along the others, and where it prefers to go."""
    alone = sums.close < 0.5
    x, y, z = unit(
        sums.ax + sums.ox + own.hx if alone else sums.rx,
        sums.ay + sums.oy + own.hy if alone else sums.ry,
        sums.az + sums.oz + own.hz if alone else sums.rz,
    )
    lead = p.omega if alone else 0.0
    x, y, z = unit(x + lead * math.cos(p.direction), y + lead * math.sin(p.direction), z)
    keep = x * x + y * y + z * z < 0.25
    return unit(
        (own.hx if keep else x) + p.sigma * percept.normal(0),
        (own.hy if keep else y) + p.sigma * percept.normal(1),
        (own.hz if keep else z) + p.sigma * percept.normal(2),
    )
