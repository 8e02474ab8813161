"""The world of a flight outside a driver: valid places, edges, appearing shapes, goals.

The first half checks starts and goals against the scene; `FlightWorld` and `GoalCourse` serve
interpreted flights.
"""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Point

from airflock.core import FAR, Model, State, call_rule
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.scenario_checks import ground_plan
from airflock.support import SceneError
from airflock.world import (
    EDGE_RULES,
    GROUND,
    Scene,
    Shapes,
    WorldMap as Map,
    arena,
    bvh,
    clearance,
    goals,
    half_sizes,
    heights_of,
    in_mesh,
    inside,
    scene_of,
    scenery,
    start,
    without_appearing,
    wrap,
)

CROWDED = 0.9  # share of a start region inside obstacles that is worth a word; less is redrawn in silence
FIRST_DRAWS = 64  # positions at which a start region is looked at
MOST_DRAWS = 2000  # the same where none is free


def scene_errors(scenario: Scenario, started: bool = False) -> list[str]:
    """Return the errors of a scene, of goals and, unless the flight has started, of the start region; one line each."""
    given = scenario.goals
    if given.kind == "own" and len(given.points) != scenario.agents:
        return [
            f"goals.kind = 'own': {len(given.points)} goals.points are not one for each of {scenario.agents} agents"
        ]
    if given.kind == "points" and not given.points:
        return ["goals.kind = 'points' needs goals.points, [[east, north, up], ...] in m"]
    if scenario.scene.draw == "flight" and scenario.scene.kind not in ("city", "forest"):
        return [f"scene.draw = 'flight' with scene.kind = {scenario.scene.kind!r}: only a city or a forest is drawn"]
    if scenario.scene.kind == "mesh" and not scenario.scene.file:
        return ["scene.kind = 'mesh' needs scene.file, a glTF, OBJ or STL file"]
    turned = [k for k, row in enumerate(scenario.scene.boxes) if any(row[c] >= row[c + 3] for c in range(3))]
    if turned:
        return [f"scene.boxes[{k}]: its first corner does not lie below its second in x, y and z" for k in turned]
    if scenario.scene.spheres and (scenario.scene.kind != "boxes" or scenario.dimensions == 2):
        return ["scene.spheres: balls stand beside boxes in space; set scene.kind = 'boxes', world.dimensions = '3'"]
    flat = [k for k, row in enumerate(scenario.scene.spheres) if row[3] <= 0.0]
    if flat:
        return [
            f"scene.spheres[{k}]: its radius is {scenario.scene.spheres[k][3]:g} m; give more than 0 m" for k in flat
        ]
    try:
        place = scenario.stands()
        points = scenario.waypoints()
    except SceneError as error:
        return str(error).splitlines()
    errors, doubts = [], _mesh_doubts(scenario)
    for number, point in enumerate(points):
        depth = _depth(place, point)
        if depth > 0.0:
            where = ", ".join(f"{c:g}" for c in point[: scenario.dimensions])
            errors.append(
                f"goals.points[{number}] = [{where}] m lies {depth:.3g} m inside what stands in the scene; move it out"
            )
    # The region is sampled, so only a share of exactly 1 counts as shut.
    if not started and _blocked(scenario) == 1.0:
        errors.append(
            "start: the whole region in which agents start lies inside what stands in the scene, or nearer to it than "
            f"start.clearance = {scenario.start.clearance:g} m; enlarge the region or lower scene.density"
        )
    return errors + doubts if errors else []


def scene_notes(scenario: Scenario) -> list[str]:
    """Return notes on the scene and on starts in it."""
    notes = [*scenario.stands().notes, *_mesh_doubts(scenario)]
    share = _blocked(scenario)
    if share > CROWDED:
        notes.append(
            f"start: {share:.0%} of the region lies inside the scene or nearer to it than start.clearance = "
            f"{scenario.start.clearance:g} m; agents start only in the rest"
        )
    if scenario.goals.role == "herd" and not getattr(scenario.parameters, "s_goal", -1.0) < 0.0:
        notes.append("goals.role = 'herd': a flock with model.s_goal >= 0 follows the shepherd instead of fleeing it")
    return notes


