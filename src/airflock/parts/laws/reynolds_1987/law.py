"""Boids (Reynolds 1987) in the form that Zapotecatl et al. 2016 measured: cohesion, separation, alignment, walls ahead.

Each boid steers by a force: towards the mean position of those within r_c (Eq. 5), away from those
within r_s (Eq. 6) and towards the mean velocity of those within r_a (Eq. 7). A wall seen within one
second of flight replaces flocking.

Differences
-----------
paper → the authors' program, which decides here because the printed equations cannot produce the
printed figures; `form = "printed"` is Eqs 2-10 as they stand (quality then stays below 0.76 instead
of 0.93):

* Eqs 5-7 are vectors of any length; the program takes unit vectors, and separation falls with 1/d, not rises with d.
* Eq. 4 has d < r; in the program any neighbour nearer than 1.5 cm acts in every behaviour (`r_floor`), even for r = 0.
* Eq. 10 is used directly; the program smooths the acceleration by k = clip(9 dt, 0.15, 0.4) at each step.
* Field of view: Eq. 4 compares the angle with theta; here theta is the full angle, seen up to half of it (360°: all).
* The wall rule is in the program only: a ray ahead, shorter than one second of flight, steers sideways to the centre.
  A boid clamped exactly on a face that heads inwards avoids it in the program for one frame; not
  here.
* Order of updates, dt and the pond's faces: `update`, `dt`, `world.edges` of the preset.

ours: force, mass and weights in SI. In the program's form a weight counts forces of f_unit: 1 cm/s²
times a mass of 1.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, choice, clamp, norm, quantity, shorten, unit

COMMAND = "acceleration"
TERMS = {"c": ("cohesion", "m"), "s": ("separation", "1/m; printed: m"), "a": ("alignment", "m/s")}
VIOLATES = {
    "units": "the program smooths by clip(9 dt, 0.15, 0.4), 9 per second; as printed, weights turn metres into newtons",
}
USUAL = {"fov_s_deg": 360.0, "fov_a_deg": 360.0, "fov_c_deg": 360.0}
PARTS = {
    "separation": ("r_s", "fov_s_deg", "w_s"),
    "alignment": ("r_a", "fov_a_deg", "w_a"),
    "cohesion": ("r_c", "fov_c_deg", "w_c"),
    "boid": ("m_b", "f_m", "f_unit", "r_floor", "look_ahead", "form"),
}
TABLE = "Zapotecatl et al. 2016, Table 1"
PROGRAM = "authors' program of Zapotecatl et al. 2016"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Radii, fields of view, weights and limits of a boid. Defaults: Table 1 with the best radii."""

    r_s: float = quantity(0.20, "m", low=0.0, high=1000.0, source="Fig. 8", meaning="radius of separation")
    r_a: float = quantity(0.30, "m", low=0.0, high=1000.0, source="Fig. 8", meaning="radius of alignment")
    r_c: float = quantity(0.50, "m", low=0.0, high=1000.0, source=TABLE, meaning="radius of cohesion")
    r_floor: float = quantity(
        0.015, "m", low=0.0, high=100.0, source=PROGRAM, meaning="distance below which boids act in all behaviours"
    )
    fov_s_deg: float = quantity(360.0, "deg", low=0.0, high=360.0, source=TABLE, meaning="field of view, separation")
    fov_a_deg: float = quantity(360.0, "deg", low=0.0, high=360.0, source=TABLE, meaning="field of view, alignment")
    fov_c_deg: float = quantity(360.0, "deg", low=0.0, high=360.0, source=TABLE, meaning="field of view, cohesion")
    w_c: float = quantity(25.0, "1", low=0.0, high=1e6, source=TABLE, meaning="weight of cohesion (alpha)")
    w_s: float = quantity(25.0, "1", low=0.0, high=1e6, source=TABLE, meaning="weight of separation (beta)")
    w_a: float = quantity(25.0, "1", low=0.0, high=1e6, source=TABLE, meaning="weight of alignment (delta)")
    f_unit: float = quantity(
        0.01, "N", low=0.0, high=1e6, source=PROGRAM, meaning="force of a weight of 1; only used by form = program"
    )
    f_m: float = quantity(0.50, "N", low=0.0, high=1e6, source=TABLE, meaning="largest force")
    m_b: float = quantity(1.0, "kg", low=1e-6, high=1e6, source=TABLE, meaning="mass of a boid")
    look_ahead: float = quantity(1.0, "s", low=0.0, high=1000.0, source=PROGRAM, meaning="time to an avoided wall")
    form: str = choice(
        "program",
        ("program", "printed"),
        source="authors' program, or Eqs 2-10",
        meaning="unit vectors, floor radius and smoothed acceleration; or the equations as printed",
    )


