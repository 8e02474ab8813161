"""Perfect: an agent knows its own position and velocity as they are."""

from dataclasses import dataclass

from airflock.core import SensorParameters


@dataclass(frozen=True, kw_only=True)
class Parameters(SensorParameters):
    """A sensor without errors; it only sets how often an agent measures, and thus decides."""


def exact(s):
    """Return True: this sensor has no error."""
    return True


def measure(x, y, z, vx, vy, vz):
    """Position (m) and velocity (m/s) as they are."""
    return x, y, z, vx, vy, vz