WIDE = 25.0  # times as wide as the arena, from which on a mesh may be in inches, centimetres or millimetres
WIDEST = 2e4  # m; the same without an arena
SMALLEST = 0.01  # times as wide as the arena, from which on a mesh is looked for in a smaller unit
BELOW, UPRIGHT = 0.25, 0.2  # share of a mesh below the ground; of the same mesh stood upright


def _mesh_doubts(scenario: Scenario) -> list[str]:
    """Return notes where a mesh hardly fits the arena: its size, its place, its axis that points up."""
    scene, world, begin = scenario.scene, scenario.world, scenario.start
    if scene.kind != "mesh":
        return []
    rows = scene_of(scene, scenario.dimensions).shapes
    rows, where = rows[rows[:, 6] != GROUND], f"scene.file = {scene.file}"
    low, high = rows[:, :3].min(axis=0), rows[:, 3:6].max(axis=0)
    width, size = float((high - low)[:2].max()), high - low
    plan = ground_plan(world)
    half = begin.radius if begin.kind == "ball" else 0.5 * begin.side
    west, south, east, north = plan.bounds if plan is not None else (-half, -half, half, half)
    across, notes = max(east - west, north - south), []
    if width > (WIDE * across if plan is not None else WIDEST):
        arena = f", {width / across:.4g} times as wide as the arena, {across:,.0f} m" if plan is not None else ""
        unit = min((1e-3, 0.01, 0.0254), key=lambda u: abs(math.log(u * width / scene.unit / max(across, 100.0))))
        notes.append(
            f"{where}: the mesh is {width:,.0f} m wide{arena}: is scene.unit = {scene.unit:g} m the unit of the file? "
            f"with scene.unit = {unit:g} it is {width * unit / scene.unit:,.3g} m"
        )
    floor, top = heights_of(world) if plan is not None and scenario.dimensions == 3 else (-math.inf, math.inf)
    beside = [max(low[a] - end, start - high[a], 0.0) for a, (start, end) in enumerate(((west, east), (south, north)))]
    if any(beside) or low[2] > top or high[2] < floor:
        middle = ", ".join(f"{c:.4g}" for c in 0.5 * (low + high)[: scenario.dimensions])
        # In a smaller unit the mesh may stand in the arena, at a size that a building or a tree has.
        fit = [
            unit for unit in (0.0254, 0.01, 1e-3)
            if (share := unit / scene.unit) < 1.0 and share * width > SMALLEST * across and all(
                share * low[a] < end and share * high[a] > start
                for a, (start, end) in enumerate(((west, east), (south, north), (floor, top)))
            )
        ]  # fmt: skip
        small = f"is scene.unit = {scene.unit:g} m the unit of the file? with {fit[0]:g} it does; or " if fit else ""
        notes.append(
            f"{where}: the mesh does not reach {'the arena' if plan is not None else 'where agents start'}: its middle "
            f"is at [{middle}] m; {small}are these map coordinates (UTM) or heights above sea level? "
            "move its origin"
        )
    # Of a mesh that lies on its side half is below the ground, and the axis that is up in truth begins near 0.
    turned = scene.up == "y" or scene.file.lower().endswith((".glb", ".gltf")) and scene.up == "standard"
    other = (-high[1], size[1]) if turned else (low[1], size[1])
    lying = scenario.dimensions == 3 and scene.ground == "yes" and -low[2] > BELOW * size[2] and low[2] > -WIDEST
    if lying and -UPRIGHT * other[1] <= other[0] <= UPRIGHT * other[1]:
        notes.append(
            f"{where}: {min(-low[2] / size[2], 1.0):.0%} of its height lies below the ground, down to {low[2]:.4g} m: "
            f"does {'z' if turned else 'y'} point up in the file? then write scene.up = '{'z' if turned else 'y'}'"
        )
    return notes


