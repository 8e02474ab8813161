"""Perceive: own state as measured, the others' as heard; the ring of past states behind the delay."""

from typing import Any

from airflock.body import sensors
from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages import faults
from airflock.engine.stages.noise import normals
from airflock.engine.stages.state import Flock
from airflock.engine.stages.words import X, Y, Z, real

SENSOR = random.SENSOR


def snapshot(flock: Flock, slot: int, m: int, ring: Any, *, plan: Plan) -> None:
    """Put the true state into the slot of the ring from which it will be heard."""
    for i in range(m):
        for a in range(plan.dimensions):
            ring[slot, a, i] = flock.position[a][i]
        for a in range(plan.dimensions):
            ring[slot, a + plan.dimensions, i] = flock.velocity[a][i]


def perceive(  # noqa: C901 - tests of the plan leave one way through
    flock: Flock, numbers: Any, whole: Any, decision: int, slot: int, m: int, ring: Any, *, plan: Plan
) -> None:
    """Advance the errors of what is measured and of what is sent, then measure and hear, with the faults of both."""
    axes, dims = range(plan.dimensions), plan.dimensions
    own, sent = (flock.own_error, flock.own_drift), (flock.sent_error, flock.sent_drift)
    errors = (((own, X), (own, Y), (sent, X), (sent, Y)), ((own, Z), (sent, Z)))
    if plan.noisy:
        for draw, kinds in enumerate(errors[: dims - 1]):
            normals(flock, flock.errors, whole, decision, SENSOR + 256 * draw, m)
            for g, ((error, drift), a) in enumerate(kinds):
                for i in range(m):
                    error[a][i], drift[a][i] = sensors.langevin(
                        error[a][i], drift[a][i], flock.errors[g][i], numbers.c.period, numbers.s
                    )
        for a in axes:
            for i in range(m):
                flock.measured_position[a][i] = flock.position[a][i] + flock.own_error[a][i]
                flock.measured_velocity[a][i] = flock.velocity[a][i] + flock.own_drift[a][i]
    elif plan.believes:
        for a in axes:
            for i in range(m):
                flock.measured_position[a][i] = flock.position[a][i]
                flock.measured_velocity[a][i] = flock.velocity[a][i]
    if plan.noisy:
        for a in axes:
            for i in range(m):
                flock.heard_position[a][i] = ring[slot, a, i] + flock.sent_error[a][i]
                flock.heard_velocity[a][i] = ring[slot, a + dims, i] + flock.sent_drift[a][i]
    elif plan.delayed:
        for a in axes:
            for i in range(m):
                flock.heard_position[a][i] = ring[slot, a, i]
                flock.heard_velocity[a][i] = ring[slot, a + dims, i]
    elif plan.told:
        for a in axes:
            for i in range(m):
                flock.heard_position[a][i] = flock.position[a][i]
                flock.heard_velocity[a][i] = flock.velocity[a][i]
    now = real(decision) * numbers.c.period
    then = now - real(whole.delay) * numbers.c.dt
    x, v, hx, hv = flock.measured_position, flock.measured_velocity, flock.heard_position, flock.heard_velocity
    for kind in plan.suffers("sense"):
        faults.mislead(range(m), kind, kind.sense, now, x, v, flock, numbers, plan=plan)
        faults.mislead(range(m), kind, kind.sense, then, hx, hv, flock, numbers, plan=plan)
    for kind in plan.suffers("tell"):
        faults.mislead(range(m), kind, kind.tell, then, hx, hv, flock, numbers, plan=plan)
