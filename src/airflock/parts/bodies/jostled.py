"""Jostled body: follows its command at once, and turbulence pushes each one about by itself."""

import math
from dataclasses import dataclass

from airflock.core import BodyParameters, quantity, shorten

ACCEPTS = "velocity"
INTEGRATION = "new"  # positions move by the velocity that has just been commanded, like a direct body's


@dataclass(frozen=True, kw_only=True)
class Parameters(BodyParameters):
    """A body without inertia in turbulent air."""

    speed_max: float = quantity(
        1000.0, "m/s", low=0.0, high=1e4, source="our choice", meaning="largest commanded speed"
    )
    noise: float = quantity(
        0.002, "m^2/s", low=0.0, high=100.0, source="our choice: a foot off after 23 s",
        meaning="diffusion constant of positions: left alone, a body is off by sqrt(2 noise time) on each axis",
    )  # fmt: skip


def move(cx, cy, cz, gx, gy, gz, dt, b):
    """Velocity (m/s) over one step: the command, and white noise that moves positions like a random walk."""
    x, y, z = shorten(cx, cy, cz, b.speed_max)
    k = math.sqrt(2.0 * b.noise / dt)
    return x + k * gx, y + k * gy, z + k * gz
