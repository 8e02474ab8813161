"""Drag descent: down the gradient of the own induced drag, beside whatever else commands an aircraft.

The third rule of Dimock & Selig (2003, Eq. 8) as a law of its own, to be added to any model that
commands a velocity (`core.model.add_laws`, the section `[aero]` of a scenario): so a flock of
drones becomes one of fixed-wing aircraft that look for each other's upwash. Its forward is the
wing's (wing.frame): along x, or the mean heading of the flock.
"""

from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, choice, quantity, shorten
from airflock.parts.aero.formation import forward, place_wings
from airflock.parts.aero.gradients import slopes
from airflock.parts.aero.lifting_line import shapes, solve
from airflock.parts.aero.wing import segments_of

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """The section [aero]; without it, a scenario flies without this rule."""

    k_d: float = quantity(
        0.1, "m^2/(N s)", low=0.0, high=1e3, meaning="gain of drag descent",
        source="our choice; Dimock & Selig 2003, best-ever controller: 0.155",
    )  # fmt: skip
    v_max: float = quantity(
        2.0, "m/s", low=0.0, high=1e4, source="our choice: less than the models that it is added to command",
        meaning="largest velocity that this rule demands",
    )  # fmt: skip
    gradient: str = choice(
        "frozen", ("frozen", "analytic", "cells_frozen", "cells"),
        source="our choice: a derivative, which needs no grid; the others' circulations held, the cheapest",
        meaning="how the gradient of the drag is found, as in model dimock_2003",
    )  # fmt: skip


class Shared(NamedTuple):
    """Gradient of the induced drag of an aircraft with its own position, N/m."""

    slope_x: float
    slope_y: float
    slope_z: float


def workspace(n, wing, aero):
    """Scratch of the lifting line for n wings."""
    return shapes(n, segments_of(wing), aero.gradient)


def flock(n, x, y, z, vx, vy, aero, wing, work, shared):
    """Gradient of every aircraft's drag: one solution for the whole flock."""
    hx, hy = forward(n, vx, vy, wing)
    place_wings(n, x, y, z, hx, hy, wing, work)
    solve(n, work, wing)
    slopes(n, hx, hy, aero.gradient, wing, work, shared)


def decide(shared, aero):
    """Velocity demand of this rule alone, m/s."""
    return shorten(-aero.k_d * shared.slope_x, -aero.k_d * shared.slope_y, -aero.k_d * shared.slope_z, aero.v_max)
