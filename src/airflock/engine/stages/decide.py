"""Decide: a law's rule for the command of each agent, with all that it may ask for."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from airflock.core import Model, Own, norm
from airflock.engine.stages.records import FlightView
from airflock.engine.stages.state import Columns, FlockRows, agent_numbers, record_from_table, scene_tree
from airflock.engine.stages.words import *
from airflock.world import bvh

MAX_GATHERED = 64  # shapes gathered at most; where more are in sight, each cast goes through the tree


def law_asks(model: Model, name: str) -> bool:
    """Return True if a deciding rule of the law takes an argument of this name."""
    return any(rule_asks(rule, name) for rule in model.decide_rules)


def summed_record(i: int, record: Any, rows: Columns, live: Iterable[int]) -> Any:
    """Sums or Walls of agent i; fields that nobody sums are zero."""
    return record(*[rows[c][i] if c in live else ZERO for c in field_indices(record)])


def shared_record(i: int, flock: FlockRows, *, model: Model) -> Any:
    """Return the record Shared of agent i, which the rule of the whole flock has filled."""
    return model.Shared(*[flock.shared("model", name)[i] for name in model.Shared._fields])  # type: ignore[misc, union-attr]


def goal_offset(i: int, a: int, flight: FlightView) -> Any:
    """Offset to the goal of agent i, its own or the flock's, along one axis as it believes, m; zero without a goal."""
    return (
        (flight.flock.goal[a][i] if flight.plan.own else flight.around.scene.aim[a])
        - flight.flock.measured_position[a][i]
        if (flight.plan.goals or flight.plan.own) and a < flight.plan.dimensions
        else ZERO
    )


def add_command(i: int, own: Own, shared: Any, percept: Any, flight: FlightView) -> None:
    """Add what the law's added rule asks for to the command of agent i."""
    plan, model, flock, numbers = flight.plan, flight.model, flight.flock, flight.numbers
    more = call_rule(
        model.added.decide, own=own, shared=shared, percept=percept, period=numbers.c.period, wing=numbers.wing,  # type: ignore[union-attr]
        aero=numbers.aero,
    )  # fmt: skip
    # A law plus another one is the sum of two commands. Only the first has parameters p, so `aero`
    # is a section of its own, and drivers without it keep their text.
    for a in range(plan.dimensions):
        flock.command[a][i] += more[a]


def decide(
    agents: Iterable[int], flight: FlightView, decision: int, time: float, mem: Any, percept_of: Callable[..., Any],
    *, summed: Iterable[int], walled: Iterable[int],
) -> None:  # fmt: skip
    """Ask each agent's law for a command, and keep what it remembers.

    mem            : what the law remembers, by field of its Memory and agent
    percept_of     : makes a record of what is perceived; its fields are those of
                     `passes.percept.record`, in order
    summed, walled : fields of Sums and Walls that neighbours and surfaces have summed
    """
    plan, model, flock, numbers = flight.plan, flight.model, flight.flock, flight.numbers
    whole, around, scene = flight.whole, flight.around, flight.around.scene
    axes, m, w = range(plan.dimensions), flock.measured_position, numbers.w
    perceives = law_asks(model, "percept")
    # One agent after another: laws branch, cast rays and remember, so this loop is no vector loop,
    # and by cells threads share it.
    for i in agents:
        own_p = agent_numbers(i, "p", flock, numbers, plan=plan)
        v = vector()
        for a in axes:
            v[a] = flock.measured_velocity[a][i]
        f = ONE / norm(v[X], v[Y], v[Z])
        own = Own(v[X], v[Y], v[Z], f * v[X], f * v[Y], f * v[Z])
        sums = summed_record(i, model.Sums, flock.sums, summed) if law_asks(model, "sums") else None
        walls = summed_record(i, model.Walls, flock.walls, walled) if law_asks(model, "walls") else None
        shared = shared_record(i, flock, model=model) if law_asks(model, "shared") else None
        memory = record_from_table(i, model.Memory, mem, 0) if law_asks(model, "memory") else None
        if perceives and model.sight is not None:
            # Shapes in sight are gathered once per decision for all rays; beyond 64 each cast walks
            # the tree. By cells threads decide side by side, so each gathers into memory of its own.
            near = np.empty(MAX_GATHERED, np.int64) if plan.grid else scene.near
            counts = np.zeros(2, np.int64) if plan.grid else scene.counts
            counts[0] = 0
            if plan.scene:
                gathered = bvh.gather(
                    m[X][i], m[Y][i], m[Z][i], call_rule(model.sight, p=own_p), *scene_tree(scene), near
                )
            else:
                gathered = 0
        if perceives:
            casts = (near, counts, gathered) if model.sight is not None else ()
            seen = scene_tree(scene) if model.sight is not None or plan.scene else ()
            # What a percept holds depends on the driver only; a rule calls its methods as functions
            # of the driver.
            percept = percept_of(
                time, *[-m[a][i] if a in axes else ZERO for a in (X, Y, Z)],
                *[goal_offset(i, a, flight) for a in (X, Y, Z)], w.half_x, w.half_y, w.half_z,
                flock.number[i], decision, whole.world, whole.seed_low, whole.seed_high, whole.corners,
                whole.obstacles, around.edges, around.spans, *seen, *casts,
            )  # fmt: skip
        o = call_rule(
            model.decide, own=own, sums=sums, walls=walls, shared=shared, memory=memory,
            percept=percept if perceives else None, period=numbers.c.period, wing=numbers.wing, aero=numbers.aero,
            p=own_p,
        )  # fmt: skip
        if model.steer is not None:  # the body takes another kind of command than the law gives
            steered = call_rule(
                model.steer, **components("c", o), own=own, period=numbers.c.period, steer=numbers.steer
            )
            for a in axes:
                flock.command[a][i] = steered[a]
        else:
            for a in axes:
                flock.command[a][i] = o[a]
        if model.added is not None:
            add_command(i, own, shared, percept if perceives else None, flight)
        if law_asks(model, "memory"):
            for c in field_indices(model.Memory):
                mem[c, i] = o[3][c]
        if perceives and model.sight is not None:
            flock.rays[i] = real(counts[0])
