"""Scenes: what one agent of a law meets, at random, and the same turned, shifted, or in other units."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.check.flock import flock_solver
from airflock.check.given import parameters_with_values
from airflock.check.units import UnitScale
from airflock.core import HeardNeighbour, Model, Percept, State, decide
from airflock.scenarios import CallerParts, Scenario, build_scenario

AGENT_COUNT = 4  # in a flight
Rotation = NDArray[np.float64]
MIRROR: Rotation = np.diag([1.0, -1.0, 1.0])


class WallPercept(Percept):
    """A percept that sees flat walls, as (distance, normal x y z)."""

    surfaces: Sequence[tuple[float, float, float, float]] = ()

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance along a unit vector, m."""
        return self.cast(ux, uy, uz, length, 0.0)

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance of a sphere along a unit vector, m."""
        free = length
        for distance, nx, ny, nz in self.surfaces:
            towards = -(ux * nx + uy * ny + uz * nz)
            if towards > 0.0:
                free = min(free, max(distance - radius, 0.0) / towards)
        return free


class Scene(NamedTuple):
    """What one agent meets: positions and velocities (row 0 is its own), walls, its goal and the arena's centre."""

    states: NDArray[np.float64]
    walls: NDArray[np.float64]
    goal: NDArray[np.float64]
    centre: NDArray[np.float64]


@dataclass(frozen=True)
class TestedLaw:
    """A law with what its scenes are made of: lengths (m) and speeds (m/s) at which it does something."""

    model: Model
    scenario: Scenario
    length: float
    speed: float

    @property
    def p(self) -> Any:
        """Parameters."""
        return self.scenario.parameters

    def scene(self, rng: np.random.Generator, neighbours: int = 4) -> Scene:
        """A random scene: neighbours from a hundredth to one and a half of its range, two walls, a goal."""
        dims = self.scenario.dimensions
        away = self.length * rng.uniform(0.01, 1.5, (neighbours, 1)) * random_directions(rng, neighbours, dims)
        speeds = self.speed * rng.uniform(0.2, 1.5, (neighbours + 1, 1)) * random_directions(rng, neighbours + 1, dims)
        own = self.length * rng.normal(0.0, 1.0, 3) * (1.0, 1.0, float(dims == 3))
        states = np.hstack([np.vstack([own, own + away]), speeds])
        walls = np.hstack([self.length * rng.uniform(0.05, 1.0, (2, 1)), random_directions(rng, 2, dims)])
        return Scene(states, walls, self.length * random_directions(rng, 1, dims)[0], np.zeros(3))

    def command(self, scene: Scene, order: Sequence[int] | None = None) -> NDArray[np.float64]:
        """Command of agent 0; order: numbers that the agents go by, and the order in which it meets the others."""
        numbers = list(order) if order is not None else list(range(len(scene.states)))
        own = State(*scene.states[0].tolist())
        heard = [HeardNeighbour(numbers[j], State(*scene.states[j].tolist()), 0.0) for j in range(1, len(scene.states))]
        heard.sort(key=lambda each: each.who)
        walls = [(d, nx, ny, nz) for d, nx, ny, nz in scene.walls.tolist()]
        period = self.scenario.sensors.period
        percept = WallPercept(5.0 * period, *(scene.centre - scene.states[0, :3]).tolist(), *scene.goal.tolist())
        percept.surfaces = walls
        made = decide(
            self.model, self.p, own, heard, walls, time=5.0 * period, period=period, index=numbers[0], percept=percept,
            shared=self.flock_solution(scene), wing=self.scenario.wing, aero=self.scenario.aero,
        )  # fmt: skip
        return np.array(made.command) * (1.0, 1.0, float(self.scenario.dimensions == 3))

    def flock_solution(self, scene: Scene) -> Any:
        """What the rule of the whole flock finds for agent 0."""
        count = replace(self.scenario.flight, agents=float(len(scene.states)))
        solve = flock_solver(replace(self.scenario, flight=count))
        return solve([State(*row) for row in scene.states.tolist()])[0] if solve else None


def tested_law(model: Model, parameters: Mapping[str, Any], dimensions: int) -> TestedLaw:
    """A law in a scene of its own size: a square arena of a few ranges, decisions every fifth step."""
    p = parameters_with_values(model.Parameters, parameters, "model")
    known = model.interaction_range or model.reach
    length = min(float(known(p)), 1e3) if known else 20.0
    keys = {f"model.{name}": value for name, value in parameters.items()}
    keys |= {"agents": AGENT_COUNT, "world.dimensions": str(dimensions), "wing.segments": "5", "start.separation": 0.0}
    keys |= {"world.arena": "none", "start.kind": "ball", "start.radius": length, "radio.range": 10.0 * length}
    scenario = build_scenario({"model": {}}, f"check of {model.name}", keys, caller_parts=CallerParts(law=model))
    speed = model.speed(p)
    speed = speed or min(float(getattr(scenario.body, "speed", getattr(scenario.body, "speed_max", 1.0))), 10.0)
    period = min(0.2, 0.05 * length / speed)
    dt = 0.2 * period
    times = {"dt": dt, "duration": 8.0 * period, "sensors.period": period, "metrics.period": period}
    side = {"world.arena": "square", "world.side": 4.0 * length, "world.height": 4.0 * length}
    keys |= times | side | {"radio.delay": period, "metrics.collision_period": dt}
    return TestedLaw(
        model,
        build_scenario({"model": {}}, f"check of {model.name}", keys, caller_parts=CallerParts(law=model)),
        length,
        speed,
    )


def random_directions(rng: np.random.Generator, count: int, dims: int) -> NDArray[np.float64]:
    """Random unit vectors (vector, axis)."""
    found = rng.normal(size=(count, 3)) * (1.0, 1.0, float(dims == 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def rotation_about_vertical(angle: float) -> Rotation:
    """A turn about the vertical by an angle, rad."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotated(scene: Scene, rotation: Rotation) -> Scene:
    """A scene turned, or seen in a mirror."""
    states = np.hstack([scene.states[:, :3] @ rotation.T, scene.states[:, 3:] @ rotation.T])
    walls = np.hstack([scene.walls[:, :1], scene.walls[:, 1:] @ rotation.T])
    return Scene(states, walls, rotation @ scene.goal, rotation @ scene.centre)


def translated(scene: Scene, length: float) -> Scene:
    """A scene elsewhere, some lengths (m) away."""
    by = length * np.array([3.7, -1.9, 0.8])
    states = scene.states + np.hstack([by, np.zeros(3)])
    return scene._replace(states=states, centre=scene.centre + by)


def in_units(scene: Scene, units: UnitScale) -> Scene:
    """A scene in other units."""
    states = scene.states * np.repeat([units.metre, units.metre / units.second], 3)
    walls = scene.walls * (units.metre, 1.0, 1.0, 1.0)
    return Scene(states, walls, units.metre * scene.goal, units.metre * scene.centre)
