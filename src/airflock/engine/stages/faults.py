"""Faults: the one place where a flight asks the rules of faults, each in the stage that it disturbs.

A fault of an agent is a column: when it began, how long it lasts (0 where there is none), its
numbers, and what its rules want to know of that moment. Columns are written between two steps
(`engine.fault_columns`), and only read here.
"""

from collections.abc import Iterable
from typing import Any

from airflock.core import DISTURBED_STATES, Fault
from airflock.engine.plan import Plan
from airflock.engine.stages.records import FlightView
from airflock.engine.stages.state import Axes, FlockRows, followed_command
from airflock.engine.stages.words import *


def has_fault(i: int, kind: Fault, time: Any, flock: FlockRows, numbers: Any) -> Any:
    """Return True if agent i has a kind of fault at a time (s), within half a step."""
    # The driver only compares times. Which agent has a fault, and when, is decided between two
    # steps, so a fault needs no memory of its own, a snapshot holds it, and any cuts give the same
    # bits.
    return (time - flock.fault(kind.name, "onset")[i] > -HALF * numbers.c.dt) & (
        time - flock.fault(kind.name, "onset")[i] < flock.fault(kind.name, "lasts")[i] - HALF * numbers.c.dt
    )


def struck(
    lanes: Iterable[int], flock: FlockRows, numbers: Any, time: Any, *, plan: Plan, kept: bool
) -> tuple[int, int]:
    """Find the first and the end of the lanes that hold all agents with a fault of motion at a time (s) or later.

    The span may be too wide: it includes a fault that ended within the last step, and lanes between
    affected ones.

    kept : whether velocities before a step are kept until the next call; else each step copies its
           own
    """
    # Velocities before a step are copied at decisions, not at each step: a copy a step became two
    # calls of memcpy, a hundredth of a flight.
    for a in range(plan.dimensions) if kept else ():
        for i in lanes:
            flock.before_step[a][i] = flock.velocity[a][i]
    lowest = LIMIT
    highest = ZERO
    # Lanes are found as reals, by masks: a minimum of integers behind a branch would not become
    # vectors.
    for i in lanes:
        until = ZERO
        for kind in plan.suffers("motion"):
            until = most(until, flock.fault(kind.name, "onset")[i] + flock.fault(kind.name, "lasts")[i])
        on = until > time - numbers.c.dt
        lowest = least(lowest, choose(on, real(i), LIMIT))
        highest = most(highest, choose(on, real(i) + ONE, ZERO))
    first = 0
    end = 0
    if highest > HALF:
        first = int(lowest)
        end = int(highest)
    return first, end


def fault_arguments(i: int, kind: Fault, time: Any, flock: FlockRows, *, plan: Plan) -> Any:
    """Return the arguments of every rule of a fault: `since`, its numbers `f`, and the state when it began."""
    return {
        "since": most(time - flock.fault(kind.name, "onset")[i], ZERO),
        "f": kind.record(*[flock.fault(kind.name, name)[i] for name in kind.fields]),
        **{
            name: flock.fault(kind.name, name)[i] if name[-1] in plan.axes else ZERO
            for name in kind.onset_names
            if not flock.then
        },
    }


def apply_state_faults(
    lanes: Iterable[int], kind: Fault, state: str, decision: int, time: Any, position: Axes, velocity: Axes,
    flock: FlockRows, numbers: Any, *, plan: Plan,
) -> None:  # fmt: skip
    """Disturb states by the rule `sense` or `tell` of a kind of fault; before it begins, keep what it may repeat.

    state : kind of state, as in `core.DISTURBED_STATES`
    time  : when these states were taken, s
    """
    for i in lanes:
        on = has_fault(i, kind, time, flock, numbers)
        # A frozen receiver repeats the last position that it reported, errors included, not the
        # true one, which it never knew. So each decision keeps what the rule last returned for a
        # state without this fault.
        for rows, at in ((position, "at_"), (velocity, "at_v")):
            for a in [a for a in range(plan.dimensions) if at + "xyz"[a] in kind.kept(state)]:
                flock.kept(kind.name, state, at + "xyz"[a])[i] = choose(
                    on & (decision > 0), flock.kept(kind.name, state, at + "xyz"[a])[i], rows[a][i]
                )
        t = call_rule(
            kind.rules[DISTURBED_STATES[state]],
            **row_components("", position, i),
            **row_components("v", velocity, i),
            **fault_arguments(i, kind, time, flock, plan=plan),
            **{
                name: flock.kept(kind.name, state, name)[i] if name[-1] in plan.axes else ZERO
                for name in kind.kept(state)
            },
        )
        for a in range(plan.dimensions):
            position[a][i] = choose(on, t[a], position[a][i])
        for a in range(plan.dimensions):
            velocity[a][i] = choose(on, t[a + 3], velocity[a][i])


