"""Kidger, An Investigation into Drone Swarms & Swarm Intelligence: oracles, five ways to recombine them, ray casts.

Each oracle suggests a movement (m/s); a recombination scheme makes one of them. Order of
importance: obstacle avoidance, separation, cohesion, alignment, goal, previous movement. The thesis
counts Unity units and frames; 1 unit is 1 m here and a second has 60 frames.

Differences from the thesis, each because its text leaves the point open or its listing contradicts
its text:
* Separation from several neighbours adds their inverse vectors -d, a metre being a metre per frame (the listing returns
  that of the first neighbour it finds); method = "turn" adds the turned headings, at p.speed.
  separation = "normalised" adds -d / d² and suggests p.speed that way: opposed by cohesion it
  cancels at any distance, and boids meet.
* Cohesion and goal suggest movements at p.speed towards a point. The listing of cohesion returns the bare offset of up
  to 40 m, beside a cap of 1 m per frame (cohesion = "printed"): goal and alignment are then cut
  off.
* Cohesion goes to the mean position as the text says; the listing has the sign reversed and divides by the neighbours
  without the agent itself. Alignment divides by the number of neighbours in the sum.
* The ray ahead lies along what the other oracles suggest together, as the comment of the 3-D listing says, so that
  nothing is flown that was not looked at; ahead = "movement" casts along the own movement, as the
  2-D listing does.
* The cast is one of a sphere (radius + margin) against everything, and the nearest hit counts (the thesis's bug 2 was
  the first edge found); cast = "thin" is the thesis's ray.
* Where no ray is free the longest is flown, no farther than it is free; the thesis suggests nothing then.
* Gravity is a steady sinking (m/s) below what the others suggest; previous movement and alignment take movements
  without it, or it would add up frame by frame. A free ray is flown as it was cast.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import TINY, Parameters as Record, choice, norm, quantity

COMMAND = "velocity"
TERMS = {"s": ("separation", ""), "a": ("alignment", "m/s"), "c": ("cohesion", "m")}
PARTS = {
    "radii": ("r_sep", "r_align", "r_cohes"),
    "drone": ("speed", "accel", "gravity", "radius", "margin"),
    "scales": ("s_obst", "s_sep", "s_goal", "s_align", "s_cohes", "s_prev"),
    "rays": ("r_ray", "rays", "cast", "ahead", "first", "fan"),
    "oracles": ("scheme", "most", "method", "separation", "cohesion"),
}
VIOLATES = {
    "rotation": "the spiral of rays that looks for a way out begins on a fixed side",
    "mirror": "the spiral of rays turns one way",
    "units": "accel is the growth of a speed per frame, and a frame is 1/60 s (FRAMES)",
}
FRAMES = 60.0  # 1/s; our choice, because the thesis gives speeds per frame only
GOLDEN = 0.6180339887498949  # fraction of the golden ratio: the turn from one point of the spiral to the next
FINAL = "Kidger, section 5.4"
INSPECTOR = "Kidger, section 5.1"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Radii, scales and choices. Defaults: the final set of section 5.4."""

    r_sep: float = quantity(10.0, "m", low=0.0, high=1000.0, source=FINAL, meaning="radius of separation")
    r_align: float = quantity(20.0, "m", low=0.0, high=1000.0, source=FINAL, meaning="radius of alignment")
    r_cohes: float = quantity(40.0, "m", low=0.0, high=1000.0, source=FINAL, meaning="radius of cohesion")
    r_ray: float = quantity(20.0, "m", low=0.01, high=1000.0, source=INSPECTOR, meaning="length of a ray")
    speed: float = quantity(60.0, "m/s", low=0.01, high=1000.0, source=f"{FINAL}: 1 per frame", meaning="drone speed")
    accel: float = quantity(1.01, "1", low=1.0, high=10.0, source=FINAL, meaning="increase of the speed per frame")
    gravity: float = quantity(0.0, "m/s", low=0.0, high=1000.0, source=f"{FINAL}: none", meaning="constant sinking")
    s_obst: float = quantity(1.0, "1", low=0.0, high=100.0, source=FINAL, meaning="scale of obstacle avoidance")
    s_sep: float = quantity(0.25, "1", low=0.0, high=100.0, source=FINAL, meaning="scale of separation")
    s_cohes: float = quantity(0.25, "1", low=0.0, high=100.0, source=FINAL, meaning="scale of cohesion")
    s_align: float = quantity(0.125, "1", low=0.0, high=100.0, source=FINAL, meaning="scale of alignment")
    s_goal: float = quantity(0.25, "1", low=-100.0, high=100.0, source=FINAL, meaning="scale of the goal; < 0: repels")
    s_prev: float = quantity(1.0, "1", low=0.0, high=100.0, source=FINAL, meaning="scale of the previous movement")
    rays: float = quantity(1000.0, "1", low=1.0, high=1e6, source=INSPECTOR, meaning="largest number of rays cast")
    most: float = quantity(3.0, "1", low=1.0, high=6.0, source="our choice", meaning="oracles heard in scheme 4")
    radius: float = quantity(0.5, "m", low=0.0, high=100.0, source="our choice", meaning="radius of a boid")
    margin: float = quantity(0.1, "m", low=0.0, high=100.0, source="our choice", meaning="added to the radius of casts")
    scheme: str = choice("5", ("1", "2", "3", "4", "5"), source="Kidger, section 4.3", meaning="recombination scheme")
    method: str = choice("away", ("away", "turn"), source="Kidger, section 4.1.1", meaning="separation 2 or 1")
    separation: str = choice(
        "printed", ("printed", "normalised"), source="4.1.1; ours", meaning="length of separation 2: bare, or p.speed"
    )
    cohesion: str = choice(
        "normalised", ("normalised", "printed"), source="ours; 4.1.3", meaning="length of cohesion: p.speed, or bare"
    )
    cast: str = choice("swept", ("swept", "thin"), source="ours; the thesis", meaning="cast spheres or thin rays")
    ahead: str = choice("suggested", ("suggested", "movement"), source="4.6.2; 4.2", meaning="where rays start")
    first: str = choice(
        "axis", ("axis", "point"), source="ours; the thesis", meaning="which part of the spiral points ahead"
    )
    fan: str = choice("space", ("space", "plane"), source="4.6; 4.2", meaning="spiral of rays, or left and right")


