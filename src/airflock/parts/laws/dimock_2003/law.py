"""Boids that feel the drag (Dimock & Selig 2003): cohesion, collision avoidance, and down the gradient of induced drag.

Every bird knows where all others are; the velocity demands of the three rules are added and obeyed
at once (Eq. 9), in a frame that flies along with the air. Induced drag and its gradient come from
one lifting-line solution per flock.

Differences
-----------
The paper survives as a damaged scan; Eqs 1 and 2 are reconstructions, fitted to what it says its
controller does.

* Eq. 1 shows X over |X| and a bracket. `cohesion`: C1 K (|X|/R)² (default), C3 K (1 - exp(-(|X|/R)²)) and C7
  K (exp((|X|/R)²) - 1) agree for small |X| and are the only forms under which the published gains
  survive; kept for comparison: C0 K exp((|X|/R)²), C2 K |X|/R, and with K in 1/s C5 K |X| and C6 K
  |X| exp(-(|X|/R)²).
* Eq. 2: positions are taken relative to the bird (the paper is silent); `centroid` divides their weighted sum by n
  (default: only so do the published gains hold a V), by the n - 1 others, or by the sum of weights.
* Eq. 4 as printed has no direction between two symmetric neighbours, and full strength towards birds at infinity;
  `avoidance` offers it weighted by presence, summed over pairs, and as a barrier that grows without
  bound.
* Eq. 8: `gradient` is the paper's central difference over one grid cell with all circulations solved again (cells), the
  same with the others' circulations held (cells_frozen, four times faster), or analytic (analytic,
  frozen), or none.
* `steps = snapped` moves birds by whole cells of the grid: one reading of "P and Q are constrained to a grid".
* The system is linear and solved so: the paper's fitness of -1000 for divergence never occurs.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, choice, norm, quantity, shorten
from airflock.parts.aero import forward, induced_drag, pitch, place_wings, rounded, segments_of, shapes, slopes, solve

COMMAND = "velocity"
TERMS = {"c": ("cohesion", "m"), "a": ("avoidance", "m; pairwise: m/s")}
PARTS = {
    "cohesion": ("k_c", "r_c", "cohesion", "centroid"),
    "avoidance": ("k_a", "r_a", "avoidance"),
    "drag descent": ("k_d", "gradient"),
    "flight": ("v_max", "steps"),
}
VIOLATES = {
    "rotation": "forward is along x, in a frame that flies along (wing.frame)",
    "units": "Eq. 4 takes the direction of a weighted offset, be it ever so short; below 1e-6 m its guard shows",
}
BEST = "Dimock & Selig 2003, best-ever controller"
UNIT = 0.3048 * 0.3048 / 4.4482216152605  # m²/(N s) in a ft²/(lbf s)


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Gains and ranges. Defaults: the paper's best-ever controller."""

    k_c: float = quantity(9.46404, "m/s", low=0.0, high=1e3, source=f"{BEST}: 31.05 ft/s", meaning="gain of cohesion")
    k_a: float = quantity(0.088392, "m/s", low=0.0, high=1e3, source=f"{BEST}: 0.29 ft/s", meaning="gain of avoidance")
    k_d: float = quantity(
        7.42 * UNIT, "m^2/(N s)", low=0.0, high=1e3, source=f"{BEST}: 7.42 ft^2/(lbf s)", meaning="gain of drag descent"
    )
    r_c: float = quantity(10.171176, "m", low=1e-3, high=1e5, source=f"{BEST}: 33.37 ft", meaning="range of cohesion")
    r_a: float = quantity(1.072896, "m", low=1e-3, high=1e5, source=f"{BEST}: 3.52 ft", meaning="range of avoidance")
    v_max: float = quantity(
        1000.0,
        "m/s",
        low=0.0,
        high=1e4,
        source="our choice: the paper has none",
        meaning="largest velocity that the law demands",
    )
    cohesion: str = choice(
        "C1",
        ("C1", "C3", "C7", "C0", "C2", "C5", "C6"),
        source="Eq. 1, illegible",
        meaning="how cohesion grows with |X|",
    )
    centroid: str = choice(
        "n", ("n", "others", "weights"), source="Eq. 2, illegible", meaning="what divides the weighted sum of positions"
    )
    avoidance: str = choice(
        "printed", ("printed", "present", "pairwise", "barrier"), source="Eq. 4; the others are ours",
        meaning="from the centroid; that times the sum of weights; a sum over pairs; the same, unbounded",
    )  # fmt: skip
    gradient: str = choice(
        "cells", ("cells", "cells_frozen", "analytic", "frozen", "none"), source="Eq. 8: cells",
        meaning="how the gradient of the drag is found",
    )  # fmt: skip
    steps: str = choice(
        "free", ("free", "snapped"), source="Eq. 9; or Eqs 5-6, constrained to a grid", meaning="how birds move"
    )


