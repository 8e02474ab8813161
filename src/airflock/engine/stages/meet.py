"""Meet: the topology chooses which of the agents that it hears an agent takes into account."""

import math
from collections.abc import Iterable
from typing import Any

from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages.percept import ray_to_obstacle
from airflock.engine.stages.records import CandidateRows, FlightView
from airflock.engine.stages.state import FlockRows, all_agents, scene_tree
from airflock.engine.stages.words import *
from airflock.world import bvh

FADE = random.FADE


def pair_number(i: int, j: int, n: int, flock: FlockRows, whole: Any, *, plan: Plan) -> Any:
    """Return the number of a pair, from which its signal is drawn; it does not depend on other agents."""
    return flock.number[i] * whole.born + flock.number[j] if plan.absence else i * n + j


def free_distance(x: Any, y: Any, z: Any, ux: Any, uy: Any, uz: Any, r: Any, flight: FlightView) -> Any:
    """Return the free length of a ray within its first r metres, past obstacles and the scene, m."""
    plan, around = flight.plan, flight.around
    free = r
    if plan.obstacles:
        # Each cast is cut at the free way so far, so that later ones end sooner.
        for o in range(flight.whole.obstacles):
            free = least(free, ray_to_obstacle(x, y, z, ux, uy, uz, around.edges, around.spans, o, plan=plan))
    if plan.scene:
        free = least(free, bvh.cast(x, y, z, ux, uy, uz, r, ZERO, *scene_tree(around.scene)))
    return free


def fill_hidden(i: int, others: Iterable[int], flight: FlightView) -> None:
    """Fill the row `hidden`: 1 where obstacles or the scene hide another agent from agent i, by believed places."""
    flock, x = flight.flock, flight.flock.measured_position
    # A cast through the tree of shapes branches and cannot be a vector, so it has a loop of its
    # own, and only agents in range are cast at.
    for j in others:
        flock.hidden[j] = ZERO
        if flock.square[j] < HALF * FAR:
            r = math.sqrt(flock.square[j])
            ux = flock.away[X][j] / r
            uy = flock.away[Y][j] / r
            uz = flock.away[Z][j] / r
            free = free_distance(x[X][i], x[Y][i], x[Z][i], ux, uy, uz, r, flight)
            flock.hidden[j] = ONE if free < r else ZERO


def fill_fade(i: int, others: Iterable[int], n: int, decision: int, flight: FlightView) -> None:
    """Fill the row `fade`: normal number of the signal between agent i and each other one, the same both ways."""
    plan, flock, whole = flight.plan, flight.flock, flight.whole
    for j in others:
        first = pair_number(i, j, n, flock, whole, plan=plan)
        second = pair_number(j, i, n, flock, whole, plan=plan)
        # The pair is numbered by the lower number first, so that the signal is the same both ways.
        pair = first if flock.number[i] < flock.number[j] else second
        w0, w1, w2, w3 = random.draw(pair, decision, FADE, whole.world, whole.seed_low, whole.seed_high)
        one, two = random.normal_pair(w0, w1)
        flock.fade[j] = one


def meet(flight: FlightView, i: int, others: Iterable[int], n: int, m: int, decision: int) -> None:
    """Fill the row `met` of agent i: 1 for each agent that it hears and its topology chooses, by believed places."""
    if flight.plan.hides:
        fill_hidden(i, others, flight)
    if flight.plan.fades:
        fill_fade(i, others, n, decision, flight)
    call_topology(m, all_agents(flight.flock), flight)


def call_topology(n: int, others: CandidateRows, flight: FlightView) -> None:
    """Fill the row `met` by the rule of the topology, for these n agents."""
    # The k-th least distance is a limit, and an agent exactly on it is met, too: no number of an
    # agent decides, and a flock that is its own mirror image stays so.
    call_rule(
        flight.plan.meets, n=n, **components("d", others.away), r2=others.square,
        hidden=others.hidden, fade=others.fade, met=others.met, heap=others.heap, weak=others.weak,
        t=flight.numbers.topology,
    )  # fmt: skip
