"""Steering: a law's command as the command that another kind of body takes.

Every conversion goes by the velocity that the law wants. A heading wants the preferred speed along
it; an acceleration wants the own velocity plus what it adds in the time in which the body answers,
so that a body that lags by that time accelerates as the law asks for. A body that takes a heading
flies along the wanted velocity; one that takes an acceleration gets what closes the gap in that
time. Ours; an ideal body makes of it the law's own integration.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from airflock.core import Model, Parameters as Record, norm, quantity, shorten, steered_law
from airflock.parts.bodies.turning import move as turned

OURS = "our choice"
NO_LIMIT = 1e6  # rad/s, in whatever units a flight counts


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """How commands are converted where the body takes another kind of command than the law gives."""

    speed: float | None = quantity(
        None, "m/s", low=0.0, high=1000.0, source=OURS,
        meaning="speed of a heading, and largest speed of an acceleration; by default the law's preferred speed, "
        "else that of the fitness",
    )  # fmt: skip
    turn: float | None = quantity(
        None, "rad/s", low=0.0, high=1e6, source=OURS,
        meaning="largest rate of turn of a heading; by default there is no limit",
    )  # fmt: skip
    response: float | None = quantity(
        None, "s", low=1e-6, high=1e7, source=OURS,
        meaning="time in which the body follows a command; by default body.tau where the body has it, else the period "
        "of decisions",
    )  # fmt: skip


def heading_to_velocity(cx, cy, cz, own, period, steer):
    """Velocity (m/s) along a heading to which the own one turns by at most the largest rate."""
    return turned(own.vx, own.vy, own.vz, cx, cy, cz, period, steer)  # as the body that flies headings turns


def acceleration_to_velocity(cx, cy, cz, own, steer):
    """Velocity (m/s) at which a body that lags by the response accelerates as commanded, at most the speed."""
    t = steer.response
    return shorten(own.vx + t * cx, own.vy + t * cy, own.vz + t * cz, steer.speed)


def velocity_to_heading(cx, cy, cz, own):
    """Direction of a velocity; the own heading where it is zero."""
    still = cx * cx + cy * cy + cz * cz < 1e-12
    k = 1.0 / norm(cx, cy, cz)
    return own.hx if still else k * cx, own.hy if still else k * cy, own.hz if still else k * cz


def velocity_to_acceleration(cx, cy, cz, own, steer):
    """Acceleration (m/s²) that closes the gap to a velocity in the response."""
    k = 1.0 / steer.response
    return k * (cx - own.vx), k * (cy - own.vy), k * (cz - own.vz)


def acceleration_to_heading(cx, cy, cz, own, steer):
    """Direction of the velocity that an acceleration wants."""
    x, y, z = acceleration_to_velocity(cx, cy, cz, own, steer)
    return velocity_to_heading(x, y, z, own)


def heading_to_acceleration(cx, cy, cz, own, period, steer):
    """Acceleration (m/s²) that closes the gap to the velocity along a heading."""
    x, y, z = heading_to_velocity(cx, cy, cz, own, period, steer)
    return velocity_to_acceleration(x, y, z, own, steer)


# What a law commands, and what the body takes → the rule.
STEERING: Mapping[tuple[str, str], Callable[..., Any]] = {
    ("heading", "velocity"): heading_to_velocity,
    ("heading", "acceleration"): heading_to_acceleration,
    ("acceleration", "velocity"): acceleration_to_velocity,
    ("acceleration", "heading"): acceleration_to_heading,
    ("velocity", "heading"): velocity_to_heading,
    ("velocity", "acceleration"): velocity_to_acceleration,
}


def law_for_command(law: Model, command: str) -> Model:
    """Return a law that gives the command which a body takes: itself, or with its own command converted."""
    return law if law.command == command else steered_law(law, command, STEERING[law.command, command])
