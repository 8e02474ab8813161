"""Motor: only a share of the acceleration is left."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """A weak motor."""

    share: float = quantity(
        0.3, "1", low=0.0, high=1.0, source="our choice", meaning="share of the acceleration that is left"
    )


def motion(vx, vy, vz, nx, ny, nz, f):
    """Velocity (m/s) after a share of the change that the sound body would have made, gusts and noise included."""
    return vx + f.share * (nx - vx), vy + f.share * (ny - vy), vz + f.share * (nz - vz)
