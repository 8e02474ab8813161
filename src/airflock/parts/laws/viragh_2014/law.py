"""Flocking algorithm for autonomous flying robots (Virágh et al. 2014): Algorithm A of Vásárhelyi et al. 2018, Fig. 1.

Repulsion is half a spring; alignment is viscous friction that decays with the square of the
distance, counted from r0_rep - r2_frict on; walls align to a shill velocity through a sinusoidal
ramp. This is the baseline that the 2018 model improves on.

Differences
-----------
The text of 2014 was not at hand, and no check against it is claimed. The transfer function, the
wall law, the half spring and the order of the terms are those of the authors' later program. The
friction kernel is that of two public programs after the authors' papers of 2014, written
independently (`uav_flocking` of cpswarm for ROS, and a Python module of Fudan University); both
also let the spring saturate, which is not built: it made no difference here. They have D in 1/s²
and C_frict in m²/s; the caption of Fig. 1 has 1/s and m²: the same with a time of 1 s.

The caption gives c_frict, r_min_frict, r0_rep and p_rep only; r2_frict, c_shill, v_shill and d_wall
are open. Our choice: c_shill = 1 as in the 2018 paper, v_shill = v_flock as in 2014, d_wall = 25 m,
a tenth of the arena, all three fixed in advance; r2_frict = r0_rep / 2, chosen after it was seen
that phi_corr then is that of the caption (`papers/` shows the map). The ramp ends at the wall, as
in the later program. The sum is limited to v_max (no rescaling).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, clamp, quantity, shorten

COMMAND = "velocity"
FIG1 = "Vásárhelyi et al. 2018, Fig. 1, caption"
OURS = "our choice (not printed)"
PARTS = {
    "self-propulsion": ("v_flock", "v_max"),
    "repulsion": ("r0_rep", "p_rep"),
    "friction": ("c_frict", "r2_frict", "r_min_frict"),
    "walls": ("c_shill", "v_shill", "d_wall"),
}


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Gains of Algorithm A at 4 m/s."""

    v_flock: float = quantity(4.0, "m/s", low=0.1, high=100.0, source=FIG1, meaning="preferred speed of every agent")
    v_max: float = quantity(6.0, "m/s", low=0.1, high=150.0, source="Results", meaning="largest commanded speed")
    r0_rep: float = quantity(20.0, "m", low=0.0, high=1000.0, source=FIG1, meaning="repulsion range")
    p_rep: float = quantity(1.0, "1/s", low=0.0, high=10.0, source=FIG1, meaning="repulsion gain")
    c_frict: float = quantity(30.0, "m^2", low=0.0, high=10000.0, source=FIG1, meaning="coefficient of friction")
    r2_frict: float = quantity(
        10.0, "m", low=0.0, high=1000.0, source=OURS, meaning="how far within r0_rep friction begins to count distance"
    )
    r_min_frict: float = quantity(
        5.0,
        "m",
        low=0.01,
        high=1000.0,
        source=FIG1,
        meaning="distance, counted so, below which friction grows no further",
    )
    c_shill: float = quantity(1.0, "1", low=0.0, high=10.0, source=OURS, meaning="strength of the walls")
    v_shill: float = quantity(4.0, "m/s", low=0.0, high=300.0, source=OURS, meaning="speed of the shill agents")
    d_wall: float = quantity(25.0, "m", low=0.01, high=1000.0, source=OURS, meaning="width of the ramp at the walls")


class Sums(NamedTuple):
    """Repulsion and friction, m/s."""

    x: float
    y: float
    z: float


class Walls(NamedTuple):
    """Velocity terms of walls and obstacles, m/s."""

    x: float
    y: float
    z: float


def preferred_speed(p):
    """Speed that the fitness prefers, m/s."""
    return p.v_flock


def interaction_range(p):
    """Radius within which agents count as one cluster, m: where the friction coefficient falls below 1/100.

    Our choice, because the kernel has no cutoff: sqrt(100 C) is 55 m for the published C, from
    r0_rep - r2_frict on.
    """
    return max(p.r0_rep, p.r0_rep - p.r2_frict + 10.0 * math.sqrt(p.c_frict))


def wall_reach(p):
    """Distance beyond which a surface says nothing, m."""
    return p.d_wall


def neighbour(dx, dy, dz, r, dvx, dvy, dvz, p):
    """Half-spring repulsion and friction from one neighbour, m/s; offsets in m."""
    away = -p.p_rep * max(p.r0_rep - r, 0.0) / r
    s = max(r - (p.r0_rep - p.r2_frict), p.r_min_frict)
    align = p.c_frict / (s * s)
    return Sums(away * dx + align * dvx, away * dy + align * dvy, away * dz + align * dvz)


def ramp(distance, d):
    """Sinusoidal transfer function: 1 at the wall and behind it, 0 from d (m) inwards."""
    s = clamp(1.0 - distance / d, 0.0, 1.0)
    return 0.5 * (1.0 - math.cos(math.pi * s))


def boundary(distance, nx, ny, nz, vx, vy, vz, p):
    """Relaxation to the shill velocity near one surface, m/s; distance in m, negative outside."""
    k = p.c_shill * ramp(distance, p.d_wall)
    return Walls(k * (p.v_shill * nx - vx), k * (p.v_shill * ny - vy), k * (p.v_shill * nz - vz))


def decide(own, sums, walls, p):
    """Desired velocity, m/s, limited to v_max."""
    x = p.v_flock * own.hx + sums.x + walls.x
    y = p.v_flock * own.hy + sums.y + walls.y
    z = p.v_flock * own.hz + sums.z + walls.z
    return shorten(x, y, z, p.v_max)
