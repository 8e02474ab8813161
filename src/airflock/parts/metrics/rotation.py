"""Rotation about the arena's centre (Vásárhelyi et al. 2018, Eq. 1): 1 counter-clockwise, -1 clockwise, 0 neither.

The centre is the point metrics.centre_x, centre_y, the origin unless it is given.
"""

from typing import NamedTuple

from airflock.core import norm

REPORTS = {
    "phi_lap": ("", "rotation about metrics.centre_x, centre_y; counter-clockwise positive"),
    "phi_lap_abs": ("", "rotation about metrics.centre_x, centre_y; either way"),
}
FORMULAS = {
    "phi_lap": (
        r"\left\langle \frac{(\bar x \times \bar v)_z}{|\bar x|\, v_{flock}} \right\rangle_t",
        "about -1 to 1; beyond if the mean flies faster than v_flock",
        "Laps of the whole flock about the arena's centre, given by `metrics.centre_x` and `metrics.centre_y` (by "
        "default the origin). Near 0 if it crosses the arena diagonally.",
    ),
    "phi_lap_abs": (
        r"\left\langle \left| \frac{(\bar x \times \bar v)_z}{|\bar x|\, v_{flock}} \right| \right\rangle_t",
        "about 0 to 1",
    ),
}
NEEDS = {"phi_lap": ("centre_x", "centre_y"), "phi_lap_abs": ("centre_x", "centre_y")}

VIOLATES = {
    "translation": "it is the rotation about the arena's centre",
    "mirror": "phi_lap tells one sense of rotation from the other",
}


class Sample(NamedTuple):
    """phi_LAP of this instant, and its magnitude."""

    phi_lap: float
    phi_lap_abs: float


def sample(mean, q):
    """Tangential share of the mean velocity at the mean position, in units of v_flock."""
    rx = mean.x - q.centre_x
    ry = mean.y - q.centre_y
    lap = (mean.vy * rx - mean.vx * ry) / (q.v_flock * norm(rx, ry, 0.0))
    return Sample(lap, abs(lap))
