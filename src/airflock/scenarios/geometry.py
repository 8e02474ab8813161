"""Checks of a world that need more than one number: simple polygons, containment, room for all agents."""

import math
from collections.abc import Sequence
from typing import Any

from shapely import union_all
from shapely.geometry import MultiPoint, Point, Polygon, box
from shapely.validation import explain_validity

from airflock.scenarios.wings import FORMATIONS
from airflock.world import arena, half_sizes, start

MOST_JITTER = 5.8  # standard deviations; no normal number of `core.random` is larger
ROUNDED = 2e-3  # m; by how much an obstacle at an edge may reach outside: corners of files are told to the millimetre
JAMMED = 0.5  # covered share at which random sequential placement of discs comes to a halt (it jams at 0.547)


def ground_plan(world: arena.Parameters) -> Any:
    """Ground plan of the arena as a shapely polygon; None without an arena."""
    if world.arena == "square":
        h = 0.5 * world.side
        return Polygon([(-h, -h), (h, -h), (h, h), (-h, h)])
    if world.arena == "circle":
        return Point(0.0, 0.0).buffer(world.radius, quad_segs=64)
    return Polygon(world.corners) if world.arena == "polygon" and len(world.corners) > 2 else None


def polygon_error(corners: Any) -> str:
    """Why a list of corners is no simple polygon; empty if it is one."""
    if len(corners) < 3:
        return f"has {len(corners)} corners; a polygon needs at least 3"
    twice = [a for a, b in zip(corners, (*corners[1:], corners[0]), strict=True) if tuple(a) == tuple(b)]
    if twice:
        return f"gives corner [{twice[0][0]:g}, {twice[0][1]:g}] twice in succession"
    shape = Polygon(corners)
    if not shape.is_valid:
        where = [f"{float(c):.4g}" for c in explain_validity(shape).partition("[")[2].rstrip("]").split()]
        return "crosses or touches itself" + (f" near [{', '.join(where)}]" if where else "")
    return "" if shape.area > 0.0 else "has no area"


def largest_extension(world: arena.Parameters) -> float:
    """Half the distance between two extreme points of the arena, m (Zapotecatl et al. 2016, Eq. 21); 0 without one."""
    x, y, z = half_sizes(world)
    up = z if world.dimensions == "3" else 0.0
    if world.arena == "none":
        return 0.0
    if world.arena == "polygon":
        ground = 0.5 * diameter([(float(c[0]), float(c[1])) for c in world.corners])
    else:
        ground = x if world.arena == "circle" else math.hypot(x, y)
    return math.hypot(ground, up)


def diameter(points: Sequence[tuple[float, float]]) -> float:
    """Largest distance between two of the points, m: by the calipers that turn around their convex hull."""
    hull = MultiPoint(points).convex_hull
    if hull.is_empty or isinstance(hull, Point):
        return 0.0
    ends: list[tuple[float, ...]] = [*hull.exterior.coords][:-1] if isinstance(hull, Polygon) else [*hull.coords]
    count, far, largest = len(ends), 1, 0.0
    for k, (x, y) in enumerate(ends):
        nx, ny = ends[(k + 1) % count]

        def beyond(i: int, x: float = x, y: float = y, nx: float = nx, ny: float = ny) -> float:
            """Twice the area that point i spans with the side, so how far it lies from it."""
            return abs((nx - x) * (ends[i][1] - y) - (ny - y) * (ends[i][0] - x))

        for _ in range(count):
            after = (far + 1) % count
            largest = max(largest, math.dist((x, y), ends[far]), math.dist((nx, ny), ends[far]))
            if beyond(after) < beyond(far) or after == k:
                break
            far = after
    return largest


def formation_errors(world: arena.Parameters, start_record: start.Parameters, agents: int) -> list[str]:
    """Why a formation does not fit into the arena. Of straight lines in a convex arena the ends decide."""
    plan = ground_plan(world)
    if plan is None:
        return []
    margin = 0.0 if world.edges == "open" else MOST_JITTER * start_record.jitter  # a face would move an agent outside
    ends = (0, max(agents - 2, 0), agents - 1)
    for agent in dict.fromkeys(range(agents) if world.arena == "polygon" else ends):
        x, y, z = FORMATIONS[start_record.kind](
            agent, start_record.spacing_x, start_record.spacing_y, start_record.spacing_z
        )
        low, top = arena.heights_of(world)
        high = not low + margin <= z <= top - margin and world.dimensions == "3"
        if high or not plan.covers(Point(x, y).buffer(margin) if margin else Point(x, y)):
            spot = f"[{x:g}, {y:g}" + (f", {z:g}]" if world.dimensions == "3" else "]")
            return [
                f"start.kind = {start_record.kind!r}: agent {agent} of {agents} would start at {spot} m, "
                "outside the arena"
                + (f" or within {margin:g} m of jitter of its faces" if margin else "")
                + "; enlarge it, or lower start.spacing_x, start.spacing_y and start.spacing_z"
            ]
    return []


def _edge_faults(world: arena.Parameters) -> list[str]:
    """Edges that the arena cannot have."""
    found = []
    if world.edges != "open" and world.arena != "square":
        found.append(f"world.edges = {world.edges!r} needs world.arena = 'square'")
    if world.edges == "periodic" and world.obstacles:
        found.append("world.edges = 'periodic' takes no obstacles")
    return found


