"""Scene of a world as triangles and lines for any renderer."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from shapely import constrained_delaunay_triangles
from shapely.geometry import Polygon

from airflock.drones import FlightCard, to_tuples
from airflock.scenarios import Scenario, ground_plan
from airflock.world import BOX, CYLINDER, SEGMENT, TRIANGLE, arena, heights_of

# ---- Scene of a scenario

BLOCK_COLOUR = (176, 182, 190)
TREE_COLOUR = (110, 150, 110)
OBSTACLE_COLOUR = (213, 94, 0)
ARENA_COLOUR = (0, 114, 178)
GOAL_COLOUR = (0, 158, 115)
CYLINDER_SIDES = 12  # of a drawn cylinder
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
    bottom, top = heights_of(world)
    solids, lines = [], []
    plan = ground_plan(world)
    if plan is not None:
        corners = np.array(plan.exterior.coords)
        lines.append(
            SceneLines(
                "arena", prism_edges(corners, 0.0, 0.0) if flat else prism_edges(corners, bottom, top), ARENA_COLOUR
            )
        )
    shapes = _drawn_shapes(scenario)
    points = [np.array(plan.exterior.coords)] if plan is not None else []
    points += [rows[:, c : c + 2] for rows in shapes.values() for c in (0, 3) if len(rows)]
    points += [np.asarray(position)[:, :2]] if not points or world.arena != "square" else []
    every = np.vstack(points)
    low, high = np.quantile(every, (0.0, 1.0), axis=0)
    span = max(0.55 * float(np.max(high - low)), 1e-3)
    tall = 0.12 * span
    for number, outline in enumerate(world.obstacles):
        ends = world.heights[number] if world.heights else (bottom, top)
        flatly = (0.0, tall) if flat else (ends[0], ends[1])
        solids.append(prism_solid(f"obstacle_{number}", np.array(outline)[:, :2], *flatly, OBSTACLE_COLOUR))
    solids += scenery_solids(shapes, tall if flat else None)
    goals = scenario.waypoints()
    if len(goals):
        size = 0.015 * span
        cross = np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 3]]], float) * size
        lines.append(SceneLines("goals", (goals[:, None, None] + cross).reshape(-1, 2, 3), GOAL_COLOUR))
    tops = [0.0, *(float(rows[:, 5].max()) for rows in shapes.values() if len(rows))]
    span_z = (bottom, top) if plan is not None else (min(0.0, float(position[:, 2].min())), max(*tops, 1.0, 1.0))
    middle = np.array([*(0.5 * (low + high)), 0.0 if flat else 0.5 * (span_z[0] + span_z[1])])
    return SceneGeometry(solids, lines, span, middle, (0.0, 0.0) if flat else span_z)


def _drawn_shapes(scenario: Scenario) -> dict[float, NDArray[Any]]:
    """Return the rows of the drawn shapes of a scene by their kind."""
    return shapes_by_kind(scenario.stands().shapes)


def shapes_by_kind(rows: NDArray[Any]) -> dict[float, NDArray[Any]]:
    """Return rows of shapes by their kind; without infinite ones."""
    small = np.abs(rows[:, [0, 1, 3, 4]]).max(axis=1, initial=0.0) < MAX_DRAWN_SIZE if len(rows) else np.zeros(0, bool)
    return {kind: rows[small & (rows[:, 6] == kind)] for kind in (BOX, CYLINDER, TRIANGLE, SEGMENT)}


def scenery_solids(shapes: dict[float, NDArray[Any]], plane_height: float | None) -> list[SceneSolid]:
    """Return boxes, trees, triangles and walls; in a plane everything is `tall` m high."""
    solids = []
    boxes = [_box_mesh(*_with_height(row, plane_height)) for row in shapes[BOX]]
    trunks = []
    for row in shapes[CYLINDER]:
        turn = np.linspace(0.0, 2.0 * np.pi, CYLINDER_SIDES, endpoint=False)
        ring = row[7:9] + row[9] * np.stack([np.cos(turn), np.sin(turn)], 1)
        bounds = _with_height(row, plane_height)
        trunks.append(_prism_mesh(ring, bounds[2], bounds[5]))
    walls = []
    for row in shapes[SEGMENT]:
        a, b = row[7:9], row[9:11]
        walls.append(_prism_mesh(np.array([a, b]), 0.0, plane_height or 10.0))
    for name, parts, colour in (
        ("blocks", boxes, BLOCK_COLOUR),
        ("trees", trunks, TREE_COLOUR),
        ("walls", walls, OBSTACLE_COLOUR),
    ):
        if parts:
            solids.append(SceneSolid(name, *_joined_meshes(parts), colour))
    triangles = shapes[TRIANGLE][:, 7:16].reshape(-1, 3)
    if len(triangles):
        solids.append(SceneSolid("mesh", triangles, np.arange(len(triangles)).reshape(-1, 3), BLOCK_COLOUR))
    return solids


def _with_height(row: NDArray[Any], plane_height: float | None) -> NDArray[Any]:
    bounds = np.array(row[:6])
    if plane_height is not None:
        bounds[2], bounds[5] = 0.0, plane_height
    return bounds


def _box_mesh(x0: float, y0: float, z0: float, x1: float, y1: float, z1: float) -> tuple[NDArray[Any], NDArray[Any]]:
    return _prism_mesh(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), z0, z1)


def prism_solid(name: str, corners: NDArray[Any], low: float, high: float, colour: tuple[int, int, int]) -> SceneSolid:
    """Return an upright prism over a ground plan (corner, 2), m."""
    return SceneSolid(name, *_prism_mesh(corners, low, high), colour)


def _prism_mesh(corners: NDArray[Any], low: float, high: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the sides and the roof over a ground plan."""
    n = len(corners)
    vertices = np.array([[x, y, z] for z in (low, high) for x, y in corners], np.float32)
    faces = [t for i in range(n) for t in ((i, (i + 1) % n, n + i), ((i + 1) % n, n + (i + 1) % n, n + i))]
    faces += [(n + a, n + b, n + c) for a, b, c in _roof_triangles(corners)]
    return vertices, np.array(faces, np.uint32)


