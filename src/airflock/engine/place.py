"""Place: the world around one agent in plain Python, its surfaces, edges, rays, casts and goals, outside a driver."""

import math
from collections.abc import Iterator
from typing import Any

from airflock.core import random
from airflock.core.agent import State, answer
from airflock.core.maths import FAR
from airflock.core.vocabulary import Percept
from airflock.engine.plan import EDGES, arena_ray, arena_surfaces
from airflock.engine.tables import faces, unbuilt
from airflock.scenarios.scenario import Scenario
from airflock.world import arena, bvh, edges, goals, polygon, rays
from airflock.world.inside import inside
from airflock.world.place import blocked, edge_rows, half_sizes, middle, obstacle_rule, raised


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
        self.edges, self.corners, self.obstacles = edge_rows(world)
        self.obstacle, self.middle = obstacle_rule(world), middle(world) if raised(world) else 0.0
        stands = scenario.stands()
        shapes, later = unbuilt(stands)
        self.scene = shapes.tolist(), stands.nodes.tolist(), stands.links.tolist()
        self.later, self.clearance, self.meshed = (
            later.tolist(),
            scenario.start.clearance,
            scenario.scene.kind == "mesh",
        )
        self.casts = scenario.model.sight is not None  # polygons are part of the scene then
        rule = scenario.model.wall_reach
        self.look = FAR if rule is None else answer(rule, "wall_reach", {"p": scenario.parameters})
        self.flat = world.arena == "polygon" and world.edges != "periodic"

    def surfaces(self, x: float, y: float, z: float) -> Iterator[arena.Surface]:
        """Distance and normal of every wall and every obstacle, as seen from a position."""
        for function, row in self.walls:
            yield function(x, y, z, *row)
        if self.flat:
            yield from self.sides(x, y, z)
        for first, last in self.obstacles if not self.casts else ():
            yield self.obstacle(x, y, z, self.edges, first, last)
        for ground in (0.0, 1.0)[: self.dims - 1]:
            found = bvh.nearest_of(x, y, z, self.look, ground, *self.scene)
            if found.distance < self.look:
                yield found

    def sides(self, x: float, y: float, z: float) -> Iterator[arena.Surface]:
        """Distance and normal of the sides of a polygonal arena that act on a position."""
        for e in range(self.corners):
            found = polygon.wall(x, y, z, self.edges, e, self.corners, self.look)
            if found.distance < self.look:
                yield found
        found = polygon.outside(x, y, z, self.edges, self.corners)
        if found.distance < 0.0:
            yield found

    def excursion(self, x: float, y: float, z: float) -> float:
        """Distance outside the arena or inside an obstacle, m; negative where flying is allowed."""
        out: float = self.beyond(x, y, z - self.middle, *self.half, self.edges, self.corners)
        for first, last in self.obstacles:
            out = max(out, -self.obstacle(x, y, z, self.edges, first, last).distance)
        return float(max(out, -bvh.nearest(x, y, z, 1e8, *self.scene).distance))

    def roomy(self, x: float, y: float, z: float) -> bool:
        """Whether an agent may start here: inside the arena, at start.clearance from what stands in the scene."""
        if self.scene[0] and bvh.nearest(x, y, z, self.clearance, *self.scene).distance < self.clearance:
            return False
        if self.meshed and inside(x, y, z, *self.scene) > 0.5:
            return False
        return self.excursion(x, y, z) <= 0.0

    def touches(self, a: State, b: State, radius: float) -> float:
        """1.0 if a sphere of this radius (m) met the scene on its way from a to b."""
        return float(bvh.touches(*a[:3], *b[:3], radius, *self.scene)) if self.scene[0] else 0.0

    def appear(self, time: float, flock: list[State]) -> None:
        """Let stand what is due, unless an agent is in its place."""
        for row in self.later:
            if 0.0 <= row[6] <= time:
                gaps = [bvh.beside(s.x, s.y, s.z, [row], 0) for s in flock]
                if min(gaps) > self.clearance**2:
                    self.scene[0][int(row[7])][:6] = row[:6]
                    row[6] = -1.0

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
        free: float = self.clear(x, y, z - self.middle, ux, uy, uz, *self.half, self.edges, self.corners)
        if self.obstacle is polygon.prism:
            solid = [polygon.ray_to_prism(x, y, z, ux, uy, uz, self.edges, a, b) for a, b in self.obstacles]
        else:
            solid = [rays.to_edges(x, y, ux, uy, self.edges, a, b) for a, b in self.obstacles]
        nearest: float = min([free, *solid])
        return float(bvh.cast(x, y, z, ux, uy, uz, nearest, 0.0, *self.scene))

    def blocked(self, x: float, y: float, z: float, to_x: float, to_y: float, to_z: float) -> bool:
        """Whether an obstacle or the scene stands between two places, m."""
        return blocked((x, y, z), (to_x, to_y, to_z), self.obstacle, self.obstacles, self.edges, self.scene)

    def cast(self, at: State, u: tuple[float, float, float], length: float, radius: float) -> float:
        """Free distance (m), at most length, of a sphere along a unit vector to walls and the scene."""
        free = length
        if self.clear is not rays.to_nothing:
            sides = (1e8, 1e8) if self.flat else (self.half[0] - radius, self.half[1] - radius)
            up = self.half[2] - radius if self.dims == 3 else 1e8
            rule = rays.to_box if self.flat else self.clear
            free = min(free, rule(*at[:2], at[2] - self.middle, *u, *sides, up, self.edges, 0))
        return float(bvh.cast(*at[:3], *u, free, radius, *self.scene)) if self.casts else free