def start_region_errors(world: arena.Parameters, start_record: start.Parameters, agents: int) -> list[str]:
    """Why a start region does not fit into the arena."""
    found = []
    if start_record.kind in FORMATIONS:
        found += formation_errors(world, start_record, agents)
    elif start_record.kind != "arena" and world.arena != "none":
        reach = start_record.radius if start_record.kind == "ball" else 0.5 * start_record.side
        z = min(-arena.heights_of(world)[0], arena.heights_of(world)[1]) if world.dimensions == "3" else math.inf
        plan = ground_plan(world)
        round_ = Point(0.0, 0.0).buffer(reach * 0.999, quad_segs=64)
        region = round_ if start_record.kind == "ball" else box(-reach, -reach, reach, reach)
        if plan is not None and (not plan.covers(region) or reach > z):
            name = "radius" if start_record.kind == "ball" else "side"
            found.append(
                f"start.{name} = {getattr(start_record, name):g} m: "
                f"the arena is smaller than the {start_record.kind} in which "
                f"agents start; enlarge world.side or world.height, or lower start.{name}"
            )
    return found


def _region(world: arena.Parameters, begin: start.Parameters) -> tuple[Any, float]:
    """Ground plan (None: without an end) and height (m) of the region in which agents start, obstacles included."""
    if begin.kind == "ball":
        return Point(0.0, 0.0).buffer(begin.radius, quad_segs=64), 4.0 / 3.0 * begin.radius
    if begin.kind == "box":
        return box(*(-0.5 * begin.side,) * 2, *(0.5 * begin.side,) * 2), begin.side
    plan, room = ground_plan(world), begin.wall_clearance
    low, high = arena.heights_of(world)
    return None if plan is None else plan.buffer(-room), max(high - low - 2.0 * room, 0.0)


def _size(world: arena.Parameters, begin: start.Parameters) -> str:
    """Key that says how large the region is in which agents start."""
    of_arena = {"circle": "world.radius", "polygon": "world.corners"}.get(world.arena, "world.side")
    return {"ball": "start.radius", "box": "start.side"}.get(begin.kind, of_arena)


def height_errors(world: arena.Parameters) -> list[str]:
    """What is wrong with floor, ceiling and the heights of obstacles."""
    found = []
    given = [key for key in ("floor", "ceiling") if getattr(world, key) is not None]
    low, high = arena.heights_of(world)
    if world.dimensions == "2":
        found += [f"world.{key}: a plane has no heights; set world.dimensions = '3'" for key in given]
        found += ["world.heights: a plane has no heights; set world.dimensions = '3'"] if world.heights else []
        return found
    if given and not low < high:
        found.append(f"world.floor = {low:g} m does not lie below world.ceiling = {high:g} m")
    if given and (world.edges != "open" or world.walls == "nearest_per_axis"):
        key, value = ("edges", world.edges) if world.edges != "open" else ("walls", world.walls)
        found.append(f"world.{given[0]}: with world.{key} = {value!r} give world.height instead")
    if world.heights and len(world.heights) != len(world.obstacles):
        found.append(f"world.heights: {len(world.heights)} pairs for {len(world.obstacles)} obstacles; give one each")
    for number, (bottom, top) in enumerate(world.heights):
        if not bottom < top:
            found.append(f"world.heights[{number}] = [{bottom:g}, {top:g}] m: the lowest height does not come first")
    return found


def world_errors(
    world: arena.Parameters, agents: int, separation: float, start_record: start.Parameters, *, started: bool = False
) -> list[str]:
    """Everything that is wrong with a world, and with starting in it unless the flight has started; one line each."""
    found = height_errors(world)
    if world.arena == "polygon":
        fault = polygon_error(world.corners)
        if fault:
            found.append(f"world.corners {fault}")
    if world.arena != "square" and world.walls == "nearest_per_axis":
        found.append("world.walls = 'nearest_per_axis' needs world.arena = 'square'; set world.walls = 'every_edge'")
    plan = None if found else ground_plan(world)
    region, height = (None, 1.0) if found else _region(world, start_record)
    if not found:
        found += (
            _edge_faults(world) if started else start_region_errors(world, start_record, agents) + _edge_faults(world)
        )
    solid: list[Polygon] = []
    within = None if plan is None or not world.obstacles else plan.buffer(ROUNDED, join_style="mitre")
    for number, corners in enumerate(world.obstacles):
        fault = polygon_error(corners)
        if fault:
            found.append(f"world.obstacles[{number}] {fault}")
            continue
        shape = Polygon(corners)
        if within is not None and not within.covers(shape):
            found.append(f"world.obstacles[{number}] reaches outside the arena")
        solid.append(shape.buffer(start_record.wall_clearance))
    if started:
        return found
    free = math.inf if region is None else region.difference(union_all(solid)).area
    if world.dimensions == "3":
        need = agents * math.pi / 6.0 * separation**3 / max(free * height, 1e-9)
    else:
        need = agents * math.pi / 4.0 * separation**2 / max(free, 1e-9)
    if not found and need > (JAMMED if world.dimensions == "2" else 0.35):
        found.append(
            f"agents = {agents} do not fit at start.separation = {separation:g} m"
            + (f" and start.wall_clearance = {start_record.wall_clearance:g} m" if start_record.wall_clearance else "")
            + (f": they would cover {need:.0%} of" if free * height > 0.0 else ": no place is left in")
            + f" the region they start in; enlarge {_size(world, start_record)}, or lower agents or "
            + ("start.separation or start.wall_clearance" if start_record.wall_clearance else "start.separation")
        )
    if not found and world.arena == "none" and agents > 1 and start_record.kind == "arena":
        found.append("world.arena = 'none' has no region to start in; give an arena, or start.kind = 'ball'")
    return found
