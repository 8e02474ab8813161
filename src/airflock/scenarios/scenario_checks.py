"""Checks of a scenario that take more than one key, after each section was checked alone.

Every check returns lines for a person to read, and none where it has nothing to object to. The
records of sections come as `parts`, section → record; a record that could not be made is None, and
checks that need it are left out.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from shapely import get_coordinates, union_all
from shapely.geometry import LineString, MultiPoint, Point, Polygon, box
from shapely.validation import explain_validity

from airflock.core import Body, Metric, MetricSet, Model, Radio, Sensor, Topology, argument_names, call_rule
from airflock.parts.aero import descent, wing as wings
from airflock.scenarios.sections import Flight
from airflock.world import arena, half_sizes, start


def body_errors(body: Body, parts: Mapping[str, Any], model: Model | None, started: bool = False) -> list[str]:
    """Return why a body cannot fly: too long a step, too fast a law or (unless the flight has started) start."""
    b, p, flight = parts["body"], parts.get("parameters"), parts["flight"]
    if b is None or flight is None or model is None or p is None:
        return []
    begin, wing = parts["start"], parts["wing"]
    if begin is None or wing is None:
        return []
    # A flight in the air may be slower than its body can start, so its speed at the start counts as
    # fast enough.
    start = math.inf if started else begin.speed
    return body.limit_errors(b=b, dt=flight.dt, speed=model.speed(p), start=start, wing=wing)


def sensor_errors(sensor: Sensor, parts: Mapping[str, Any]) -> list[str]:
    """Return the errors of a sensor at its sampling period."""
    s, flight = parts["sensors"], parts["flight"]
    if s is None or flight is None:
        return []
    period = max(1, round(s.period / flight.dt)) * flight.dt
    return sensor.bound_errors(s=s, period=period, dt=flight.dt)


IDEAL = {"radio.kind": "'constant'", "sensors.kind": "'perfect'"}  # what is not ideal at 0


def update_order_errors(flight: Any, sensor: Sensor, sensors: Any, radio: Radio, k: Any, b: Any) -> list[str]:
    """Return why agents cannot update in turn: they need ideal perception at every step, and follow commands at once.

    sensors, k, b : parameters of sensor, radio and body; None where they have errors
    """
    if flight.update == "synchronous" or sensors is None or k is None:
        return []
    # A period of one step is as good as none.
    late = sensors.period if round(sensors.period / flight.dt) > 1 else 0.0
    ideal = {
        "sensors.kind": 0.0 if sensor.is_exact(sensors) else sensor.name,
        "sensors.period": late,
        "radio.delay": k.delay,
        "radio.loss": k.loss,
        "radio.kind": radio.name if radio.keeps_packets else 0.0,
    }
    errors = []
    if b is not None and round(b.delay / flight.dt) > 0:
        errors = [f"body.delay = {b.delay:g} s: with update = 'sequential' no command waits; set body.delay = 0"]
    return errors + [
        f"{key} = {value}: update = 'sequential' needs ideal perception at every step; set {key} = "
        + IDEAL.get(key, "0")
        for key, value in ideal.items()
        if value != 0.0
    ]


def topology_errors(kind: Topology | None, world: Any, model: Model | None) -> list[str]:
    """Return why agents of a law in a world cannot meet each other by a topology."""
    errors = []
    if kind is not None and kind.flat and world is not None and world.dimensions == "3":
        errors.append(f"topology.kind = {kind.name!r}: works in a plane only; set world.dimensions = '2'")
    if kind is not None and model is not None and model.neighbour is None:
        errors.append(f"topology.kind = {kind.name!r}: law {model.name} has no rule for single neighbours")
    return errors


def metric_errors(measures: MetricSet, q: Any, world: Any) -> list[str]:
    """Return the errors that a metric set finds in its parameters beyond single ranges."""
    if q is None or world is None or measures.errors is None:
        return []
    # A metric set names the arguments that its check needs; the same call serves sets of the user's
    # own.
    given = {"q": q, "largest": largest_extension(world), "edges": world.edges}
    return list(call_rule(measures.errors, "errors", given, measures.name))


def silence_errors(rule: str, flight: Any, model: Model | None) -> list[str]:
    """Return why a law cannot stop for a lost neighbour: it hears none, or cannot stop."""
    if rule == "fly_on" or model is None:
        return []
    errors = []
    if model.command != "velocity":
        errors.append(
            f"commands {'an' if model.command[0] in 'aeiou' else 'a'} {model.command}, and none of it stops an agent"
        )
    if model.neighbour is None or model.flock is not None:
        errors.append("has no rule for the neighbours that an agent hears")
    if flight.update == "sequential":
        errors.append("sees all others as they are with update = 'sequential'")
    return [f"silence.rule = {rule!r}: model {model.name} {error}; set silence.rule = 'fly_on'" for error in errors]


def timing_errors(flight: Flight, period: float, metrics: Any) -> list[str]:
    """Return the errors of periods below a step, and of more steps than can be counted."""
    dt = flight.dt
    times = {
        "sensors.period": period,
        "metrics.period": metrics.period,
        "metrics.collision_period": metrics.collision_period or dt,
    }
    errors = [
        f"{key} = {value:g} s is shorter than dt = {dt:g} s" for key, value in times.items() if 0.0 < value < 0.5 * dt
    ]
    if flight.duration / dt > 2**31:
        errors.append(f"duration = {flight.duration:g} s takes more than 2^31 steps of dt = {dt:g} s")
    return errors


def field_file_errors(world: Any) -> list[str]:
    """Return an error where a record of an arena still names a file, which only `load` reads."""
    if world is None or not world.file:
        return []
    return [f"world.file = {world.file!r}: a file is read where a scenario is loaded, and not here"]


FormationPlace = Callable[[int, float, float, float], tuple[float, float, float]]
FORMATIONS: dict[str, FormationPlace] = {"vee": start.in_vee, "echelon": start.in_echelon}  # by the key start.kind
THIN = 0.1  # of a span: wings farther apart in height do not meet


def uses_lifting_line(law: Model | None, metrics: tuple[Metric, ...]) -> bool:
    """Return True if a rule of this scenario solves for the wings of the flock."""
    return (law is not None and law.flock is not None) or any(
        "wing" in argument_names(m.survey, "survey") for m in metrics if m.survey
    )


def wing_errors(parts: Mapping[str, Any], law: Model | None, measures: MetricSet, started: bool = False) -> list[str]:
    """Return all errors of the wings of a scenario, one line each; without its start once the flight has started."""
    q, wing = parts["metrics"], parts["wing"]
    if q is None or wing is None:
        return []
    lines, metrics = [], measures.of(q)
    if q.stop == "collision" and not any("n_coll" in m.Sample._fields for m in metrics):
        lines.append(f"metrics.stop = 'collision' needs collisions, which metrics.kind = {q.kind!r} does not count")
    if not uses_lifting_line(law, metrics):
        return lines
    lines += stall_errors(wing) if wing.stall == "refused" else []
    lines += [] if started else _overlapping(parts)
    place = "aero" if law is not None and law.flock is descent.flock else "model"
    # [aero] and a law of the whole flock bring their own key `gradient`; only one of the two flies.
    gradient = getattr(parts["aero"] if place == "aero" else parts.get("parameters"), "gradient", "none")
    if gradient in ("analytic", "frozen") and wing.positions == "grid":
        lines.append(f"{place}.gradient = {gradient!r} is a derivative; it needs wing.positions = 'free', not 'grid'")
    flight = parts["flight"]
    if law is not None and law.flock is not None and flight is not None and flight.update == "sequential":
        lines.append(f"update = 'sequential': model {law.name} solves for the whole flock at once")
    return lines


def stall_errors(wing: wings.Parameters) -> list[str]:
    """Return the line about a wing below its stall speed; empty where it is faster."""
    lift = wings.lift_coefficient(wing)
    if lift <= wing.cl_max:
        return []
    # The lift coefficient falls with the square of the speed: at this speed it is wing.cl_max.
    fast = wing.speed * (lift / wing.cl_max) ** 0.5
    return [
        f"wing.speed = {wing.speed:g} m/s: the wing stalls, its lift coefficient of {lift:.3g} is beyond wing.cl_max = "
        f"{wing.cl_max:g}; fly at {fast:.3g} m/s or more"
    ]


def _overlapping(parts: Mapping[str, Any]) -> list[str]:
    """Return an error about the first two wings that overlap in a start formation."""
    begin, wing, flight = parts["start"], parts["wing"], parts["flight"]
    if begin is None or flight is None or begin.kind not in FORMATIONS:
        return []
    place = FORMATIONS[begin.kind]
    # formations repeat themselves: if any two wings overlap, two of the first four do
    spots = [place(i, begin.spacing_x, begin.spacing_y, begin.spacing_z) for i in range(min(int(flight.agents), 4))]
    for j in range(len(spots)):
        for i in range(j):
            dx, dy, dz = (abs(a - b) for a, b in zip(spots[i], spots[j], strict=True))
            if dx < wing.chord and dy < wing.span and dz < THIN * wing.span:
                return [
                    f"start.spacing_y = {begin.spacing_y:g} m: the wings of agents {i} and {j} overlap by "
                    f"{wing.span - dy:.3g} m; keep wing.span = {wing.span:g} m apart sideways, or wing.chord = "
                    f"{wing.chord:g} m behind"
                ]
    return []


MOST_JITTER = 5.8  # standard deviations; no normal number of `core.random` is larger
ROUNDED = 2e-3  # m; by how much an obstacle at an edge may reach outside: files round corners to the millimetre
JAMMED = 0.5  # covered share at which random sequential placement of discs comes to a halt (it jams at 0.547)


def ground_plan(world: arena.Parameters) -> Any:
    """Return the ground plan of the arena as a shapely polygon; None without an arena."""
    if world.arena == "square":
        h = 0.5 * world.side
        return Polygon([(-h, -h), (h, -h), (h, h), (-h, h)])
    if world.arena == "circle":
        # 64 segments per quarter: the polygon lies within 8e-5 of the radius of the circle.
        return Point(0.0, 0.0).buffer(world.radius, quad_segs=64)
    return Polygon(world.corners) if world.arena == "polygon" and len(world.corners) > 2 else None


def polygon_error(corners: Any) -> str:
    """Return why a list of corners is no simple polygon; empty if it is one."""
    if len(corners) < 3:
        return f"has {len(corners)} corners; a polygon needs at least 3"
    # Shapely accepts repeated corners, but the surface between them has no direction.
    twice = [a for a, b in zip(corners, (*corners[1:], corners[0]), strict=True) if tuple(a) == tuple(b)]
    if twice:
        return f"gives corner [{twice[0][0]:g}, {twice[0][1]:g}] twice in succession"
    shape = Polygon(corners)
    if not shape.is_valid:
        where = [f"{float(c):.4g}" for c in explain_validity(shape).partition("[")[2].rstrip("]").split()]
        return "crosses or touches itself" + (f" near [{', '.join(where)}]" if where else "")
    return "" if shape.area > 0.0 else "has no area"


@lru_cache(maxsize=64)
def largest_extension(world: arena.Parameters) -> float:
    """Return half the largest distance of two points of the arena, m; 0 without one.

    Source: Zapotecatl et al. 2016, Eq. 21.
    """
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
    """Return the largest distance between two of the points, m."""
    # Both ends are corners of the convex hull; a field has few of them.
    ends = get_coordinates(MultiPoint(points).convex_hull)
    farthest = (ends[np.argmax(np.hypot(*(ends - end).T))] for end in ends)
    return max((math.dist(end, other) for end, other in zip(ends, farthest, strict=True)), default=0.0)


def formation_errors(world: arena.Parameters, start_record: start.Parameters, agents: int) -> list[str]:
    """Return why a formation does not fit into the arena."""
    plan = ground_plan(world)
    if plan is None:
        return []
    margin = 0.0 if world.edges == "open" else MOST_JITTER * start_record.jitter  # a face would move an agent outside
    spacing = (start_record.spacing_x, start_record.spacing_y, start_record.spacing_z)
    low, top = arena.heights_of(world)
    for agent in _outermost(plan, FORMATIONS[start_record.kind], spacing, agents):
        x, y, z = FORMATIONS[start_record.kind](agent, *spacing)
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


def _outermost(plan: Any, place: FormationPlace, spacing: tuple[float, float, float], agents: int) -> list[int]:
    """Return agents of a formation of which one is outside a ground plan wherever any is.

    Every other agent stands on one line. Its ends are returned, and those beside each place where
    it crosses an edge: between two such places all are inside, or none.
    """
    # Not each agent in turn: ten million that fit took minutes.
    numbers = set()
    for first in range(min(agents, 2)):
        last = (agents - 1 - first) // 2  # number along the line
        ends = [place(first + 2 * k, *spacing)[:2] for k in (0, last)]
        crossings = get_coordinates(LineString(ends).intersection(plan.boundary)) if ends[0] != ends[1] else ()
        along = {0, last} | {int(last * math.dist(ends[0], at) / math.dist(*ends)) for at in crossings}
        # One more on each side, as a crossing is rounded.
        numbers |= {first + 2 * k for each in along for k in range(each - 1, each + 3) if 0 <= k <= last}
    return sorted(numbers)


def _edge_errors(world: arena.Parameters) -> list[str]:
    """Return the errors of edges that the arena cannot have."""
    errors = []
    if world.edges != "open" and world.arena != "square":
        errors.append(f"world.edges = {world.edges!r} needs world.arena = 'square'")
    if world.edges == "periodic" and world.obstacles:
        errors.append("world.edges = 'periodic' takes no obstacles")
    return errors


def start_region_errors(world: arena.Parameters, start_record: start.Parameters, agents: int) -> list[str]:
    """Return why a start region does not fit into the arena."""
    errors = []
    if start_record.kind in FORMATIONS:
        errors += formation_errors(world, start_record, agents)
    elif start_record.kind != "arena" and world.arena != "none":
        reach = start_record.radius if start_record.kind == "ball" else 0.5 * start_record.side
        z = min(-arena.heights_of(world)[0], arena.heights_of(world)[1]) if world.dimensions == "3" else math.inf
        plan = ground_plan(world)
        # A thousandth smaller, so that the polygon of a circular arena may hold a ball of the same
        # radius.
        round_ = Point(0.0, 0.0).buffer(reach * 0.999, quad_segs=64)
        region = round_ if start_record.kind == "ball" else box(-reach, -reach, reach, reach)
        if plan is not None and (not plan.covers(region) or reach > z):
            name = "radius" if start_record.kind == "ball" else "side"
            errors.append(
                f"start.{name} = {getattr(start_record, name):g} m: "
                f"the arena is smaller than the {start_record.kind} in which "
                f"agents start; enlarge world.side or world.height, or lower start.{name}"
            )
    return errors


def _region(world: arena.Parameters, begin: start.Parameters) -> tuple[Any, float]:
    """Return ground plan (None: unbounded) and height (m) of the region in which agents start, obstacles included."""
    if begin.kind == "ball":
        return Point(0.0, 0.0).buffer(begin.radius, quad_segs=64), 4.0 / 3.0 * begin.radius
    if begin.kind == "box":
        return box(*(-0.5 * begin.side,) * 2, *(0.5 * begin.side,) * 2), begin.side
    plan, room = ground_plan(world), begin.wall_clearance
    low, high = arena.heights_of(world)
    # Agents start this far from walls, so the walls' strip is no room for them.
    return None if plan is None else plan.buffer(-room), max(high - low - 2.0 * room, 0.0)


def _size(world: arena.Parameters, begin: start.Parameters) -> str:
    """Return the key for the size of the region in which agents start."""
    of_arena = {"circle": "world.radius", "polygon": "world.corners"}.get(world.arena, "world.side")
    return {"ball": "start.radius", "box": "start.side"}.get(begin.kind, of_arena)


def height_errors(world: arena.Parameters) -> list[str]:
    """Return the errors of floor, ceiling and the heights of obstacles."""
    errors = []
    given = [key for key in ("floor", "ceiling") if getattr(world, key) is not None]
    low, high = arena.heights_of(world)
    if world.dimensions == "2":
        errors += [f"world.{key}: a plane has no heights; set world.dimensions = '3'" for key in given]
        errors += ["world.heights: a plane has no heights; set world.dimensions = '3'"] if world.heights else []
        return errors
    if given and not low < high:
        errors.append(f"world.floor = {low:g} m does not lie below world.ceiling = {high:g} m")
    # Periodic and bouncing boxes are symmetric about the origin, and so is the wall rule of one
    # axis.
    if given and (world.edges != "open" or world.walls == "nearest_per_axis"):
        key, value = ("edges", world.edges) if world.edges != "open" else ("walls", world.walls)
        errors.append(f"world.{given[0]}: with world.{key} = {value!r} give world.height instead")
    if world.heights and len(world.heights) != len(world.obstacles):
        errors.append(f"world.heights: {len(world.heights)} pairs for {len(world.obstacles)} obstacles; give one each")
    for number, (bottom, top) in enumerate(world.heights):
        if not bottom < top:
            errors.append(f"world.heights[{number}] = [{bottom:g}, {top:g}] m: the lowest height does not come first")
    return errors


def world_errors(
    world: arena.Parameters, agents: int, separation: float, start_record: start.Parameters, *, started: bool = False
) -> list[str]:
    """Return all errors of a world, and of starting in it unless the flight has started."""
    errors = height_errors(world)
    if world.arena == "polygon":
        error = polygon_error(world.corners)
        if error:
            errors.append(f"world.corners {error}")
    if world.arena != "square" and world.walls == "nearest_per_axis":
        errors.append("world.walls = 'nearest_per_axis' needs world.arena = 'square'; set world.walls = 'every_edge'")
    plan = None if errors else ground_plan(world)
    region, height = (None, 1.0) if errors else _region(world, start_record)
    if not errors:
        errors += (
            _edge_errors(world) if started else start_region_errors(world, start_record, agents) + _edge_errors(world)
        )
    solid: list[Polygon] = []
    within = None if plan is None or not world.obstacles else plan.buffer(ROUNDED, join_style="mitre")
    for number, corners in enumerate(world.obstacles):
        error = polygon_error(corners)
        if error:
            errors.append(f"world.obstacles[{number}] {error}")
            continue
        shape = Polygon(corners)
        if within is not None and not within.covers(shape):
            errors.append(f"world.obstacles[{number}] reaches outside the arena")
        solid.append(shape.buffer(start_record.wall_clearance))
    if started:
        return errors
    free = math.inf if region is None else region.difference(union_all(solid)).area
    if world.dimensions == "3":
        need = agents * math.pi / 6.0 * separation**3 / max(free * height, 1e-9)
    else:
        need = agents * math.pi / 4.0 * separation**2 / max(free, 1e-9)
    if not errors and need > (JAMMED if world.dimensions == "2" else 0.35):
        errors.append(
            f"agents = {agents} do not fit at start.separation = {separation:g} m"
            + (f" and start.wall_clearance = {start_record.wall_clearance:g} m" if start_record.wall_clearance else "")
            + (f": they would cover {need:.0%} of" if free * height > 0.0 else ": no place is left in")
            + f" the region they start in; enlarge {_size(world, start_record)}, or lower agents or "
            + ("start.separation or start.wall_clearance" if start_record.wall_clearance else "start.separation")
        )
    if not errors and world.arena == "none" and agents > 1 and start_record.kind == "arena":
        errors.append("world.arena = 'none' has no region to start in; give an arena, or start.kind = 'ball'")
    return errors