class Course:
    """Goals: where the goal is, which one it is, and when each was reached (s; nan: never)."""

    def __init__(self, scenario: Scenario):
        self.given, self.points = scenario.goals, [tuple(map(float, p)) for p in scenario.waypoints()]
        self.number, self.times = 0, [float("nan")] * len(self.points)
        self.starts: list[Any] = []
        self.own: list[list[float]] = []
        self.duration = 0.0
        self.at: tuple[float, float, float] = self.points[0] if self.points else (0.0, 0.0, 0.0)  # type: ignore[assignment]

    def advance(self, time: float, elapsed: float, flock: list[State]) -> None:
        """Move the goal on for the flock's centre as it is."""
        if self.given.kind == "own":
            self._glide(time, flock)
            return
        if self.number >= len(self.points):
            return
        g, n = self.given, float(len(flock))
        centre = tuple(sum(s[c] for s in flock) / n for c in range(3))
        travel = g.speed * elapsed if g.speed > 0.0 else FAR
        place: Any = (*self.at, *self.points[self.number], *centre)
        if g.role == "herd":
            far = max(flock, key=lambda s: sum((s[c] - centre[c]) ** 2 for c in range(3)))
            rest: Any = (*far[:3], g.spread, g.behind, g.radius, travel)
            aim = goals.herd(*place, *rest)
        else:
            rest = (g.radius, travel)
            aim = goals.pursue(*place, *rest)
        self.at = aim[:3]
        if aim.reached > 0.5:
            self.times[self.number] = time
            self.number += 1

    def _glide(self, time: float, flock: list[State]) -> None:
        """Each agent's own goal on its way."""
        if time <= 0.0:
            self.starts = [state[:3] for state in flock]
            far = max(math.dist(a, b) for a, b in zip(self.starts, self.points, strict=True))
            self.duration = 1.5 * far / self.given.speed if self.given.speed > 0.0 else 0.0
        pairs = zip(self.starts, self.points, strict=True)
        self.own = [[goals.glide(a, b, time, self.duration) for a, b in zip(*pair, strict=True)] for pair in pairs]  # type: ignore[call-arg]

    def of(self, agent: int) -> Any:
        """Where the goal of an agent is."""
        return self.own[agent] if self.given.kind == "own" else self.at

    def values(self) -> dict[str, Any]:
        """What is reported of it."""
        if not self.points or self.given.kind == "own":
            return {}
        count = float(len(self.points))
        return {"goals_reached": float(self.number), "goals": count, "time_to_goal": self.times}


class Senses(Percept):
    """A Percept whose rays and random numbers are those of a flight."""

    place: Place
    own: State
    asker: tuple[int, int, int]
    rays: int

    @classmethod
    def of(
        cls, place: Place, course: Course, own: State, time: float, seed: int, decision: int, agent: int
    ) -> "Senses":
        """What one agent perceives at one decision."""
        goal = [a - b for a, b in zip(course.of(agent), own, strict=False)] if course.points else [0.0] * 3
        found = cls(time, -own.x, -own.y, -own.z, *goal)
        found.rays = 0
        found.place, found.own, found.asker = place, own, (seed, decision, agent)
        return found

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance along the unit vector u, at most length, m."""
        return min(length, self.place.ray(*self.own[:3], ux, uy, uz))

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance of a sphere of this radius (m) along the unit vector u, at most length, m."""
        self.rays += 1
        return self.place.cast(self.own, (ux, uy, uz), length, radius)

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
