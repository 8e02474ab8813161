"""GNSS: a satellite receiver as in its data sheet, by standard deviations; with multipath jumps and outages."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import SensorParameters, quantity

OURS = "our choice"


@dataclass(frozen=True, kw_only=True)
class Parameters(SensorParameters):
    """A satellite receiver. All standard deviations (SD) are per axis, and those of a stationary error.

    The SD of a horizontal axis is sqrt(sd² + white² + bias²), apart from multipath and outages. A
    data sheet's CEP, the radius of half of all fixes, is 1.18 of it.
    """

    sd: float = quantity(
        1.5, "m", low=0.0, high=1000.0, source=OURS, meaning="SD of the wandering error, east and north"
    )
    sd_up: float = quantity(3.0, "m", low=0.0, high=1000.0, source=OURS, meaning="SD of the wandering error, up")
    drift_time: float = quantity(
        60.0, "s", low=0.001, high=1e5, source=OURS, meaning="correlation time of the wandering error"
    )
    white: float = quantity(
        0.0, "m", low=0.0, high=1000.0, source=OURS, meaning="SD of an error that is new at each measurement"
    )
    bias: float = quantity(
        0.0, "m", low=0.0, high=1000.0, source=OURS, meaning="SD of an error that stays the same for the whole flight"
    )
    sd_velocity: float = quantity(
        0.05, "m/s", low=0.0, high=100.0, source=OURS, meaning="SD of the velocity, from Doppler shifts"
    )
    jump_rate: float = quantity(
        0.0, "1/s", low=0.0, high=100.0, source=OURS, meaning="how often multipath begins while there is none"
    )
    jump_time: float = quantity(20.0, "s", low=0.0, high=1e5, source=OURS, meaning="how long multipath lasts")
    jump_sd: float = quantity(
        5.0, "m", low=0.0, high=1000.0, source=OURS, meaning="SD of the offset while multipath lasts"
    )
    outage_rate: float = quantity(
        0.0, "1/s", low=0.0, high=100.0, source=OURS, meaning="how often a receiver with a fix loses it"
    )
    outage_time: float = quantity(5.0, "s", low=0.0, high=1e5, source=OURS, meaning="how long an outage lasts")
    coasting: float = quantity(
        0.3, "m/s", low=0.0, high=100.0, source=OURS,
        meaning="SD of the velocity by which inertial sensors carry the position on in an outage",
    )  # fmt: skip


class Memory(NamedTuple):
    """State of one receiver: errors (m, m/s) and times left (s)."""

    begun: float = 0.0
    bias_x: float = 0.0
    bias_y: float = 0.0
    bias_z: float = 0.0
    drift_x: float = 0.0
    drift_y: float = 0.0
    drift_z: float = 0.0
    jump_x: float = 0.0
    jump_y: float = 0.0
    jump_z: float = 0.0
    jump_left: float = 0.0
    error_x: float = 0.0
    error_y: float = 0.0
    error_z: float = 0.0
    coast_x: float = 0.0
    coast_y: float = 0.0
    coast_z: float = 0.0
    outage_left: float = 0.0


def exact(s):
    """Return True if the sensor has no error."""
    quiet = s.sd == 0.0 and s.sd_up == 0.0 and s.white == 0.0 and s.bias == 0.0 and s.sd_velocity == 0.0
    jumps = s.jump_rate > 0.0 and s.jump_sd > 0.0
    outages = s.outage_rate > 0.0 and s.outage_time > 0.0 and s.coasting > 0.0
    return quiet and not jumps and not outages


def measure(
    x, y, z, vx, vy, vz, memory, g0, g1, g2, g3, g4, g5, g6, g7, g8, g9, g10, g11, u0, u1, period, s
):  # fmt: skip
    """Position (m) and velocity (m/s) with the errors of the receiver, and its Memory.

    The wandering error is a Gauss-Markov process: exp(-time / drift_time) is its autocorrelation,
    whatever the period. Multipath and outages begin at their rates, as in a Poisson process, and
    last for their times. In an outage the error grows by a velocity that is drawn when the fix is
    lost; with the fix the other errors are back.
    """
    sound = memory.begun > 0.5  # at the first measurement, the drift is drawn from its stationary distribution
    keep = math.exp(-period / s.drift_time) if sound else 0.0
    # The exact factor for any period, and a first value from the stationary distribution: shares of
    # time then have closed forms that tests compare with.
    push = math.sqrt(1.0 - keep * keep)
    dx = keep * memory.drift_x + s.sd * push * g0
    dy = keep * memory.drift_y + s.sd * push * g1
    dz = keep * memory.drift_z + s.sd_up * push * g2
    bx = memory.bias_x if sound else s.bias * g3
    by = memory.bias_y if sound else s.bias * g4
    bz = memory.bias_z if sound else s.bias * g5
    white = s.white if sound else 0.0

    left = max(memory.jump_left - period, 0.0)
    # Half a period as the limit, so that rounding of the time left neither adds nor drops a
    # measurement.
    if left < 0.5 * period:
        jumps = u0 < 1.0 - math.exp(-s.jump_rate * period) and sound
        left = s.jump_time if jumps else 0.0
        size = s.jump_sd if jumps else 0.0
        jx, jy, jz = size * g9, size * g10, size * g11
    else:
        jx, jy, jz = memory.jump_x, memory.jump_y, memory.jump_z

    out = max(memory.outage_left - period, 0.0)
    cx, cy, cz = memory.coast_x, memory.coast_y, memory.coast_z
    if out < 0.5 * period:
        lost = u1 < 1.0 - math.exp(-s.outage_rate * period) and sound
        out = s.outage_time if lost else 0.0
        cx, cy, cz = s.coasting * g6, s.coasting * g7, s.coasting * g8
    if out > 0.0:
        ex, ey, ez = memory.error_x + period * cx, memory.error_y + period * cy, memory.error_z + period * cz
        ux, uy, uz = cx, cy, cz
    else:
        ex, ey, ez = bx + dx + jx + white * g3, by + dy + jy + white * g4, bz + dz + jz + white * g5
        ux, uy, uz = s.sd_velocity * g6, s.sd_velocity * g7, s.sd_velocity * g8
    return (
        x + ex, y + ey, z + ez, vx + ux, vy + uy, vz + uz,
        Memory(1.0, bx, by, bz, dx, dy, dz, jx, jy, jz, left, ex, ey, ez, cx, cy, cz, out),
    )  # fmt: skip
