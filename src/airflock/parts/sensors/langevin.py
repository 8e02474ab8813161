"""Langevin: satellite navigation with slowly wandering errors, as Vásárhelyi et al. 2018 simulate it."""

import math
from dataclasses import dataclass

from airflock.core import SensorParameters, quantity

S5 = "Vásárhelyi et al. 2018, Table S5"
PROGRAM = "authors' program of Vásárhelyi et al. 2018"


@dataclass(frozen=True, kw_only=True)
class Parameters(SensorParameters):
    """Satellite navigation with a slowly wandering error. Stationary per axis: SD of the velocity error sqrt(noise),
    of the position error sqrt(scale · sqrt(noise / (2 damping))), 0.69 m with the defaults.
    """

    noise: float = quantity(
        0.005, "m^2/s^2", low=0.0, high=100.0, source=S5, meaning="variance of the velocity error (S5: noise level)"
    )
    damping: float = quantity(0.1, "1/s", low=0.001, high=10.0, source=PROGRAM, meaning="damping of the error's swing")
    scale: float = quantity(
        3.0, "m s^(1/2)", low=0.01, high=1000.0, source=PROGRAM, meaning="sets the spring: sqrt(2 damping noise)/scale"
    )


def exact(s):
    """Return True if the sensor has no error: without noise."""
    return s.noise == 0.0


def error(dx, dv, g, period, s):
    """One period of an error along one axis: of the position dx (m), of the velocity dv (m/s), from a normal number g.

    A damped oscillator with a random push (authors' program; the paper says only "Langevin,
    parabolic potential").
    """
    push = math.sqrt(2.0 * s.damping * period * s.noise)
    spring = math.sqrt(2.0 * s.damping * s.noise) / s.scale
    new = dv + push * g - spring * period * dx - s.damping * period * dv
    return dx + period * new, new
