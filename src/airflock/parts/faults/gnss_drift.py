"""GNSS drift: the position of the satellite receiver wanders off; the agent believes it, and sends it to the others."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """An error of the position that grows up to a largest one."""

    east: float = quantity(
        0.5, "m/s", low=-100.0, high=100.0, usual=(-3.0, 3.0), source="our choice", meaning="drift towards the east"
    )
    north: float = quantity(
        0.0, "m/s", low=-100.0, high=100.0, usual=(-3.0, 3.0), source="our choice", meaning="drift towards the north"
    )
    up: float = quantity(
        0.0, "m/s", low=-100.0, high=100.0, usual=(-1.0, 1.0), source="our choice", meaning="drift upwards"
    )
    grows: float = quantity(
        60.0,
        "s",
        low=0.0,
        high=1e6,
        usual=(0.0, 300.0),
        source="our choice",
        meaning="time after which the error stops growing",
    )


def sense(x, y, z, vx, vy, vz, since, f):
    """Position (m) off by drift times time; the velocity, from Doppler shifts, is right."""
    t = min(since, f.grows)
    return x + f.east * t, y + f.north * t, z + f.up * t, vx, vy, vz
