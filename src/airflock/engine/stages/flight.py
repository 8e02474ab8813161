"""Flight: the order of the stages in a step of a flight, and in a recording that is measured."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from airflock.core import Metric
from airflock.engine.plan import Plan
from airflock.engine.stages.approach import BEGUN, CALM, ENDED, GAP, SLACK, TRAVELLED, approach_bound, start_drift
from airflock.engine.stages.measure import MeasuredMetric
from airflock.engine.stages.records import FlightView
from airflock.engine.stages.state import FlockRows
from airflock.engine.stages.words import *

Stages = Mapping[str, Callable[..., Any]]  # by name, called with their arguments by name
Order = Mapping[str, tuple[str, ...]]  # stages of each event that a plan has (`engine.schedule`)
Sampled = Iterable[tuple[int, str]]  # places among all values, and how they add up over time
# Measured at 1,000,000 boids: rearranging every 16 decisions costs 3 % more, every 256 the same as
# every 64.
ENFORCED = ("stop", "overrule")  # what acts on a command whoever gave it
EVERY = 64  # decisions from one rearrangement to the next; a boid crosses about a cell meanwhile


def add_up(sums: Any, values: Any, sampled: Sampled, count: int) -> None:
    """Add the values of one instant to the sums over time; sums[count] counts instants."""
    # Which value adds up in which way is known when the driver is made: the loop is written out,
    # without a test.
    for c, way in sampled:
        if way in ("mean", "sum"):
            sums[c] += values[c]
        else:
            sums[c] = min(sums[c], values[c]) if way == "min" else max(sums[c], values[c])
    sums[count] += 1


def metric_range(metrics: tuple[Metric, ...], q: Any) -> Any:
    """Return the distance beyond which pairs contribute to no metric, m."""
    # The widest radius of all metrics on this clock: one loop serves all of them, so the least
    # eager one decides.
    return most(metric_range(metrics[:-1], q), call_rule(metrics[-1].within, q=q)) if metrics else ZERO


def reset_metric_memory(metrics: tuple[MeasuredMetric, ...], memory: Any, n: int) -> None:
    """Reset the memory of metrics to its start values."""
    # Metrics and fields are written out; the loop over agents is the one that remains in the
    # driver.
    for one in metrics:
        for c, start in enumerate(getattr(one.metric.Memory, "_field_defaults", {}).values()):
            for i in range(n):
                memory[one.row + c, i] = float(start)


def keep(frame: int, flock: FlockRows, frames: Any, n: int, *, plan: Plan, slots: bool) -> None:
    """Keep positions, velocities and commands as a frame: frames[frame, component, agent]."""
    # A frame is kept by number, so that a reader need not know where agents lay in memory.
    for i in range(n):
        for part, row in enumerate((flock.position, flock.velocity, flock.command)):
            for a in range(plan.dimensions):
                c = part * plan.dimensions + a
                frames[frame, c, row_index(flock.number[i]) if slots else i] = row[a][i]


def keep_frame(step: int, first: int, frames: Any, whole: Any, *, stages: Stages) -> None:
    """Keep a frame, where there are any.

    The first frame is that of the first sample at or after the step `first`. The size of the array
    decides whether a flight is recorded, not the plan: one driver flies with and without a
    recording.
    """
    # A driver with and one without frames would be two compilations for `run --save`; one
    # comparison a sample is cheaper.
    if frames.shape[0] > 0:
        frame = step // whole.sample_every - (first + whole.sample_every - 1) // whole.sample_every
        call_rule(stages["keep"], frame=frame)


def turns(n: int, *, stages: Stages, order: tuple[str, ...]) -> Any:
    """Each agent in turn meets its neighbours, decides and moves, so that the next one sees it there.

    Returns the largest squared speed.
    """
    fastest = ZERO
    # Each agent senses, decides and moves before the next one: the authors' boids update in turn,
    # and the order shows.
    for i in range(n):
        for name in order[:-1]:
            call_rule(stages[name], i=i)
        fastest = most(fastest, call_rule(stages[order[-1]], i=i))
    return fastest


def sample_stage(
    name: str, time: Any, values: Any, sums: Any, *, stages: Stages, sampled: Mapping[str, tuple[Sampled, int]]
) -> None:
    """Call a stage that measures, and add its values to the sums."""
    call_rule(stages[name], time=time)
    add_up(sums, values, *sampled[name])


def prepare(
    held: Any, flock: FlockRows, whole: Any, m: int, past: Any, *, stages: Stages, order: Order, slots: bool
) -> None:
    """Number the slots and fill the ring of sent states, once the agents have their places."""
    if slots:
        for i in range(m):
            flock.number[i] = i
    if order["send"]:
        # Before the first step all packets in the ring are the state at the start, so that an agent
        # hears its neighbours from the first decision on.
        for slot in range(whole.ring):
            call_rule(stages["snapshot"], slot=slot, ring=past)
    if order["queue"]:
        for slot in range(whole.ring):
            call_rule(stages["first_command"], slot=slot, ring=past)
    held[BEGUN] = ONE


def sense(
    step: int, time: Any, late: Any, numbers: Any, whole: Any, past: Any, *, plan: Plan, stages: Stages, order: Order
) -> None:
    """Do the first half of a step: send, change the world and, unless agents take turns, decide."""
    # The ring holds what is under way: slot k of the ring is heard at decision k, `delay` steps
    # after it was sent.
    for name in order["send"]:
        if (step + whole.delay) % whole.decide_every == 0:
            call_rule(stages[name], slot=((step + whole.delay) // whole.decide_every) % whole.ring, ring=past)
    for name in order["world"]:
        call_rule(stages[name], time=time, elapsed=numbers.c.dt)
    if not plan.sequential and step % whole.decide_every == 0:
        k = step // whole.decide_every
        # A policy outside of the flight commands between the halves of a step.
        for name in [each for each in order["decide"] if not (plan.observes and each in ENFORCED)]:
            # Rearranging moves every row of the work table, so it waits for EVERY decisions; cells
            # stay nearly sorted meanwhile.
            if name != "rearrange" or k % EVERY == 0:
                call_rule(stages[name], k=k, k_=k, slot=k % whole.ring, ring=past, time=time, late=late)


def advance(  # noqa: C901 - tests of the plan leave one way through
    first: int, last: int, half: int, held: Any, flock: FlockRows, numbers: Any, whole: Any, n: int, m: int, past: Any,
    memory: Any, values: Any, sums: Any, frames: Any,
    *, plan: Plan, stages: Stages, order: Order, sampled: Mapping[str, tuple[Sampled, int]],
    watched: tuple[MeasuredMetric, ...], drifts: bool, foretold: bool, collided: int, slots: bool,
) -> int:  # fmt: skip
    """Fly the steps first to last - 1; returns the next one, or minus the first agent (from 1) that found no room.

    half, held : as `passes.driver.flight` says
    past       : states that are not heard yet, by slot, component and agent
    sampled    : by stage: values that it samples, and which of the sums counts its instants
    watched    : metrics that look for collisions, if all of them promise a distance beyond which
                 there are none
    drifts     : whether it counts how fast agents are beside the drift of the flock, or how fast
                 they are
    foretold   : whether the least distance of a pair is looked for alone, as long as there is
                 nothing to measure
    collided   : place of the value that ends a flight, where a scenario says so
    slots      : whether agents lie in slots
    """
    late = real(whole.delay) * numbers.c.dt
    # A call flies a part of a flight; only the first one places the agents.
    if held[BEGUN] < HALF:
        status = call_rule(stages["begin"])
        if status < 0:
            return status  # type: ignore[no-any-return]
        prepare(held, flock, whole, m, past, stages=stages, order=order, slots=slots)
    travelled = held[TRAVELLED]
    gap = held[GAP]
    calm = held[CALM] > HALF
    fastest = ZERO
    following = last
    hurt_first = 0
    hurt_end = 0
    for step in range(first, last):
        time = real(step) * numbers.c.dt
        if plan.sequential or (step != first) | (half & 1 == 0):
            sense(step, time, late, numbers, whole, past, plan=plan, stages=stages, order=order)
        # The first half of a step ends before anybody moves, so that a caller can overrule commands.
        # Where agents take turns, those who sense and those who move alternate: no place to cut.
        if not plan.sequential and half & 2 != 0:
            break
        for name in [each for each in order["decide"] if plan.observes and each in ENFORCED]:
            if step % whole.decide_every == 0:
                call_rule(stages[name], time=time)
        for name in order["watch"]:
            if step % whole.collide_every == 0:
                # Collisions count at every step, but pairs are looked at only when two agents can
                # have closed the gap since the last look. Positions move by the old velocity, so
                # the bound is exact; SLACK covers rounding. This makes collisions at every step
                # cost a few per cent instead of doubling the flight.
                if drifts and travelled >= gap:
                    start_drift(held, flock, n, plan=plan)
                # While nobody is in contact only the least distance is searched, each pair once:
                # the pair rules have nothing to say yet. The search is a function of its own, since
                # standing twice in the loop cost half a second of compiling.
                if foretold and calm and travelled >= gap:
                    gap = (
                        call_rule(stages["nearest"])
                        - metric_range(tuple(one.metric for one in watched), numbers.q)
                        - SLACK
                    )
                    travelled = ZERO
                if watched and travelled < gap:  # no pair can have come near enough since the last check
                    # The instant counts although no pair was looked at: `within` promises that
                    # metrics contribute nothing beyond it.
                    sums[sampled[name][1]] += 1
                    if not calm:
                        reset_metric_memory(watched, memory, n)
                        calm = True
                elif watched:
                    near = call_rule(stages[name], time=time)
                    add_up(sums, values, *sampled[name])
                    gap = near - metric_range(tuple(one.metric for one in watched), numbers.q) - SLACK
                    travelled = ZERO
                    calm = False
                else:
                    sample_stage(name, time, values, sums, stages=stages, sampled=sampled)
        if plan.stop and values[collided] > HALF:
            held[ENDED] = ONE
            following = step
            break
        if step % whole.sample_every == 0:
            for name in order["sample"]:
                sample_stage(name, time, values, sums, stages=stages, sampled=sampled)
            keep_frame(step, first, frames, whole, stages=stages)
        if step < whole.steps:
            # Columns of faults are written between two calls and agents change places at decisions
            # only, so it is enough to search the affected lanes here; searching at every step cost
            # two passes over the flock.
            if plan.struck and (step == first or step % whole.decide_every == 0):  # between, agents keep their places
                hurt_first, hurt_end = call_rule(stages["struck"], time=time)
            for name in order["queue"]:
                if step % whole.decide_every == 0:
                    call_rule(stages[name], slot=step // whole.decide_every % whole.ring, ring=past)
            for name in order["obey"]:
                # One round of the ring is added: before the first command is due the number of the
                # decision is negative.
                if (step - whole.lag) % whole.decide_every == 0:
                    waited = step - whole.lag + whole.ring * whole.decide_every
                    call_rule(stages[name], slot=waited // whole.decide_every % whole.ring, ring=past)
            fastest = call_rule(stages["turns" if plan.sequential else "move"], step=step, time=time, late=late)
            if drifts:  # noqa: SIM108 - a helper of several lines stands where it is assigned
                nearer = approach_bound(held, fastest, numbers.c.dt)
            else:
                nearer = 2.0 * math.sqrt(fastest) * numbers.c.dt
            travelled += nearer
    # What the next call needs goes back into the array, so that any cuts give the bits of the whole
    # flight.
    held[TRAVELLED] = travelled
    held[GAP] = gap
    held[CALM] = ONE if calm else ZERO
    return following


def measure_frames(
    first: int, flight: FlightView, n: int, values: Any, sums: Any, frames: Any, series: Any, frame_period: float,
    *, stages: Stages, order: Order, sampled: Mapping[str, tuple[Sampled, int]],
) -> int:  # fmt: skip
    """Measure a recording, whose first frame has the number `first`: the values of each frame to `series`.

    frame_period : s
    """
    plan, flock, whole = flight.plan, flight.flock, flight.whole
    # Recordings are measured by the very stages of a flight, so that a score never depends on where
    # it was computed.
    for step in range(first, first + frames.shape[0]):
        time = real(step) * frame_period
        for i in range(n):
            for a in range(plan.dimensions):
                flock.position[a][i] = frames[step - first, a, i]
            for a in range(plan.dimensions):
                flock.velocity[a][i] = frames[step - first, plan.dimensions + a, i]
        for name in order["world"]:
            call_rule(stages[name], time=time, elapsed=frame_period)
        for name in order["watch"]:
            if step % whole.collide_every == 0:
                sample_stage(name, time, values, sums, stages=stages, sampled=sampled)
        for name in order["sample"]:
            if step % whole.sample_every == 0:
                sample_stage(name, time, values, sums, stages=stages, sampled=sampled)
        for c in range(len(values)):
            series[step, c] = values[c]
    return 0
