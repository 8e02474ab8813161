"""GNSS spoofed: a false signal makes the agent believe another track, which it also sends to the others."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """A straight track from the place where the agent believed itself before the fault."""

    east: float = quantity(
        3.0,
        "m/s",
        low=-100.0,
        high=100.0,
        usual=(-10.0, 10.0),
        source="our choice",
        meaning="velocity of the false track, east",
    )
    north: float = quantity(
        0.0,
        "m/s",
        low=-100.0,
        high=100.0,
        usual=(-10.0, 10.0),
        source="our choice",
        meaning="velocity of the false track, north",
    )
    up: float = quantity(
        0.0,
        "m/s",
        low=-100.0,
        high=100.0,
        usual=(-3.0, 3.0),
        source="our choice",
        meaning="velocity of the false track, up",
    )


def sense(at_x, at_y, at_z, since, f):
    """Position (m) and velocity (m/s) of the track, whatever the agent does."""
    return at_x + f.east * since, at_y + f.north * since, at_z + f.up * since, f.east, f.north, f.up
