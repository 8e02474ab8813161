"""Flocking of a lattice of double integrators (Olfati-Saber 2006): alpha-lattice, beta agents, gamma agent.

Neighbours pull and push an agent towards the distance d, and their velocities draw its own (alpha).
A wall or an obstacle is a neighbour at its nearest point that moves along its surface (beta). The
agent follows a virtual leader, the gamma agent: the goal of the flock (`[goals]`).

Differences
-----------
The text was not at hand. The functions are those that the paper's followers print and program
alike; the numbers d, r, d', epsilon, a, b and h are those of a public program that names Section
VIII (OptFlock, Montanari et al. 2025). Gains c1 are our choice, and c2 = 2 sqrt(c1) is the paper's.
Lengths have no unit there; here they count in `unit`, 1 m.

* The velocity of the gamma agent is not perceived. Its speed is v_gamma, its direction the agent's own: the same where
  all follow it, and with v_gamma = 0 the static rendezvous of the paper. Without a goal v_gamma
  alone is kept.
* The curvature of an obstacle is not perceived either: the speed of its beta agent is that along a flat wall (mu = 1).
* Behind a surface an agent is pushed as before it, so that it does not stay inside.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, quantity

COMMAND = "acceleration"
PARTS = {
    "lattice": ("d", "r", "c1_alpha", "c2_alpha", "a", "b", "h_alpha"),
    "walls and obstacles": ("d_beta", "c1_beta", "c2_beta", "h_beta"),
    "gamma agent": ("v_gamma", "c1_gamma", "c2_gamma"),
}
PROGRAM = "Section VIII, after OptFlock"
OURS = "our choice"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Distances, gains and shapes of the potentials; c1 counts in m/s², c2 in 1/s."""

    d: float = quantity(7.0, "m", low=0.01, high=1e4, source=PROGRAM, meaning="distance of neighbours in the lattice")
    r: float = quantity(8.4, "m", low=0.01, high=1e4, source=f"{PROGRAM}: 1.2 d", meaning="range of interaction")
    d_beta: float = quantity(
        4.2, "m", low=0.01, high=1e4, source=f"{PROGRAM}: 0.6 d", meaning="distance at which surfaces begin to act"
    )
    unit: float = quantity(1.0, "m", low=1e-6, high=1e6, source="the unit of length", meaning="length that counts as 1")
    eps: float = quantity(0.1, "1", low=1e-6, high=10.0, source=PROGRAM, meaning="epsilon of the sigma-norm")
    a: float = quantity(5.0, "1", low=1e-3, high=1e3, source=PROGRAM, meaning="strength of attraction")
    b: float = quantity(5.0, "1", low=1e-3, high=1e3, source=PROGRAM, meaning="strength of repulsion; at least a")
    h_alpha: float = quantity(0.2, "1", low=0.0, high=0.99, source=PROGRAM, meaning="where neighbours begin to fade")
    h_beta: float = quantity(0.9, "1", low=0.0, high=0.99, source=PROGRAM, meaning="where surfaces begin to fade")
    c1_alpha: float = quantity(3.0, "m/s^2", low=0.0, high=1e4, source=OURS, meaning="gain of the lattice")
    c2_alpha: float = quantity(
        3.4641, "1/s", low=0.0, high=1e3, source="2 sqrt(c1)", meaning="gain of matching the velocity of neighbours"
    )
    c1_beta: float = quantity(10.0, "m/s^2", low=0.0, high=1e5, source=OURS, meaning="push of surfaces")
    c2_beta: float = quantity(
        6.3246, "1/s", low=0.0, high=1e3, source="2 sqrt(c1)", meaning="damping of the velocity towards surfaces"
    )
    c1_gamma: float = quantity(1.0, "m/s^2", low=0.0, high=1e4, source=OURS, meaning="pull of the goal")
    c2_gamma: float = quantity(
        2.0, "1/s", low=0.0, high=1e3, source="2 sqrt(c1)", meaning="gain of matching the speed of the gamma agent"
    )
    v_gamma: float = quantity(5.0, "m/s", low=0.0, high=1e3, source=OURS, meaning="speed of the gamma agent")


class Sums(NamedTuple):
    """Acceleration by neighbours, m/s²."""

    x: float
    y: float
    z: float


class Walls(NamedTuple):
    """Acceleration by beta agents, m/s²."""

    x: float
    y: float
    z: float


def preferred_speed(p):
    """Speed of the gamma agent, m/s."""
    return p.v_gamma


def interaction_range(p):
    """Radius within which agents are neighbours, m."""
    return p.r


def reach(p):
    """Range of interaction, m."""
    return p.r


def wall_reach(p):
    """Distance beyond which a surface says nothing, m."""
    return p.d_beta


def sigma_norm(r, p):
    """The sigma-norm of a vector of length r (m): smooth where r vanishes."""
    s = r / p.unit
    return (math.sqrt(1.0 + p.eps * s * s) - 1.0) / p.eps


def slope(r, p):
    """Gradient of the sigma-norm over the vector itself, 1/m."""
    s = r / p.unit
    return 1.0 / (p.unit * math.sqrt(1.0 + p.eps * s * s))


def saturated(z):
    """Return sigma_1(z) = z / sqrt(1 + z²), from -1 to 1."""
    return z / math.sqrt(1.0 + z * z)


def bump(z, h):
    """Weight of a pair: 1 up to h, then half a cosine down to 0 at 1."""
    fading = 0.5 * (1.0 + math.cos(math.pi * (z - h) / (1.0 - h)))
    return 1.0 if z < h else (fading if z < 1.0 else 0.0)


def pull(z, p):
    """Action phi of a pair, from -b (push) to a (pull), 0 at z = 0."""
    c = abs(p.a - p.b) / math.sqrt(4.0 * p.a * p.b)
    return 0.5 * ((p.a + p.b) * saturated(z + c) + (p.a - p.b))


def neighbour(dx, dy, dz, r, dvx, dvy, dvz, p):
    """Pull towards the lattice and matching of velocity by one neighbour, m/s²."""
    s = sigma_norm(r, p)
    w = bump(s / sigma_norm(p.r, p), p.h_alpha)
    g = p.c1_alpha * w * pull(s - sigma_norm(p.d, p), p) * slope(r, p)
    k = p.c2_alpha * w
    return Sums(g * dx + k * dvx, g * dy + k * dvy, g * dz + k * dvz)


def boundary(distance, nx, ny, nz, vx, vy, vz, p):
    """Push of one surface's beta agent and damping of the velocity across the surface, m/s²."""
    s = abs(distance)
    z, edge = sigma_norm(s, p), sigma_norm(p.d_beta, p)
    w = bump(z / edge, p.h_beta)
    push = p.c1_beta * w * (1.0 - saturated(z - edge)) * slope(s, p) * s
    k = push - p.c2_beta * w * (vx * nx + vy * ny + vz * nz)
    return Walls(k * nx, k * ny, k * nz)


def decide(own, sums, walls, percept, p):
    """Acceleration, m/s²: neighbours, surfaces and the gamma agent."""
    gx, gy, gz = percept.goal_x / p.unit, percept.goal_y / p.unit, percept.goal_z / p.unit
    k = p.c1_gamma / math.sqrt(1.0 + gx * gx + gy * gy + gz * gz)
    return (
        sums.x + walls.x + k * gx + p.c2_gamma * (p.v_gamma * own.hx - own.vx),
        sums.y + walls.y + k * gy + p.c2_gamma * (p.v_gamma * own.hy - own.vy),
        sums.z + walls.z + k * gz + p.c2_gamma * (p.v_gamma * own.hz - own.vz),
    )
