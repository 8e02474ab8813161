"""A signal that rain weakens with the distance."""

import math
from dataclasses import dataclass

import airflock


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One length."""

    reach: float = airflock.quantity(60.0, "m", low=1.0, high=1e5, meaning="where a share of 1/e arrives")


def missed(distance, k):
    """Probability that nothing arrives."""
    return 1.0 - math.exp(-distance / k.reach)


def carry(x, y, z, vx, vy, vz, age):
    """State by the time it is used."""
    return x + vx * age, y + vy * age, z + vz * age
