"""Perceive: own state as measured, the others' as heard; the ring of past states, and faults, behind the delay.

Of a sensor whose errors are added along each axis, those of what is measured and of what is sent
are drawn apart. Any other measures once: what an agent sends is its state with the errors of its
last measurement.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from airflock.core import FIRST_DRAW, random
from airflock.engine.plan import Plan
from airflock.engine.stages import faults
from airflock.engine.stages.noise import Draw, normals, uniforms
from airflock.engine.stages.state import FlockRows, Row, agent_numbers, record_from_rows
from airflock.engine.stages.words import *

SENSOR = random.SENSOR


class ErrorFunctions(NamedTuple):
    """`wander` and `err` as functions of the driver, each once for all rows."""

    wander: Callable[..., Any]
    err: Callable[..., Any]


def wander(m: int, q: Row, u: Row, g: Row, flock: FlockRows, numbers: Any, *, plan: Plan) -> None:
    """Errors along one axis after one more measurement: of the position, and of the velocity."""
    # The Langevin error keeps this short form (one axis at a time): written as `measure` it would
    # be one loop over a dozen rows. `gnss` through `measure` costs 1.19 times this flight.
    for i in range(m):
        q[i], u[i] = call_rule(
            plan.sensor.error, dx=q[i], dv=u[i], g=g[i], period=numbers.c.period,
            s=agent_numbers(i, "s", flock, numbers, plan=plan),
        )  # fmt: skip


def err(m: int, place: Row, rate: Row, x: Row, v: Row, q: Row, u: Row) -> None:
    """Positions and velocities along one axis with their errors."""
    # A loop of its own over rows that are known to lie apart, so that it is one loop of vectors.
    for i in range(m):
        place[i] = x[i] + q[i]
        rate[i] = v[i] + u[i]


def snapshot(flock: FlockRows, slot: int, m: int, ring: Any, *, plan: Plan) -> None:
    """Put the state that is sent, and the faults by which, into the slot of the ring from which it will be heard."""
    # What is sent carries the error of the sender's last measurement, and the faults of the moment
    # of sending: beside each state the ring holds the columns of faults that disturb it. Faults
    # replaced within the delay stay as sent.
    for i in range(m):
        for a in range(plan.dimensions):
            ring[slot, a, i] = (
                flock.position[a][i] + flock.own_error[a][i] if plan.senses and not plan.sees else flock.position[a][i]
            )
        for a in range(plan.dimensions):
            ring[slot, a + plan.dimensions, i] = (
                flock.velocity[a][i] + flock.own_drift[a][i] if plan.senses and not plan.sees else flock.velocity[a][i]
            )
    for c, name, what in plan.sent_faults:
        for i in range(m):
            ring[slot, c, i] = flock.fault(name, what)[i]


def draw_sensor_numbers(flock: FlockRows, whole: Any, decision: int, m: int, *, plan: Plan, drawn: Draw) -> None:
    """Random numbers that a sensor asks for: g0 to g11, u0 to u3."""
    # Only the numbers that the rule takes are drawn: Philox and normal numbers are a third of a
    # small flight.
    if rule_asks(plan.sensor.measure, "g0", "g1", "g2", "g3"):
        normals(flock, flock.errors, whole, decision, SENSOR + 256 * FIRST_DRAW, m, 0, drawn)
    if rule_asks(plan.sensor.measure, "g4", "g5", "g6", "g7"):
        normals(flock, flock.errors, whole, decision, SENSOR + 256 * (FIRST_DRAW + 1), m, 4, drawn)
    if rule_asks(plan.sensor.measure, "g8", "g9", "g10", "g11"):
        normals(flock, flock.errors, whole, decision, SENSOR + 256 * (FIRST_DRAW + 2), m, 8, drawn)
    if rule_asks(plan.sensor.measure, "u0", "u1", "u2", "u3"):
        uniforms(flock, flock.chances, whole, decision, SENSOR + 256 * (FIRST_DRAW + 3), m, drawn)


def measure(lanes: Iterable[int], flock: FlockRows, numbers: Any, time: Any, *, plan: Plan) -> None:
    """Own states by the rule of the sensor, and how far they are off."""
    x, v, g, u = flock.position, flock.velocity, flock.errors, flock.chances
    for i in lanes:
        t = call_rule(
            plan.sensor.measure, **row_components("", x, i), **row_components("v", v, i),
            memory=record_from_rows(i, plan.sensor.Memory, flock.sense), **{"g" + str(c): g[c][i] for c in range(12)},
            **{"u" + str(c): u[c][i] for c in range(4)}, time=time, period=numbers.c.period,
            s=agent_numbers(i, "s", flock, numbers, plan=plan),
        )  # fmt: skip
        # The error is kept because others hear it too. A second measurement for them would give a
        # receiver two biases and two outages at once.
        for a in range(plan.dimensions):
            flock.measured_position[a][i] = t[a]
            flock.own_error[a][i] = t[a] - x[a][i]
        for a in range(plan.dimensions):
            flock.measured_velocity[a][i] = t[a + 3]
            flock.own_drift[a][i] = t[a + 3] - v[a][i]
        for c in field_indices(plan.sensor.Memory):
            flock.sense[c][i] = t[6][c]


def perceive(  # noqa: C901 - tests of the plan leave one way through
    flock: FlockRows, numbers: Any, whole: Any, decision: int, slot: int, m: int, ring: Any, *, plan: Plan,
    drawn: Draw = None, shared: ErrorFunctions | None = None,
) -> None:  # fmt: skip
    """Advance the errors of what is measured and of what is sent, then measure and hear, with the faults of both."""
    axes, dims = range(plan.dimensions), plan.dimensions
    own, sent = (flock.own_error, flock.own_drift), (flock.sent_error, flock.sent_drift)
    errors = (((own, X), (own, Y), (sent, X), (sent, Y)), ((own, Z), (sent, Z)))
    if plan.senses:
        draw_sensor_numbers(flock, whole, decision, m, plan=plan, drawn=drawn)
        measure(range(m), flock, numbers, real(decision) * numbers.c.period, plan=plan)
    elif plan.has_sensor_error:
        # Four normal numbers of one draw serve four errors: the first draw both axes of a plane,
        # own and sent, the second the height.
        for draw, kinds in enumerate(errors[: dims - 1]):
            normals(flock, flock.errors, whole, decision, SENSOR + 256 * draw, m, 0, drawn)
            for g, ((error, drift), a) in enumerate(kinds):
                if shared is None:
                    wander(m, error[a], drift[a], flock.errors[g], flock, numbers, plan=plan)
                else:
                    call_rule(shared.wander, q=error[a], u=drift[a], g=flock.errors[g])
        for a in axes:
            if shared is None:
                err(
                    m, flock.measured_position[a], flock.measured_velocity[a], flock.position[a], flock.velocity[a],
                    flock.own_error[a], flock.own_drift[a],
                )  # fmt: skip
            else:
                call_rule(
                    shared.err, place=flock.measured_position[a], rate=flock.measured_velocity[a],
                    x=flock.position[a], v=flock.velocity[a], q=flock.own_error[a], u=flock.own_drift[a],
                )  # fmt: skip
    # Without a sensor error, rows of the measured state exist only where a fault may change them.
    elif plan.believes:
        for a in axes:
            for i in range(m):
                flock.measured_position[a][i] = flock.position[a][i]
                flock.measured_velocity[a][i] = flock.velocity[a][i]
    if plan.has_sensor_error and not plan.senses and not plan.sees:
        for a in axes:
            if shared is not None:
                call_rule(
                    shared.err, place=flock.heard_position[a], rate=flock.heard_velocity[a], x=ring[slot, a],
                    v=ring[slot, a + dims], q=flock.sent_error[a], u=flock.sent_drift[a],
                )  # fmt: skip
            else:
                for i in range(m):
                    flock.heard_position[a][i] = ring[slot, a, i] + flock.sent_error[a][i]
                    flock.heard_velocity[a][i] = ring[slot, a + dims, i] + flock.sent_drift[a][i]
    elif plan.late:
        for a in axes:
            for i in range(m):
                flock.heard_position[a][i] = ring[slot, a, i]
                flock.heard_velocity[a][i] = ring[slot, a + dims, i]
    elif plan.told:
        for a in axes:
            for i in range(m):
                flock.heard_position[a][i] = flock.position[a][i]
                flock.heard_velocity[a][i] = flock.velocity[a][i]
    # Faults travel with the packet: what is heard now is disturbed by the columns that stood when
    # it was sent.
    for c, name, what in plan.sent_faults:
        for i in range(m):
            flock.as_sent.fault(name, what)[i] = ring[slot, c, i]
    now = real(decision) * numbers.c.period
    then = now - real(whole.delay) * numbers.c.dt
    x, v, hx, hv = flock.measured_position, flock.measured_velocity, flock.heard_position, flock.heard_velocity
    as_sent = flock.as_sent if plan.late else flock
    # The own state is disturbed by the faults of now, what is heard by those of the moment of
    # sending (`as_sent`).
    for kind in plan.suffers("sense"):
        faults.apply_state_faults(range(m), kind, "believed", decision, now, x, v, flock, numbers, plan=plan)
        if not plan.sees:
            faults.apply_state_faults(range(m), kind, "sent", decision, then, hx, hv, as_sent, numbers, plan=plan)
    for kind in plan.suffers("tell") if not plan.sees else ():
        faults.apply_state_faults(range(m), kind, "told", decision, then, hx, hv, as_sent, numbers, plan=plan)
