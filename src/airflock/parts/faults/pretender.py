"""Pretender: the agent knows where it is, but sends the others another position."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Offset of the pretended position from the true one."""

    east: float = quantity(
        20.0, "m", low=-1e4, high=1e4, usual=(-50.0, 50.0), source="our choice", meaning="pretended offset, east"
    )
    north: float = quantity(
        0.0, "m", low=-1e4, high=1e4, usual=(-50.0, 50.0), source="our choice", meaning="pretended offset, north"
    )
    up: float = quantity(
        0.0, "m", low=-1e4, high=1e4, usual=(-20.0, 20.0), source="our choice", meaning="pretended offset, up"
    )


def tell(x, y, z, vx, vy, vz, f):
    """Position (m) off by the offset; the velocity (m/s) is true."""
    return x + f.east, y + f.north, z + f.up, vx, vy, vz