def wrap_start(scenario: Scenario, start: NDArray[Any]) -> NDArray[Any]:
    """Move the places (m) of a start (component, agent) back into a periodic box."""
    if scenario.world.edges != "periodic":
        return start
    put = start.copy()
    for axis, half in enumerate(half_sizes(scenario.world)[: scenario.dimensions]):
        for agent in np.flatnonzero(np.abs(start[axis]) > half):
            put[axis, agent], _ = wrap(float(start[axis, agent]), 0.0, half)
    return put


def start_error(scenario: Scenario, start: NDArray[Any]) -> str:
    """Return why a start (component, agent) cannot be flown, as a sentence; empty if it can."""
    error = position_error(scenario, start, range(np.shape(start)[1]))
    return f"start: {error}" if error else ""


def position_error(scenario: Scenario, positions: NDArray[Any], agents: Sequence[int]) -> str:
    """Return why agents cannot be at these places (component, agent), m; empty if they can."""
    dims = scenario.dimensions
    if scenario.world.edges == "bounce":  # which would move an agent beyond a face onto it, farther than it flies
        beyond = np.abs(np.asarray(positions, float)[:dims]) - np.array(half_sizes(scenario.world)[:dims])[:, None]
        if beyond.max() > 0.0:
            agent = agents[int(beyond.max(axis=0).argmax())]
            return (
                f"agent {agent} lies {beyond.max():.3g} m outside the arena, from whose faces agents bounce; "
                "move it in or enlarge world.side"
            )
    # The scene is checked, walls are not: outside an open arena the law brings an agent back.
    place = scenario.stands()
    columns = np.asarray(positions, float)[:dims].T if len(place.shapes) else ()
    for agent, column in zip(agents, columns, strict=False):
        depth = _depth(place, np.append(column, [0.0] * (3 - dims)))
        if depth > 0.0:
            return f"agent {agent} lies {depth:.3g} m inside what stands in the scene"
    return ""


def _depth(place: Scene, point: NDArray[np.float64]) -> float:
    """Return how deep a position lies inside a solid or a closed mesh, m; 0 outside."""
    if not len(place.shapes):
        return 0.0
    gap = clearance(place, point)
    if gap <= 0.0:
        # At least a nanometre, so that a point on a face counts as inside.
        return max(-gap, 1e-9)
    return gap if in_mesh(place, point) else 0.0


def _blocked(scenario: Scenario) -> float:
    """Return the share of the start region in which no agent can start."""
    if scenario.scene.kind == "none" or (scenario.start.kind == "arena" and scenario.world.arena == "none"):
        return 0.0
    return _blocked_share(scenario.scene, scenario.start, scenario.world)


def _start_region(begin: start.Parameters, world: arena.Parameters) -> Iterator[NDArray[np.float64]]:
    """Yield random places (m) of the region in which agents start."""
    reach, rng = begin.radius if begin.kind == "ball" else 0.5 * begin.side, np.random.default_rng(0)
    space = world.dimensions == "3"
    plan, (low, high) = ground_plan(world), heights_of(world) if space else (0.0, 0.0)
    while True:
        spot = rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, float(space))
        if begin.kind == "ball":
            spot *= min(1.0, 1.0 / max(float(np.linalg.norm(spot)), 1e-9))
        spot *= reach
        if begin.kind == "arena":
            west, south, east, north = plan.bounds
            spot = rng.uniform((west, south, low), (east, north, high))
            if not plan.contains(Point(spot[:2])):
                continue
        yield spot


@lru_cache(maxsize=64)
def _blocked_share(scene: scenery.Parameters, begin: start.Parameters, world: arena.Parameters) -> float:
    dims = int(world.dimensions)
    place = scene_of(scene, dims)
    if not len(place.shapes):
        return 0.0
    spots, shut = _start_region(begin, world), 0
    for number in range(1, MOST_DRAWS + 1):
        spot = next(spots)
        shut += clearance(place, spot, begin.clearance) < begin.clearance or in_mesh(place, spot)
        if number >= FIRST_DRAWS and shut < number:  # only a region that looks shut is looked at for longer
            break
    return shut / number


