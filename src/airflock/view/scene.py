"""What stands in a world and what an agent looks like: the one description that pictures, pages and replays draw.

Solids are triangles, walls and goals lines, all in m, east, north and up; agents are darts along
their velocity.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.drones import FlightCard, to_tuples
from airflock.scenarios import Scenario, ground_plan
from airflock.world import BOX, CYLINDER, SEGMENT, SHAPES, SPHERE, TRIANGLE, arena, heights_of, prism_mesh

BLOCK_COLOUR = (176, 182, 190)
TREE_COLOUR = (110, 150, 110)
OBSTACLE_COLOUR = (213, 94, 0)
ARENA_COLOUR = (0, 114, 178)
GOAL_COLOUR = (0, 158, 115)
FENCE_COLOUR = (204, 121, 167)
SOLIDS = {  # kind of shape → what a page calls all of it, and their colour; walls are those of the world
    BOX: ("blocks", BLOCK_COLOUR), CYLINDER: ("trees", TREE_COLOUR), SEGMENT: ("walls", OBSTACLE_COLOUR),
    TRIANGLE: ("mesh", BLOCK_COLOUR), SPHERE: ("balls", BLOCK_COLOUR),
}  # fmt: skip
MAX_DRAWN_SIZE = 1e5  # m; what is larger has no drawn end


class SceneSolid(NamedTuple):
    """Triangles of one colour: vertices (vertex, 3) in m, faces (face, 3)."""

    name: str
    vertices: NDArray[Any]
    faces: NDArray[Any]
    colour: tuple[int, int, int]


class SceneLines(NamedTuple):
    """Line segments of one colour: points (segment, 2, 3) in m."""

    name: str
    points: NDArray[Any]
    colour: tuple[int, int, int]


class SceneGeometry(NamedTuple):
    """Solids and lines that stand still.

    span   : half the width of what should be seen, m
    centre : of it (3,), m
    height : lowest and highest place, m
    """

    solids: list[SceneSolid]
    lines: list[SceneLines]
    span: float
    centre: NDArray[Any]
    height: tuple[float, float]


def scenario_geometry(scenario: Scenario, position: NDArray[Any]) -> SceneGeometry:
    """Return the scene of a scenario; position (agent, 3) in m places the view of an open world."""
    world, flat = scenario.world, scenario.dimensions == 2
    plan, shapes = ground_plan(world), shapes_by_kind(scenario.stands().shapes)
    points = [np.array(plan.exterior.coords)] if plan is not None else []
    points += [rows[:, c : c + 2] for rows in shapes.values() for c in (0, 3) if len(rows)]
    points += [np.asarray(position)[:, :2]] if not points or world.arena != "square" else []
    every = np.vstack(points)
    low, high = np.quantile(every, (0.0, 1.0), axis=0)
    span = max(0.55 * float(np.max(high - low)), 1e-3)
    tall = 0.12 * span
    solids, lines = _arena_and_obstacles(world, tall)
    solids += scenery_solids(shapes, tall if flat else None)
    goals = scenario.waypoints()
    if len(goals):
        size = 0.015 * span
        cross = np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 3]]], float) * size
        lines.append(SceneLines("goals", (goals[:, None, None] + cross).reshape(-1, 2, 3), GOAL_COLOUR))
    tops = [0.0, *(float(rows[:, 5].max()) for rows in shapes.values() if len(rows))]
    span_z = heights_of(world) if plan is not None else (min(0.0, float(position[:, 2].min())), max(*tops, 1.0, 1.0))
    middle = np.array([*(0.5 * (low + high)), 0.0 if flat else 0.5 * (span_z[0] + span_z[1])])
    return SceneGeometry(solids, lines, span, middle, (0.0, 0.0) if flat else span_z)


def _arena_and_obstacles(
    world: arena.Parameters, tall: float, lift: float = 0.0
) -> tuple[list[SceneSolid], list[SceneLines]]:
    """Return the obstacles, and the lines of the arena, `lift` m higher; in a plane obstacles stand `tall` m high."""
    flat, lines, solids = world.dimensions == "2", [], []
    whole = (0.0, 0.0) if flat else heights_of(world)
    plan = ground_plan(world)
    if plan is not None:
        corners = np.array(plan.exterior.coords)
        lines.append(SceneLines("arena", prism_edges(corners, lift + whole[0], lift + whole[1]), ARENA_COLOUR))
    for number, outline in enumerate(world.obstacles):
        low, high = world.heights[number] if world.heights else whole
        ends = (0.0, tall) if flat else (lift + low, lift + high)
        solids.append(prism_solid(f"obstacle_{number}", np.array(outline)[:, :2], *ends, OBSTACLE_COLOUR))
    return solids, lines


def shapes_by_kind(rows: NDArray[Any]) -> dict[float, NDArray[Any]]:
    """Return rows of shapes by their kind; without infinite ones."""
    small = np.abs(rows[:, [0, 1, 3, 4]]).max(axis=1, initial=0.0) < MAX_DRAWN_SIZE if len(rows) else np.zeros(0, bool)
    return {kind: rows[small & (rows[:, 6] == kind)] for kind in SHAPES}


def scenery_solids(shapes: dict[float, NDArray[Any]], plane_height: float | None) -> list[SceneSolid]:
    """Return boxes, trees, triangles and walls; in a plane everything is `tall` m high."""
    solids = []
    for kind, (name, colour) in SOLIDS.items():
        rows = shapes[kind]
        if len(rows):
            solids.append(SceneSolid(name, *SHAPES[kind].mesh(_with_heights(kind, rows, plane_height)), colour))
    return solids


def _with_heights(kind: float, rows: NDArray[Any], plane_height: float | None) -> NDArray[Any]:
    """Return rows with the heights that are drawn: in a plane one for all; walls without end are 10 m high."""
    if kind == SEGMENT or (plane_height is not None and kind in (BOX, CYLINDER)):
        rows = np.array(rows)
        rows[:, 2], rows[:, 5] = 0.0, plane_height or 10.0
    return rows


def prism_solid(name: str, corners: NDArray[Any], low: float, high: float, colour: tuple[int, int, int]) -> SceneSolid:
    """Return an upright prism over a ground plan (corner, 2), m."""
    return SceneSolid(name, *prism_mesh(corners, low, high), colour)


def prism_lines(corners: NDArray[Any], low: float, high: float) -> list[NDArray[Any]]:
    """Return the outlines of an upright prism over a closed plan (corner, 2), and its uprights, as lines (point, 3)."""
    lines = [np.column_stack([corners, np.full(len(corners), z)]) for z in sorted({low, high})]
    # Round plans have many corners; eight uprights are enough to see their height.
    step = max(1, (len(corners) - 1) // 8) if len(corners) > 17 else 1
    uprights = corners[:-1:step] if low < high else corners[:0]
    return [*lines, *(np.array([[x, y, low], [x, y, high]]) for x, y in uprights)]


def prism_edges(corners: NDArray[Any], low: float, high: float) -> NDArray[Any]:
    """Return the same as segments (segment, 2, 3)."""
    return np.vstack([np.stack([line[:-1], line[1:]], 1) for line in prism_lines(corners, low, high)])


class WorldOutline(NamedTuple):
    """Corners (corner, axis) in m of a line of the world; `obstacle` is false for the arena."""

    corners: NDArray[Any]
    obstacle: bool


def wall_lines(world: arena.Parameters) -> list[WorldOutline]:
    """Return the lines of arena and obstacles: in the plane their plans; in space floors, ceilings, uprights."""
    plan, whole = ground_plan(world), heights_of(world)
    plans = [] if plan is None else [(np.array(plan.exterior.coords), whole, False)]
    heights = world.heights or [whole] * len(world.obstacles)
    for corners, ends in zip(world.obstacles, heights, strict=True):
        plans.append((np.array([*corners, corners[0]]), (ends[0], ends[1]), True))
    if world.dimensions == "2":
        return [WorldOutline(corners, obstacle) for corners, _, obstacle in plans]
    return [WorldOutline(line, obstacle) for corners, ends, obstacle in plans for line in prism_lines(corners, *ends)]


def dart_mesh(size: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return a dart along +x, `size` m long: nose, ring of the tail, notch."""
    turn = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    ring = np.stack([np.full(8, -0.4), 0.3 * np.cos(turn), 0.18 * np.sin(turn)], 1)
    vertices = np.vstack([[[0.6, 0.0, 0.0]], ring, [[-0.2, 0.0, 0.0]]]) * size
    faces = [(0, 1 + i, 1 + (i + 1) % 8) for i in range(8)] + [(9, 1 + (i + 1) % 8, 1 + i) for i in range(8)]
    return vertices.astype(np.float32), np.array(faces, np.uint32)


