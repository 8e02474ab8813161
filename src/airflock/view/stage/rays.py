"""Rays of one agent at one instant: which were cast, how far each was free, and what was decided on."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from airflock.core import BoundPercept, HeardNeighbour, State, decide
from airflock.scenarios import FlightWorld, GoalCourse, Scenario, step_counts


class CastRay(NamedTuple):
    """A cast: its direction, how far it was free and how far it looked, m."""

    x: float
    y: float
    z: float
    free: float
    length: float


class RecordingPercept(BoundPercept):
    """Senses that keep every cast."""

    cast_rays: list[CastRay]

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance along the unit vector u, m."""
        free = super().cast(ux, uy, uz, length, radius)
        self.cast_rays.append(CastRay(ux, uy, uz, free, length))
        return free


def rays_and_command(
    scenario: Scenario,
    world: FlightWorld,
    course: GoalCourse,
    own: State,
    heard: Sequence[HeardNeighbour],
    time: float,
    agent: int,
) -> tuple[list[CastRay], Any]:
    """Rays that an agent casts, and the command that it decides on, by its law's own rules.

    place, course : the world and its goals as they are at this time, s; own, heard : states of the agent and of others
    """
    senses = RecordingPercept.of(world, own, time, course.of(agent), (0, 0, agent))
    senses.cast_rays = []
    period = step_counts(scenario)["decide_every"] * scenario.flight.dt
    made = decide(
        scenario.model, scenario.parameters, own, list(heard), (), None,
        time=time, period=period, index=agent, percept=senses,
    )  # fmt: skip
    return senses.cast_rays, made.command
