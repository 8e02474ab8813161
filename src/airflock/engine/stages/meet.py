"""Meet: which of those whom an agent hears it meets, where that is not all of them."""

import math
from collections.abc import Iterable
from typing import Any

from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages.percept import ray_to_obstacle
from airflock.engine.stages.records import CandidateRows, WorldArrays
from airflock.engine.stages.state import FlockRows, all_agents, scene_tree
from airflock.engine.stages.words import FAR, HALF, ONE, ZERO, X, Y, Z, call_rule, least
from airflock.world import bvh

FADE = random.FADE


def pair_number(i: int, j: int, n: int, flock: FlockRows, whole: Any, *, plan: Plan) -> Any:
    """Number by which the signal between two agents is known, whoever else is there."""
    return flock.number[i] * whole.born + flock.number[j] if plan.absence else i * n + j


def free_distance(
    x: Any, y: Any, z: Any, ux: Any, uy: Any, uz: Any, r: Any, whole: Any, around: WorldArrays, *, plan: Plan
) -> Any:
    """How far (m) obstacles and the scene leave a ray free on its first r metres."""
    free = r
    if plan.obstacles:
        # Each cast is cut at the free way so far, so that later ones end sooner.
        for o in range(whole.obstacles):
            free = least(free, ray_to_obstacle(x, y, z, ux, uy, uz, around.edges, around.spans, o, plan=plan))
    if plan.scene:
        free = least(free, bvh.cast(x, y, z, ux, uy, uz, r, ZERO, *scene_tree(around.scene)))
    return free


def fill_hidden(
    i: int, others: Iterable[int], flock: FlockRows, whole: Any, around: WorldArrays, *, plan: Plan
) -> None:
    """Whom obstacles or the scene hide from agent i, as it believes both to be placed: row `hidden`."""
    x = flock.measured_position
    # A cast through the tree of shapes branches and cannot be a vector, so it has a loop of its own, and only agents
    # in range are cast at.
    for j in others:
        flock.hidden[j] = ZERO
        if flock.square[j] < HALF * FAR:
            r = math.sqrt(flock.square[j])
            ux = flock.away[X][j] / r
            uy = flock.away[Y][j] / r
            uz = flock.away[Z][j] / r
            free = free_distance(x[X][i], x[Y][i], x[Z][i], ux, uy, uz, r, whole, around, plan=plan)
            flock.hidden[j] = ONE if free < r else ZERO


def fill_fade(
    i: int, others: Iterable[int], n: int, decision: int, flock: FlockRows, whole: Any, *, plan: Plan
) -> None:
    """Normal number of the signal between agent i and each other one, the same both ways: row `fill_fade`."""
    for j in others:
        first = pair_number(i, j, n, flock, whole, plan=plan)
        second = pair_number(j, i, n, flock, whole, plan=plan)
        # The pair is numbered by the lower number first, so that the signal is the same both ways.
        pair = first if flock.number[i] < flock.number[j] else second
        w0, w1, w2, w3 = random.draw(pair, decision, FADE, whole.world, whole.seed_low, whole.seed_high)
        one, two = random.normal_pair(w0, w1)
        flock.fade[j] = one


def meet(
    flock: FlockRows, numbers: Any, whole: Any, around: WorldArrays, i: int, others: Iterable[int], n: int, m: int,
    decision: int, *, plan: Plan,
) -> None:  # fmt: skip
    """Whom agent i meets of those whom it hears, as it believes them to be placed: row `met`."""
    if plan.hides:
        fill_hidden(i, others, flock, whole, around, plan=plan)
    if plan.fades:
        fill_fade(i, others, n, decision, flock, whole, plan=plan)
    call_topology(m, all_agents(flock), numbers, plan=plan)


def call_topology(n: int, others: CandidateRows, numbers: Any, *, plan: Plan) -> None:
    """Ask the topology whom of these n an agent meets: row `met`."""
    # The k-th least distance is a limit, and an agent exactly on it is met, too: no number of an agent decides, and a
    # flock that is its own mirror image stays so.
    call_rule(
        plan.meets, n=n, dx=others.away[X], dy=others.away[Y], dz=others.away[Z], r2=others.square,
        hidden=others.hidden, fade=others.fade, met=others.met, heap=others.heap, weak=others.weak, t=numbers.topology,
    )  # fmt: skip
