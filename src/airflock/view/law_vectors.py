"""Vectors that a law makes of its neighbours, and the rays that it casts."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.core import BoundPercept, HeardNeighbour, Model, State, decide
from airflock.scenarios import FlightWorld, GoalCourse, Scenario, step_counts


def vector_fields(record: Any) -> dict[str, tuple[str, str]]:
    """Find the vectors among the fields of a NamedTuple: name → fields of its x and y component.

    Sums(x, y, z) is one vector without a name; Sums(away_x, away_y, away_z, n) one called away.
    """
    fields = record._fields
    vectors = {}
    for field in fields:
        stem = field[:-1]
        if field.endswith("x") and f"{stem}y" in fields:
            vectors[stem.strip("_")] = (field, f"{stem}y")
    return vectors


def term_name_and_unit(model: Model, stem: str) -> tuple[str, str]:
    """Return the law's name for a vector among its Sums, and its unit; by default the field's stem."""
    return model.terms.get(stem, (stem or "neighbours", ""))


def vector_values(record: Any) -> dict[str, NDArray[np.float64]]:
    """Return the vectors that a NamedTuple holds, by name: (3,), 0 for a missing z component."""
    return {
        name: np.array([getattr(record, x), getattr(record, y), getattr(record, f"{x[:-1]}z", 0.0)], float)
        for name, (x, y) in vector_fields(type(record)).items()
    }


def arrow_lines(begin: NDArray[Any], end: NDArray[Any]) -> NDArray[np.float64]:
    """Return a shaft and two barbs, (3, 2, 3), in the plane or as seen from above; nothing for a zero arrow."""
    along = np.asarray(end, float) - begin
    length = float(np.linalg.norm(along))
    if length < 1e-9:
        return np.zeros((0, 2, 3))
    side = np.array([-along[1], along[0], 0.0])
    across = side / max(float(np.linalg.norm(side)), 1e-9) * length
    barbs = [end - 0.25 * along + sign * 0.12 * across for sign in (-1.0, 1.0)]
    return np.array([[begin, end], [barbs[0], end], [barbs[1], end]], float)


class CastRay(NamedTuple):
    """A cast: its direction, how far it was free and how far it looked, m."""

    x: float
    y: float
    z: float
    free: float
    length: float


class RecordingPercept(BoundPercept):
    """Percept that keeps every ray that a law casts."""

    cast_rays: list[CastRay]

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Return the free distance along the unit vector u, m, and keep the ray."""
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
    """Return the rays that an agent casts and the command that it decides on, by its law's own rules.

    place, course : the world and its goals as they are at this time, s; own, heard : states of the
                    agent and of others
    """
    senses = RecordingPercept.of(world, own, time, course.of(agent), (0, 0, agent))
    senses.cast_rays = []
    period = step_counts(scenario)["decide_every"] * scenario.flight.dt
    decision = decide(
        scenario.model, scenario.parameters, own, list(heard), (), None,
        time=time, period=period, index=agent, percept=senses,
    )  # fmt: skip
    return senses.cast_rays, decision.command
