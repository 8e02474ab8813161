"""Vectors of three floats, transfer functions and the braking curve; plain scalar text for rules to call.

Lengths are guarded by `TINY`, so that no rule divides by zero: the unit vector of nothing is
nothing.
"""

import math

FAR = 1e30  # stands for "no limit": rules use no infinity, because kernels are compiled with fastmath
TINY = 1e-12  # added under a square root, in the square of the unit at hand


def norm(x, y, z):
    """Length of a vector, in its own unit; 1e-6 for the zero vector."""
    return math.sqrt(x * x + y * y + z * z + TINY)


def unit(x, y, z):
    """Unit vector of (x, y, z); the zero vector stays zero."""
    k = 1.0 / norm(x, y, z)
    return x * k, y * k, z * k


def shorten(x, y, z, most):
    """The vector itself, or shortened to length `most` (same unit) with its direction kept."""
    k = min(1.0, most / norm(x, y, z))
    return x * k, y * k, z * k


def clamp(x, low, high):
    """x, but at least low and at most high."""
    return min(max(x, low), high)


def arc_cosine(c):
    """Angle (rad) whose cosine is c, clamped to [-1, 1]; within 2e-8 (Abramowitz and Stegun 1964, 4.4.46).

    A polynomial and a root instead of the C library's acos, whose scalar call would stop
    vectorisation.
    """
    s = min(abs(c), 1.0)
    a = arc_over_root(s) * math.sqrt(1.0 - s)
    return a if c >= 0.0 else math.pi - a


def arc_over_root(s):
    """Angle (rad) whose cosine is s, 0-1, over the root of 1 - s (Abramowitz and Stegun 1964, 4.4.46)."""
    t = -0.0012624911 * s + 0.0066700901
    t = t * s - 0.0170881256
    t = t * s + 0.0308918810
    t = t * s - 0.0501743046
    t = t * s + 0.0889789874
    t = t * s - 0.2145988016
    return t * s + 1.5707963050


def angle_between(ax, ay, az, bx, by, bz):
    """Angle (rad) between two unit vectors, within 2e-8; a quarter turn where one of them is zero.

    A cosine near 1 says little of a small angle (1.5e-8 rad are one unit in its last place in
    double precision, 3e-4 in single), so 1 - |cosine| comes from the cross product there.
    """
    c = ax * bx + ay * by + az * bz
    s = min(abs(c), 1.0)
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    rest = (x * x + y * y + z * z) / (1.0 + s) if s > 0.5 else 1.0 - s
    a = arc_over_root(s) * math.sqrt(rest)
    return a if c >= 0.0 else math.pi - a


def braking_curve(r, a, p):
    """Speed from which one can still stop within r: D(r, a, p) of Vásárhelyi et al. 2018, Eq. 4.

    r : distance to the stopping point, m; a : deceleration, m/s²; p : gain near the stop, 1/s.
    Returns m/s: 0 behind the stopping point, linear near it, constant deceleration farther out.
    """
    s = max(r, 0.0)
    linear = s * p
    return linear if linear * p < a else math.sqrt(max(2.0 * a * s - (a / p) * (a / p), 0.0))


def braking_distance(v, a, p):
    """Distance (m) at which the braking curve allows speed v (m/s): D~(v, a, p) of Eq. 12."""
    if v * p < a:
        return v / p
    return 0.5 * (v * v / a + a / (p * p))


def excess(v, allowed):
    """Share of a speed v that lies above what is allowed: max(v - allowed, 0) / v; both m/s, v > 0."""
    return max(v - allowed, 0.0) / v


def falling_sigmoid(x, x0, d):
    """S(x, x0, d): 1 below x0 - d, 0 above x0, half a cosine between (Vásárhelyi et al. 2018, Eq. 18).

    The printed first branch of Eq. 18 is 1/2; continuity and the paper's own Table S2 ask for 1.
    """
    if x < x0 - d:
        return 1.0
    if x < x0:
        return 0.5 * (1.0 - math.cos(math.pi / d * (x - x0)))
    return 0.0


def rising(x, x0, d):
    """F1 of Vásárhelyi et al. 2018, Eq. 17: 0 below x0 - d, 1 above x0."""
    return 1.0 - falling_sigmoid(x, x0, d)


def bell(x, s):
    """F2 of Vásárhelyi et al. 2018, Eq. 19: 1 at x = 0, a Gaussian decay of width s around it."""
    return math.exp(-(x * x) / (s * s))


def peak(x, a):
    """F3 of Vásárhelyi et al. 2018, Eq. 20: 1 at x = 0, a quarter at x = a."""
    return (a / (x + a)) ** 2
