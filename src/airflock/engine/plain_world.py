"""The world of a plain flight: surfaces, edges and rays, and what an agent perceives of them."""

from collections.abc import Iterator
from typing import Any

from airflock.core import random
from airflock.core.agent import State
from airflock.core.vocabulary import Percept
from airflock.engine.plan import EDGES, arena_ray, arena_surfaces
from airflock.engine.tables import faces, polygon_edges
from airflock.scenarios.geometry import half_sizes
from airflock.scenarios.scenario import Scenario
from airflock.world import arena, edges, rays


class Place:
    """The world of a scenario: its surfaces, edges and rays, and how far outside a position is."""

    def __init__(self, scenario: Scenario):
        world = scenario.world
        functions, self.beyond = arena_surfaces(world)
        self.clear, self.edge, self.dims = arena_ray(world), EDGES[world.edges], scenario.dimensions
        rows, counts = faces(scenario)
        families = [function for function, count in zip(functions, counts, strict=False) for _ in range(count)]
        self.walls = list(zip(families, rows, strict=True))
        self.half = half_sizes(scenario.world)
        self.edges, self.corners, self.obstacles = polygon_edges(scenario)

    def surfaces(self, x: float, y: float, z: float) -> Iterator[arena.Surface]:
        """Distance and normal of every wall and every obstacle, as seen from a position."""
        for function, row in self.walls:
            yield function(x, y, z, *row)
        for first, last in self.obstacles:
            yield arena.convex_obstacle(x, y, z, self.edges, first, last)

    def excursion(self, x: float, y: float, z: float) -> float:
        """Distance outside the arena or inside an obstacle, m; negative where flying is allowed."""
        out: float = self.beyond(x, y, z, *self.half, self.edges, self.corners)
        for first, last in self.obstacles:
            out = max(out, -arena.convex_obstacle(x, y, z, self.edges, first, last).distance)
        return out

    def image(self, dx: float, dy: float, dz: float) -> tuple[float, float, float]:
        """Offset to the nearest image in a periodic box; elsewhere the offset itself."""
        if self.edge is not edges.wrap:
            return dx, dy, dz
        x, y, z = (edges.nearest_image(d, half) for d, half in zip((dx, dy, dz), self.half, strict=True))
        return x, y, z

    def beside(self, own: State, other: State) -> State:
        """State of another agent at the image that is nearest to own."""
        dx, dy, dz = self.image(other.x - own.x, other.y - own.y, other.z - own.z)
        return other if self.edge is not edges.wrap else State(own.x + dx, own.y + dy, own.z + dz, *other[3:])

    def settled(self, state: State) -> State:
        """State after the edges of the arena have acted on it."""
        if self.edge is None:
            return state
        edge: Any = self.edge
        moved = [edge(state[c], state[3 + c], self.half[c]) for c in range(self.dims)]
        pad = (0.0,) * (3 - self.dims)
        return State(*(x for x, _ in moved), *pad, *(v for _, v in moved), *pad)

    def ray(self, x: float, y: float, z: float, ux: float, uy: float, uz: float) -> float:
        """Free distance (m) along a unit vector to walls and obstacles."""
        free: float = self.clear(x, y, z, ux, uy, uz, *self.half, self.edges, self.corners)
        nearest: float = min([free, *(rays.to_edges(x, y, ux, uy, self.edges, a, b) for a, b in self.obstacles)])
        return nearest


class Senses(Percept):
    """A Percept whose rays and random numbers are those of a flight."""

    place: Place
    own: State
    asker: tuple[int, int, int]

    @classmethod
    def of(cls, place: Place, own: State, time: float, seed: int, decision: int, agent: int) -> "Senses":
        """What one agent perceives at one decision."""
        found = cls(time, -own.x, -own.y, -own.z)
        found.place, found.own, found.asker = place, own, (seed, decision, agent)
        return found

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance along the unit vector u, at most length, m."""
        return min(length, self.place.ray(*self.own[:3], ux, uy, uz))

    def normal(self, draw: int) -> float:
        """Normal random number of this agent and decision."""
        words = self._words(draw)
        return float(random.normal_pair(words[0], words[1])[0])

    def uniform(self, draw: int) -> float:
        """Uniform random number of this agent and decision."""
        return float(random.uniform(self._words(draw)[0]))

    def _words(self, draw: int) -> Any:
        seed, decision, agent = self.asker
        return random.words(seed, random.MODEL, 0, decision, agent, draw)
