"""Milling: how far a group turns about its own centre (Couzin et al. 2002, Eq. 5: m_group); 1 in a perfect torus."""

import math
from typing import NamedTuple

from airflock.core import norm

REPORTS = {"milling": ("", "rotation about the group's own centre, 1 is a mill")}
FORMULAS = {
    "milling": (
        r"\left\langle \left| \frac{1}{N}\sum_i u_i \times h_i \right| \right\rangle_t",
        "0 to 1; 1 is a torus",
        "$u_i$ is the unit vector from the group's centre to agent $i$.",
    ),
}


class Agent(NamedTuple):
    """Cross product of the unit vector from the group's centre and the heading."""

    turn_x: float
    turn_y: float
    turn_z: float


class Sample(NamedTuple):
    """Length of the mean cross product, 0 to 1."""

    milling: float


def agent(x, y, z, hx, hy, hz, mean):
    """Rotation of one agent about the centre of the group."""
    k = 1.0 / norm(x - mean.x, y - mean.y, z - mean.z)
    rx = k * (x - mean.x)
    ry = k * (y - mean.y)
    rz = k * (z - mean.z)
    return Agent(ry * hz - rz * hy, rz * hx - rx * hz, rx * hy - ry * hx)


def sample(agents, n):
    """Mean over the group; a random crowd has about sqrt(2/3/n)."""
    sx = agents.turn_x / n
    sy = agents.turn_y / n
    sz = agents.turn_z / n
    return Sample(math.sqrt(sx * sx + sy * sy + sz * sz))