class Sums(NamedTuple):
    """Weighted offsets (m) and weights for cohesion, the same for avoidance (pairwise: its demand, m/s), neighbours."""

    cx: float
    cy: float
    cz: float
    cw: float
    ax: float
    ay: float
    az: float
    aw: float
    others: float


class Shared(NamedTuple):
    """Induced drag of a bird, N, and its gradient with its own position, N/m."""

    drag: float
    slope_x: float
    slope_y: float
    slope_z: float


def workspace(n, p, wing):
    """Scratch of the lifting line for n birds."""
    return shapes(n, segments_of(wing), p.gradient)


def flock(n, x, y, z, vx, vy, p, wing, work, shared):
    """Drag of every bird and its gradient: one solution for the whole flock."""
    hx, hy = forward(n, vx, vy, wing)
    place_wings(n, x, y, z, hx, hy, wing, work)
    solve(n, work, wing)
    for i in range(n):
        shared.drag[i] = induced_drag(i, work, work.circulation, wing)
    slopes(n, hx, hy, p.gradient, wing, work, shared)


def neighbour(dx, dy, dz, r, r2, p):
    """Weights of one neighbour (Eq. 3), and with pairwise avoidance its push."""
    c = math.exp(-r2 / (p.r_c * p.r_c))
    a = math.exp(-r2 / (p.r_a * p.r_a))
    f = a
    if p.avoidance == "pairwise":
        f = -p.k_a * a / r
    if p.avoidance == "barrier":
        f = -p.k_a * a * p.r_a / r2
    return Sums(c * dx, c * dy, c * dz, c, f * dx, f * dy, f * dz, a, 1.0)


def divisor(weights, others, p):
    """Divisor of the sum of weighted positions (Eq. 2)."""
    if p.centroid == "n":
        return others + 1.0
    if p.centroid == "others":
        return max(others, 1.0)
    return max(weights, 1e-30)


def cohesion_speed(far, p):
    """Demand towards a centroid at this distance, m: m/s (Eq. 1)."""
    s = far / p.r_c
    # Bounded: for a flock that has come apart it would overflow single precision, from 88 on.
    grown = math.exp(min(s * s, 50.0))
    if p.cohesion == "C1":
        return p.k_c * s * s
    if p.cohesion == "C3":
        return p.k_c * (1.0 - math.exp(-s * s))
    if p.cohesion == "C7":
        return p.k_c * (grown - 1.0)
    if p.cohesion == "C0":
        return p.k_c * grown
    if p.cohesion == "C2":
        return p.k_c * s
    if p.cohesion == "C5":
        return p.k_c * far
    return p.k_c * far * math.exp(-s * s)


def avoided(sums, p):
    """Demand of collision avoidance, m/s (Eq. 4)."""
    if p.avoidance == "pairwise":
        return sums.ax, sums.ay, sums.az
    if p.avoidance == "barrier":
        return sums.ax, sums.ay, sums.az
    d = 1.0 / divisor(sums.aw, sums.others, p)
    far = norm(d * sums.ax, d * sums.ay, d * sums.az)
    s = far / p.r_a
    k = -p.k_a * math.exp(-s * s) * d / far
    if p.avoidance == "present":
        k = k * sums.aw
    return k * sums.ax, k * sums.ay, k * sums.az


def decide(sums, shared, period, wing, p):
    """Velocity demand, m/s (Eq. 9)."""
    d = 1.0 / divisor(sums.cw, sums.others, p)
    far = norm(d * sums.cx, d * sums.cy, d * sums.cz)
    k = cohesion_speed(far, p) * d / far
    ax, ay, az = avoided(sums, p)
    x = k * sums.cx + ax - p.k_d * shared.slope_x
    y = k * sums.cy + ay - p.k_d * shared.slope_y
    z = k * sums.cz + az - p.k_d * shared.slope_z
    x, y, z = shorten(x, y, z, p.v_max)
    if p.steps == "snapped":
        h = pitch(wing)
        return rounded(x * period, h) / period, rounded(y * period, h) / period, rounded(z * period, h) / period
    return x, y, z
