"""Receive: which of the others an agent hears, and over two lossy links what it last heard."""

import math
from typing import Any

from airflock.body import radio
from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages.state import Flock
from airflock.engine.stages.words import ONE, SIDES, TINY, ZERO, least, real, vector
from airflock.world.edges import nearest_image

LOSS, LINK = random.LOSS, random.LINK


def pair_number(i: int, j: int, n: int, flock: Flock, whole: Any, *, plan: Plan) -> Any:
    """Number by which random numbers know the pair, whoever else is there."""
    return flock.number[i] * whole.born + flock.number[j] if plan.absence else i * n + j


def drawn(i: int, j: int, n: int, decision: int, stream: int, flock: Flock, whole: Any, *, plan: Plan) -> Any:
    """Random words of the pair."""
    return random.draw(
        pair_number(i, j, n, flock, whole, plan=plan), decision, stream, whole.world, whole.seed_low, whole.seed_high
    )


def by_clock(time: Any, i: int, flock: Flock, *, plan: Plan) -> Any:
    """A time (s) as the clock of agent i tells it."""
    return time + flock.clock[i] if plan.suffers("clock") else time


def receive(  # noqa: C901 - tests of the plan leave one way through
    flock: Flock, numbers: Any, whole: Any, i: int, decision: int, n: int, time: float, late: float, store: Any,
    *, plan: Plan,
) -> None:  # fmt: skip
    """Whom agent i hears now, and on two lossy links the newest packet of each, extrapolated.

    What has just come is kept, too, where agents mind whom they have lost.

    late  : how old a packet is when it arrives, s
    store : of each pair the last packet: position, velocity, time stamp
    """
    axes, dims = range(plan.dimensions), plan.dimensions
    k, w, x = numbers.k, numbers.w, flock.position
    said = [*(flock.heard_position[a] for a in axes), *(flock.heard_velocity[a] for a in axes)]
    if plan.links:
        fast = real(radio.packets(real(decision), k.fast_rate, numbers.c.period))
        slow = real(radio.packets(real(decision), k.slow_rate, numbers.c.period))
    if plan.packets and plan.bits == 64:
        farthest = math.sqrt(k.range * k.range + TINY)  # as d carries its guard
    for j in range(n):
        if plan.periodic:  # neighbours are met at their image
            o = vector()
            for a in axes:
                o[a] = x[a][j] - x[a][i]
            for a in axes:
                o[a] = nearest_image(o[a], getattr(w, SIDES[a]))
            d = math.sqrt(sum(o[a] * o[a] for a in axes) + TINY)
        else:
            d = math.sqrt(sum((x[a][j] - x[a][i]) * (x[a][j] - x[a][i]) for a in axes) + TINY)
        if plan.lossy:
            w0, w1, w2, w3 = drawn(i, j, n, decision, LOSS, flock, whole, plan=plan)
            arrives = random.uniform(w0) >= radio.lost(d, k)
        else:
            arrives = True
        if plan.links:
            w0, w1, w2, w3 = drawn(i, j, n, decision, LINK, flock, whole, plan=plan)
            miss_fast = (ONE - radio.received(d, ZERO, k)) ** fast
            miss_slow = (ONE - radio.received(d, ONE, k)) ** slow
            got = (
                arrives
                & (d <= (farthest if plan.bits == 64 else k.range))
                & (random.uniform(w0) >= miss_fast * miss_slow)
            )
        elif plan.silent:
            got = arrives & (d <= (farthest if plan.bits == 64 else k.range))
        if plan.links or plan.silent:
            if plan.suffers("radio"):
                got = got & (d * d <= least(flock.reach_in[i], flock.reach_out[j]) + TINY)
            if got:
                for c, row in enumerate(said):
                    store[i, c, j] = row[j]
                store[i, 2 * dims, j] = by_clock(time - late, j, flock, plan=plan)
        if plan.links:
            flock.age[j] = by_clock(time, i, flock, plan=plan) - store[i, 2 * dims, j]
            flock.heard[j] = ONE if store[i, 2 * dims, j] > -1e8 else ZERO
            for a in axes:
                flock.latest_position[a][j] = store[i, a, j] + store[i, a + dims, j] * flock.age[j]
            for a in axes:
                flock.latest_velocity[a][j] = store[i, a + dims, j]
        else:
            flock.heard[j] = ONE if arrives else ZERO
            flock.age[j] = late + flock.clock[i] - flock.clock[j] if plan.suffers("clock") else late
