"""Steered body: a point that accelerates as commanded, up to a largest speed (Zapotecatl et al. 2016, Eqs 11-12)."""

from dataclasses import dataclass

from airflock.core import BodyParameters, norm, quantity, shorten

ACCEPTS = "acceleration"
INTEGRATION = "new"  # Eq. 12: positions move by the velocity after the step


@dataclass(frozen=True, kw_only=True)
class Parameters(BodyParameters):
    """Limits of speed; forces and mass belong to the model, because a boid's force is its impulse to steer."""

    speed_max: float = quantity(
        0.25, "m/s", low=0.0, high=1000.0, source="Zapotecatl et al. 2016, Table 1", meaning="largest speed s_m"
    )
    speed_min: float = quantity(
        0.0, "m/s", low=0.0, high=1000.0, source="authors' program: none", meaning="least speed, kept along the heading"
    )


def move(vx, vy, vz, cx, cy, cz, dt, b):
    """Velocity after dt, m/s: add the acceleration c (m/s²), then limit the speed (Eq. 11 with its dt)."""
    nx, ny, nz = shorten(vx + cx * dt, vy + cy * dt, vz + cz * dt, b.speed_max)
    k = max(1.0, b.speed_min / norm(nx, ny, nz))
    return k * nx, k * ny, k * nz
