"""Surfaces: sum a law's boundary rule over walls, obstacles and what stands in the scene."""

from collections.abc import Iterable
from typing import Any

from airflock.engine.stages.records import FlightView
from airflock.engine.stages.state import agent_numbers, scene_tree
from airflock.engine.stages.words import *
from airflock.world import bvh, polygon


def add_surface(i: int, surface: Any, flight: FlightView) -> None:
    """Add the terms of one surface to the sums of agent i."""
    plan, model, flock, v = flight.plan, flight.model, flight.flock, vector()
    for a in range(plan.dimensions):
        v[a] = flock.measured_velocity[a][i]
    t = call_rule(
        model.boundary, distance=surface.distance, nx=surface.nx, ny=surface.ny, nz=surface.nz,
        **components("v", v), p=agent_numbers(i, "p", flock, flight.numbers, plan=plan),
    )  # fmt: skip
    # Sums go to rows, not to locals: the loop over surfaces is the outer one, so an agent comes by
    # once per surface.
    for c in nonzero_fields(model.Walls, plan.dimensions):
        flock.walls[c][i] += t[c]


def wall_reach_of(i: int, look: Any, flight: FlightView) -> Any:
    """Return the distance within which agent i feels surfaces, m: that of the flock, or by its own numbers."""
    return (
        least(
            call_rule(flight.model.wall_reach, p=agent_numbers(i, "p", flight.flock, flight.numbers, plan=flight.plan)),
            LIMIT,
        )
        if flight.plan.varies("p") and flight.model.wall_reach is not None
        else look
    )


def sum_walls(agents: Iterable[int], flight: FlightView, faces: Any) -> None:
    """Walls whose surface is a function of four numbers, by family."""
    whole, x = flight.whole, flight.flock.measured_position
    bounds = (0, whole.faces_0, whole.faces_0 + whole.faces_1)
    # Surfaces outside, agents inside: the inner loop runs over agents that share one wall, so that
    # its numbers are constants of the loop and the agents fill vectors. Families have a rule each,
    # hence the loop that is written out.
    for family, distance_to in enumerate(flight.plan.surfaces):
        for e in range(bounds[family], bounds[family + 1]):
            ea = faces[e, 0]
            eb = faces[e, 1]
            ec = faces[e, 2]
            ed = faces[e, 3]
            for i in agents:
                f = distance_to(x[X][i], x[Y][i], x[Z][i], ea, eb, ec, ed)
                add_surface(i, f, flight)


def sum_edges(agents: Iterable[int], flight: FlightView, look: Any) -> None:
    """Edges of a polygonal arena: those that an agent can see and, for an agent outside, the nearest point."""
    whole, edges, x = flight.whole, flight.around.edges, flight.flock.measured_position
    # The shill agent of an edge stands at its closest point, as the paper says. On the infinite
    # line it would be up to 13 m off in a hexagon of 100 m, and push agents in one arm of an L away
    # from a wall of the other.
    for e in range(whole.corners):
        for i in agents:
            f = polygon.wall(x[X][i], x[Y][i], x[Z][i], edges, e, whole.corners, wall_reach_of(i, look, flight))
            if f.distance < wall_reach_of(i, look, flight):
                add_surface(i, f, flight)
    # An agent outside is on the wrong side of every edge, and no edge would call it back.
    for i in agents:
        f = polygon.outside(x[X][i], x[Y][i], x[Z][i], edges, whole.corners)
        if f.distance < ZERO:
            add_surface(i, f, flight)


def boundaries(agents: Iterable[int], flight: FlightView, faces: Any) -> None:
    """Sum the boundary rule over all surfaces: walls outside, agents inside the loop nest.

    Of the scene two surfaces are felt: the ground, and the nearest point of what stands on it.
    """
    plan, model, flock, around = flight.plan, flight.model, flight.flock, flight.around
    x = flock.measured_position
    if plan.polygonal or plan.scene:
        look = least(LIMIT if model.wall_reach is None else call_rule(model.wall_reach, p=flight.numbers.p), LIMIT)
    for i in agents:
        for c in nonzero_fields(model.Walls, plan.dimensions):
            flock.walls[c][i] = ZERO
    sum_walls(agents, flight, faces)
    if plan.polygonal:
        sum_edges(agents, flight, look)
    if plan.obstacles and model.sight is None:  # who casts meets them in the scene
        for o in range(flight.whole.obstacles):
            for i in agents:
                f = plan.obstacle(x[X][i], x[Y][i], x[Z][i], around.edges, around.spans[o, 0], around.spans[o, 1])
                add_surface(i, f, flight)
    if plan.scene:
        # Only the ground and the one nearest point are felt. With every building in reach the
        # pushes of both sides of a street cancel while their damping adds up, and nothing of the
        # own way is left.
        for ground in (ZERO, ONE)[: plan.dimensions - 1]:
            for i in agents:
                f = bvh.nearest_of(
                    x[X][i], x[Y][i], x[Z][i], wall_reach_of(i, look, flight), ground, *scene_tree(around.scene)
                )  # fmt: skip
                if f.distance < wall_reach_of(i, look, flight):
                    add_surface(i, f, flight)
