"""Formation: where the wings of a flock are in the air's own axes, x forward and y across."""

import math

from airflock.parts.aero.wing import pitch, rounded


def forward(n, vx, vy, wing):
    """Unit vector of the flight direction in the plane: x itself, or the mean heading of the flock (wing.frame)."""
    if wing.frame == "air":
        return 1.0, 0.0
    sx = 0.0
    sy = 0.0
    for i in range(n):
        f = 1.0 / math.sqrt(vx[i] * vx[i] + vy[i] * vy[i] + 1e-12)
        sx = sx + f * vx[i]
        sy = sy + f * vy[i]
    s = math.sqrt(sx * sx + sy * sy)
    # nobody moves, or all against each other: x will do
    return (sx / s, sy / s) if s > 1e-6 else (1.0, 0.0)


def place_wings(n, x, y, z, hx, hy, wing, work):
    """Fill work.place from positions (m) and the flight direction; on the grid where wing.positions says so."""
    place = work.place
    h = pitch(wing)
    for i in range(n):
        ahead = x[i] * hx + y[i] * hy
        aside = y[i] * hx - x[i] * hy
        if wing.positions == "grid":
            place[0][i] = rounded(ahead, h)
            place[1][i] = rounded(aside, h)
            place[2][i] = rounded(z[i], h)
        else:
            place[0][i] = ahead
            place[1][i] = aside
            place[2][i] = z[i]
