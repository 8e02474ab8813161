"""Meet: which of those whom an agent hears it meets, where that is not all of them."""

import math
from collections.abc import Iterable
from typing import Any

from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages.receive import by_clock, carried, carries, hear, on_record, sent, unheard
from airflock.engine.stages.state import Flock, tree
from airflock.engine.stages.words import (
    FAR,
    HALF,
    LIMIT,
    ONE,
    SIDES,
    TINY,
    ZERO,
    X,
    Y,
    Z,
    ask,
    choose,
    integer,
    least,
    totals,
    vector,
)  # fmt: skip
from airflock.world import bvh, polygon, rays
from airflock.world.edges import nearest_image

FADE = random.FADE


def pair_number(i: int, j: int, n: int, flock: Flock, whole: Any, *, plan: Plan) -> Any:
    """Number by which the signal between two agents is known, whoever else is there."""
    return flock.number[i] * whole.born + flock.number[j] if plan.absence else i * n + j


def hide(
    i: int, others: Iterable[int], flock: Flock, whole: Any, edges: Any, spans: Any, scene: Any, *, plan: Plan
) -> None:
    """Whom obstacles or the scene hide from agent i, as it believes both to be placed: row `hidden`."""
    x = flock.measured_position
    for j in others:
        flock.hidden[j] = ZERO
        if flock.apart[j] < HALF * FAR:
            r = math.sqrt(flock.apart[j])
            ux = flock.away[X][j] / r
            uy = flock.away[Y][j] / r
            uz = flock.away[Z][j] / r
            free = r
            if plan.obstacles:
                for o in range(whole.obstacles):
                    if plan.obstacle is polygon.prism:
                        free = least(
                            free,
                            polygon.ray_to_prism(
                                x[X][i], x[Y][i], x[Z][i], ux, uy, uz, edges, spans[o, 0], spans[o, 1]
                            ),
                        )
                    else:
                        free = least(free, rays.to_edges(x[X][i], x[Y][i], ux, uy, edges, spans[o, 0], spans[o, 1]))
            if plan.scene:
                free = least(free, bvh.cast(x[X][i], x[Y][i], x[Z][i], ux, uy, uz, r, ZERO, *tree(scene)))
            flock.hidden[j] = ONE if free < r else ZERO


def fade(i: int, others: Iterable[int], n: int, decision: int, flock: Flock, whole: Any, *, plan: Plan) -> None:
    """Normal number of the signal between agent i and each other one, the same both ways: row `fade`."""
    for j in others:
        first = pair_number(i, j, n, flock, whole, plan=plan)
        second = pair_number(j, i, n, flock, whole, plan=plan)
        pair = first if flock.number[i] < flock.number[j] else second
        w0, w1, w2, w3 = random.draw(pair, decision, FADE, whole.world, whole.seed_low, whole.seed_high)
        one, two = random.normal_pair(w0, w1)
        flock.fade[j] = one


def meet(  # noqa: C901 - tests of the plan leave one way through
    flock: Flock, numbers: Any, whole: Any, i: int, others: Iterable[int], n: int, m: int, decision: int, time: float,
    late: float, words: Any, edges: Any, spans: Any, scene: Any, *, plan: Plan, images: bool,
) -> None:  # fmt: skip
    """Whom agent i meets: row `met`. It is judged by what the agent believes, but who is in range by the radio."""
    axes, k, w = range(plan.dimensions), numbers.k, numbers.w
    exact = plan.bits == 64
    range_ = least(k.range, LIMIT)
    range2 = range_ * range_ + TINY if exact and not plan.perturbed else range_ * range_
    ii = integer(i)
    own, true = vector(), vector()
    for a in axes:
        own[a] = flock.measured_position[a][i]
    if plan.perturbed or plan.packets:
        for a in axes:
            true[a] = flock.position[a][i]
    if plan.lossy or plan.links:
        lot = words[flock.number[i] & 3]
    if plan.links:
        fast = sent(decision, k.fast_rate, numbers)
        slow = sent(decision, k.slow_rate, numbers)
    for j in others:
        d, o, packet = vector(), vector(), totals()
        if plan.perturbed or plan.packets:
            for a in axes:
                o[a] = flock.position[a][j] - true[a]
            if plan.periodic:
                for a in axes:
                    o[a] = nearest_image(o[a], getattr(w, SIDES[a]))
            apart2 = sum(o[a] * o[a] for a in axes)
        if plan.packets:
            carried2 = carries(i, j, range_ * range_, flock, plan=plan)
            hear(i, j, apart2, carried2, fast, slow, lot, None, time - late, packet, flock, numbers, plan=plan)
        if plan.packets:
            age = by_clock(time, i, flock, plan=plan) - packet[2 * plan.dimensions]
            for a in axes:
                d[a] = carried(a, age, packet, plan=plan) - own[a]
        else:
            for a in axes:
                d[a] = flock.heard_position[a][j] - own[a]
        if images:
            for a in axes:
                d[a] = nearest_image(d[a], getattr(w, SIDES[a]))
        r2 = sum(d[a] * d[a] for a in axes) + TINY
        if plan.packets:
            hears = (apart2 <= range2) & on_record(age, packet, numbers, plan=plan) & (integer(j) != ii)
        elif plan.perturbed:
            hears = (apart2 <= carries(i, j, range2, flock, plan=plan)) & (integer(j) != ii)
        else:
            hears = (r2 <= range2) & (integer(j) != ii)
        if plan.lossy and not plan.packets:
            distance = math.sqrt(apart2 + TINY if plan.perturbed else r2)
            hears = hears & (random.uniform(lot[j]) >= unheard(distance, ZERO, ZERO, k, plan=plan))
        if plan.meeting("dx") or plan.hides:
            for a in axes:
                flock.away[a][j] = d[a]
        flock.apart[j] = choose(hears, r2, FAR)
    if plan.hides:
        hide(i, others, flock, whole, edges, spans, scene, plan=plan)
    if plan.fades:
        fade(i, others, n, decision, flock, whole, plan=plan)
    ask(
        plan.meets, n=m, dx=flock.away[X], dy=flock.away[Y], dz=flock.away[Z], r2=flock.apart,
        hidden=flock.hidden, fade=flock.fade, met=flock.met, heap=flock.heap, weak=flock.weak, t=numbers.topology,
    )  # fmt: skip
