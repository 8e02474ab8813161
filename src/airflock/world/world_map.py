"""The map of a world: its outlines, walls, obstacles and shapes, queried at one position.

Plain Python, as a drone carries it. A map is made from the record of an arena and, where a scene
stands in it, from rows of shapes behind their tree.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, Self

from airflock.core import FAR, State, norm
from airflock.world import arena, bvh, edges, excursion, polygon, rays
from airflock.world.arena import Surface

Corners = Sequence[Sequence[float]]
STRAIGHT = 1e-9  # rad; by how much an outline at least turns at a corner


def signed_area(corners: Corners) -> float:
    """Signed area of a polygon, m²: positive if its corners run counter-clockwise."""
    pairs = zip(corners, [*corners[1:], corners[0]], strict=True)
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)


def counter_clockwise(corners: Corners) -> list[Sequence[float]]:
    """The corners in counter-clockwise order."""
    return list(corners) if signed_area(corners) > 0.0 else list(corners)[::-1]


def polygon_error(corners: Corners) -> str:
    """Return the reason why a list of corners is no simple polygon; empty if it is one."""
    if len(corners) < 3:
        return f"has {len(corners)} corners; a polygon needs at least 3"
    n = len(corners)
    # All pairs of edges: outlines have tens of corners, and a sweep line would need its own tests.
    for k in range(n):
        if tuple(corners[k][:2]) == tuple(corners[(k + 1) % n][:2]):
            return f"gives corner [{corners[k][0]:g}, {corners[k][1]:g}] twice in succession"
    edges = [(corners[k], corners[(k + 1) % n]) for k in range(n)]
    for k in range(n):
        if _folds(*edges[k], edges[(k + 1) % n][1]):
            return f"turns back on itself at [{edges[k][1][0]:g}, {edges[k][1][1]:g}]"
        for m in range(k + 2, n if k else n - 1):  # neighbours share a corner
            if _meet(*edges[k], *edges[m]):
                return f"crosses or touches itself near [{edges[m][0][0]:g}, {edges[m][0][1]:g}]"
    return "" if signed_area(corners) != 0.0 else "has no area"


def is_convex(corners: Corners) -> bool:
    """Return True if a simple polygon turns one way only."""
    ring = counter_clockwise(corners)
    n = len(ring)
    return all(_turn(ring[k], ring[(k + 1) % n], ring[(k + 2) % n]) >= -1e-9 * abs(signed_area(ring)) for k in range(n))


def _turn(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    """Twice the signed area of a triangle, m²: positive for a turn to the left at b."""
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def without_straight_corners(corners: Corners) -> list[Sequence[float]]:
    """Corners of a simple polygon at which it turns, in order: a straight side is one side, however it is divided."""
    n = len(corners)
    return [b for k, b in enumerate(corners) if _turns(corners[k - 1], b, corners[(k + 1) % n])]


def _turns(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> bool:
    """Return True if the path a b c turns at b."""
    across = abs(_turn(a, b, c))
    along = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1])
    return along <= 0.0 or across > STRAIGHT * along


def _folds(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> bool:
    """Return True if the path a b c goes back over itself."""
    return _turn(a, b, c) == 0.0 and (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0.0


def _meet(a: Sequence[float], b: Sequence[float], c: Sequence[float], d: Sequence[float]) -> bool:
    """Return True if the segments a b and c d have a point in common."""
    for k in (0, 1):
        if max(a[k], b[k]) < min(c[k], d[k]) or max(c[k], d[k]) < min(a[k], b[k]):
            return False
    return _turn(a, b, c) * _turn(a, b, d) <= 0.0 and _turn(c, d, a) * _turn(c, d, b) <= 0.0


FAR_HEIGHT = 1e9  # m; half height of an arena that is flown in a plane
AWAY = 1e8  # m; nothing is looked for beyond


def half_sizes(world: arena.Parameters) -> tuple[float, float, float]:
    """Half sizes of an arena, m: of a box, or radius and half height; a plane is taken as very high."""
    z = FAR_HEIGHT
    if world.dimensions == "3":
        low, high = arena.heights_of(world)
        z = 0.5 * (high - low)
    if world.arena == "circle":
        return world.radius, world.radius, z
    return 0.5 * world.side, 0.5 * world.side, z


def is_off_centre(world: arena.Parameters) -> bool:
    """Return True if the middle of an arena between floor and ceiling is not at height 0."""
    return world.dimensions == "3" and world.arena != "none" and middle_height(world) != 0.0


def middle_height(world: arena.Parameters) -> float:
    """Height of the middle of an arena, m."""
    low, high = arena.heights_of(world)
    return 0.5 * (low + high) if world.dimensions == "3" else 0.0


def obstacle_rule(world: arena.Parameters) -> Callable[..., Any]:
    """Surface function of the obstacles: convex ones, any polygons, or prisms with ends in height."""
    if world.heights:
        return polygon.prism
    return arena.convex_obstacle if all(map(is_convex, world.obstacles)) else polygon.obstacle


def edge_rows(world: arena.Parameters) -> tuple[list[list[float]], int, list[list[int]]]:
    """Edges of all polygons (rows ax ay bx by), how many are the arena's, and first and last row of each obstacle.

    A side of the arena that goes straight on over corners is one edge, with one shill agent. Behind
    the edges of the arena stands the height of its middle where it is `is_off_centre`, behind those
    of each obstacle its two heights where obstacles have any.
    """
    rows: list[list[float]] = []
    spans = []

    def add(corners: Corners) -> None:
        # Counter-clockwise rings have their inner side on the left, which the sign of every surface
        # function relies on.
        ring = counter_clockwise(corners)
        rows.extend([*a[:2], *b[:2]] for a, b in zip(ring, [*ring[1:], ring[0]], strict=True))

    if world.arena == "polygon":
        add(without_straight_corners(world.corners))
    own = len(rows)
    if is_off_centre(world):
        rows.append([middle_height(world), 0.0, 0.0, 0.0])
    for number, corners in enumerate(world.obstacles):
        first = len(rows)
        add(corners)
        spans.append([first, len(rows)])
        if world.heights:
            rows.append([*world.heights[number][:2], 0.0, 0.0])
    return rows, own, spans


def wall_functions(world: arena.Parameters) -> Sequence[tuple[Callable[..., Any], tuple[float, ...]]]:
    """Surface function of each wall with its four numbers, in the order in which a driver asks them.

    The edges of a polygon are no such walls: `Place.surfaces` asks `polygon.wall`.
    """
    h, z = 0.5 * world.side, 0.5 * world.height
    three = world.dimensions == "3"
    low, high = arena.heights_of(world)
    caps = [(arena.plane, (0.0, 0.0, 1.0, -low)), (arena.plane, (0.0, 0.0, -1.0, high))] if three else []
    if world.arena == "none" or world.edges == "periodic":
        return []
    if world.arena == "circle":
        return [(arena.cylinder, (0.0, 0.0, 0.0, world.radius)), *caps]
    if world.arena == "square" and world.walls == "nearest_per_axis":
        axes = [(1.0, 0.0, 0.0, h), (0.0, 1.0, 0.0, h)] + ([(0.0, 0.0, 1.0, z)] if three else [])
        return [(arena.slab, axis) for axis in axes]
    if world.arena == "polygon":
        return caps
    corners = ((-h, -h), (h, -h), (h, h), (-h, h))
    return [(arena.plane, inward_plane(a, b)) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)] + caps


def inward_plane(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float, float]:
    """Normal and distance of the wall from a to b of a counter-clockwise ring, as `arena.plane` takes them."""
    tx, ty = b[0] - a[0], b[1] - a[1]
    length = (tx * tx + ty * ty) ** 0.5
    nx, ny = -ty / length, tx / length
    return nx, ny, 0.0, -(nx * a[0] + ny * a[1])


BEYOND = {
    "square": excursion.beyond_box,
    "circle": excursion.beyond_cylinder,
    "polygon": excursion.beyond_polygon,
    "none": excursion.beyond_nothing,
}
CLEAR = {"square": rays.to_box, "circle": rays.to_cylinder, "polygon": rays.to_polygon, "none": rays.to_nothing}


def _walled(world: arena.Parameters) -> str:
    """Return the shape of the walls of a world: none of a periodic one."""
    return "none" if world.edges == "periodic" else world.arena


@dataclass(frozen=True)
class Shapes:
    """Shapes of a world: rows of `world.shapes` and the tree over them, as `world.bvh` reads it."""

    shapes: Any = ()
    nodes: Any = ()
    links: Any = ()


class WorldMap:
    """The world as one agent asks it.

    world  : record of the arena
    shapes : what stands in it
    look   : distance (m) beyond which shapes say nothing; a model's wall_reach
    casts  : whether the law casts at the scene: then polygons are shapes of it and no surfaces
    """

    def __init__(
        self, world: arena.Parameters, shapes: Shapes | None = None, *, look: float = FAR, casts: bool = False
    ):
        found = shapes or Shapes()
        self._dims, self._look, self._casts = int(world.dimensions), look, casts
        self._walls, self._half, self._periodic = wall_functions(world), half_sizes(world), world.edges == "periodic"
        self._scene = found.shapes, found.nodes, found.links
        self._beyond, self._clear, self._flat = BEYOND[_walled(world)], arena_ray(world), world.arena == "polygon"
        self._edges, self._corners, self._obstacles = edge_rows(world)
        self._obstacle, self._middle = obstacle_rule(world), middle_height(world) if is_off_centre(world) else 0.0

    def seen(self, look: float) -> Self:
        """Return a copy of this map, with its shapes that appear, for an agent that feels shapes up to `look`, m."""
        found = copy(self)
        found._look = look
        return found

    def image_offset(self, dx: float, dy: float, dz: float) -> tuple[float, float, float]:
        """Offset (m) to the nearest image in a periodic box; elsewhere the offset itself."""
        if not self._periodic:
            return dx, dy, dz
        x, y, z = (edges.nearest_image(d, half) for d, half in zip((dx, dy, dz), self._half, strict=True))
        return x, y, z

    def beside(self, own: State, other: State) -> State:
        """State of another agent at the image that is nearest to own."""
        if not self._periodic:
            return other
        dx, dy, dz = self.image_offset(other.x - own.x, other.y - own.y, other.z - own.z)
        return other._replace(x=own.x + dx, y=own.y + dy, z=own.z + dz)

    def surfaces(self, x: float, y: float, z: float) -> Iterator[Surface]:
        """Distance (m) and unit normal of every wall, every obstacle, and the nearest of the ground and the scene."""
        for function, row in self._walls:
            yield function(x, y, z, *row)
        yield from self.sides(x, y, z, self._look)
        if not self._casts:
            yield from self.obstacles(x, y, z)
        for ground in (0.0, 1.0)[: self._dims - 1]:
            found = bvh.nearest_of(x, y, z, self._look, ground, *self._scene)
            if found.distance < self._look:
                yield found

    def sides(self, x: float, y: float, z: float, look: float) -> Iterator[Surface]:
        """Distance (m) and unit normal of every side of a polygonal arena that acts on a position."""
        for e in range(self._corners if self._clear is rays.to_polygon else 0):
            found = polygon.wall(x, y, z, self._edges, e, self._corners, look)
            if found.distance < look:
                yield found
        if self._clear is rays.to_polygon:
            found = polygon.outside(x, y, z, self._edges, self._corners)
            if found.distance < 0.0:
                yield found

    def obstacles(self, x: float, y: float, z: float) -> Iterator[Surface]:
        """Distance (m) and unit normal of every obstacle."""
        for first, last in self._obstacles:
            yield self._obstacle(x, y, z, self._edges, first, last)

    def solid_surfaces(self, x: float, y: float, z: float) -> Iterator[Surface]:
        """Distance (m) and unit normal of every obstacle and of the nearest of what stands in the scene."""
        yield from self.obstacles(x, y, z)
        found = bvh.nearest_of(x, y, z, AWAY, 0.0, *self._scene)
        if found.distance < AWAY:
            yield found

    def distances(self, x: float, y: float, z: float) -> Iterator[tuple[str, float]]:
        """Distance (m, negative beyond or within) to the walls, to each obstacle, and to what stands in the scene."""
        yield "wall", -self._beyond(x, y, z - self._middle, *self._half, self._edges, self._corners)
        for number, surface in enumerate(self.obstacles(x, y, z)):
            yield f"obstacle {number}", surface.distance
        yield "scene", bvh.nearest(x, y, z, AWAY, *self._scene).distance

    def excursion(self, x: float, y: float, z: float) -> float:
        """Distance outside the arena or inside an obstacle or a shape, m; negative where flying is allowed."""
        out = self._beyond(x, y, z - self._middle, *self._half, self._edges, self._corners)
        for surface in self.obstacles(x, y, z):
            out = max(out, -surface.distance)
        return float(max(out, -bvh.nearest(x, y, z, AWAY, *self._scene).distance))

    def ray(self, x: float, y: float, z: float, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance (m, at most length) of a thin ray along a unit vector."""
        free = min(length, self._clear(x, y, z - self._middle, ux, uy, uz, *self._half, self._edges, self._corners))
        return self._free_of_solids(x, y, z, ux, uy, uz, free)

    def is_blocked(self, x: float, y: float, z: float, to_x: float, to_y: float, to_z: float) -> bool:
        """Return True if an obstacle or the scene stands between two positions, m; walls of an arena do not hide."""
        dx, dy, dz = to_x - x, to_y - y, to_z - z
        length = norm(dx, dy, dz)
        return bool(self._free_of_solids(x, y, z, dx / length, dy / length, dz / length, length) < length)

    def _free_of_solids(self, x: float, y: float, z: float, ux: float, uy: float, uz: float, free: float) -> float:
        """Return how far a thin ray that is free so far (m) goes before it meets an obstacle or the scene, m."""
        for first, last in self._obstacles:
            if self._obstacle is polygon.prism:
                free = min(free, polygon.ray_to_prism(x, y, z, ux, uy, uz, self._edges, first, last))
            else:
                free = min(free, rays.to_edges(x, y, ux, uy, self._edges, first, last))
        return float(bvh.cast(x, y, z, ux, uy, uz, free, 0.0, *self._scene))

    def cast(
        self, x: float, y: float, z: float, ux: float, uy: float, uz: float, length: float, radius: float
    ) -> float:  # fmt: skip
        """Free distance (m, at most length) of a sphere of this radius (m) along a unit vector to walls and scene."""
        free = length
        if self._clear is not rays.to_nothing:
            sides = (AWAY, AWAY) if self._flat else (self._half[0] - radius, self._half[1] - radius)
            up = self._half[2] - radius if self._dims == 3 else AWAY
            rule = rays.to_box if self._flat else self._clear
            free = min(free, rule(x, y, z - self._middle, ux, uy, uz, *sides, up, self._edges, 0))
        return float(bvh.cast(x, y, z, ux, uy, uz, free, radius, *self._scene)) if self._casts else float(free)


EDGE_RULES = {"open": None, "bounce": edges.bounce, "periodic": edges.wrap}


def arena_surfaces(world: arena.Parameters) -> tuple[tuple[Callable[..., Any], ...], Callable[..., float]]:
    """Families of surfaces of an arena, and its excursion function; a periodic one has no walls to feel or to leave."""
    return tuple(dict.fromkeys(function for function, _ in wall_functions(world))), BEYOND[_walled(world)]


def arena_ray(world: arena.Parameters) -> Callable[..., float]:
    """Free distance along a direction to the arena's walls."""
    return CLEAR[_walled(world)]


def face_rows(world: arena.Parameters) -> tuple[list[list[float]], list[int]]:
    """Rows of the surface functions of `arena_surfaces`, and how many belong to each family."""
    walls = wall_functions(world)
    return [list(row) for _, row in walls], list(Counter(function for function, _ in walls).values())
