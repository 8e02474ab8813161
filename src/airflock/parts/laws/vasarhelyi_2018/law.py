"""Optimised flocking of autonomous drones in confined environments (Vásárhelyi et al. 2018), Eqs 2-11.

A drone wishes to fly at v_flock along its own velocity; neighbours push it away like half a spring
(Eqs 2-3) and pull its velocity towards theirs where the difference exceeds what an ideal braking
curve allows (Eqs 4-7); walls and obstacles act as shill agents that fly inwards (Eqs 8-9). The
rules are vectors; 2-D and 3-D are the same text.

Differences
-----------
paper → the authors' program, which decides here because only it reproduces Table S2:

* Eq. 11 caps the sum at v_max. The program always rescales it to v_flock, also when it is shorter; `limit = "rescale"`
  is that and the default, `limit = "cap"` is Eq. 11 as printed (then phi_vel is 2.9 instead of 3.8
  m/s at v_flock = 4).
* r0_frict is the absolute distance of Eq. 5; the program's file takes it as an offset to r0_rep.
* Eqs 6 and 9 print v_i - v_j and v_i - v_s; velocities would then be driven apart. Here as in the program v_j - v_i.
* The program caps the repulsion of a pair at 6.2 m/s, which no published parameter set reaches: not built.
* Which walls act (one shill per axis, or one per edge) is `world.walls`; the paper's presets use nearest_per_axis.

ours: nothing else. A sum that is exactly zero stays zero, as in the program.
"""

from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, braking_curve, braking_distance, choice, excess, norm, quantity

COMMAND = "velocity"
S1 = "Table S1, column 4 m/s"
PARTS = {
    "self-propulsion": ("v_flock", "v_max", "limit"),
    "repulsion": ("r0_rep", "p_rep"),
    "alignment": ("r0_frict", "c_frict", "v_frict", "p_frict", "a_frict"),
    "walls and obstacles": ("r0_shill", "v_shill", "p_shill", "a_shill"),
}


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Flocking gains. Defaults: the optimised set for v_flock = 4 m/s (Table S1); meanings after Table S3."""

    v_flock: float = quantity(4.0, "m/s", low=0.1, high=100.0, source=S1, meaning="preferred speed of every agent")
    v_max: float = quantity(
        6.0, "m/s", low=0.1, high=150.0, source="Results", meaning="largest commanded speed; only used by limit = cap"
    )
    r0_rep: float = quantity(
        25.6, "m", low=0.0, high=1000.0, source=S1, meaning="repulsion range; larger: sparser flock, fewer collisions"
    )
    p_rep: float = quantity(
        0.13,
        "1/s",
        low=0.0,
        high=10.0,
        source=S1,
        meaning="repulsion gain; larger: safer, but oscillates when confined",
    )
    r0_frict: float = quantity(
        85.3, "m", low=0.0, high=2000.0, source=S1, meaning="stopping point of alignment in front of a neighbour"
    )
    c_frict: float = quantity(
        0.05, "1", low=0.0, high=10.0, source=S1, meaning="coefficient of alignment; larger: damped, but sluggish"
    )
    v_frict: float = quantity(
        0.63, "m/s", low=0.0, high=50.0, source=S1, meaning="velocity difference allowed at any distance (slack)"
    )
    p_frict: float = quantity(
        3.20, "1/s", low=0.01, high=100.0, source=S1, meaning="gain of the braking curve between agents"
    )
    a_frict: float = quantity(
        4.16, "m/s^2", low=0.01, high=100.0, source=S1, meaning="deceleration of the braking curve between agents"
    )
    r0_shill: float = quantity(
        0.3, "m", low=-100.0, high=500.0, source=S1, meaning="stopping point in front of walls and obstacles"
    )
    v_shill: float = quantity(
        13.6, "m/s", low=0.0, high=300.0, source=S1, meaning="speed of the shill agents; at least twice v_flock"
    )
    p_shill: float = quantity(
        3.55, "1/s", low=0.01, high=100.0, source=S1, meaning="gain of the braking curve at walls"
    )
    a_shill: float = quantity(
        3.02, "m/s^2", low=0.01, high=100.0, source=S1, meaning="deceleration of the braking curve at walls"
    )
    limit: str = choice(
        "rescale",
        ("rescale", "cap"),
        source="Eq. 11 and the authors' program",
        meaning="length of the desired velocity: always v_flock; or that of the sum, capped at v_max, as printed",
    )


class Sums(NamedTuple):
    """Repulsion and alignment, m/s."""

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
    """Radius within which agents count as one cluster, m (Eq. 12)."""
    return max(p.r0_rep, p.r0_frict + braking_distance(p.v_flock, p.a_frict, p.p_frict))


def wall_reach(p):
    """Distance beyond which a surface says nothing, m: an agent at twice v_flock could still stop before it."""
    return max(p.r0_shill, 0.0) + braking_distance(p.v_shill + 2.0 * p.v_flock, p.a_shill, p.p_shill)


def neighbour(dx, dy, dz, r, dvx, dvy, dvz, dv, p):
    """Repulsion (Eq. 2) and alignment (Eqs 4-6) from one neighbour, m/s; offsets in m."""
    away = -p.p_rep * max(p.r0_rep - r, 0.0) / r
    allowed = max(p.v_frict, braking_curve(r - p.r0_frict, p.a_frict, p.p_frict))
    align = p.c_frict * excess(dv, allowed)
    return Sums(away * dx + align * dvx, away * dy + align * dvy, away * dz + align * dvz)


def boundary(distance, nx, ny, nz, vx, vy, vz, p):
    """Alignment to the shill agent of one surface (Eqs 8-9), m/s; distance in m, negative outside."""
    sx = p.v_shill * nx - vx
    sy = p.v_shill * ny - vy
    sz = p.v_shill * nz - vz
    k = excess(norm(sx, sy, sz), braking_curve(distance - p.r0_shill, p.a_shill, p.p_shill))
    return Walls(k * sx, k * sy, k * sz)


def decide(own, sums, walls, p):
    """Desired velocity, m/s (Eqs 10-11)."""
    x = p.v_flock * own.hx + sums.x + walls.x
    y = p.v_flock * own.hy + sums.y + walls.y
    z = p.v_flock * own.hz + sums.z + walls.z
    length = norm(x, y, z)
    # Only the rescaled sum reproduces Table S2: with Eq. 11 as printed phi_vel is 2.9 instead of
    # 3.8 m/s at 4 m/s.
    k = p.v_flock / length if p.limit == "rescale" else min(1.0, p.v_max / length)
    return k * x, k * y, k * z
