"""Direct body: a point that follows its command at once (the thesis of Kidger; any law without inertia)."""

from dataclasses import dataclass

from airflock.core import BodyParameters, quantity, shorten

ACCEPTS = "velocity"  # the COMMAND that this body takes
INTEGRATION = "new"  # positions move by the velocity that has just been commanded


@dataclass(frozen=True, kw_only=True)
class Parameters(BodyParameters):
    """A body without inertia."""

    speed_max: float = quantity(
        1000.0, "m/s", low=0.0, high=1e4, source="our choice: beyond any of the thesis's", meaning="largest speed"
    )


def move(cx, cy, cz, b):
    """Velocity (m/s) after one step: the command itself, at most b.speed_max."""
    return shorten(cx, cy, cz, b.speed_max)
