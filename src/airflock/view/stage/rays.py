"""Rays of one agent at one instant: which were cast, how far each was free, and what was decided on."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from airflock.core.agent import Heard, State, decide
from airflock.core.senses import Senses
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.surroundings import Course, Place
from airflock.scenarios.timing import clock


class Ray(NamedTuple):
    """A cast: its direction, how far it was free and how far it looked, m."""

    x: float
    y: float
    z: float
    free: float
    length: float


class Watched(Senses):
    """Senses that keep every cast."""

    cast_rays: list[Ray]

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance along the unit vector u, m."""
        free = super().cast(ux, uy, uz, length, radius)
        self.cast_rays.append(Ray(ux, uy, uz, free, length))
        return free


def cast_rays(
    scenario: Scenario, place: Place, course: Course, own: State, heard: Sequence[Heard], time: float, agent: int
) -> tuple[list[Ray], Any]:
    """Rays that an agent casts, and the command that it decides on, by its law's own rules.

    place, course : the world and its goals as they are at this time, s; own, heard : states of the agent and of others
    """
    senses = Watched.of(place, own, time, course.of(agent), (0, 0, agent))
    senses.cast_rays = []
    period = clock(scenario)["decide_every"] * scenario.flight.dt
    made = decide(
        scenario.model, scenario.parameters, own, list(heard), (), None,
        time=time, period=period, index=agent, percept=senses,
    )  # fmt: skip
    return senses.cast_rays, made.command
