"""GNSS offset: the satellite receiver is off by a constant; the agent believes it, and sends it to the others."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """A constant error of the position."""

    east: float = quantity(
        10.0, "m", low=-1e4, high=1e4, usual=(-50.0, 50.0), source="our choice", meaning="error towards the east"
    )
    north: float = quantity(
        0.0, "m", low=-1e4, high=1e4, usual=(-50.0, 50.0), source="our choice", meaning="error towards the north"
    )
    up: float = quantity(
        0.0, "m", low=-1e4, high=1e4, usual=(-20.0, 20.0), source="our choice", meaning="error upwards"
    )


def sense(x, y, z, vx, vy, vz, f):
    """Position (m) off by the error; the velocity, from Doppler shifts, is right."""
    return x + f.east, y + f.north, z + f.up, vx, vy, vz
