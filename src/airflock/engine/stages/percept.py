"""Percept: what the methods of `Percept` do in a flight: rays and casts in its world, numbers of the stream MODEL."""

from typing import Any

from airflock.core import Model, random
from airflock.engine.plan import Plan
from airflock.engine.stages.words import *
from airflock.world import bvh, polygon, rays

MODEL = random.MODEL


def height_above_middle(z: Any, edges: Any, corners: int, *, plan: Plan) -> Any:
    """Height above the middle of the arena, m, which edges and corners tell where it is not 0."""
    return z - edges[corners, 0] if plan.off_centre_height else z


def ray_to_obstacle(
    x: Any, y: Any, z: Any, ux: Any, uy: Any, uz: Any, edges: Any, spans: Any, o: Any, *, plan: Plan
) -> Any:  # fmt: skip
    """Free distance along a ray to obstacle number o, m."""
    return (
        polygon.ray_to_prism(x, y, z, ux, uy, uz, edges, spans[o, 0], spans[o, 1])
        if plan.obstacle is polygon.prism
        else rays.to_edges(x, y, ux, uy, edges, spans[o, 0], spans[o, 1])
    )


def ray(percept: Any, ux: float, uy: float, uz: float, length: float, *, plan: Plan) -> Any:
    """Free distance (m) along the unit vector u to walls, obstacles and the scene, at most `length` (m)."""
    x = -percept.centre_x
    y = -percept.centre_y
    z = -percept.centre_z
    t = least(
        length,
        plan.ray(
            x,
            y,
            height_above_middle(z, percept.edges, percept.corners, plan=plan),
            ux,
            uy,
            uz,
            percept.half_x,
            percept.half_y,
            percept.half_z,
            percept.edges,
            percept.corners,
        ),
    )
    if plan.obstacles:
        for o in range(percept.obstacles):
            free = ray_to_obstacle(x, y, z, ux, uy, uz, percept.edges, percept.spans, o, plan=plan)
            t = least(t, free)
    # The tree comes last: its search ends at the free distance that walls and obstacles have left.
    if plan.scene:
        t = least(t, bvh.cast(x, y, z, ux, uy, uz, t, ZERO, percept.shapes, percept.nodes, percept.links))
    return t


def cast(
    percept: Any, ux: float, uy: float, uz: float, length: float, radius: float, *, plan: Plan, model: Model
) -> Any:
    """Free distance (m) for a sphere of this radius (m) along the unit vector u, at most `length` (m)."""
    # Rays are counted: metrics report what a law spends on seeing.
    percept.counts[0] += 1
    x = -percept.centre_x
    y = -percept.centre_y
    z = -percept.centre_z
    t = length
    if plan.ray is not rays.to_nothing:
        sides = plan.ray is rays.to_polygon  # which stand in the scene; here are floor and ceiling
        rule = rays.to_box if sides else plan.ray
        t = least(
            t,
            rule(
                x, y, height_above_middle(z, percept.edges, percept.corners, plan=plan), ux, uy, uz,
                LIMIT if sides else percept.half_x - radius, LIMIT if sides else percept.half_y - radius,
                percept.half_z - radius if plan.dimensions == 3 else LIMIT, percept.edges, 0,
            ),
        )  # fmt: skip
    if plan.scene and model.sight is not None:
        # Few shapes in sight lie in the list of this decision; where they did not fit (-1), the
        # cast walks the tree.
        if percept.gathered >= 0:
            t = bvh.cast_near(x, y, z, ux, uy, uz, t, radius, percept.shapes, percept.near, percept.gathered)
        else:
            t = bvh.cast(x, y, z, ux, uy, uz, t, radius, percept.shapes, percept.nodes, percept.links)
    return t


def percept_words(percept: Any, draw: int) -> Any:
    """Random words of this agent and decision."""
    return random.draw(
        percept.agent, percept.step, MODEL + 256 * draw, percept.world, percept.seed_low, percept.seed_high
    )


def normal(percept: Any, draw: int) -> Any:
    """Normal random number N(0, 1) of this agent and decision."""
    w0, w1, w2, w3 = percept_words(percept, draw)
    a, b = random.normal_pair(w0, w1)
    return a


def uniform(percept: Any, draw: int) -> Any:
    """Uniform random number between 0 and 1."""
    w0, w1, w2, w3 = percept_words(percept, draw)
    return random.uniform(w0)
