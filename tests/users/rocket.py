"""A body of accelerations with drag and a largest speed."""

import math
from dataclasses import dataclass

import airflock

ACCEPTS = "acceleration"
INTEGRATION = "new"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """Drag and a limit."""

    drag: float = airflock.quantity(0.1, "1/s", low=0.0, high=10.0, meaning="drag")
    fastest: float = airflock.quantity(8.0, "m/s", low=0.1, high=100.0, meaning="largest speed")


def move(vx, vy, vz, cx, cy, cz, dt, b):
    """Velocity after one step, m/s."""
    nx = vx + dt * (cx - b.drag * vx)
    ny = vy + dt * (cy - b.drag * vy)
    nz = vz + dt * (cz - b.drag * vz)
    k = min(1.0, b.fastest / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-12))
    return k * nx, k * ny, k * nz