def tune(lanes: Iterable[int], decision: int, flock: FlockRows, numbers: Any, whole: Any, *, plan: Plan) -> None:
    """Find the radio range of each agent out and in at a decision, and the lead of its clock now and when it sent."""
    time = real(decision) * numbers.c.period
    if plan.suffers("radio"):
        reach = least(numbers.k.range, LIMIT)
        for i in lanes:
            out = reach
            into = reach
            # Of several faults of the radio the worst one counts, in each direction by itself.
            for kind in plan.suffers("radio"):
                on = has_fault(i, kind, time, flock, numbers)
                t = call_rule(kind.radio, reach=reach, **fault_arguments(i, kind, time, flock, plan=plan))
                out = least(out, choose(on, t[0], reach))
                into = least(into, choose(on, t[1], reach))
            # Squares, because the pair loop compares squares; negative stands for "not at all",
            # which no square can be.
            flock.reach_out[i] = choose(out < ZERO, -ONE, out * out)
            flock.reach_in[i] = choose(into < ZERO, -ONE, into * into)
    if plan.suffers("clock"):
        set_clocks(lanes, flock.clock, time, flock, numbers, plan=plan)
        if plan.late:
            then = time - real(whole.delay) * numbers.c.dt
            set_clocks(lanes, flock.sent_clock, then, flock.as_sent, numbers, plan=plan)


def set_clocks(lanes: Iterable[int], clock: Any, time: Any, flock: FlockRows, numbers: Any, *, plan: Plan) -> None:
    """Fill a row with how far the clocks of agents are ahead at a time (s), by their faults."""
    # Several kinds of clock faults add up, since each is an offset of the same clock.
    for i in lanes:
        ahead = ZERO
        for kind in plan.suffers("clock"):
            on = has_fault(i, kind, time, flock, numbers)
            t = call_rule(kind.clock, **fault_arguments(i, kind, time, flock, plan=plan))
            ahead = ahead + choose(on, t, ZERO)
        clock[i] = ahead


def overrule(agents: Iterable[int], flock: FlockRows, numbers: Any, time: float, *, plan: Plan) -> None:
    """Disturb the commands of this decision."""
    c = flock.command
    # After the law and before the body: a fault of command must be seen by the body and its limits.
    for i in agents:
        for kind in plan.suffers("overrule"):
            t = call_rule(
                kind.overrule, **row_components("c", c, i), **fault_arguments(i, kind, time, flock, plan=plan)
            )
            on = has_fault(i, kind, time, flock, numbers)
            for a in range(plan.dimensions):
                c[a][i] = choose(on, t[a], c[a][i])


def apply_motion_fault(i: int, moved: Any, kind: Fault, time: Any, flight: FlightView) -> Any:
    """Return the velocity after a motion step as the rule `motion` of a kind of fault changes it, m/s."""
    plan, flock = flight.plan, flight.flock
    before, command = flock.before_step, followed_command(flock, plan=plan)
    return call_rule(
        kind.motion, **row_components("v", before, i), **row_components("c", command, i), **components("n", moved),
        dt=flight.numbers.c.dt, **fault_arguments(i, kind, time, flock, plan=plan),
    )  # fmt: skip
