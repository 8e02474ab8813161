"""Autopilot: a multirotor that answers a velocity command late, with a lag, and with limited acceleration and jerk.

The defaults are measured: ArduCopter 4.6.0-dev in software in the loop, in GUIDED mode with
velocity set-points, at its own defaults. From the set-points (log message GUIP) to the velocity it
is a dead time of 0.40 s and a lag of 1.20 s; accelerations reach WPNAV_ACCEL, and change by
PSC_JERK_XY. With WPNAV_ACCEL 500 and PSC_JERK_XY 20 it is another drone: delay = 0.35, tau = 0.5,
a_max = 5, jerk = 20.

Dead time and lag were measured as one lag without limits. With both limits beside them this body is
slower than that autopilot: a dead time of 0.1 to 0.2 s and a lag of 0.5 s come closest to its logs
(0.10 to 0.17 m/s, rms, instead of 0.5 to 0.7). The defaults stay on the safe side.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import quantity, shorten
from airflock.parts.bodies import motion

ACCEPTS = "velocity"
INTEGRATION = "new"  # positions move by the velocity after the step
MEASURED = "measured on ArduCopter 4.6.0-dev in software in the loop, at its defaults"


@dataclass(frozen=True, kw_only=True)
class Parameters(motion.Parameters):
    """A real autopilot, as it answers velocity set-points; noise and drag are those of the multirotor."""

    delay: float = quantity(
        0.4, "s", low=0.0, high=10.0, usual=(0.0, 1.0), source=MEASURED,
        meaning="dead time between a command and the body that follows it; the same for all agents",
    )  # fmt: skip
    tau: float = quantity(
        1.2, "s", low=0.01, high=60.0, source=MEASURED, meaning="relaxation time towards the command, after the delay"
    )
    a_max: float = quantity(
        2.5, "m/s^2", low=0.01, high=100.0, source="WPNAV_ACCEL of ArduCopter, 250 cm/s²; 2.7 m/s² were measured",
        meaning="largest controlled acceleration",
    )  # fmt: skip
    jerk: float = quantity(
        5.0, "m/s^3", low=0.01, high=1e4, source="PSC_JERK_XY of ArduCopter",
        meaning="largest change of the controlled acceleration per time",
    )  # fmt: skip


class Memory(NamedTuple):
    """Controlled acceleration, m/s²."""

    ax: float = 0.0
    ay: float = 0.0
    az: float = 0.0


def move(vx, vy, vz, mx, my, mz, cx, cy, cz, gx, gy, gz, wx, wy, wz, memory, dt, b):
    """Velocity after dt, m/s, and Memory: relax to the command within a_max, at most b.jerk; then noise and wind.

    Like `motion.move`, but for the jerk: the acceleration goes towards the one that is wanted by at
    most jerk dt. Both limits hold for the length of the vector, as ArduCopter limits a horizontal
    command.
    """
    ax, ay, az = shorten((cx - mx) / b.tau, (cy - my) / b.tau, (cz - mz) / b.tau, b.a_max)
    jx, jy, jz = shorten(ax - memory.ax, ay - memory.ay, az - memory.az, b.jerk * dt)
    nx = memory.ax + jx
    ny = memory.ay + jy
    nz = memory.az + jz
    k = math.sqrt(2.0 * b.noise * dt)
    return (
        vx + nx * dt + k * gx + b.drag * wx * dt,
        vy + ny * dt + k * gy + b.drag * wy * dt,
        vz + nz * dt + k * gz + b.drag * wz * dt,
        Memory(nx, ny, nz),
    )
