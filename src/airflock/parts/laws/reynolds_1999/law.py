"""Steering behaviors for autonomous characters (Reynolds 1999): separation, cohesion, alignment, and a turn limit.

An agent is the paper's simple vehicle: forces steer it, cut off at a largest one, and it has a
largest speed. Separation pushes from neighbours by 1/r, cohesion pulls to their mean position,
alignment to their mean velocity, each within its own radius and field of view. Containment looks
ahead and steers back from where the agent would be outside.

Differences
-----------
The text was not at hand; the behaviours are as it is quoted, where it leaves a choice the plain sum
of the three is taken. Forces are over the mass: accelerations. The paper lets a vehicle turn at
rest and names limits against it; here the acceleration across the heading is at most `turn` times
the speed, counted as a tenth of v_max where it is less, so that an agent at rest can start.

ours: an agent seeks its goal, or without one its own heading, at v_max. Containment pushes along a
wall's normal, in proportion to how far behind the wall the agent would be.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, norm, quantity, shorten, unit

COMMAND = "acceleration"
TERMS = {"s": ("separation", "1/m"), "c": ("cohesion", "m"), "a": ("alignment", "m/s")}
USUAL = {"fov_deg": 360.0}
PARTS = {
    "separation": ("r_s", "w_s"),
    "cohesion": ("r_c", "w_c"),
    "alignment": ("r_a", "w_a"),
    "vehicle": ("v_max", "a_max", "turn", "w_seek", "fov_deg"),
    "containment": ("look_ahead", "w_wall"),
}
OURS = "our choice, for drones; the paper prints no numbers"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Radii and weights of the three behaviours, and limits of the vehicle."""

    r_s: float = quantity(24.0, "m", low=0.0, high=1e4, source=OURS, meaning="radius of separation")
    r_c: float = quantity(40.0, "m", low=0.0, high=1e4, source=OURS, meaning="radius of cohesion")
    r_a: float = quantity(60.0, "m", low=0.0, high=1e4, source=OURS, meaning="radius of alignment")
    fov_deg: float = quantity(360.0, "deg", low=0.0, high=360.0, source=OURS, meaning="full field of view")
    w_s: float = quantity(13.0, "m^2/s^2", low=0.0, high=1e4, source=OURS, meaning="weight of separation")
    w_c: float = quantity(0.005, "1/s^2", low=0.0, high=1e4, source=OURS, meaning="weight of cohesion")
    w_a: float = quantity(0.9, "1/s", low=0.0, high=1e4, source=OURS, meaning="weight of alignment")
    w_seek: float = quantity(0.5, "1/s", low=0.0, high=1e4, source=OURS, meaning="weight of seeking, at v_max")
    v_max: float = quantity(4.0, "m/s", low=0.01, high=1e3, source=OURS, meaning="largest and preferred speed")
    a_max: float = quantity(4.5, "m/s^2", low=0.0, high=1e4, source=OURS, meaning="largest force over mass")
    turn: float = quantity(0.6, "rad/s", low=0.0, high=100.0, source=OURS, meaning="largest rate of turn")
    look_ahead: float = quantity(4.5, "s", low=0.0, high=1e3, source=OURS, meaning="how far ahead walls are seen")
    w_wall: float = quantity(0.45, "1/s^2", low=0.0, high=1e4, source=OURS, meaning="weight of containment")


class Sums(NamedTuple):
    """Separation (1/m), cohesion (m), alignment (m/s), and the numbers of neighbours in the two means."""

    sx: float
    sy: float
    sz: float
    cx: float
    cy: float
    cz: float
    ax: float
    ay: float
    az: float
    near_c: float
    near_a: float


class Walls(NamedTuple):
    """Containment, m."""

    x: float
    y: float
    z: float


def preferred_speed(p):
    """Largest speed, m/s, which seeking leads to."""
    return p.v_max


def reach(p):
    """Largest of the three radii, m."""
    return max(p.r_c, max(p.r_s, p.r_a))


def interaction_range(p):
    """Radius within which agents count as one group, m: that of cohesion."""
    return p.r_c


def wall_reach(p):
    """Distance that an agent at twice v_max looks ahead, m."""
    return 2.0 * p.v_max * p.look_ahead


def neighbour(dx, dy, dz, r, r2, dvx, dvy, dvz, hx, hy, hz, p):
    """Contributions of one neighbour to the three behaviours."""
    ahead = dx * hx + dy * hy + dz * hz
    seen = (p.fov_deg >= 360.0) | (ahead >= math.cos(p.fov_deg * (0.5 * math.pi / 180.0)) * r)
    s = (-1.0 if seen & (r < p.r_s) else 0.0) / r2
    c = 1.0 if seen & (r < p.r_c) else 0.0
    a = 1.0 if seen & (r < p.r_a) else 0.0
    return Sums(s * dx, s * dy, s * dz, c * dx, c * dy, c * dz, a * dvx, a * dvy, a * dvz, c, a)


def boundary(distance, nx, ny, nz, vx, vy, vz, p):
    """How far behind one surface the agent would be after the time that it looks ahead, along the normal, m."""
    k = max(-(distance + p.look_ahead * (vx * nx + vy * ny + vz * nz)), 0.0)
    return Walls(k * nx, k * ny, k * nz)


def turned(ax, ay, az, own, p):
    """Acceleration (m/s²) with its part across the heading cut to the turn limit."""
    along = ax * own.hx + ay * own.hy + az * own.hz
    speed = max(norm(own.vx, own.vy, own.vz), 0.1 * p.v_max)
    x, y, z = shorten(ax - along * own.hx, ay - along * own.hy, az - along * own.hz, p.turn * speed)
    return along * own.hx + x, along * own.hy + y, along * own.hz + z


def decide(own, sums, walls, percept, p):
    """Acceleration, m/s²: seeking, the three behaviours and containment, cut to the limits."""
    gx, gy, gz = unit(percept.goal_x, percept.goal_y, percept.goal_z)
    free = gx * gx + gy * gy + gz * gz < 0.25
    c = p.w_c / max(sums.near_c, 1.0)
    a = p.w_a / max(sums.near_a, 1.0)
    k, v = p.w_seek, p.v_max
    hx, hy, hz = own.hx if free else gx, own.hy if free else gy, own.hz if free else gz
    x, y, z = shorten(
        k * (v * hx - own.vx) + p.w_s * sums.sx + c * sums.cx + a * sums.ax + p.w_wall * walls.x,
        k * (v * hy - own.vy) + p.w_s * sums.sy + c * sums.cy + a * sums.ay + p.w_wall * walls.y,
        k * (v * hz - own.vz) + p.w_s * sums.sz + c * sums.cz + a * sums.az + p.w_wall * walls.z,
        p.a_max,
    )
    return turned(x, y, z, own, p)
