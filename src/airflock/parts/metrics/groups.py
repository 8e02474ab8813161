"""Sub-groups as separate flocks: what Zapotecatl et al. 2016 leave as future work. Our definitions.

Extension and quality of the whole cannot distinguish a dispersed flock from one that split into
tight groups. Here agents nearer than r_cluster belong to one group. Distances and angles are taken
from the own group, and an agent without companions costs as much as one in collision:

    cns_ext_groups = 1 - (sum of distances to the own group's centre + k · (colliding + alone)) /
    (max_e n)

One group: equal to cns_ext. Tight groups far apart: near 1 while cns_ext falls. Everybody alone: 1
- k/max_e.
"""

import math
from typing import NamedTuple

from airflock.parts.metrics.quality import angle_from, offset_from

REPORTS = {
    "n_groups": ("", "number of groups of two or more agents"),
    "share_alone": ("", "share of agents that are alone"),
    "share_largest": ("", "share of agents in the largest group"),
    "extension_groups_cm": ("cm", "extension within groups"),
    "polarization_groups_deg": ("deg", "polarization within groups"),
    "cns_ext_groups": ("", "consistency in extension within groups"),
    "cns_pol_groups": ("", "consistency in polarization within groups"),
    "quality_groups": ("", "quality of groups"),
    "local_density": ("1/m² or 1/m³", "density of agents around an agent"),
}
FORMULAS = {
    "n_groups": (r"\left\langle |\{c : N_c \ge 2\}| \right\rangle_t", "0 to N/2"),
    "share_alone": (r"\left\langle \frac{1}{N} |\{i : N_i = 1\}| \right\rangle_t", "0 to 1"),
    "share_largest": (r"\left\langle \frac{1}{N}\max_c N_c \right\rangle_t", "1/N to 1"),
    "extension_groups_cm": (r"\left\langle \frac{1}{N_g}\sum_i |x_i - \bar x_{c(i)}| \right\rangle_t", "0 and more"),
    "polarization_groups_deg": (
        r"\left\langle \frac{1}{N_g}\sum_i \arccos(h_i \cdot \hat{\bar h}_{c(i)}) \right\rangle_t",
        "0 to 180",
    ),
    "cns_ext_groups": (
        r"1 - \frac{1}{N\,e_{max}}\left(\sum_{free} |x_i - \bar x_{c(i)}| + k\,(N_{coll} + N_{alone})\right)",
        "up to 1; 1 is best",
    ),
    "cns_pol_groups": (
        r"1 - \frac{1}{N\,\pi}\left(\sum_{free} \theta_{i,c(i)} + \rho\,(N_{coll} + N_{alone})\right)",
        "0 to 1; 1 is best",
    ),
    "quality_groups": (r"\sigma\,\textrm{cns}_{ext,groups} + \gamma\,\textrm{cns}_{pol,groups}", "up to 1; 1 is best"),
    "local_density": (
        r"\left\langle \frac{1}{N}\sum_i \frac{|\{j : r_{ij} < r_{cluster}\}|}{V(r_{cluster})} \right\rangle_t",
        "0 and more",
    ),
}
NEEDS = {
    "n_groups": ("r_cluster",),
    "share_alone": ("r_cluster",),
    "share_largest": ("r_cluster",),
    "extension_groups_cm": ("r_cluster",),
    "polarization_groups_deg": ("r_cluster",),
    "cns_ext_groups": ("max_e", "r_b", "r_cluster"),
    "cns_pol_groups": ("r_b", "r_cluster"),
    "quality_groups": ("max_e", "r_b", "r_cluster"),
    "local_density": ("r_cluster",),
}
COURSES = {
    "extension_groups": ("m", "extension within groups"),
    "polarization_groups": ("rad", "polarization within groups"),
}

REDUCE = {"nearest2": "min", "largest": "max"}


class Pair(NamedTuple):
    """Squared distance to the nearest other agent (m²); agents within r_cluster."""

    nearest2: float
    within: float


class Member(NamedTuple):
    """Distance (m) and angle (rad) from the own group, all and without those in collision; those in collision."""

    offset: float
    angle: float
    free_offset: float
    free_angle: float
    collides: float


class Cluster(NamedTuple):
    """Sums over the groups of two and more; groups; agents alone; members of the largest group."""

    offset: float
    angle: float
    lost: float
    lost_offset: float
    lost_angle: float
    groups: float
    alone: float
    largest: float


class Agent(NamedTuple):
    """Agents within r_cluster of one agent."""

    company: float


class Sample(NamedTuple):
    """n_groups (2 agents and more); share alone and in the largest group; extension (m) and polarization (rad) within
    groups; consistencies and quality of groups; agents per m² or m³ around an agent.
    """

    n_groups: float
    share_alone: float
    share_largest: float
    extension_groups: float
    polarization_groups: float
    cns_ext_groups: float
    cns_pol_groups: float
    quality_groups: float
    local_density: float


def pair(r2, q):
    """Squared distance of one other agent, m²; 1.0 if it is within r_cluster."""
    return Pair(r2, 1.0 if r2 < q.r_cluster * q.r_cluster else 0.0)


def settled(pair, beyond, q):
    """Return True if no agent beyond this distance (m) can be the nearest one, or within r_cluster."""
    return (pair.nearest2 <= beyond * beyond) & (q.r_cluster <= beyond)


def linked(r2, q):
    """Return True if two agents at a squared distance r2 (m²) belong to one group."""
    return r2 < q.r_cluster * q.r_cluster


def linked_within(q):
    """Distance beyond which no two agents are linked, m."""
    return q.r_cluster


def member(x, y, z, hx, hy, hz, pair, mean, q):
    """One agent in its group, whose mean is `mean`."""
    offset = offset_from(x, y, z, mean)
    angle = angle_from(hx, hy, hz, mean)
    collides = 1.0 if pair.nearest2 < q.r_b * q.r_b else 0.0
    return Member(offset, angle, (1.0 - collides) * offset, (1.0 - collides) * angle, collides)


def cluster(n, members):
    """A group, or an agent alone."""
    alone = 1.0 if n < 1.5 else 0.0
    company = 1.0 - alone
    return Cluster(
        company * members.offset,
        company * members.angle,
        alone + members.collides,
        company * members.free_offset,
        company * members.free_angle,
        company,
        alone,
        company * n,
    )


def agent(pair):
    """Agents within r_cluster of one agent."""
    return Agent(pair.within)


def sample(clusters, agents, n, q, dimensions):
    """Values of one instant; local density counts the neighbours in the disc or ball of radius r_cluster."""
    grouped = max(n - clusters.alone, 1.0)
    ext = 1.0 - (clusters.lost_offset + q.k * clusters.lost) / (q.max_e * n)
    pol = 1.0 - (clusters.lost_angle + q.rho * clusters.lost) / (math.pi * n)
    r = q.r_cluster
    room = math.pi * r * r if dimensions < 2.5 else 4.0 / 3.0 * math.pi * r * r * r
    return Sample(
        clusters.groups,
        clusters.alone / n,
        clusters.largest / n,
        clusters.offset / grouped,
        clusters.angle / grouped,
        ext,
        pol,
        q.sigma * ext + q.gamma * pol,
        agents.company / (n * room),
    )


def total(over_time):
    """Angles in degrees and lengths in cm, as the metrics of the whole flock."""
    named = dict(over_time)
    named["extension_groups_cm"] = 100.0 * named.pop("extension_groups")
    named["polarization_groups_deg"] = math.degrees(named.pop("polarization_groups"))
    return named
