"""Multirotor: a body whose low-level controller follows a velocity."""

import math
from dataclasses import dataclass

from airflock.core import BodyParameters, quantity, shorten

NAME = "multirotor"
ACCEPTS = "velocity"  # the COMMAND that this body takes
INTEGRATION = "old"  # positions move by the velocity before the step (authors' program)
S5 = "Vásárhelyi et al. 2018, Table S5"


@dataclass(frozen=True, kw_only=True)
class Parameters(BodyParameters):
    """A multirotor whose low-level controller follows a velocity. Defaults: Table S5."""

    tau: float = quantity(1.0, "s", low=0.01, high=60.0, source=S5, meaning="relaxation time towards the command")
    a_max: float = quantity(6.0, "m/s^2", low=0.01, high=100.0, source=S5, meaning="largest controlled acceleration")
    noise: float = quantity(
        0.2, "m^2/s^3", low=0.0, high=10.0, source=S5, meaning="diffusion constant of the outer noise (not an SD)"
    )
    drag: float = quantity(
        0.1,
        "1/s",
        low=0.0,
        high=5.0,
        source="our choice, because a multirotor of 1 m/s² drag at 10 m/s is usual",
        meaning="acceleration caused by the wind, per wind speed",
    )


def move(vx, vy, vz, mx, my, mz, cx, cy, cz, gx, gy, gz, wx, wy, wz, dt, b):
    """Velocity after dt, m/s: relax to the command, saturate, then add outer noise and the push of the wind.

    The controller sees the measured velocity m, so the measurement error enters at every step; the
    noise comes after the saturation (authors' program; Methods of Vásárhelyi et al. 2018). Wind
    pushes with b.drag times its velocity: the drag of the own motion is part of tau. Our choice,
    because the paper has no wind.
    """
    ax, ay, az = shorten((cx - mx) / b.tau, (cy - my) / b.tau, (cz - mz) / b.tau, b.a_max)
    k = math.sqrt(2.0 * b.noise * dt)
    return (
        vx + ax * dt + k * gx + b.drag * wx * dt,
        vy + ay * dt + k * gy + b.drag * wy * dt,
        vz + az * dt + k * gz + b.drag * wz * dt,
    )