class Sums(NamedTuple):
    """Cohesion (m), separation (1/m; printed: m), alignment (m/s), and the numbers of boids in the two means."""

    cx: float
    cy: float
    cz: float
    sx: float
    sy: float
    sz: float
    ax: float
    ay: float
    az: float
    near_c: float
    near_a: float


class Memory(NamedTuple):
    """Smoothed acceleration, m/s²."""

    ax: float = 0.0
    ay: float = 0.0
    az: float = 0.0


def reach(p):
    """Largest of the three radii, m."""
    return max(p.r_c, max(p.r_s, p.r_a))


def interaction_range(p):
    """Radius within which boids count as one group, m: that of cohesion."""
    return max(p.r_c, p.r_floor)


def seen(r2, ahead, radius, fov_deg, p):
    """1.0 if a neighbour acts in a behaviour: within its radius (m) and field of view, or nearer than the floor.

    r2 : squared distance, m²; ahead : component of the offset along the own heading, m (Eqs 2-4)
    """
    c = math.cos(fov_deg * (0.5 * math.pi / 180.0))
    # cos(angle) >= c without a root: ahead >= c r, by the signs of both sides
    wide = (fov_deg >= 360.0) | (ahead * abs(ahead) >= c * abs(c) * r2 * (1.0 + 1e-5 * (1.0 if c < 0.0 else 0.0)))
    floor = p.r_floor if p.form == "program" else 0.0
    return 1.0 if ((r2 <= radius * radius) & wide) | (r2 < floor * floor) else 0.0


def neighbour(dx, dy, dz, r2, dvx, dvy, dvz, hx, hy, hz, p):
    """Contributions of one neighbour to the three behaviours (Eqs 5-7)."""
    ahead = dx * hx + dy * hy + dz * hz
    c = seen(r2, ahead, p.r_c, p.fov_c_deg, p)
    a = seen(r2, ahead, p.r_a, p.fov_a_deg, p)
    s = -seen(r2, ahead, p.r_s, p.fov_s_deg, p) / (r2 if p.form == "program" else 1.0)
    return Sums(c * dx, c * dy, c * dz, s * dx, s * dy, s * dz, a * dvx, a * dvy, a * dvz, c, a)


def flocking(sums, p):
    """Net force before its limit (Eq. 8), N."""
    if p.form == "program":
        cx, cy, cz = unit(sums.cx, sums.cy, sums.cz)
        sx, sy, sz = unit(sums.sx, sums.sy, sums.sz)
        ax, ay, az = unit(sums.ax, sums.ay, sums.az)
        u = p.f_unit
        return (
            u * (p.w_c * cx + p.w_s * sx + p.w_a * ax),
            u * (p.w_c * cy + p.w_s * sy + p.w_a * ay),
            u * (p.w_c * cz + p.w_s * sz + p.w_a * az),
        )
    c = p.w_c / max(sums.near_c, 1.0)
    a = p.w_a / max(sums.near_a, 1.0)
    return (
        c * sums.cx + p.w_s * sums.sx + a * sums.ax,
        c * sums.cy + p.w_s * sums.sy + a * sums.ay,
        c * sums.cz + p.w_s * sums.sz + a * sums.az,
    )


def avoidance(own, percept, distance, p):
    """Force (N) that turns a boid from a wall `distance` (m) ahead: sideways, to the side of the arena's centre."""
    ux, uy, uz = unit(
        percept.centre_x - distance * own.hx, percept.centre_y - distance * own.hy, percept.centre_z - distance * own.hz
    )
    k = ux * own.hx + uy * own.hy + uz * own.hz
    ux, uy, uz = unit(ux - k * own.hx, uy - k * own.hy, uz - k * own.hz)
    return p.f_m * ux, p.f_m * uy, p.f_m * uz


def decide(own, sums, memory, percept, period, p):
    """Acceleration, m/s² (Eqs 8-10); `Memory` holds the smoothed one."""
    ahead = p.look_ahead * norm(own.vx, own.vy, own.vz)
    distance = percept.ray(own.hx, own.hy, own.hz, ahead)
    fx, fy, fz = flocking(sums, p)
    wx, wy, wz = avoidance(own, percept, distance, p)
    wall = distance < ahead
    fx, fy, fz = shorten(wx if wall else fx, wy if wall else fy, wz if wall else fz, p.f_m)
    k = clamp(9.0 * period, 0.15, 0.4) if p.form == "program" else 1.0
    ax = memory.ax + k * (fx / p.m_b - memory.ax)
    ay = memory.ay + k * (fy / p.m_b - memory.ay)
    az = memory.az + k * (fz / p.m_b - memory.az)
    return ax, ay, az, Memory(ax, ay, az)
