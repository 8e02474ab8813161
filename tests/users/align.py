"""A law of headings: the mean heading of the neighbours, turned by noise."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "heading"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """A radius and a noise."""

    radius: float = airflock.quantity(30.0, "m", low=0.0, high=1e4, meaning="radius of alignment")
    noise: float = airflock.quantity(0.3, "rad", low=0.0, high=6.3, meaning="width of the noise")


class Sums(NamedTuple):
    """Sum of headings."""

    x: float
    y: float
    z: float


def reach(p):
    """Radius of alignment, m."""
    return p.radius


def neighbour(nhx, nhy, nhz):
    """Heading of one neighbour."""
    return Sums(nhx, nhy, nhz)


def decide(own, sums, percept, p):
    """New heading."""
    x = sums.x + own.hx
    y = sums.y + own.hy
    z = sums.z + own.hz
    k = 1.0 / math.sqrt(x * x + y * y + z * z + 1e-12)
    angle = p.noise * (percept.uniform(0) - 0.5)
    c = math.cos(angle)
    s = math.sin(angle)
    return k * (c * x - s * y), k * (s * x + c * y), k * z
