"""Place: the world around one agent in plain Python, its edges and what appears in it, and goals, outside a driver."""

import math
from typing import Any

from airflock.core import FAR, Model, State, call_rule
from airflock.scenarios.scenario import Scenario
from airflock.world import EDGE_RULES, Shapes, WorldMap as Map, bvh, goals, inside, without_appearing


class FlightWorld(Map):
    """The world of a flight: the map that a drone carries, with what happens in it: edges act, shapes appear."""

    def __init__(self, scenario: Scenario):
        stands, self.edge, self.dims = scenario.stands(), EDGE_RULES[scenario.world.edges], scenario.dimensions
        shapes, later = without_appearing(stands)
        casts = any(law.model.sight is not None for law in scenario.laws)
        super().__init__(
            scenario.world, Shapes(shapes.tolist(), stands.nodes.tolist(), stands.links.tolist()),
            look=wall_range(scenario.model, scenario.parameters), casts=casts,
        )  # fmt: skip
        self.later, self.clearance = later.tolist(), scenario.start.clearance
        self.wall_clearance = scenario.start.wall_clearance
        self.meshed = scenario.scene.kind == "mesh"

    @property
    def shapes(self) -> Any:
        """Rows of all shapes, as they stand now."""
        return self._scene[0]

    def is_free(self, x: float, y: float, z: float) -> bool:
        """Whether an agent may start here: start.wall_clearance off walls, start.clearance off the scene."""
        if self.shapes and bvh.nearest(x, y, z, self.clearance, *self._scene).distance < self.clearance:
            return False
        if self.meshed and inside(x, y, z, *self._scene) > 0.5:
            return False
        return self.excursion(x, y, z) <= -self.wall_clearance

    def touches(self, a: State, b: State, radius: float) -> float:
        """1.0 if a sphere of this radius (m) met the scene on its way from a to b."""
        return float(bvh.touches(*a[:3], *b[:3], radius, *self._scene)) if self.shapes else 0.0

    def update_appearing(self, time: float, flock: list[State]) -> None:
        """Let stand what is due, unless an agent is in its place."""
        for row in self.later:
            if 0.0 <= row[6] <= time:
                gaps = [bvh.beside(s.x, s.y, s.z, [row], 0) for s in flock]
                if min(gaps) > self.clearance**2:
                    self.shapes[int(row[7])][:6] = row[:6]
                    row[6] = -1.0

    def settled(self, state: State) -> State:
        """State after the edges of the arena have acted on it."""
        if self.edge is None:
            return state
        edge: Any = self.edge
        moved = [edge(state[c], state[3 + c], self._half[c]) for c in range(self.dims)]
        pad = (0.0,) * (3 - self.dims)
        return State(*(x for x, _ in moved), *pad, *(v for _, v in moved), *pad)


def wall_range(model: Model, p: Any) -> float:
    """How far (m) a law with these parameters looks for what stands in the world."""
    return FAR if model.wall_reach is None else float(call_rule(model.wall_reach, "wall_reach", {"p": p}, model.name))


class GoalCourse:
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
        self.own = [[goals.glide(a, b, time, self.duration) for a, b in zip(*pair, strict=True)] for pair in pairs]

    def of(self, agent: int) -> tuple[float, float, float] | None:
        """Where the goal of an agent is, m; None without goals."""
        if not self.points:
            return None
        x, y, z = self.own[agent] if self.given.kind == "own" else self.at
        return x, y, z

    def values(self) -> dict[str, Any]:
        """What is reported of it."""
        if not self.points or self.given.kind == "own":
            return {}
        count = float(len(self.points))
        return {"goals_reached": float(self.number), "goals": count, "time_to_goal": self.times}
