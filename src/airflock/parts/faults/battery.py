"""Battery: the agent grows weaker, and lands when the battery is empty; from then on it is absent."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """The rest of a battery."""

    endurance: float = quantity(
        60.0,
        "s",
        low=0.0,
        high=1e6,
        usual=(0.0, 300.0),
        source="our choice",
        meaning="time from the warning to the landing",
    )
    share: float = quantity(
        0.5, "1", low=0.0, high=1.0, source="our choice", meaning="share of the acceleration that is left at the end"
    )


def motion(vx, vy, vz, nx, ny, nz, since, f):
    """Velocity (m/s) after a share of the change, which falls linearly from 1 to f.share."""
    k = 1.0 - (1.0 - f.share) * min(since / max(f.endurance, 1e-6), 1.0)
    return vx + k * (nx - vx), vy + k * (ny - vy), vz + k * (nz - vz)


def leaves(f):
    """Time from the onset until the drone lands, s."""
    return f.endurance
