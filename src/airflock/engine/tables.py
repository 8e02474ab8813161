"""Tables: a scenario as the numbers that a driver reads: a row of reals, a row of integers, the arena's geometry."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.absence_and_faults import GroundContact, ground_contact
from airflock.engine.plan import INTEGER_NAMES, Plan
from airflock.parts.bodies import dryden, wind
from airflock.scenarios import ORDER, FaultOnset, Geometry, Scenario, StepTimes, draw_onsets, step_counts
from airflock.world import edge_rows, face_rows, half_sizes, heights_of, make_scene as make_scene, without_appearing

EMPTY = make_scene([])
SEEDED = [INTEGER_NAMES.index(name) for name in ("world", "seed_low", "seed_high")]


@dataclass(frozen=True)
class WorldTables:
    """Numbers of one world.

    row   : (columns,) all records of numbers in the plan's order, SI
    whole : (len(WHOLE),) integers
    faces : (face, 4) numbers of each surface, families one after another
    edges : (edge, 4) ax ay bx by of polygons, m: the arena's first, then the obstacles', with
            heights behind them where there are any (`world.place.edge_rows`)
    spans : (obstacle, 2) first and last edge of each obstacle
    shapes, nodes, links : what stands in the scene, as in `world.scenes.tree`
    later : (shape, 8) bounds (m), time (s) and number of each shape that appears while flying
    goals : (goal, 3) points in their order, m
    own   : (number, agent) what differs among agents, in the plan's order
    due   : faults in the order of their steps
    landing : who can land with an empty battery; None where nobody can
    """

    row: NDArray[Any]
    whole: NDArray[np.int64]
    faces: NDArray[Any]
    edges: NDArray[Any]
    spans: NDArray[np.int64]
    shapes: NDArray[Any]
    nodes: NDArray[Any]
    links: NDArray[np.int64]
    later: NDArray[Any]
    goals: NDArray[Any]
    own: NDArray[Any]
    due: tuple[FaultOnset, ...] = ()
    ground_contact: GroundContact | None = None

    def changed(self, **whole: int) -> "WorldTables":
        """Return this world with other integers, by their names in `plan.INTEGER_NAMES`."""
        return replace(self, whole=np.array([(self.integers | whole)[name] for name in INTEGER_NAMES], np.int64))

    @property
    def integers(self) -> dict[str, int]:
        """Integers of this world by name."""
        return dict(zip(INTEGER_NAMES, self.whole.tolist(), strict=True))


def start_extents(scenario: Scenario) -> tuple[float, float, float]:
    """Half sizes of the box about the origin from which starts are drawn, m."""
    world = scenario.world
    x, y, z = half_sizes(scenario.world)
    if scenario.start.kind != "arena":
        reach = scenario.start.radius if scenario.start.kind == "ball" else 0.5 * scenario.start.side
        return reach, reach, reach if scenario.dimensions == 3 else 0.0
    if world.arena == "polygon":
        x, y = (max(abs(c[axis]) for c in world.corners) for axis in (0, 1))
    return x, y, max(map(abs, heights_of(world))) if scenario.dimensions == 3 else 0.0


def driver_records(scenario: Scenario, period: float) -> dict[str, Any]:
    """Record behind each letter of a driver's row; period: time between two decisions, s."""
    a, records = scenario.wind, scenario.records | {"metrics": scenario.resolved_metrics()}
    derived = {
        "w": driver_geometry(scenario), "c": StepTimes(scenario.flight.dt, period), "air": dryden.numbers_of(a),
        "a": wind.Steady(a.east, a.north, a.up, a.gust, a.gust_time), "silence": scenario.resolved_silence(),
        "steer": scenario.resolved_steer() if scenario.steers else scenario.steer,
    }  # fmt: skip
    found = {each.letter: derived.get(each.letter, records[each.key]) for each in ORDER if each.letter}
    return found | {f"p{k}": law.parameters for k, law in enumerate(scenario.laws) if k}