class Sums(NamedTuple):
    """Separation (m/s as printed, else without a scale), neighbours' velocities (m/s), offsets (m) and numbers."""

    sx: float
    sy: float
    sz: float
    ax: float
    ay: float
    az: float
    n_align: float
    cx: float
    cy: float
    cz: float
    n_cohes: float


class Tally(NamedTuple):
    """Taken so far: movement (m/s), share of the oracles, how many spoke, sum of their scales; 1.0 once full."""

    x: float
    y: float
    z: float
    used: float
    heard: float
    scales: float
    full: float


class Way(NamedTuple):
    """A direction (unit vector) and how far it is free, m."""

    x: float
    y: float
    z: float
    free: float


def reach(p):
    """Largest of the three radii, m."""
    return max(p.r_sep, max(p.r_align, p.r_cohes))


def interaction_range(p):
    """Boids nearer than this belong to one swarm, m: they cohere."""
    return p.r_cohes


def preferred_speed(p):
    """Speed of a free boid, m/s."""
    return p.speed


def sight(p):
    """Largest distance of a cast, m."""
    return p.r_ray + p.radius + p.margin


def turned_away(dx, dy, dz, r, hx, hy, hz, p):
    """Own heading, turned away from a neighbour by an angle that grows as it nears (separation 1, section 4.1.1).

    The angle is (1 - d/r_sep) 2 pi 0.05 pi, with d (m) from surface to surface: about 0.99 rad at
    contact.
    """
    apart = max(r - 2.0 * p.radius, 0.0)
    angle = (1.0 - apart / p.r_sep) * 0.1 * math.pi * math.pi
    along = dx * hx + dy * hy + dz * hz
    wx = along * hx - dx
    wy = along * hy - dy
    wz = along * hz - dz
    k = math.sin(angle) / norm(wx, wy, wz)
    c = math.cos(angle)
    return c * hx + k * wx, c * hy + k * wy, c * hz + k * wz


