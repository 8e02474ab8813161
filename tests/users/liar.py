"""A drone that reports a place beside its own."""

from dataclasses import dataclass

import airflock


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One offset."""

    east: float = airflock.quantity(5.0, "m", low=-100.0, high=100.0, meaning="offset towards the east")


def tell(x, y, z, vx, vy, vz, f):
    """What the agent sends."""
    return x + f.east, y, z, vx, vy, vz
