"""Where agents start, and the random numbers that they draw."""

from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

from airflock.core import random
from airflock.core.agent import State
from airflock.scenarios.flight_world import FlightWorld
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.scenario_checks import FORMATIONS
from airflock.world import start as start_rules
from inside import extents

ATTEMPTS = 20_000  # draws of a place for one agent
Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)


def given(start: NDArray[Any], dims: int) -> list[State]:
    """States from positions and velocities (component, agent)."""
    pad = (0.0,) * (3 - dims)
    columns = [tuple(float(c) for c in column) for column in start.T]
    return [State(*c[:dims], *pad, *c[dims:], *pad) for c in columns]


def begin(scenario: Scenario, seed: int, place: FlightWorld) -> list[State]:
    """Agents at random places in the arena, far enough apart; fewer than asked for if one finds no room."""
    flock: list[State] = []
    if scenario.start.kind in FORMATIONS:
        return [in_formation(scenario, seed, i) for i in range(scenario.agents)]
    for i in range(scenario.agents):
        spot = find_room(scenario, seed, place, i, flock)
        if spot is None:
            break
        flock.append(State(*spot, *start_velocity(scenario, seed, i)))
    return flock


def in_formation(scenario: Scenario, seed: int, i: int) -> State:
    """Agent i at its place in the formation, off it by start.jitter."""
    s = scenario.start
    place = FORMATIONS[s.kind](i, s.spacing_x, s.spacing_y, s.spacing_z)
    gx, gy, gz, _ = normals(seed, random.START, 0, i, draw=2)
    z = place[2] + s.jitter * gz if scenario.dimensions == 3 else 0.0
    return State(place[0] + s.jitter * gx, place[1] + s.jitter * gy, z, s.speed, 0.0, 0.0)


def find_room(scenario: Scenario, seed: int, place: FlightWorld, i: int, flock: Sequence[State]) -> Vector | None:
    """Position (m) for agent i inside the arena and away from those already placed; None if there is none."""
    reach, apart = extents(scenario), scenario.separation()
    for attempt in range(ATTEMPTS):
        words = random.random_words(seed, random.START, 0, attempt, i)
        x, y, z = (start_rules.spread(random.uniform(w), -half, half) for w, half in zip(words, reach, strict=False))
        z = z if scenario.dimensions == 3 else 0.0
        if scenario.start.kind == "ball" and not start_rules.in_ball(x, y, z, reach[0]):
            continue
        gaps = ((x - s.x) ** 2 + (y - s.y) ** 2 + (z - s.z) ** 2 for s in flock)
        near = apart > 0.0 and any(gap < apart * apart for gap in gaps)
        if not near and place.is_free(x, y, z):
            return x, y, z
    return None


def start_velocity(scenario: Scenario, seed: int, i: int) -> Vector:
    """Velocity of agent i at the start, m/s: start.speed in a random direction."""
    if scenario.start.speed == 0.0:
        return ZERO
    gx, gy, gz, _ = normals(seed, random.START, 0, i, draw=1)
    gz = gz if scenario.dimensions == 3 else 0.0
    velocity: Vector = start_rules.heading_off(gx, gy, gz, scenario.start.speed)
    return velocity


def normals(seed: int, stream: int, step: int, agent: int, draw: int = 0) -> tuple[float, float, float, float]:
    """Four normal random numbers of one consumer."""
    a, b, c, d = random.random_words(seed, stream, 0, step, agent, draw)
    return *random.normal_pair(a, b), *random.normal_pair(c, d)
