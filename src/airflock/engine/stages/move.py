"""Move: one motion step."""

from collections.abc import Callable, Iterable
from typing import Any

from airflock.core import norm
from airflock.engine.plan import Plan
from airflock.engine.stages.approach import velocity_beside_drift
from airflock.engine.stages.faults import apply_motion_fault, has_fault
from airflock.engine.stages.records import FlightView
from airflock.engine.stages.state import FlockRows, agent_numbers, followed_command, record_from_rows
from airflock.engine.stages.words import *


def first_command(flock: FlockRows, slot: int, m: int, ring: Any, *, plan: Plan) -> None:
    """Set the commands that bodies follow until those of the first decision are due: to fly on as they started."""
    v = flock.velocity
    for i in range(m):
        f = ONE / norm(v[X][i], v[Y][i], v[Z][i]) if plan.model.command == "heading" else ONE
        for a in range(plan.dimensions):
            flock.obeyed[a][i] = ZERO if plan.model.command == "acceleration" else f * v[a][i]
            ring[slot, plan.command_in_ring + a, i] = flock.obeyed[a][i]


def queue(flock: FlockRows, slot: int, m: int, ring: Any, *, plan: Plan) -> None:
    """Put the commands of a decision into its slot of the ring, where they wait for the body's dead time."""
    # The ring of what is heard has slots by decisions already; commands are further columns of it.
    # They join it before a motion step and not at the decision, since a caller may overrule them.
    for a in range(plan.dimensions):
        for i in range(m):
            ring[slot, plan.command_in_ring + a, i] = flock.command[a][i]


def obey(flock: FlockRows, slot: int, m: int, ring: Any, *, plan: Plan) -> None:
    """Take the commands that are due out of the ring, for bodies to follow until the next ones are."""
    for a in range(plan.dimensions):
        for i in range(m):
            flock.obeyed[a][i] = ring[slot, plan.command_in_ring + a, i]


def measured_velocity(i: int, a: int, flock: FlockRows, *, plan: Plan) -> Any:
    """Return the own velocity as agent i measures it along one axis, m/s."""
    # The controller feels the true velocity plus the error of the last measurement, so the body
    # flies on between two decisions. It keeps the inertial velocity when satellite navigation
    # fails: a frozen one would be a runaway.
    return (
        flock.velocity[a][i] + flock.own_drift[a][i]
        if plan.has_sensor_error and a < plan.dimensions
        else flock.velocity[a][i]
    )


def apply_body_and_faults(
    lanes: Iterable[int], flight: FlightView, time: Any, g: Any, wind: tuple[Any, Any, Any], hurt_first: int,
    hurt_end: int, *, kept: bool,
) -> None:  # fmt: skip
    """Advance velocities by the rule of the body, then apply faults of motion on the affected lanes."""
    plan, flock, v = flight.plan, flight.flock, flight.flock.velocity
    faults = plan.suffers("motion")
    hurt = () if not faults else lanes if plan.sequential else lanes_between(lanes, hurt_first, hurt_end)
    for i in () if kept else hurt:
        for a in range(plan.dimensions):
            flock.before_step[a][i] = v[a][i]
    # All lanes take the plain loop of the body; rules of faults are called afterwards over the
    # lanes that may suffer. Two loops of the body (with and without faults) gave other last bits
    # and cost more than this second pass.
    apply_body(lanes, flight, time, g, wind)
    # Faults are applied one after another, each to what the one before left of the motion.
    for i in hurt:
        t = (v[X][i], v[Y][i], v[Z][i])
        for kind in faults:
            on = has_fault(i, kind, time, flock, flight.numbers)
            s = apply_motion_fault(i, t, kind, time, flight)
            t = (choose(on, s[X], t[X]), choose(on, s[Y], t[Y]), choose(on, s[Z], t[Z]))
        for a in range(plan.dimensions):
            v[a][i] = t[a]
        for a in range(plan.dimensions) if kept else ():
            flock.before_step[a][i] = t[a]


