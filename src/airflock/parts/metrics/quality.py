"""Extension, polarization, collisions, consistencies and quality of a flock (Zapotecatl et al. 2016, Eqs 13-24).

Polarization is an angle in degrees, 0 if all fly alike; not to be confused with the order parameter
polarisation, 1 if all fly alike. Its printed range ends at 90°, the program's at 180°, as here. Eq.
18 says r_b is the radius of the body, yet compares the distance of two centres with it; so does the
program, and so do we.
"""

import math
from typing import NamedTuple

from airflock.core import angle_between, norm

REPORTS = {
    "extension_cm": ("cm", "mean distance to the centre"),
    "polarization_deg": ("deg", "mean angle to the mean heading, 0 is aligned"),
    "f_collision": ("", "share of agents that collide"),
    "cns_ext": ("", "consistency in extension"),
    "cns_pol": ("", "consistency in polarization"),
    "quality": ("", "quality of the flock, 1 is best"),
}
FORMULAS = {
    "extension_cm": (r"\left\langle \frac{1}{N}\sum_i |x_i - \bar x| \right\rangle_t", "0 and more"),
    "polarization_deg": (
        r"\left\langle \frac{1}{N}\sum_i \arccos(h_i \cdot \hat{\bar h}) \right\rangle_t",
        "0 to 180",
        "An angle: 0 is aligned. Not the order parameter polarisation, where 1 is aligned.",
    ),
    "f_collision": (r"\left\langle \frac{1}{N}\sum_i \Theta(r_b - \min_{j \ne i} r_{ij}) \right\rangle_t", "0 to 1"),
    "cns_ext": (r"1 - \frac{1}{N\,e_{max}}\left(\sum_{free} |x_i - \bar x| + k\,N_{coll}\right)", "up to 1; 1 is best"),
    "cns_pol": (r"1 - \frac{1}{N\,\pi}\left(\sum_{free} \theta_i + \rho\,N_{coll}\right)", "0 to 1; 1 is best"),
    "quality": (r"\sigma\,\textrm{cns}_{ext} + \gamma\,\textrm{cns}_{pol}", "up to 1; 1 is best"),
}
NEEDS = {"f_collision": ("r_b",), "cns_ext": ("max_e", "r_b"), "cns_pol": ("r_b",), "quality": ("max_e", "r_b")}
COURSES = {
    "extension": ("m", "mean distance to the centre"),
    "polarization": ("rad", "mean angle to the mean heading, 0 is aligned"),
}

REDUCE = {"nearest2": "min"}


class Pair(NamedTuple):
    """Squared distance to the nearest other agent, m²."""

    nearest2: float


class Agent(NamedTuple):
    """Distance to the centre (m), angle to the mean heading (rad), 1.0 in collision; both where not in collision."""

    offset: float
    angle: float
    collides: float
    free_offset: float
    free_angle: float


class Sample(NamedTuple):
    """Extension (m), polarization (rad), frequency of collision, both consistencies and quality of one instant."""

    extension: float
    polarization: float
    f_collision: float
    cns_ext: float
    cns_pol: float
    quality: float


def pair(r2):
    """Squared distance of one other agent, m²."""
    return Pair(r2)


def settled(pair, beyond):
    """Return True if no agent beyond this distance (m) can be the nearest one."""
    return pair.nearest2 <= beyond * beyond


def offset_from(x, y, z, mean):
    """Distance (m) from a position to a mean position: a term of Eq. 14."""
    return math.sqrt((x - mean.x) * (x - mean.x) + (y - mean.y) * (y - mean.y) + (z - mean.z) * (z - mean.z))


def angle_from(hx, hy, hz, mean):
    """Angle (rad) between a heading and a mean heading (Eq. 16); a quarter turn where one of them is zero."""
    f = 1.0 / norm(mean.hx, mean.hy, mean.hz)
    return angle_between(hx, hy, hz, f * mean.hx, f * mean.hy, f * mean.hz)


def agent(x, y, z, hx, hy, hz, pair, mean, q):
    """Terms of Eqs 14, 17, 18, 21 and 22 for one agent."""
    offset = offset_from(x, y, z, mean)
    angle = angle_from(hx, hy, hz, mean)
    collides = 1.0 if pair.nearest2 < q.r_b * q.r_b else 0.0
    return Agent(offset, angle, collides, (1.0 - collides) * offset, (1.0 - collides) * angle)


def sample(agents, n, q):
    """Eqs 14, 17, 20-23."""
    ext = 1.0 - (agents.free_offset + q.k * agents.collides) / (q.max_e * n)
    pol = 1.0 - (agents.free_angle + q.rho * agents.collides) / (math.pi * n)
    return Sample(agents.offset / n, agents.angle / n, agents.collides / n, ext, pol, q.sigma * ext + q.gamma * pol)


def total(over_time):
    """The paper's names and units."""
    return {
        "extension_cm": 100.0 * over_time["extension"],
        "polarization_deg": math.degrees(over_time["polarization"]),
        **{name: over_time[name] for name in ("f_collision", "cns_ext", "cns_pol", "quality")},
    }


def errors(q, largest, edges):
    """Return the errors of the parameters of the set beyond single ranges; largest: extension of the arena, m."""
    most = q.max_e if q.max_e is not None else largest
    found = []
    if q.count == "program" and edges == "periodic":
        found.append("metrics.count = 'program': the program knows no periodic box (world.edges); count each")
    if q.k is not None and most and q.k > most * (1.0 + 1e-9):
        found.append(f"metrics.k = {q.k:g} m lies outside [0, {most:g}] m, the largest extension metrics.max_e")
    if abs(q.sigma + q.gamma - 1.0) > 1e-9:
        found.append(f"metrics.sigma + metrics.gamma = {q.sigma + q.gamma:g} is not 1")
    return found
