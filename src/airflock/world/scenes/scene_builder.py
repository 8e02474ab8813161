"""The scene of a scenario, and the goals in it: made once, kept as arrays."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.support import SceneError
from airflock.world import bvh, goals, scenery
from airflock.world.casts import ray_to_cylinder, ray_to_segment, ray_to_sphere, ray_to_triangle
from airflock.world.inside import inside
from airflock.world.shapes import (
    APPEARS,
    BOX,
    CLOSED,
    COLUMNS,
    CYLINDER,
    GROUND,
    SEGMENT,
    SPHERE,
    TRIANGLE,
    from_box,
    from_cylinder,
    from_segment,
    from_sphere,
    from_triangle,
)

FAR_AWAY = 1e9  # m; where the bounds of a shape lie that is not there yet
LEAF = 4  # shapes of a leaf
TALL_HEIGHT = 1e6  # m; half height of what has no end in height


@dataclass(frozen=True)
class Scene:
    """Shapes that stand in a world, with the tree over them.

    shapes : (shape, 18) rows as in `world.shapes`, in the order of the tree's leaves
    nodes  : (node, 6) bounds, m; links : (node, 3) skip, first, last as in `world.bvh`
    notes  : what was adjusted while it was made, for a person to read
    """

    shapes: NDArray[np.float64]
    nodes: NDArray[np.float64]
    links: NDArray[np.int64]
    notes: tuple[str, ...] = field(default=())

    @cached_property
    def as_lists(self) -> tuple[list[list[float]], list[list[float]], list[list[int]]]:
        """Shapes, nodes and links as plain lists, for plain Python."""
        return self.shapes.tolist(), self.nodes.tolist(), self.links.tolist()

    @cached_property
    def has_closed_surface(self) -> bool:
        """Return True if any surface can close around a position."""
        return bool((self.shapes[:, CLOSED] > 0.0).any())

    @property
    def later(self) -> NDArray[np.int64]:
        """Numbers of the shapes that appear while flying."""
        return np.flatnonzero(self.shapes[:, APPEARS] > 0.0)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest corner (2, 3), m; zeros if empty."""
        if not len(self.shapes):
            return np.zeros((2, 3))
        return np.array([self.shapes[:, :3].min(axis=0), self.shapes[:, 3:6].max(axis=0)])


def box_rows(corners: Any, kind: float = BOX) -> NDArray[np.float64]:
    """Rows of boxes, or of the ground, from (box, 6) lowest and highest corners, m."""
    given = np.asarray(corners, float).reshape(-1, 6)
    return _rows(kind, given, given[:, :0])


def cylinder_rows(values: Any) -> NDArray[np.float64]:
    """Rows of upright cylinders from (cylinder, 5) x y radius z0 z1, m."""
    x, y, r, low, high = np.asarray(values, float).reshape(-1, 5).T
    bounds = np.stack([x - r, y - r, low, x + r, y + r, high], axis=1)
    return _rows(CYLINDER, bounds, np.stack([x, y, r], axis=1))


def triangle_rows(corners: Any) -> NDArray[np.float64]:
    """Rows of triangles from (triangle, 3, 3) corners, m."""
    given = np.asarray(corners, float).reshape(-1, 3, 3)
    bounds = np.concatenate([given.min(axis=1), given.max(axis=1)], axis=1)
    return _rows(TRIANGLE, bounds, given.reshape(-1, 9))


def segment_rows(ends: Any) -> NDArray[np.float64]:
    """Rows of upright walls without end in height from (segment, 4) ax ay bx by, m."""
    given = np.asarray(ends, float).reshape(-1, 4)
    tall = np.full(len(given), TALL_HEIGHT)
    low = np.minimum(given[:, :2], given[:, 2:])
    high = np.maximum(given[:, :2], given[:, 2:])
    bounds = np.column_stack([low, -tall, high, tall])
    return _rows(SEGMENT, bounds, given)


def sphere_rows(values: Any) -> NDArray[np.float64]:
    """Rows of spheres from (sphere, 4) x y z radius, m."""
    given = np.asarray(values, float).reshape(-1, 4)
    bounds = np.concatenate([given[:, :3] - given[:, 3:], given[:, :3] + given[:, 3:]], axis=1)
    return _rows(SPHERE, bounds, given)


SIDES = 12  # of a drawn circle


