"""Dryden turbulence: gusts whose spectrum is that of the military specification MIL-F-8785C (1980), section 3.7.

Up to 305 m above ground its lengths and intensities follow from the height h and the wind at 6 m
(20 ft), W:

    L_w = h,  L_u = L_v = h / (0.177 + 0.000823 h)^1.2 (feet),
    σ_w = 0.1 W,  σ_u = σ_v = σ_w / (0.177 + 0.000823 h)^0.4.

A flock that flies through frozen air at an airspeed V meets u, along the mean wind, as a process of
first order, and v across it and w upwards as processes with the spectrum Φ(ω) = σ² L/(πV) (1 + 3
(Lω/V)²) / (1 + (Lω/V)²)². Both are advanced exactly, so that variance and spectrum do not depend on
the time step. The flock is small beside L: all of it feels the same gust. The rates of rotation of
the specification are left out, as no body here has them.
"""

import math
from typing import NamedTuple

ROOT = math.sqrt(3.0)
FOOT = 0.3048  # m


class Numbers(NamedTuple):
    """Numbers of a driver: lengths (m), standard deviations (m/s), airspeed (m/s), unit vector of the mean wind."""

    length: float
    length_up: float
    sigma: float
    sigma_up: float
    airspeed: float
    east: float
    north: float


def numbers_of(a):
    """Numbers of the turbulence at a.height (m) with a.at_6m (m/s); a : record of the wind."""
    k = 0.177 + 0.000823 * a.height / FOOT
    up = 0.1 * a.at_6m
    level = math.hypot(a.east, a.north)
    east, north = (a.east / level, a.north / level) if level > 0.0 else (1.0, 0.0)
    return Numbers(a.height / k**1.2, a.height, up / k**0.4, up, a.airspeed, east, north)


def along(u, g, dt, length, sigma, airspeed):
    """Gust along the mean wind after dt: u (m/s) decays over a length (m) and is renewed by the normal number g."""
    keep = math.exp(-dt * airspeed / length)
    return keep * u + sigma * math.sqrt(1.0 - keep * keep) * g


def across(p, q, g, h, dt, length, airspeed):
    """The two states of a gust across the mean wind after dt, from normal numbers g and h; without a unit.

    p is a process of first order of variance 1, q follows it with the same lag. What comes anew of
    both in a step has the covariance that keeps their own: 1 of p, 1/2 of q and of both.
    """
    r = dt * airspeed / length
    keep = math.exp(-r)
    fresh = 1.0 - keep * keep
    both = 0.5 - keep * keep * (r + 0.5)
    rest = 0.5 - keep * keep * (r * r + r + 0.5)
    first = math.sqrt(fresh)
    return (
        keep * p + first * g,
        keep * q + keep * r * p + both / first * g + math.sqrt(max(rest - both * both / fresh, 0.0)) * h,
    )


def gust_of(p, q, sigma):
    """Gust (m/s) from its two states: its variance is sigma², its spectrum that of the specification."""
    return sigma * (ROOT * p + (1.0 - ROOT) * q) / math.sqrt(2.0)
