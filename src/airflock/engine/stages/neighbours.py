"""Neighbours: sum a law's rule over all agents in range of each agent."""

import math
from collections.abc import Callable, Iterable
from typing import Any

from airflock.core.contract import Model
from airflock.core.maths import norm
from airflock.engine.plan import Plan
from airflock.engine.stages.state import Flock, numbers_of
from airflock.engine.stages.words import (
    FAR,
    HALF,
    LIMIT,
    ONE,
    SIDES,
    START,
    TINY,
    ZERO,
    X,
    Y,
    Z,
    ask,
    choose,
    integer,
    least,
    reduced,
    totals,
    vector,
)  # fmt: skip
from airflock.world.edges import nearest_image

# Where an agent meets but some of whom it hears, its others are gone through twice: who is heard, and, of those whom
# it meets, what they say.
BOTH, HEAR, ADD = "both", "hear", "add"


def carries(i: int, j: int, range2: Any, flock: Flock, *, plan: Plan) -> Any:
    """Square of how far agent i hears agent j, m². Over links the last packet that came is heard on and on."""
    return (
        least(least(range2, flock.reach_in[i]), flock.reach_out[j])
        if plan.suffers("radio") and not plan.links
        else range2
    )


def heard_age(i: int, j: int, late: float, flock: Flock, *, plan: Plan) -> Any:
    """How old the data of agent j are, as the clocks of both tell, s."""
    return (
        flock.age[j]
        if plan.lossy or plan.packets
        else (late + flock.clock[i] - flock.clock[j] if plan.suffers("clock") else late)
    )


def neighbours(  # noqa: C901 - tests of the plan leave one way through
    agents: Iterable[int], others: Iterable[int], flock: Flock, numbers: Any, late: float,
    receive: Callable[[int], None], meet: Callable[[int], None], *, plan: Plan, model: Model,
    sums: tuple[tuple[int, str], ...], images: bool,
) -> None:  # fmt: skip
    """Sum the neighbour rule over all others in range of each agent, or over those that its topology lets it meet.

    late    : how old is what is heard, s
    receive : finds whom agent i hears, where packets are lost; meet: whom of them it meets, where that is not all
    sums    : each field of Sums that is summed, and how it is reduced
    images  : whether offsets go to the nearest image (candidates that come by cells are at theirs)
    """
    axes, k, w = range(plan.dimensions), numbers.k, numbers.w
    heard_position = flock.latest_position if plan.links else flock.heard_position
    heard_velocity = flock.latest_velocity if plan.links else flock.heard_velocity
    selective = plan.lossy or plan.packets
    true_range = plan.perturbed  # who is in range is a matter of true distances
    # A neighbour at exactly the range or the reach counts. Squares of distances that carry the guard TINY, which only
    # double precision can tell, are compared with squares that carry it, too.
    exact = plan.bits == 64
    range_ = least(k.range, LIMIT)
    range2 = range_ * range_ + TINY if exact and not true_range else range_ * range_
    if model.reach is not None and not plan.varies("p"):
        near = least(ask(model.reach, p=numbers.p), LIMIT)
        near2 = near * near + TINY if exact else near * near
    for i in agents:
        ii = integer(i)
        own_p = numbers_of(i, "p", flock, numbers, plan=plan)
        if model.reach is not None and plan.varies("p"):
            near = least(ask(model.reach, p=own_p), LIMIT)
            near2 = near * near + TINY if exact else near * near
        if selective:
            receive(i)
        own, v, true, h, total = vector(), vector(), vector(), vector(), totals()
        for a in axes:
            own[a] = flock.measured_position[a][i]
            v[a] = flock.measured_velocity[a][i]
        if plan.dimensions == 2:
            v[Z] = ZERO
        if true_range:
            for a in axes:
                true[a] = flock.position[a][i]
        f = ONE / norm(v[X], v[Y], v[Z])
        for a in (X, Y, Z):
            h[a] = f * v[a]
        for c, how in sums:
            total[c] = START[how]
        for part in (BOTH,) if plan.topology is None else (HEAR, ADD):
            for j in others:
                d, dv, o, nh = vector(), vector(), vector(), vector()
                for a in axes:
                    d[a] = heard_position[a][j] - own[a]
                    dv[a] = heard_velocity[a][j] - v[a]
                if images:
                    for a in axes:
                        d[a] = nearest_image(d[a], getattr(w, SIDES[a]))
                if plan.dimensions == 2:
                    d[Z] = ZERO
                    dv[Z] = ZERO
                r2 = sum(d[a] * d[a] for a in axes) + TINY
                r = math.sqrt(r2)
                speed = math.sqrt(sum(dv[a] * dv[a] for a in axes) + TINY)
                g = ONE / norm(v[X] + dv[X], v[Y] + dv[Y], v[Z] + dv[Z])
                for a in (X, Y, Z):
                    nh[a] = g * (v[a] + dv[a])
                if part == HEAR:
                    flock.square[j] = FAR  # and so it stays where an interpreted driver goes on to the next one
                if part == ADD:
                    ok = flock.met[j] > HALF
                elif true_range:
                    for a in axes:
                        o[a] = flock.position[a][j] - true[a]
                    if plan.periodic:
                        for a in axes:
                            o[a] = nearest_image(o[a], getattr(w, SIDES[a]))
                    ok = (sum(o[a] * o[a] for a in axes) <= carries(i, j, range2, flock, plan=plan)) & (
                        integer(j) != ii
                    )
                else:
                    ok = (r2 <= range2) & (integer(j) != ii)
                if model.reach is not None and (part != HEAR or plan.grid):
                    ok = ok & (r2 <= near2)
                if selective and part != ADD:
                    ok = ok & (flock.heard[j] > HALF)
                if part == HEAR:
                    if plan.meeting("dx") or plan.hides:
                        for a in axes:
                            flock.away[a][j] = d[a]
                    flock.square[j] = choose(ok, r2, FAR)
                else:
                    t = ask(
                        model.neighbour, dx=d[X], dy=d[Y], dz=d[Z], r=r, r2=r2, dvx=dv[X], dvy=dv[Y], dvz=dv[Z],
                        dv=speed, vx=v[X], vy=v[Y], vz=v[Z], hx=h[X], hy=h[Y], hz=h[Z], nhx=nh[X], nhy=nh[Y], nhz=nh[Z],
                        age=heard_age(i, j, late, flock, plan=plan), lower=ONE if integer(j) < ii else ZERO, p=own_p,
                    )  # fmt: skip
                    for c, how in sums:
                        total[c] = reduced(how, total[c], choose(ok, t[c], START[how]))
            if part == HEAR:
                meet(i)
        for c, _ in sums:
            flock.sums[c][i] = total[c]