def neighbour(dx, dy, dz, r, dvx, dvy, dvz, vx, vy, vz, hx, hy, hz, p):
    """Contributions of one neighbour to separation, alignment and cohesion."""
    s = 1.0 if r < p.r_sep else 0.0
    a = 1.0 if r < p.r_align else 0.0
    c = 1.0 if r < p.r_cohes else 0.0
    if p.method == "turn":
        sx, sy, sz = turned_away(dx, dy, dz, r, hx, hy, hz, p)
    else:
        k = -FRAMES if p.separation == "printed" else -1.0 / (r * r)
        sx = k * dx
        sy = k * dy
        sz = k * dz
    return Sums(s * sx, s * sy, s * sz, a * (vx + dvx), a * (vy + dvy), a * (vz + dvz), a, c * dx, c * dy, c * dz, c)


def take(t, x, y, z, scale, p):
    """The tally after one more suggestion (m/s) of this scale, by the chosen scheme; oracles in order of importance."""
    size = norm(x, y, z)
    # An oracle that suggests nothing must not count as one that spoke: schemes 1, 2 and 4 count
    # them.
    if (size < 1e-5) | (scale == 0.0):
        return t
    share = 1.0
    full = 0.0
    weight = scale
    if p.scheme == "1":
        share = 1.0 if t.heard < 0.5 else 0.0
        weight = 1.0 if scale > 0.0 else -1.0
    elif p.scheme == "2":
        weight = 1.0 if scale > 0.0 else -1.0
    elif p.scheme == "4":
        share = 1.0 if t.heard < p.most - 0.5 else 0.0
    elif p.scheme == "5":
        # the largest share with |t + share w| <= cap: the greater root of a quadratic
        wx = scale * x
        wy = scale * y
        wz = scale * z
        a = wx * wx + wy * wy + wz * wz + TINY
        b = t.x * wx + t.y * wy + t.z * wz
        room = max(p.speed * p.speed - (t.x * t.x + t.y * t.y + t.z * t.z), 0.0)
        room_for = max((math.sqrt(b * b + a * room + TINY) - b) / a, 0.0)
        share = 0.0 if t.full > 0.5 else min(room_for, 1.0)
        full = 1.0 if (room_for <= 1.0001) | (t.full > 0.5) else 0.0  # a rounding is no room
    k = share * weight
    return Tally(
        t.x + k * x, t.y + k * y, t.z + k * z, t.used + share, t.heard + 1.0, t.scales + share * abs(scale), full
    )


def movement(t, p):
    """Movement (m/s) that a tally stands for: a sum, or a mean (schemes 2 and 4) or a weighted mean (scheme 3)."""
    k = 1.0
    if (p.scheme == "2") | (p.scheme == "4"):
        k = 1.0 / max(t.used, 1.0)
    elif p.scheme == "3":
        k = 1.0 / max(t.scales, 1e-6)
    return k * t.x, k * t.y, k * t.z


def others(t, own, sums, percept, p):
    """The tally after all oracles but obstacle avoidance."""
    k = 1.0
    if (p.method == "turn") | (p.separation == "normalised"):
        k = p.speed / norm(sums.sx, sums.sy, sums.sz)
    t = take(t, k * sums.sx, k * sums.sy, k * sums.sz, p.s_sep, p)
    k = FRAMES / (sums.n_cohes + 1.0) if p.cohesion == "printed" else p.speed / norm(sums.cx, sums.cy, sums.cz)
    t = take(t, k * sums.cx, k * sums.cy, k * sums.cz, p.s_cohes, p)
    some = min(sums.n_align, 1.0)
    k = some / (sums.n_align + 1.0)
    sunk = some * p.gravity
    t = take(t, k * (sums.ax + own.vx), k * (sums.ay + own.vy), k * (sums.az + own.vz) + sunk, p.s_align, p)
    k = p.speed / norm(percept.goal_x, percept.goal_y, percept.goal_z)
    t = take(t, k * percept.goal_x, k * percept.goal_y, k * percept.goal_z, p.s_goal, p)
    return take(t, own.vx, own.vy, own.vz + p.gravity, p.s_prev, p)


def sphere_point(k, n):
    """Point k of n on a Fibonacci sphere whose spiral begins at the pole (0, 0, 1) (Drost 2017; section 4.6.1)."""
    c = 1.0 - 2.0 * (k + 0.5) / n
    s = math.sqrt(max(1.0 - c * c, 0.0) + TINY)
    turns = GOLDEN * (k + 0.5)
    a = 2.0 * math.pi * (turns - float(math.floor(turns)))
    return s * math.cos(a), s * math.sin(a), c