class Shape(NamedTuple):
    """A kind of shape: how drivers measure it, and how it is drawn. Rows are those of `world.shapes`.

    rows     : its numbers → rows with their bounds
    distance : scalar rule: position (m) and numbers → distance (m) and the unit vector away
    ray      : scalar rule: position (m), direction and numbers → distance (m); None where the
               bounds say all
    plan     : row → ground plan, a line (point, 2), m
    lines    : row → edges in space, lines (point, 3), m
    mesh     : rows → vertices (vertex, 3), m, and triangles (face, 3) of all of them together
    """

    rows: Callable[[Any], NDArray[np.float64]]
    distance: Callable[..., Any]
    ray: Callable[..., float] | None
    plan: Callable[[NDArray[Any]], NDArray[np.float64]]
    lines: Callable[[NDArray[Any]], list[NDArray[np.float64]]]
    mesh: Callable[[NDArray[Any]], tuple[NDArray[Any], NDArray[Any]]]


def _rectangle(row: NDArray[Any]) -> NDArray[np.float64]:
    x0, y0, _, x1, y1 = row[:5]
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]])


def _circle(x: float, y: float, radius: float) -> NDArray[np.float64]:
    turn = np.linspace(0.0, 2.0 * np.pi, SIDES + 1)
    return np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])


def _upright(plan: NDArray[np.float64], row: NDArray[Any], every: int) -> list[NDArray[np.float64]]:
    """Return both rims of an upright solid over a closed plan, and some uprights between them."""
    rims = [np.column_stack([plan, np.full(len(plan), z)]) for z in (row[2], row[5])]
    return rims + [np.array([[*p, row[2]], [*p, row[5]]]) for p in plan[:-1:every]]