def velocity_quaternions(velocity: NDArray[Any]) -> NDArray[Any]:
    """Return quaternions (agent, 4), w first, that turn +x along velocities (agent, 3): yaw, then pitch."""
    yaw = np.arctan2(velocity[:, 1], velocity[:, 0])
    # No roll: darts show where agents fly, the state holds no attitude.
    pitch = -np.arctan2(velocity[:, 2], np.hypot(velocity[:, 0], velocity[:, 1]))
    cy, sy, cp, sp = np.cos(yaw / 2), np.sin(yaw / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    return np.stack([cy * cp, -sy * sp, cy * sp, sy * cp], 1).astype(np.float32)


def card_scene(card: FlightCard) -> SceneGeometry:
    """Return the scene of a flight card, m from its site."""
    world = arena.Parameters(**to_tuples(card.document["world"]))
    rows = np.array(card.document["shapes"].get("shapes", []), float).reshape(-1, 18)
    lift = 0.0 if len(rows) else card.height
    fence = np.array(card.document["fence"]["corners"], float)[:, :2]
    solids, lines = _arena_and_obstacles(world, card.high, lift)
    edges = prism_edges(np.vstack([fence, fence[:1]]), card.low, card.high)
    lines = [SceneLines("fence", edges, FENCE_COLOUR), *lines]
    solids += scenery_solids(shapes_by_kind(rows), None)
    ends = np.array([fence.min(axis=0), fence.max(axis=0)])
    middle = np.array([*ends.mean(axis=0), 0.5 * card.height])
    return SceneGeometry(solids, lines, 0.55 * float(np.ptp(ends, axis=0).max()), middle, (0.0, card.high))