class FlightWorld(Map):
    """The world of a flight: the map of a drone, with edges that act and shapes that appear."""

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
        """Rows of all shapes as they are now."""
        return self._scene[0]

    def is_free(self, x: float, y: float, z: float) -> bool:
        """Return True if an agent may start here: start.wall_clearance off walls, start.clearance off the scene."""
        if self.shapes and bvh.nearest(x, y, z, self.clearance, *self._scene).distance < self.clearance:
            return False
        # Distances to a mesh are to its faces: deep inside of one they are large again.
        if self.meshed and inside(x, y, z, *self._scene) > 0.5:
            return False
        return self.excursion(x, y, z) <= -self.wall_clearance

    def touches(self, a: State, b: State, radius: float) -> float:
        """Return 1.0 if a sphere of this radius (m) met the scene on its way from a to b."""
        return float(bvh.touches(*a[:3], *b[:3], radius, *self._scene)) if self.shapes else 0.0

    def update_appearing(self, time: float, flock: list[State]) -> None:
        """Make due shapes appear, unless an agent is in their place."""
        for row in self.later:
            if 0.0 <= row[6] <= time:
                gaps = [bvh.beside(s.x, s.y, s.z, [row], 0) for s in flock]
                # A shape waits until its place is free: an agent inside of it could never leave.
                if min(gaps) > self.clearance**2:
                    self.shapes[int(row[7])][:6] = row[:6]
                    row[6] = -1.0

    def settled(self, state: State) -> State:
        """Return a state after the edges of the arena have acted on it."""
        if self.edge is None:
            return state
        edge: Any = self.edge
        moved = [edge(state[c], state[3 + c], self._half[c]) for c in range(self.dims)]
        pad = (0.0,) * (3 - self.dims)
        return State(*(x for x, _ in moved), *pad, *(v for _, v in moved), *pad)


def wall_range(model: Model, p: Any) -> float:
    """Return how far (m) a law with these parameters looks for walls and shapes."""
    return FAR if model.wall_reach is None else float(call_rule(model.wall_reach, "wall_reach", {"p": p}, model.name))


class GoalCourse:
    """Goals of a flight: the current one, and when each was reached (s; nan: never)."""

    def __init__(self, scenario: Scenario):
        self.given, self.points = scenario.goals, [tuple(map(float, p)) for p in scenario.waypoints()]
        self.number, self.times = 0, [float("nan")] * len(self.points)
        self.starts: list[Any] = []
        self.own: list[list[float]] = []
        self.duration = 0.0
        self.at: tuple[float, float, float] = self.points[0] if self.points else (0.0, 0.0, 0.0)  # type: ignore[assignment]

    def advance(self, time: float, elapsed: float, flock: list[State]) -> None:
        """Move the goal on for the current centre of the flock."""
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
        """Move each agent's own goal on its way."""
        if time <= 0.0:
            self.starts = [state[:3] for state in flock]
            far = max(math.dist(a, b) for a, b in zip(self.starts, self.points, strict=True))
            # The path is a cubic from rest to rest, whose largest speed is 1.5 times its mean.
            self.duration = 1.5 * far / self.given.speed if self.given.speed > 0.0 else 0.0
        pairs = zip(self.starts, self.points, strict=True)
        self.own = [[goals.glide(a, b, time, self.duration) for a, b in zip(*pair, strict=True)] for pair in pairs]

    def of(self, agent: int) -> tuple[float, float, float] | None:
        """Return the place of an agent's goal, m; None without goals."""
        if not self.points:
            return None
        x, y, z = self.own[agent] if self.given.kind == "own" else self.at
        return x, y, z

    def values(self) -> dict[str, Any]:
        """Return the goals' part of a flight's results."""
        if not self.points or self.given.kind == "own":
            return {}
        count = float(len(self.points))
        return {"goals_reached": float(self.number), "goals": count, "time_to_goal": self.times}
