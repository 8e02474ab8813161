"""Neighbours that are hardly farther than the nearest one."""

from dataclasses import dataclass

import airflock

NEAR = True


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One factor."""

    times: float = airflock.quantity(2.0, "1", low=1.0, high=100.0, meaning="of the distance of the nearest")


def meet(n, r2, met, t):
    """Fill `met`."""
    nearest = 1e30
    for j in range(n):
        if r2[j] < nearest:
            nearest = r2[j]
    for j in range(n):
        met[j] = 1.0 if r2[j] < 1e29 and r2[j] <= t.times * t.times * nearest else 0.0
