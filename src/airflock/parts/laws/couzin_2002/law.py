"""Collective memory and spatial sorting in animal groups (Couzin et al. 2002), Eqs 1-3.

Three zones, one around the other: repulsion within r_r goes before everything; else alignment with
those in the zone of orientation and attraction to those in the zone of attraction, half and half.
Nobody sees behind. As the zone of orientation widens, a group passes from swarm to torus to dynamic
and highly parallel motion.

Differences
-----------
Units are body lengths and seconds in the paper; here metres. The random direction error, a wrapped
Gaussian on the sphere, is a Gaussian of width sigma on each axis, made a unit vector again: equal
to first order at 0.05 rad. Where nobody is in any zone, or the vectors cancel, the heading is kept.
The turning rate is the body's: body.turn.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, quantity, unit

COMMAND = "heading"
TERMS = {"r": ("repulsion", ""), "o": ("orientation", ""), "a": ("attraction", "")}
USUAL = {"fov_deg": 360.0}
PARTS = {"zones": ("r_r", "dr_o", "dr_a"), "perception": ("fov_deg", "sigma")}
TABLE = "Couzin et al. 2002, Table 1"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Widths of the zones, blind angle and error. The widths are counted from the next zone inwards."""

    r_r: float = quantity(1.0, "m", low=0.0, high=1e4, source=TABLE, meaning="radius of repulsion")
    dr_o: float = quantity(2.0, "m", low=0.0, high=1e4, source=TABLE, meaning="width of the zone of orientation")
    dr_a: float = quantity(13.0, "m", low=0.0, high=1e4, source=TABLE, meaning="width of the zone of attraction")
    fov_deg: float = quantity(270.0, "deg", low=0.0, high=360.0, source=TABLE, meaning="full field of view (alpha)")
    sigma: float = quantity(0.05, "rad", low=0.0, high=3.0, source=TABLE, meaning="error of the direction, per axis")


class Sums(NamedTuple):
    """Sums over each zone: repulsion (unit vectors away), orientation (headings), attraction (unit vectors towards)."""

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
    """Outer edge of the zone of attraction, m."""
    return p.r_r + p.dr_o + p.dr_a


def interaction_range(p):
    """Radius within which agents count as one group, m."""
    return p.r_r + p.dr_o + p.dr_a


def neighbour(dx, dy, dz, r, hx, hy, hz, nhx, nhy, nhz, p):
    """Contributions of one neighbour to the zone it is in; who is in the blind angle counts for repulsion only."""
    ahead = dx * hx + dy * hy + dz * hz
    seen = (p.fov_deg >= 360.0) | (ahead >= math.cos(p.fov_deg * (0.5 * math.pi / 180.0)) * r)
    close = 1.0 if r < p.r_r else 0.0
    far = r >= p.r_r + p.dr_o
    o = 1.0 if seen & (r >= p.r_r) & (r < p.r_r + p.dr_o) else 0.0
    a = (1.0 if seen & far & (r >= p.r_r) else 0.0) / r
    k = -close / r
    return Sums(k * dx, k * dy, k * dz, o * nhx, o * nhy, o * nhz, a * dx, a * dy, a * dz, close)


def decide(own, sums, percept, p):
    """Desired heading: away from who is too near, else along and towards the others; then an error (Eqs 1-3)."""
    alone = sums.close < 0.5
    x, y, z = unit(
        sums.ox + sums.ax if alone else sums.rx,
        sums.oy + sums.ay if alone else sums.ry,
        sums.oz + sums.az if alone else sums.rz,
    )
    keep = x * x + y * y + z * z < 0.25
    return unit(
        (own.hx if keep else x) + p.sigma * percept.normal(0),
        (own.hy if keep else y) + p.sigma * percept.normal(1),
        (own.hz if keep else z) + p.sigma * percept.normal(2),
    )
