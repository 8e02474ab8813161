"""Delayed: an agent knows its own state exactly, but as it was some time ago, as behind a slow filter or a slow bus."""

from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import SensorParameters, quantity

# The states are kept in the Memory of the sensor, four measurements back, with cubic interpolation,
# since a ring of states for one sensor would be one more mechanism.
LONGEST = 4.0  # periods that the Memory reaches back


@dataclass(frozen=True, kw_only=True)
class Parameters(SensorParameters):
    """A constant delay of the own state, at most four periods."""

    lag: float = quantity(
        0.2, "s", low=0.0, high=60.0, source="our choice", meaning="age of what an agent knows of its own state"
    )


class Memory(NamedTuple):
    """The last four states as they were: position (m) and velocity (m/s), newest first; how many there are."""

    x1: float = 0.0
    y1: float = 0.0
    z1: float = 0.0
    vx1: float = 0.0
    vy1: float = 0.0
    vz1: float = 0.0
    x2: float = 0.0
    y2: float = 0.0
    z2: float = 0.0
    vx2: float = 0.0
    vy2: float = 0.0
    vz2: float = 0.0
    x3: float = 0.0
    y3: float = 0.0
    z3: float = 0.0
    vx3: float = 0.0
    vy3: float = 0.0
    vz3: float = 0.0
    x4: float = 0.0
    y4: float = 0.0
    z4: float = 0.0
    vx4: float = 0.0
    vy4: float = 0.0
    vz4: float = 0.0
    held: float = 0.0


def exact(s):
    """Return True if the sensor has no error: without a delay."""
    return s.lag == 0.0


def bounds(s, period):
    """Lines for a delay that the Memory does not reach back to."""
    if s.lag <= LONGEST * period * (1.0 + 1e-9):
        return []
    return [
        f"sensors.lag = {s.lag:g} s is more than {LONGEST:g} periods of {period:g} s, all that is kept; "
        f"give sensors.period = {s.lag / LONGEST:g} s or more"
    ]


def measure(x, y, z, vx, vy, vz, memory, period, s):
    """Position (m) and velocity (m/s) of `lag` ago, and Memory. At the start, the oldest state that there is.

    Between two measurements positions follow the cubic polynomial that has both positions and both
    velocities (Hermite), and velocities its slope: exact while the acceleration changes linearly.
    """
    m = memory
    back = min(s.lag / period, m.held)
    k = 0.0 if back < 1.0 else 1.0 if back < 2.0 else 2.0 if back < 3.0 else 3.0
    f = back - k  # share of the way from the newer state of the two to the older one
    ax, bx = chosen(k, x, m.x1, m.x2, m.x3), chosen(k, m.x1, m.x2, m.x3, m.x4)
    ay, by = chosen(k, y, m.y1, m.y2, m.y3), chosen(k, m.y1, m.y2, m.y3, m.y4)
    az, bz = chosen(k, z, m.z1, m.z2, m.z3), chosen(k, m.z1, m.z2, m.z3, m.z4)
    avx, bvx = chosen(k, vx, m.vx1, m.vx2, m.vx3), chosen(k, m.vx1, m.vx2, m.vx3, m.vx4)
    avy, bvy = chosen(k, vy, m.vy1, m.vy2, m.vy3), chosen(k, m.vy1, m.vy2, m.vy3, m.vy4)
    avz, bvz = chosen(k, vz, m.vz1, m.vz2, m.vz3), chosen(k, m.vz1, m.vz2, m.vz3, m.vz4)
    return (
        place(f, ax, bx, avx, bvx, period), place(f, ay, by, avy, bvy, period), place(f, az, bz, avz, bvz, period),
        pace(f, ax, bx, avx, bvx, period), pace(f, ay, by, avy, bvy, period), pace(f, az, bz, avz, bvz, period),
        Memory(
            x, y, z, vx, vy, vz, m.x1, m.y1, m.z1, m.vx1, m.vy1, m.vz1, m.x2, m.y2, m.z2, m.vx2, m.vy2, m.vz2,
            m.x3, m.y3, m.z3, m.vx3, m.vy3, m.vz3, min(m.held + 1.0, LONGEST),
        ),
    )  # fmt: skip


def chosen(k, a, b, c, d):
    """The k-th of four numbers."""
    return a if k < 0.5 else b if k < 1.5 else c if k < 2.5 else d


def place(f, a, b, u, v, period):
    """Position a share f of a period before a, on the cubic from b, the older; u and v are velocities at a and b."""
    h = f * f * (3.0 - 2.0 * f)
    return a + h * (b - a) - period * f * (1.0 - f) * ((1.0 - f) * u - f * v)


def pace(f, a, b, u, v, period):
    """Velocity there: the slope of the cubic."""
    return 6.0 * f * (1.0 - f) * (a - b) / period + (1.0 - f) * (1.0 - 3.0 * f) * u - f * (2.0 - 3.0 * f) * v
