"""Start: the places of agents when a flight begins, and the distance of a place outside the arena."""

from collections.abc import Callable
from typing import Any

from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages.percept import height_above_middle
from airflock.engine.stages.records import WorldArrays
from airflock.engine.stages.state import FlockRows, scene_tree
from airflock.engine.stages.words import *
from airflock.scenarios import FORMATIONS
from airflock.world import bvh, inside, start as places

START = random.START
SPEEDS, OFFSETS = START + 256, START + 512  # further draws of the same agent
ATTEMPTS = 20_000  # draws per agent before a start fails; validation refuses crowded arenas before
EXTENTS = ("extent_x", "extent_y", "extent_z")


def excursion(
    x: Any, y: Any, z: Any, w: Any, edges: Any, spans: Any, corners: int, obstacles: int, scene: Any, *, plan: Plan
) -> Any:
    """Return how far a position is outside the arena, or inside an obstacle, m; negative elsewhere."""
    e = plan.excursion(
        x, y, height_above_middle(z, edges, corners, plan=plan), w.half_x, w.half_y, w.half_z, edges, corners
    )
    if plan.obstacles:
        # The deepest of all: outside the arena, inside an obstacle, inside a shape of the scene.
        for o in range(obstacles):
            e = most(e, -plan.obstacle(x, y, z, edges, spans[o, 0], spans[o, 1]).distance)
    if plan.scene:
        e = most(e, -bvh.nearest(x, y, z, LIMIT, *scene_tree(scene)).distance)
    return e


def try_place(
    i: int, attempt: int, s: Any, w: Any, whole: Any, around: WorldArrays, excursion: Callable[..., Any], *, plan: Plan
) -> Any:
    """Put a random place of agent i into the vector s, m; returns whether it lies in the region of the start."""
    w0, w1, w2, w3 = random.draw(i, attempt, START, whole.world, whole.seed_low, whole.seed_high)
    for a, word in zip(range(plan.dimensions), (w0, w1, w2), strict=False):
        s[a] = places.spread(random.uniform(word), -getattr(w, EXTENTS[a]), getattr(w, EXTENTS[a]))
    # In a world without walls the test always holds, but compilers cannot see it: 26 instructions
    # of a GPU kernel.
    free = (
        excursion(s[X], s[Y], s[Z], w, around.edges, around.spans, whole.corners, whole.obstacles, around.scene)
        <= -w.wall_clearance
        if plan.bounded
        else True
    )
    if plan.start == "ball":
        free = free & places.in_ball(s[X], s[Y], s[Z], w.extent_x)
    return free


def is_free(free: Any, s: Any, w: Any, scene: Any, *, plan: Plan) -> Any:
    """Return True if a place that is free so far keeps `start.clearance` from the scene and is inside no mesh."""
    if plan.scene:
        if free:
            free = bvh.nearest(s[X], s[Y], s[Z], w.clearance, *scene_tree(scene)).distance >= w.clearance
        # Parity of crossings is wrong where buildings of a city model overlap (inside both it is
        # even); a winding number over the closed parts is not. Of three lines two decide, as one
        # may pass through an edge of two triangles.
        if plan.has_mesh and free:
            free = inside(s[X], s[Y], s[Z], *scene_tree(scene)) < HALF
    return free


def heading_off(i: int, w: Any, whole: Any, *, plan: Plan) -> Any:
    """Velocity of agent i at the start, in a random direction, m/s."""
    w0, w1, w2, w3 = random.draw(i, 0, SPEEDS, whole.world, whole.seed_low, whole.seed_high)
    gx, gy = random.normal_pair(w0, w1)
    gz, _ = random.normal_pair(w2, w3)
    return places.heading_off(gx, gy, gz if plan.dimensions == 3 else ZERO, w.speed)


def place_in_formation(i: int, s: Any, w: Any, whole: Any, *, plan: Plan) -> None:
    """Put the place of agent i in a formation into the vector s, off it by `start.jitter`, m."""
    f, g = vector(), vector()
    f[X], f[Y], f[Z] = FORMATIONS[plan.start](i, w.spacing_x, w.spacing_y, w.spacing_z)
    w0, w1, w2, w3 = random.draw(i, 0, OFFSETS, whole.world, whole.seed_low, whole.seed_high)
    g[X], g[Y] = random.normal_pair(w0, w1)
    g[Z], _ = random.normal_pair(w2, w3)
    # Jitter is a normal offset from the own place, drawn by number, so that a formation is the same
    # for every size of flock.
    for a in range(plan.dimensions):
        s[a] = f[a] + w.jitter * g[a]


def begin(  # noqa: C901 - tests of the plan leave one way through
    flock: FlockRows, numbers: Any, whole: Any, around: WorldArrays, n: int, m: int, start: Any,
    excursion: Callable[..., Any], *, plan: Plan,
) -> int:  # fmt: skip
    """Place all agents at rest or at start speed; returns minus the first agent (from 1) that found no room.

    start     : positions and velocities that are handed over, (component, agent)
    excursion : the stage of this name
    """
    axes, x, v, w = range(plan.dimensions), flock.position, flock.velocity, numbers.w
    # Lanes without an agent must be far away from the start: at the origin they would be met by
    # vector loops.
    for i in range(m):
        for a in axes:
            x[a][i] = AWAY
            v[a][i] = ZERO
    if plan.given_start:
        for i in range(n):
            for a in axes:
                x[a][i] = start[a, i]
            for a in axes:
                v[a][i] = start[a + plan.dimensions, i]
        return 0
    # Formations need no search: their places are apart by construction, and all fly along x.
    if plan.start in FORMATIONS:
        for i in range(n):
            s = vector()
            place_in_formation(i, s, w, whole, plan=plan)
            for a in axes:
                x[a][i] = s[a]
            v[X][i] = w.speed
        return 0
    for i in range(n):
        placed = False
        # Rejection sampling, agent by agent: a place depends only on the seed and on agents with
        # lower numbers, so the same start comes out on every device.
        for attempt in repeat(ATTEMPTS):
            s = vector()
            free = try_place(i, attempt, s, w, whole, around, excursion, plan=plan)
            for j in range(i if w.separation > ZERO else 0):
                free = free & (sum((s[a] - x[a][j]) * (s[a] - x[a][j]) for a in axes) >= w.separation * w.separation)
            # The dear test, through the tree of shapes, comes last and only for places that are
            # free so far.
            free = is_free(free, s, w, around.scene, plan=plan)
            if free:
                for a in axes:
                    x[a][i] = s[a]
                placed = True
                break
        if not placed:
            return -(i + 1)
        if w.speed > ZERO:
            u = vector()
            u[X], u[Y], u[Z] = heading_off(i, w, whole, plan=plan)
            for a in axes:
                v[a][i] = u[a]
    return 0