def _roof_triangles(corners: NDArray[Any]) -> list[tuple[int, int, int]]:
    """Return triangles that fill a simple polygon, by the numbers of its corners."""
    place = {(float(x), float(y)): number for number, (x, y) in enumerate(corners)}
    triangles = constrained_delaunay_triangles(Polygon(corners)).geoms
    return [tuple(place[corner] for corner in triangle.exterior.coords[:3]) for triangle in triangles]  # type: ignore[misc]


def _joined_meshes(parts: list[tuple[NDArray[Any], NDArray[Any]]]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Join many solids to one."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    faces = np.vstack([part[1] + offset for part, offset in zip(parts, offsets, strict=True)])
    return np.vstack([part[0] for part in parts]), faces.astype(np.uint32)


def prism_edges(corners: NDArray[Any], low: float, high: float) -> NDArray[Any]:
    """Return the edges of an upright prism over a closed outline (corner, 2), as segments."""
    edges = []
    for z in {low, high}:
        ring = np.column_stack([corners, np.full(len(corners), z)])
        edges.append(np.stack([ring[:-1], ring[1:]], 1))
    if low < high:
        # Round plans have many corners; eight uprights are enough to see their height.
        some = corners[: -1 : max(1, (len(corners) - 1) // 8) if len(corners) > 17 else 1]
        edges.append(np.array([[[x, y, low], [x, y, high]] for x, y in some]))
    return np.vstack(edges)


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


# ---- Scene of a flight card

FENCE_COLOUR = (204, 121, 167)


def card_scene(card: FlightCard) -> SceneGeometry:
    """Return the scene of a flight card, m from its site."""
    world = arena.Parameters(**to_tuples(card.document["world"]))
    rows = np.array(card.document["shapes"].get("shapes", []), float).reshape(-1, 18)
    lift = 0.0 if len(rows) else card.height
    bottom, top = (0.0, 0.0) if card.flat else arena.heights_of(world)
    fence = np.array(card.document["fence"]["corners"], float)[:, :2]
    lines = [SceneLines("fence", prism_edges(np.vstack([fence, fence[:1]]), card.low, card.high), FENCE_COLOUR)]
    plan = ground_plan(world)
    if plan is not None:
        lines.append(
            SceneLines("arena", prism_edges(np.array(plan.exterior.coords), lift + bottom, lift + top), ARENA_COLOUR)
        )
    solids = []
    for number, outline in enumerate(world.obstacles):
        low, high = world.heights[number] if world.heights else (bottom, top)
        foot, roof = (0.0, card.high) if card.flat else (lift + low, lift + high)
        solids.append(prism_solid(f"obstacle_{number}", np.array(outline)[:, :2], foot, roof, OBSTACLE_COLOUR))
    solids += scenery_solids(shapes_by_kind(rows), None)
    ends = np.array([fence.min(axis=0), fence.max(axis=0)])
    middle = np.array([*ends.mean(axis=0), 0.5 * card.height])
    return SceneGeometry(solids, lines, 0.55 * float(np.ptp(ends, axis=0).max()), middle, (0.0, card.high))