def apply_body(lanes: Iterable[int], flight: FlightView, time: Any, g: Any, wind: tuple[Any, Any, Any]) -> None:
    """Advance velocities by the rule of the body."""
    plan, flock, numbers = flight.plan, flight.flock, flight.numbers
    v, command = flock.velocity, followed_command(flock, plan=plan)
    # One call of the rule per lane, whatever the body: what it needs of wind, noise or memory is
    # decided when the driver is made, so that the loop has no branch.
    for i in lanes:
        t = call_rule(
            plan.body.move,
            **row_components("v", v, i),
            **row_components("c", command, i),
            mx=measured_velocity(i, X, flock, plan=plan),
            my=measured_velocity(i, Y, flock, plan=plan),
            mz=measured_velocity(i, Z, flock, plan=plan),
            **row_components("g", g, i),
            wx=wind[X],
            wy=wind[Y],
            wz=wind[Z] if plan.dimensions == 3 else ZERO,
            memory=record_from_rows(i, plan.body.Memory, flock.body),
            dt=numbers.c.dt,
            wing=numbers.wing,
            b=agent_numbers(i, "b", flock, numbers, plan=plan),
        )
        for a in range(plan.dimensions):
            v[a][i] = t[a]
        for c in field_indices(plan.body.Memory):
            flock.body[c][i] = t[3][c]


def move(
    agents: Iterable[int], lanes: Iterable[int], flight: FlightView, step: int, n: int, noise: Callable[[], None],
    gusts: Callable[[], Any], held: Any, hurt_first: int, hurt_end: int, *, watched: bool, drifts: bool, kept: bool,
) -> Any:  # fmt: skip
    """Advance velocities by the body and positions by the velocity before or after; return the largest squared speed.

    noise, gusts         : the stages of these names, for this step
    watched              : whether that speed is needed; else it is 0
    drifts, held         : whether it is that beside the drift of the flock (`stages.approach`)
    hurt_first, hurt_end : lanes that hold all agents with a fault of motion
                           (`stages.faults.struck`)
    kept                 : whether their velocities are kept from step to step, so that no step
                           copies them
    """
    plan, flock, numbers = flight.plan, flight.flock, flight.numbers
    x, v = flock.position, flock.velocity
    g = aliases()
    if rule_asks(plan.body.move, "gx", "gy", "gz"):
        noise()
        # One Philox call gives four normal numbers; in a plane two steps share it.
        for a in range(plan.dimensions):
            g[a] = flock.outer[a] if plan.dimensions == 3 or step % 2 == 0 else flock.outer[a + 2]
    time = real(step) * numbers.c.dt
    wx = ZERO
    wy = ZERO
    wz = ZERO
    if plan.windy:
        wx, wy, wz = gusts()
    if plan.integration != "old":
        apply_body_and_faults(lanes, flight, time, g, (wx, wy, wz), hurt_first, hurt_end, kept=kept)
    fastest = ZERO
    # Over whole vectors, with absent lanes counted as standing: the remainder of a loop costs three
    # times as much per agent as its vector part.
    for i in lanes if watched else ():
        if drifts:
            speed2 = sum(
                velocity_beside_drift(i, a, held, flock) * velocity_beside_drift(i, a, held, flock)
                for a in range(plan.dimensions)
            )
        else:
            speed2 = sum(v[a][i] * v[a][i] for a in range(plan.dimensions))
        fastest = most(fastest, choose(integer(i) < integer(n), speed2, ZERO))
    # Positions move by the velocity before the step (the authors' program, integration "old") or
    # after it; `fastest` is that of the velocity that moves them, so the bound on collisions is
    # exact.
    for a in range(plan.dimensions):
        for i in lanes:
            x[a][i] += v[a][i] * numbers.c.dt
    if plan.integration == "old":
        apply_body_and_faults(lanes, flight, time, g, (wx, wy, wz), hurt_first, hurt_end, kept=kept)
    # Edges come last, when the step is done: a periodic box takes the agent to its other side, a
    # mirror turns its velocity.
    if plan.edge_rule:
        for i in agents:
            for a in range(plan.dimensions):
                x[a][i], v[a][i] = plan.edge_rule(x[a][i], v[a][i], getattr(numbers.w, HALF_SIZES[a]))
    return fastest if watched else ZERO