def turned(x, y, z, ax, ay, az, bx, by, bz):
    """Vector (x, y, z) turned by the shortest rotation that takes unit vector a to unit vector b."""
    cx = ay * bz - az * by
    cy = az * bx - ax * bz
    cz = ax * by - ay * bx
    c = ax * bx + ay * by + az * bz
    if c < -0.9999:  # half a turn: about any axis across a; this one is never parallel to it
        px = 1.0 if abs(ax) < 0.6 else 0.0
        py = 1.0 - px
        d = ax * px + ay * py
        px -= d * ax
        py -= d * ay
        pz = -d * az
        d = 2.0 * (x * px + y * py + z * pz) / (px * px + py * py + pz * pz)
        return d * px - x, d * py - y, d * pz - z
    k = (cx * x + cy * y + cz * z) / (1.0 + c)
    return c * x + cy * z - cz * y + k * cx, c * y + cz * x - cx * z + k * cy, c * z + cx * y - cy * x + k * cz


def ray_direction(k, hx, hy, hz, p):
    """Direction of ray k, counted from 0: ever farther from the heading h, at last behind it."""
    if p.fan == "plane":
        turn = 2.0 * math.pi / p.rays * float(math.floor(0.5 * k + 1.0))
        a = -turn if k - 2.0 * float(math.floor(0.5 * k)) < 0.5 else turn
        return math.cos(a) * hx - math.sin(a) * hy, math.sin(a) * hx + math.cos(a) * hy, 0.0 * hz
    x, y, z = sphere_point(k, p.rays)
    if p.first == "point":
        px, py, pz = sphere_point(0.0, p.rays)
        return turned(x, y, z, px, py, pz, hx, hy, hz)
    return turned(x, y, z, 0.0, 0.0, 1.0, hx, hy, hz)


def way_out(percept, hx, hy, hz, ahead, p):
    """First free ray around a heading free for `ahead` (m) only; else the freest of them all (section 4.6.2)."""
    radius = p.radius + p.margin if p.cast == "swept" else 0.0
    best = Way(hx, hy, hz, ahead)
    k = 0.0
    while k < p.rays:
        x, y, z = ray_direction(k, hx, hy, hz, p)
        free = percept.cast(x, y, z, p.r_ray, radius)
        if free > best.free:
            best = Way(x, y, z, free)
        if free >= p.r_ray:
            k = p.rays
        k += 1.0
    return best


def decide(own, sums, percept, period, p):
    """Movement, m/s: what the oracles suggest together, with obstacle avoidance where the way ahead is not free."""
    t = others(Tally(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), own, sums, percept, p)
    mx, my, mz = movement(t, p)
    # The thesis multiplies by accel once a frame; a decision lasts FRAMES * period of them.
    grow = p.accel ** (FRAMES * period)
    k = min(grow, p.speed / norm(mx, my, mz))
    mx = k * mx
    my = k * my
    mz = k * mz - p.gravity
    hx = mx if p.ahead == "suggested" else own.vx
    hy = my if p.ahead == "suggested" else own.vy
    hz = mz if p.ahead == "suggested" else own.vz
    k = 1.0 / norm(hx, hy, hz)
    hx = k * hx
    hy = k * hy
    hz = k * hz
    radius = p.radius + p.margin if p.cast == "swept" else 0.0
    ahead = percept.cast(hx, hy, hz, p.r_ray, radius)
    if ahead >= p.r_ray:
        return mx, my, mz
    way = way_out(percept, hx, hy, hz, ahead, p)
    v = min(p.speed, 0.9 * way.free / period)  # a boxed-in boid stops short of the wall
    t = take(Tally(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), v * way.x, v * way.y, v * way.z, p.s_obst, p)
    # Boxed in: what other oracles add would lead into the wall before which it stops.
    if (p.scheme == "5") & (v < p.speed):
        return v * way.x, v * way.y, v * way.z
    t = others(t, own, sums, percept, p)
    mx, my, mz = movement(t, p)
    return mx, my, mz
