"""Surfaces: sum a law's boundary rule over walls, obstacles and what stands in the scene."""

from collections.abc import Iterable
from typing import Any

from airflock.core import Model
from airflock.engine.plan import Plan
from airflock.engine.stages.records import WorldArrays
from airflock.engine.stages.state import FlockRows, agent_numbers, scene_tree
from airflock.engine.stages.words import LIMIT, ONE, ZERO, X, Y, Z, call_rule, least, nonzero_fields, vector
from airflock.world import bvh, polygon


def add_surface(i: int, surface: Any, flock: FlockRows, numbers: Any, *, plan: Plan, model: Model) -> None:
    """Add the terms of one surface to the sums of agent i."""
    v = vector()
    for a in range(plan.dimensions):
        v[a] = flock.measured_velocity[a][i]
    t = call_rule(
        model.boundary, distance=surface.distance, nx=surface.nx, ny=surface.ny, nz=surface.nz,
        vx=v[X], vy=v[Y], vz=v[Z], p=agent_numbers(i, "p", flock, numbers, plan=plan),
    )  # fmt: skip
    # Sums go to rows, not to locals: the loop over surfaces is the outer one, so an agent comes by
    # once per surface.
    for c in nonzero_fields(model.Walls, plan.dimensions):
        flock.walls[c][i] += t[c]


def wall_reach_of(i: int, look: Any, flock: FlockRows, numbers: Any, *, plan: Plan, model: Model) -> Any:
    """Return the distance within which agent i feels surfaces, m: that of the flock, or by its own numbers."""
    return (
        least(call_rule(model.wall_reach, p=agent_numbers(i, "p", flock, numbers, plan=plan)), LIMIT)
        if plan.varies("p") and model.wall_reach is not None
        else look
    )


def sum_walls(
    agents: Iterable[int], flock: FlockRows, numbers: Any, whole: Any, faces: Any, *, plan: Plan, model: Model
) -> None:
    """Walls whose surface is a function of four numbers, by family."""
    x = flock.measured_position
    bounds = (0, whole.faces_0, whole.faces_0 + whole.faces_1)
    # Surfaces outside, agents inside: the inner loop runs over agents that share one wall, so that
    # its numbers are constants of the loop and the agents fill vectors. Families have a rule each,
    # hence the loop that is written out.
    for family, distance_to in enumerate(plan.surfaces):
        for e in range(bounds[family], bounds[family + 1]):
            ea = faces[e, 0]
            eb = faces[e, 1]
            ec = faces[e, 2]
            ed = faces[e, 3]
            for i in agents:
                f = distance_to(x[X][i], x[Y][i], x[Z][i], ea, eb, ec, ed)
                add_surface(i, f, flock, numbers, plan=plan, model=model)


def sum_edges(
    agents: Iterable[int],
    flock: FlockRows,
    numbers: Any,
    whole: Any,
    edges: Any,
    look: Any,
    *,
    plan: Plan,
    model: Model,
) -> None:
    """Edges of a polygonal arena: those that an agent can see and, for an agent outside, the nearest point."""
    x = flock.measured_position
    # The shill agent of an edge stands at its closest point, as the paper says. On the infinite
    # line it would be up to 13 m off in a hexagon of 100 m, and push agents in one arm of an L away
    # from a wall of the other.
    for e in range(whole.corners):
        for i in agents:
            f = polygon.wall(
                x[X][i], x[Y][i], x[Z][i], edges, e, whole.corners,
                wall_reach_of(i, look, flock, numbers, plan=plan, model=model),
            )  # fmt: skip
            if f.distance < wall_reach_of(i, look, flock, numbers, plan=plan, model=model):
                add_surface(i, f, flock, numbers, plan=plan, model=model)
    # An agent outside is on the wrong side of every edge, and no edge would call it back.
    for i in agents:
        f = polygon.outside(x[X][i], x[Y][i], x[Z][i], edges, whole.corners)
        if f.distance < ZERO:
            add_surface(i, f, flock, numbers, plan=plan, model=model)


def boundaries(
    agents: Iterable[int], flock: FlockRows, numbers: Any, whole: Any, faces: Any, around: WorldArrays,
    *, plan: Plan, model: Model,
) -> None:  # fmt: skip
    """Sum the boundary rule over all surfaces: walls outside, agents inside the loop nest.

    Of the scene two surfaces are felt: the ground, and the nearest point of what stands on it.
    """
    x = flock.measured_position
    if plan.polygonal or plan.scene:
        look = least(LIMIT if model.wall_reach is None else call_rule(model.wall_reach, p=numbers.p), LIMIT)
    for i in agents:
        for c in nonzero_fields(model.Walls, plan.dimensions):
            flock.walls[c][i] = ZERO
    sum_walls(agents, flock, numbers, whole, faces, plan=plan, model=model)
    if plan.polygonal:
        sum_edges(agents, flock, numbers, whole, around.edges, look, plan=plan, model=model)
    if plan.obstacles and model.sight is None:  # who casts meets them in the scene
        for o in range(whole.obstacles):
            for i in agents:
                f = plan.obstacle(x[X][i], x[Y][i], x[Z][i], around.edges, around.spans[o, 0], around.spans[o, 1])
                add_surface(i, f, flock, numbers, plan=plan, model=model)
    if plan.scene:
        # Only the ground and the one nearest point are felt. With every building in reach the
        # pushes of both sides of a street cancel while their damping adds up, and nothing of the
        # own way is left.
        for ground in (ZERO, ONE)[: plan.dimensions - 1]:
            for i in agents:
                f = bvh.nearest_of(
                    x[X][i], x[Y][i], x[Z][i], wall_reach_of(i, look, flock, numbers, plan=plan, model=model), ground,
                    *scene_tree(around.scene),
                )  # fmt: skip
                if f.distance < wall_reach_of(i, look, flock, numbers, plan=plan, model=model):
                    add_surface(i, f, flock, numbers, plan=plan, model=model)
