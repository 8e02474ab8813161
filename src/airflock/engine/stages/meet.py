"""Meet: which of those whom an agent hears it meets, where that is not all of them."""

import math
from collections.abc import Iterable
from typing import Any

from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages.percept import to_obstacle
from airflock.engine.stages.records import Others, Surroundings
from airflock.engine.stages.state import Flock, everybody, tree
from airflock.engine.stages.words import FAR, HALF, ONE, ZERO, X, Y, Z, ask, least
from airflock.world import bvh

FADE = random.FADE


def pair_number(i: int, j: int, n: int, flock: Flock, whole: Any, *, plan: Plan) -> Any:
    """Number by which the signal between two agents is known, whoever else is there."""
    return flock.number[i] * whole.born + flock.number[j] if plan.absence else i * n + j


def free_way(
    x: Any, y: Any, z: Any, ux: Any, uy: Any, uz: Any, r: Any, whole: Any, around: Surroundings, *, plan: Plan
) -> Any:
    """How far (m) obstacles and the scene leave a ray free on its first r metres."""
    free = r
    if plan.obstacles:
        for o in range(whole.obstacles):
            free = least(free, to_obstacle(x, y, z, ux, uy, uz, around.edges, around.spans, o, plan=plan))
    if plan.scene:
        free = least(free, bvh.cast(x, y, z, ux, uy, uz, r, ZERO, *tree(around.scene)))
    return free


def hide(i: int, others: Iterable[int], flock: Flock, whole: Any, around: Surroundings, *, plan: Plan) -> None:
    """Whom obstacles or the scene hide from agent i, as it believes both to be placed: row `hidden`."""
    x = flock.measured_position
    for j in others:
        flock.hidden[j] = ZERO
        if flock.square[j] < HALF * FAR:
            r = math.sqrt(flock.square[j])
            ux = flock.away[X][j] / r
            uy = flock.away[Y][j] / r
            uz = flock.away[Z][j] / r
            free = free_way(x[X][i], x[Y][i], x[Z][i], ux, uy, uz, r, whole, around, plan=plan)
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


def meet(
    flock: Flock, numbers: Any, whole: Any, around: Surroundings, i: int, others: Iterable[int], n: int, m: int,
    decision: int, *, plan: Plan,
) -> None:  # fmt: skip
    """Whom agent i meets of those whom it hears, as it believes them to be placed: row `met`."""
    if plan.hides:
        hide(i, others, flock, whole, around, plan=plan)
    if plan.fades:
        fade(i, others, n, decision, flock, whole, plan=plan)
    chosen(m, everybody(flock), numbers, plan=plan)


def chosen(n: int, others: Others, numbers: Any, *, plan: Plan) -> None:
    """Ask the topology whom of these n an agent meets: row `met`."""
    ask(
        plan.meets, n=n, dx=others.away[X], dy=others.away[Y], dz=others.away[Z], r2=others.square,
        hidden=others.hidden, fade=others.fade, met=others.met, heap=others.heap, weak=others.weak, t=numbers.topology,
    )  # fmt: skip
