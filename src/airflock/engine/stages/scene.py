"""Scene: goals on their way, shapes that appear, and who touches what stands there."""

import math
from typing import Any

from airflock.engine.plan import Plan
from airflock.engine.stages.state import FlockRows, scene_tree
from airflock.engine.stages.words import *
from airflock.world import bvh, goals


def apart(i: int, centre: Any, flock: FlockRows, *, plan: Plan) -> Any:
    """Squared distance of agent i from the centre of the flock, m²."""
    return sum((flock.position[a][i] - centre[a]) * (flock.position[a][i] - centre[a]) for a in range(plan.dimensions))


def move_goal(flock: FlockRows, numbers: Any, time: float, elapsed: float, n: int, scene: Any, *, plan: Plan) -> int:
    """Send the goal on its way, for the flock's centre as it is.

    time, elapsed : since the start, and since the goal last moved, s
    """
    x, w, at, axes = flock.position, numbers.w, scene.aim, range(plan.dimensions)
    number = int(at[3])
    if number >= len(scene.goals):
        return 0
    s = vector()
    for a in axes:
        s[a] = ZERO
    for i in range(n):
        for a in axes:
            s[a] = s[a] + x[a][i]
    centre = (s[X] / real(n), s[Y] / real(n), s[Z] / real(n))
    target = (scene.goals[number, X], scene.goals[number, Y], scene.goals[number, Z])
    if plan.is_shepherd:
        c, f = vector(), vector()
        c[X], c[Y], c[Z] = centre
        stray = GONE
        for a in (X, Y, Z):
            f[a] = c[a]
        # A shepherd drives the agent that has strayed farthest; of several as far, the first one.
        for i in range(n):
            if apart(i, c, flock, plan=plan) > stray:
                stray = apart(i, c, flock, plan=plan)
                for a in axes:
                    f[a] = x[a][i]
        g = goals.herd(
            at[X], at[Y], at[Z], *target, *centre, f[X], f[Y], f[Z], w.goal_spread, w.goal_behind, w.goal_radius,
            w.goal_speed * elapsed if w.goal_speed > ZERO else FAR,
        )  # fmt: skip
    else:
        g = goals.pursue(
            at[X], at[Y], at[Z], *target, *centre, w.goal_radius,
            w.goal_speed * elapsed if w.goal_speed > ZERO else FAR,
        )  # fmt: skip
    for a in (X, Y, Z):
        at[a] = g[a]
    if g.reached > HALF:
        scene.reached[number] = time
        at[3] += ONE
    return 0


def move_own_goals(flock: FlockRows, numbers: Any, time: float, n: int, scene: Any, *, plan: Plan) -> int:
    """Send each agent's own goal on its way from where the agent was when all set out.

    aim[0] keeps when they set out, s. aim[3] keeps how long all are under way, s: the longest way
    at goals.speed, which a smooth course exceeds by half; it is negative where points are new, so
    that all set out now.
    """
    x, w, at, axes = flock.position, numbers.w, scene.aim, range(plan.dimensions)
    who = flock.number
    if (time <= ZERO) | (at[3] < ZERO):
        at[X] = time
        far = ZERO
        for i in range(n):
            for a in axes:
                flock.departed[a][i] = x[a][i]
            far = most(far, sum((scene.goals[who[i], a] - x[a][i]) * (scene.goals[who[i], a] - x[a][i]) for a in axes))
        # All goals are under way for the same time on straight ways. With least squared ways no two
        # come nearer than the spacing over the root of 2 (Turpin, Michael & Kumar 2014), so
        # flocking only mends what noise and wind disturb.
        at[3] = 1.5 * math.sqrt(far) / w.goal_speed if w.goal_speed > ZERO else ZERO
    for i in range(n):
        for a in axes:
            flock.goal[a][i] = goals.glide(flock.departed[a][i], scene.goals[who[i], a], time - at[X], at[3])
    return 0


def let_appear(flock: FlockRows, numbers: Any, time: float, n: int, scene: Any) -> int:
    """Let stand what is due, as soon as nobody is in its place.

    A shape waits until every agent is at start.clearance from its bounds, so that nothing appears
    on top of a drone.
    """
    x, w, later = flock.position, numbers.w, scene.later
    for r in range(len(later)):
        if (later[r, 6] >= ZERO) and (later[r, 6] <= time):
            free = True
            # Every agent is looked at: shapes appear a few times in a flight, so the search need
            # not be quick.
            for i in range(n):
                if bvh.beside(x[X][i], x[Y][i], x[Z][i], later, r) <= w.clearance * w.clearance:
                    free = False
            if free:
                shape = int(later[r, 7])
                later[r, 6] = GONE
                # A shape that is not due yet has its bounds at 1e9 m: all loops test bounds first,
                # so no cast tests a time.
                for c in repeat(6):
                    scene.shapes[shape, c] = later[r, c]
    return 0


def find_contacts(flock: FlockRows, numbers: Any, n: int, scene: Any, *, plan: Plan) -> None:
    """Find which agents have touched the scene since the positions were last looked at."""
    x, before, axes = flock.position, flock.before, range(plan.dimensions)
    if plan.scene:
        # At the first look there is no way yet: the agent is taken to have stood where it is.
        if scene.counts[1] == 0:
            for i in range(n):
                for a in axes:
                    before[a][i] = x[a][i]
        scene.counts[1] = 1
    # A contact is tested along the way since the last look, so that a fast agent cannot pass
    # through a thin wall between two.
    for i in range(n):
        if plan.scene:
            flock.touches[i] = bvh.touches(
                before[X][i],
                before[Y][i],
                before[Z][i],
                x[X][i],
                x[Y][i],
                x[Z][i],
                numbers.q.r_body,
                *scene_tree(scene),
            )
            for a in axes:
                before[a][i] = x[a][i]
        else:
            flock.touches[i] = ZERO
