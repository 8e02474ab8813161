"""Decide: a law's rule for the command of each agent, with all that it may ask for."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from airflock.core.contract import Model
from airflock.core.maths import norm
from airflock.core.vocabulary import Own
from airflock.engine.plan import Plan
from airflock.engine.stages.records import Surroundings
from airflock.engine.stages.state import Columns, Flock, entry_of, numbers_of, tree
from airflock.engine.stages.words import ONE, ZERO, X, Y, Z, ask, fields, real, vector, wants
from airflock.world import bvh

NEAR = 64  # shapes gathered at most; where more are in sight, each cast goes through the tree


def asks(model: Model, name: str) -> bool:
    """Whether a rule that decides asks for something by this name."""
    return any(wants(rule, name) for rule in model.deciding)


def added_up(i: int, record: Any, rows: Columns, live: Iterable[int]) -> Any:
    """Sums or Walls of agent i; fields that nobody sums are zero."""
    return record(*[rows[c][i] if c in live else ZERO for c in fields(record)])


def solved(i: int, flock: Flock, *, model: Model) -> Any:
    """What the rule of the whole flock found for agent i."""
    return model.Shared(*[flock.shared("model", name)[i] for name in model.Shared._fields])  # type: ignore[misc, union-attr]


def goal_of(i: int, a: int, flock: Flock, scene: Any, *, plan: Plan) -> Any:
    """Where the goal of agent i is along one axis, m: its own, or that of the flock."""
    return flock.goal[a][i] if plan.own else scene.aim[a]


def offset(i: int, a: int, flock: Flock, scene: Any, *, plan: Plan) -> Any:
    """Offset to the goal along one axis as agent i believes, m; zero where there is none."""
    return (
        goal_of(i, a, flock, scene, plan=plan) - flock.measured_position[a][i]
        if (plan.goals or plan.own) and a < plan.dimensions
        else ZERO
    )


def add(
    i: int, own: Own, shared: Any, percept: Any, flock: Flock, numbers: Any, *, plan: Plan, model: Model
) -> None:  # fmt: skip
    """Add what the law's added rule asks for to the command of agent i."""
    more = ask(
        model.added.decide, own=own, shared=shared, percept=percept, period=numbers.c.period, wing=numbers.wing,  # type: ignore[union-attr]
        aero=numbers.aero,
    )  # fmt: skip
    for a in range(plan.dimensions):
        flock.command[a][i] += more[a]


def decide(
    agents: Iterable[int], flock: Flock, numbers: Any, whole: Any, around: Surroundings, decision: int, time: float,
    mem: Any, percept_of: Callable[..., Any],
    *, plan: Plan, model: Model, summed: Iterable[int], walled: Iterable[int],
) -> None:  # fmt: skip
    """Ask each agent's law for a command, and keep what it remembers.

    mem            : what the law remembers, by field of its Memory and agent
    percept_of     : makes a record of what is perceived; its fields are those of `passes.percept.record`, in order
    summed, walled : fields of Sums and Walls that neighbours and surfaces have summed
    """
    axes, m, w, scene = range(plan.dimensions), flock.measured_position, numbers.w, around.scene
    perceives = asks(model, "percept")
    for i in agents:
        own_p = numbers_of(i, "p", flock, numbers, plan=plan)
        v = vector()
        for a in axes:
            v[a] = flock.measured_velocity[a][i]
        f = ONE / norm(v[X], v[Y], v[Z])
        own = Own(v[X], v[Y], v[Z], f * v[X], f * v[Y], f * v[Z])
        sums = added_up(i, model.Sums, flock.sums, summed) if asks(model, "sums") else None
        walls = added_up(i, model.Walls, flock.walls, walled) if asks(model, "walls") else None
        shared = solved(i, flock, model=model) if asks(model, "shared") else None
        memory = entry_of(i, model.Memory, mem, 0) if asks(model, "memory") else None
        if perceives and model.sight is not None:
            # decided side by side, each agent gathers into memory of its own
            near = np.empty(NEAR, np.int64) if plan.grid else scene.near
            counts = np.zeros(2, np.int64) if plan.grid else scene.counts
            counts[0] = 0
            if plan.scene:
                gathered = bvh.gather(m[X][i], m[Y][i], m[Z][i], ask(model.sight, p=own_p), *tree(scene), near)
            else:
                gathered = 0
        if perceives:
            casts = (near, counts, gathered) if model.sight is not None else ()
            seen = tree(scene) if model.sight is not None or plan.scene else ()
            percept = percept_of(
                time, *[-m[a][i] if a in axes else ZERO for a in (X, Y, Z)],
                *[offset(i, a, flock, scene, plan=plan) for a in (X, Y, Z)], w.half_x, w.half_y, w.half_z,
                flock.number[i], decision, whole.world, whole.seed_low, whole.seed_high, whole.corners,
                whole.obstacles, around.edges, around.spans, *seen, *casts,
            )  # fmt: skip
        o = ask(
            model.decide, own=own, sums=sums, walls=walls, shared=shared, memory=memory,
            percept=percept if perceives else None, period=numbers.c.period, wing=numbers.wing, aero=numbers.aero,
            p=own_p,
        )  # fmt: skip
        for a in axes:
            flock.command[a][i] = o[a]
        if model.added is not None:
            add(i, own, shared, percept if perceives else None, flock, numbers, plan=plan, model=model)
        if asks(model, "memory"):
            for c in fields(model.Memory):
                mem[c, i] = o[3][c]
        if perceives and model.sight is not None:
            flock.rays[i] = real(counts[0])