def driver_geometry(scenario: Scenario) -> Geometry:
    """Return the numbers of world, start and goals that drivers read."""
    begin, goals = scenario.start, scenario.goals
    half, extent = half_sizes(scenario.world), start_extents(scenario)
    return Geometry(
        **dict(zip(("half_x", "half_y", "half_z"), half, strict=True)),
        **dict(zip(("extent_x", "extent_y", "extent_z"), extent, strict=True)),
        separation=scenario.separation(),
        speed=begin.speed,
        clearance=begin.clearance,
        wall_clearance=begin.wall_clearance,
        goal_radius=goals.radius,
        goal_speed=goals.speed,
        goal_spread=goals.spread,
        goal_behind=goals.behind,
        spacing_x=begin.spacing_x,
        spacing_y=begin.spacing_y,
        spacing_z=begin.spacing_z,
        jitter=begin.jitter,
    )


def world_tables(scenario: Scenario, plan: Plan, seed: int, world: int = 0) -> WorldTables:
    """Numbers of one world for a plan's driver."""
    scenario = scenario.with_drawn_scene(seed)
    key = "tables", plan
    if key not in scenario.engine_cache:
        scenario.engine_cache[key] = _common(scenario, plan)
    common: WorldTables = scenario.engine_cache[key]
    whole = common.whole.copy()
    whole[SEEDED] = world, seed & 0xFFFFFFFF, (seed >> 32) & 0xFFFFFFFF
    return replace(
        common,
        whole=whole,
        own=agent_values(scenario, plan, seed).astype(common.row.dtype) if plan.columns else common.own,
        due=draw_onsets(scenario, seed, world) if plan.faults else (),
        ground_contact=ground_contact(scenario, seed, common.row.dtype.type),
    )


def _common(scenario: Scenario, plan: Plan) -> WorldTables:
    """Numbers that the flights of a scenario have in common; of the seed there is nothing in them."""
    real = np.float32 if plan.bits == 32 else np.float64
    dt, times = scenario.flight.dt, step_counts(scenario)
    surfaces, families = face_rows(scenario.world)
    edges, corners, spans = edge_rows(scenario.world)
    scene = scenario.stands() if plan.scene else EMPTY
    shapes, later = without_appearing(scene)
    values = driver_records(scenario, dt * times["decide_every"])
    numbers = [_number(values[letter], name) for letter, names in plan.numbers for name in names]
    counts = families + [0] * (2 - len(families))
    whole = times | {
        "agents": scenario.agents,
        "born": scenario.agents,
        "world": 0,
        "seed_low": 0,
        "seed_high": 0,
        "corners": corners,
        "obstacles": len(spans),
        "faces_0": counts[0],
        "faces_1": counts[1],
    }
    return WorldTables(
        row=np.array(numbers, real),
        whole=np.array([whole[name] for name in INTEGER_NAMES], np.int64),
        faces=np.array(surfaces, real).reshape(-1, 4),
        edges=np.array(edges, real).reshape(-1, 4),
        spans=np.array(spans, np.int64).reshape(-1, 2),
        shapes=shapes.astype(real),
        later=later.astype(real),
        nodes=scene.nodes.astype(real),
        links=scene.links,
        goals=scenario.waypoints().astype(real),
        own=np.zeros((0, scenario.agents), real),
    )


def _number(record: Any, name: str) -> float:
    """Return a number of a record, or of a column of it by "name[k]"; an optional one that is None becomes 0."""
    name, _, place = name.partition("[")
    value = getattr(record, name)
    return float(value[int(place[:-1])] if place else value or 0.0)


def agent_values(scenario: Scenario, plan: Plan, seed: int) -> Any:
    """Return the numbers that differ among agents, (number, agent): with manufacturing tolerances, law and group."""
    made = np.zeros((len(plan.columns), scenario.agents))
    known = {"law": scenario.law_indices, "group": scenario.group_indices}
    for c, (letter, name) in enumerate(plan.columns):
        made[c] = scenario.agent_values(letter, name, seed) if letter else known[name]
    return made
