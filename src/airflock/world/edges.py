"""Edges of a box: motion beyond its faces, one coordinate at a time, and offsets across a periodic box."""

import math


def bounce(x, v, half):
    """Coordinate (m) and velocity (m/s) after a wall at ±half: clamped to it, velocity reversed (Zapotecatl 2016)."""
    out = abs(x) > half
    return min(max(x, -half), half), -v if out else v


def wrap(x, v, half):
    """Coordinate (m) put back into a periodic box from -half to half, and the velocity (m/s) as it is."""
    return x - 2.0 * half * math.floor((x + half) / (2.0 * half)), v


def nearest_image(d, half):
    """Offset d (m) of two agents of a periodic box of half side `half`, to the nearest image."""
    box = 2.0 * half
    return d - (box if d > half else (-box if d < -half else 0.0))