def prism_mesh(corners: NDArray[Any], low: float, high: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return vertices and triangles of the sides and the roof over a simple ground plan (corner, 2), m."""
    n = len(corners)
    vertices = np.array([[x, y, z] for z in (low, high) for x, y in corners], np.float32)
    faces = [t for i in range(n) for t in ((i, (i + 1) % n, n + i), ((i + 1) % n, n + (i + 1) % n, n + i))]
    place = {(float(x), float(y)): n + number for number, (x, y) in enumerate(corners)}
    roof = _triangles(corners) if n > 2 else ()
    faces += [tuple(place[corner] for corner in part) for part in roof]  # type: ignore[misc]
    return vertices, np.array(faces, np.uint32)


def _triangles(corners: Any) -> list[Any]:
    """Return triangles (three corners each) of a simple polygon, m."""
    from shapely import constrained_delaunay_triangles  # here, because most worlds have no polygon to triangulate
    from shapely.geometry import Polygon

    return [part.exterior.coords[:3] for part in constrained_delaunay_triangles(Polygon(corners)).geoms]


def _sphere_lines(row: NDArray[Any]) -> list[NDArray[np.float64]]:
    """Return three great circles."""
    circle, still = _circle(0.0, 0.0, row[10]), np.zeros(SIDES + 1)
    u, v = circle.T
    return [row[7:10] + np.column_stack(axes) for axes in ((u, v, still), (u, still, v), (still, u, v))]


def _sphere_mesh(row: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    rings = np.linspace(-0.5 * np.pi, 0.5 * np.pi, SIDES // 2 + 1)
    ring = _circle(0.0, 0.0, 1.0)[:-1]
    points = [np.column_stack([ring * math.cos(a), np.full(SIDES, math.sin(a))]) for a in rings]
    vertices = (row[7:10] + row[10] * np.concatenate(points)).astype(np.float32)
    first = [(k * SIDES + i, k * SIDES + (i + 1) % SIDES) for k in range(len(rings) - 1) for i in range(SIDES)]
    faces = [face for a, b in first for face in ((a, b, a + SIDES), (b, b + SIDES, a + SIDES))]
    return vertices, np.array(faces, np.uint32)


def _corners(row: NDArray[Any]) -> NDArray[np.float64]:
    return np.asarray(row[7:16].reshape(3, 3))


def _joined(parts: Sequence[tuple[NDArray[Any], NDArray[Any]]]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Join the meshes of many solids to one."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    faces = np.vstack([part[1] + offset for part, offset in zip(parts, offsets, strict=True)])
    return np.vstack([part[0] for part in parts]), faces.astype(np.uint32)


SHAPES: dict[float, Shape] = {
    BOX: Shape(
        box_rows, from_box, None, _rectangle, lambda row: _upright(_rectangle(row), row, 1),
        lambda rows: _joined([prism_mesh(_rectangle(row)[:-1], row[2], row[5]) for row in rows]),
    ),
    CYLINDER: Shape(
        cylinder_rows, from_cylinder, ray_to_cylinder, lambda row: _circle(*row[7:10]),
        lambda row: _upright(_circle(*row[7:10]), row, 3),
        lambda rows: _joined([prism_mesh(_circle(*row[7:10])[:-1], row[2], row[5]) for row in rows]),
    ),
    TRIANGLE: Shape(
        triangle_rows, from_triangle, ray_to_triangle, lambda row: _corners(row)[[0, 1, 2, 0], :2],
        lambda row: [_corners(row)[[0, 1, 2, 0]]],
        lambda rows: (rows[:, 7:16].reshape(-1, 3), np.arange(3 * len(rows)).reshape(-1, 3)),
    ),
    # The plans of the world's own walls, whose heights the arena knows: no lines in space.
    SEGMENT: Shape(
        segment_rows, from_segment, ray_to_segment, lambda row: np.asarray(row[7:11].reshape(2, 2)), lambda row: [],
        lambda rows: _joined([prism_mesh(row[7:11].reshape(2, 2), row[2], row[5]) for row in rows]),
    ),
    SPHERE: Shape(
        sphere_rows, from_sphere, ray_to_sphere, lambda row: _circle(row[7], row[8], row[10]), _sphere_lines,
        lambda rows: _joined([_sphere_mesh(row) for row in rows]),
    ),
}  # fmt: skip


def make_scene(rows: Sequence[NDArray[np.float64]], notes: tuple[str, ...] = ()) -> Scene:
    """Scene of these rows of shapes."""
    shapes = np.concatenate([np.zeros((0, COLUMNS)), *rows])
    order, nodes, links = _tree(shapes)
    return Scene(shapes[order], nodes, links, notes)


def _rows(kind: float, bounds: NDArray[np.float64], numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    rows = np.zeros((len(bounds), COLUMNS))
    rows[:, :6], rows[:, 6], rows[:, 7 : 7 + numbers.shape[1]] = bounds, kind, numbers
    return rows


def _tree(shapes: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Order of the shapes, nodes and links: split at the median of the longest axis until leaves are small."""
    if not len(shapes):
        return np.zeros(0, np.int64), np.zeros((0, 6)), np.zeros((0, 3), np.int64)
    low, high = shapes[:, :3], shapes[:, 3:6]
    middle = np.clip(0.5 * (low + high), -TALL_HEIGHT, TALL_HEIGHT)
    order: list[int] = []
    nodes: list[Any] = []
    links: list[list[int]] = []
    pending = [(np.arange(len(shapes)), -1)]  # members, or the node whose walk ends here
    while pending:
        members, closes = pending.pop()
        if closes >= 0:
            links[closes][0] = len(nodes)
            continue
        number = len(nodes)
        nodes.append(np.concatenate([low[members].min(axis=0), high[members].max(axis=0)]))
        links.append([0, len(order), len(order)])
        # Below both halves on the stack: when its turn comes, the next number is that of the node
        # at which a walk goes on that misses this one.
        pending.append((members[:0], number))
        if len(members) <= LEAF:
            order.extend(members.tolist())
            links[number][2] = len(order)
            continue
        axis = int(np.ptp(middle[members], axis=0).argmax())
        half = len(members) // 2
        # At the median of the members, not of the space: however they lie, the depth is the
        # logarithm of their number.
        sides = np.argpartition(middle[members, axis], half)
        pending.append((members[sides[half:]], -1))
        pending.append((members[sides[:half]], -1))
    return np.array(order), np.array(nodes), np.array(links, np.int64)


def without_appearing(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shapes as they stand at the start, and what appears later: its bounds (m), time (s) and number."""
    if not len(scene.later):
        return scene.shapes, np.zeros((0, 8))
    shapes, k = scene.shapes.copy(), scene.later
    later = np.column_stack([shapes[k, :6], shapes[k, APPEARS], k])
    shapes[k, :6] = FAR_AWAY
    return shapes, later


def buildings(p: scenery.Parameters) -> NDArray[np.float64]:
    """Rows of boxes. Blocks are numbered from the south-west; a lower density leaves some of them empty."""
    rng = np.random.default_rng(int(p.seed))
    n, pitch = int(p.blocks), p.block + p.street
    west = (np.arange(n) - 0.5 * n) * pitch + 0.5 * p.street
    x, y = (axis.ravel() for axis in np.meshgrid(west, west, indexing="ij"))
    height = rng.uniform(min(p.low, p.high), max(p.low, p.high), n * n)
    stands = rng.uniform(0.0, 1.0, n * n) < p.density
    flat = np.zeros(n * n)
    return box_rows(np.stack([x, y, flat, x + p.block, y + p.block, height], axis=1)[stands])


def half_side(p: scenery.Parameters, shapes: Any) -> float:
    """Half side (m) of the square that a scene stands on."""
    if p.kind == "city":  # with the street around it
        return 0.5 * int(p.blocks) * (p.block + p.street)
    if p.kind == "forest":
        return 0.5 * p.side
    return float(np.abs(shapes[:, [0, 1, 3, 4]]).max()) if len(shapes) else 0.0


# Our choice: a stand of grown broad-leaved trees; the thesis's scene is not available
MOST = 200_000  # trees, of two shapes each: their tree of boxes takes some 10 s to build
HEIGHT = (8.0, 20.0)  # m, tree
TRUNK = (0.15, 0.40)  # m, radius
CROWN = (1.0, 2.5)  # m, radius
CLEAR = (0.35, 0.55)  # share of the height below the crown


def trees(p: scenery.Parameters) -> NDArray[np.float64]:
    """Rows of cylinders: trunks, then crowns."""
    rng = np.random.default_rng(int(p.seed))
    n = round(p.trees * p.density)
    if n > MOST:
        raise SceneError(
            f"scene.trees = {p.trees:g} at scene.density = {p.density:g} are {n} trees; at most {MOST} fit, "
            f"for instance scene.trees = {int(MOST / p.density)}"
        )
    x, y = rng.uniform(-0.5 * p.side, 0.5 * p.side, (2, n))
    height, trunk, crown, clear = (rng.uniform(*span, n) for span in (HEIGHT, TRUNK, CROWN, CLEAR))
    ground = np.zeros(n)
    stems = np.stack([x, y, trunk, ground, clear * height], axis=1)
    crowns = np.stack([x, y, crown, clear * height, height], axis=1)
    return cylinder_rows(np.concatenate([stems, crowns]))


Polygons = tuple[tuple[tuple[float, ...], ...], ...]
MARGIN = 100.0  # m; the ground reaches beyond the scene, so that no flock slips under it
DEPTH = 1000.0  # m; thickness of the ground: nothing starts below it
MANY = 50_000  # shapes; of more no lists are made, which would take longer than they save
ATTEMPTS = 100_000  # draws of all free points
IN_VAIN = 10_000  # of them without finding one: hardly any of the scene is free


@lru_cache(maxsize=32)
def scene_of(
    p: scenery.Parameters, dimensions: int, polygons: Polygons = (), heights: tuple[tuple[float, ...], ...] = ()
) -> Scene:
    """Scene as arrays; in a plane every building and tree is its ground plan.

    polygons : walls besides, m; heights: lowest and highest of the last of them, if they have ends
               in height, m
    """
    tall = len(polygons) - len(heights)
    walls = [
        segment_rows([[*a, *b] for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]) for ring in polygons[:tall]
    ]
    walls += [triangle_rows(_faces(ring, *ends)) for ring, ends in zip(polygons[tall:], heights, strict=True)]
    if p.kind == "none":
        return make_scene(walls)
    notes: tuple[str, ...] = ()
    if p.kind == "mesh":
        from airflock.world.scenes.meshes import load_mesh

        rows, notes = load_mesh(p, dimensions)
    elif p.kind == "boxes":
        boxes, balls = np.array(p.boxes, float).reshape(-1, 7), np.array(p.spheres, float).reshape(-1, 5)
        rows = np.concatenate([box_rows(boxes[:, :6]), sphere_rows(balls[:, :4])])
        rows[:, APPEARS] = np.concatenate([boxes[:, 6], balls[:, 4]])
    else:
        rows = buildings(p) if p.kind == "city" else trees(p)
        rows[:, APPEARS] = appearance_times(p, len(rows))
    if dimensions == 2:
        flat = (rows[:, 6] == BOX) | (rows[:, 6] == CYLINDER)
        rows[flat, 2], rows[flat, 5] = -TALL_HEIGHT, TALL_HEIGHT
        return make_scene([rows, *walls], notes)
    half = half_side(p, rows) + MARGIN
    below = [box_rows([-half, -half, -DEPTH, half, half, 0.0], GROUND)] if p.ground == "yes" else []
    return make_scene([*below, rows, *walls], notes)


def _faces(ring: tuple[tuple[float, ...], ...], low: float, high: float) -> list[list[tuple[float, ...]]]:
    """Triangles (3 corners each, m) of an upright prism over a simple polygon."""
    pairs = list(zip(ring, ring[1:] + ring[:1], strict=True))
    found = [[(*a, low), (*b, low), (*b, high)] for a, b in pairs]
    found += [[(*a, low), (*b, high), (*a, high)] for a, b in pairs]
    return found + [[(*corner, z) for corner in part] for part in _triangles(ring) for z in (low, high)]


def appearance_times(p: scenery.Parameters, count: int) -> NDArray[np.float64]:
    """Draw when each shape appears, s; 0 for the start. Trunk and crown of a tree come together."""
    parts = 2 if p.kind == "forest" else 1
    # A stream of its own: shapes that come later stand where they would stand otherwise.
    rng = np.random.default_rng([int(p.seed), 2])
    late, when = rng.uniform(0.0, 1.0, (2, count // parts))
    # A time of 0 means that it stands from the start, so a time that is drawn lies above.
    return np.tile(np.where(late < p.later, np.maximum(when * p.later_until, 1e-6), 0.0), parts)


def clearance(scene: Scene, position: Any, within: float = 1e6) -> float:
    """Distance (m) to what stands in a scene; negative inside a solid, 1e30 if nothing is within (m)."""
    x, y, z = (float(c) for c in position)
    return float(bvh.nearest(x, y, z, within, *_tables(scene)).distance)


def in_mesh(scene: Scene, position: Any) -> bool:
    """Return True if a position lies inside a closed mesh, in a plane inside its cut at height 0."""
    x, y, z = (float(c) for c in position)
    return scene.has_closed_surface and bool(inside(x, y, z, *_tables(scene)) > 0.5)


def _tables(found: Scene) -> Any:
    """Shapes, nodes and links for plain Python: lists, or the arrays where there are too many."""
    return found.as_lists if len(found.shapes) < MANY else (found.shapes, found.nodes, found.links)


@lru_cache(maxsize=32)
def waypoints(g: goals.Parameters, p: scenery.Parameters, dimensions: int) -> NDArray[np.float64]:
    """Goals in their order (goal, 3), m.

    Free points are drawn by the scene's seed: within the scene, between the two heights, clear of
    everything, and at least goals.apart from the one before.
    """
    if g.kind == "none":
        return np.zeros((0, 3))
    if g.kind in ("points", "own"):
        found = np.array(g.points, float).reshape(-1, 3)
        return found * (1.0, 1.0, 0.0) if dimensions == 2 else found
    place = scene_of(p, dimensions)
    half = (
        half_side(p, place.shapes)
        if p.kind in ("city", "forest")
        else 0.5 * float(np.ptp(place.bounds, axis=0)[:2].min())
    )
    rng = np.random.default_rng([int(p.seed), 1])
    chosen: list[NDArray[np.float64]] = []
    last = np.zeros(3)
    vain = drawn = 0
    while vain < IN_VAIN and drawn < ATTEMPTS:
        vain, drawn = vain + 1, drawn + 1
        spot = np.array(
            [*rng.uniform(-half, half, 2), rng.uniform(g.low, max(g.high, g.low)) if dimensions == 3 else 0.0]
        )
        free = np.linalg.norm(spot - last) >= g.apart and clearance(place, spot, g.clearance) >= g.clearance
        if free and not in_mesh(place, spot):
            chosen.append(spot)
            last, vain = spot, 0
            if len(chosen) == int(g.count):
                return np.array(chosen)
    raise SceneError(
        f"goals.kind = 'scene': no free point at {g.clearance:g} m from everything and {g.apart:g} m from the last; "
        "lower goals.clearance, goals.apart or scene.density"
    )
