"""Measure: the rules of order parameters at one instant, for pairs, for agents, for clusters and for the flock."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from airflock.core import Mean, Metric, norm
from airflock.engine.plan import Plan
from airflock.engine.stages.records import FlightView
from airflock.engine.stages.scene import find_contacts
from airflock.engine.stages.state import Axes, FlockRows, record_from_table
from airflock.engine.stages.words import *
from airflock.world import nearest_image


class MeasuredMetric(NamedTuple):
    """An order parameter that is measured, and where its numbers lie.

    value : the first of its values among those of all
    row   : the first row of what it remembers in the table of what all remember
    total : the first of what it sums up over pairs, among those of all with the same clock
    """

    metric: Metric
    value: int
    row: int
    total: int


def measured_metrics(plan: Plan, clock: str) -> tuple[MeasuredMetric, ...]:
    """Metrics of a clock, and where their numbers lie."""
    found, value, row, total = [], 0, 0, 0
    # Values and memories are numbered over all metrics, pair totals only among those of one clock,
    # since only these share a loop.
    for metric in plan.metrics:
        if metric.clock == clock:
            found.append(MeasuredMetric(metric, value, row, total))
            total += len(field_indices(metric.Pair))
        value += len(field_indices(metric.Sample))
        row += len(field_indices(metric.Memory))
    return tuple(found)


def mean_of_sum(total: Any, n: int, *, plan: Plan) -> Any:
    """Mean of a vector over n agents, from its sum."""
    return [total[a] / real(n) if a < plan.dimensions else ZERO for a in (X, Y, Z)]


def fill_headings(flock: FlockRows, n: int, *, plan: Plan, summed: str) -> Any:
    """Speed and heading of each agent; returns the means of the flock.

    summed : of what a mean is taken: position x, velocity v, heading h
    """
    axes, x, v, h = range(plan.dimensions), flock.position, flock.velocity, flock.heading
    # Speeds first, as every heading divides by one; the sums of the second loop then read finished
    # rows.
    for i in range(n):
        flock.speed[i] = norm(v[X][i], v[Y][i], v[Z][i])
        f = ONE / flock.speed[i]
        for a in axes:
            h[a][i] = f * v[a][i]
    sx, sv, sh = vector(), vector(), vector()
    for total in (sx, sv, sh):
        for a in axes:
            total[a] = ZERO
    # A CPU compiler drops sums that no rule reads; a GPU kernel would exchange them by shuffles,
    # hence `summed`.
    for i in range(n):
        for total, row in ((sx, x), (sv, v), (sh, h)):
            for a in axes:
                total[a] = total[a] + row[a][i]
    return Mean(  # type: ignore[call-arg]
        *(mean_of_sum(sx, n, plan=plan) if "x" in summed else (ZERO, ZERO, ZERO)),
        *(mean_of_sum(sv, n, plan=plan) if "v" in summed else (ZERO, ZERO, ZERO)),
        *(mean_of_sum(sh, n, plan=plan) if "h" in summed else (ZERO, ZERO, ZERO)),
        real(n),
    )


def field_names(record: Any) -> tuple[str, ...]:
    """Names of the fields of a record."""
    return tuple(record._fields)


def reductions(record: Any, metric: Metric) -> list[str]:
    """Return the reduction of each field of a record of a metric: sum, min or max."""
    return [metric.reduce.get(name, "sum") for name in field_names(record)]


def clear_totals(total: Any, record: Any, metric: Metric) -> None:
    """Totals of a record before its first term."""
    # Written out: one variable of the driver for each field.
    for c, way in enumerate(reductions(record, metric)):
        total[c] = REDUCTION_START[way]


def add_terms(total: Any, t: Any, record: Any, metric: Metric) -> None:
    """Add what a rule returns to the totals of a record."""
    for c, way in enumerate(reductions(record, metric)):
        total[c] = reduce_term(way, total[c], t[c])


def record_of_totals(record: Any, total: Any) -> Any:
    """A record of totals."""
    return record(*[total[c] for c in field_indices(record)])


def shared_record(record: Any, columns: Callable[[str, str], Any], i: int, metric: Metric) -> Any:
    """A record of agent i from columns that a rule of a metric has filled."""
    return record(*[columns(metric.name, name)[i] for name in field_names(record)])


def offset(d: Any, own: Any, x: Axes, j: int, w: Any, *, plan: Plan) -> Any:
    """Put the offset from a place to agent j into the vector d, m; returns its square."""
    for a in range(plan.dimensions):
        d[a] = x[a][j] - own[a]
    if plan.periodic:
        for a in range(plan.dimensions):
            d[a] = nearest_image(d[a], getattr(w, HALF_SIZES[a]))
    # The guard TINY is added here and in the pair loop of the law alike, so that limits compare the
    # same squares.
    return sum(d[a] * d[a] for a in range(plan.dimensions)) + TINY


def sum_pairs(
    flight: FlightView, n: int, m: int, *, metrics: tuple[MeasuredMetric, ...], nearest: bool, abreast: bool
) -> Any:
    """Sum the pair rules of all metrics over the others of each agent; returns the least squared distance, m².

    nearest : whether the least distance is needed; only then, as two minima of the same squares in
              one loop are not vectorised (7 times slower)
    abreast : whether two agents go through the others together, where the least distance is not
              needed
    """
    least2 = FAR
    if any(one.metric.pair is not None for one in metrics):
        # LLVM unrolls a short loop of minima four times, a body of 64 agents, so a flock of 30 runs
        # in its slow remainder. With two agents per turn it unrolls twice, and one reading of the
        # others serves both.
        if abreast and not nearest:
            for h in range((n + 1) // 2):
                i = 2 * h
                last = min(i + 1, n - 1)  # of an odd flock the last one goes with itself
                near2 = sum_pairs_of((i, last), flight, n, m, metrics=metrics, nearest=nearest)
        else:
            for i in range(n):
                near2 = sum_pairs_of((i,), flight, n, m, metrics=metrics, nearest=nearest)
                # The collision clock alone needs the least distance: adding this second minimum to
                # every sample took 7.9 µs instead of 0.95 µs for 50 boids.
                if nearest:
                    least2 = least(least2, near2)
    return least2


def sum_pairs_of(
    agents: tuple[int, ...], flight: FlightView, n: int, m: int, *, metrics: tuple[MeasuredMetric, ...], nearest: bool
) -> Any:
    """Sum the pair rules for these agents, one or two; return the least squared distance, m²."""
    plan, flock, numbers = flight.plan, flight.flock, flight.numbers
    axes, x = range(plan.dimensions), flock.position
    paired = [one for one in metrics if one.metric.pair is not None]
    own, other, sums, others = vector(), vector(), totals(), totals()
    near2 = FAR
    nn = integer(n)
    sides = tuple(zip(agents, (own, other), (sums, others), strict=False))
    # Totals lie in registers over the whole pair loop, for all metrics of this clock at once: the
    # distance of a pair is computed once for all of them.
    for e, at, total in sides:
        for a in axes:
            at[a] = x[a][e]
        for metric, _, _, first in paired:
            for c, way in enumerate(reductions(metric.Pair, metric)):
                total[first + c] = REDUCTION_START[way]
    # The pair loop runs over whole vectors of the others (m of them); `ok` drops the agent itself
    # and the lanes behind the last agent, so that no turn branches.
    for j in range(m):
        for e, at, total in sides:
            d = vector()
            r2 = offset(d, at, x, j, numbers.w, plan=plan)
            r = math.sqrt(r2)
            ok = (integer(j) != integer(e)) & (integer(j) < nn)
            for metric, _, _, first in paired:
                t = call_rule(
                    metric.pair, **components("d", d), r=r, r2=r2, q=numbers.q,
                    lower=(ONE if integer(j) < integer(e) else ZERO),
                )  # fmt: skip
                for c, way in enumerate(reductions(metric.Pair, metric)):
                    total[first + c] = reduce_term(way, total[first + c], choose(ok, t[c], REDUCTION_START[way]))
            if nearest:
                near2 = least(near2, choose(ok, r2, FAR))
    for e, _, total in sides:
        for metric, _, _, first in paired:
            for c, name in enumerate(field_names(metric.Pair)):
                flock.pair(metric.name, name)[e] = total[first + c]
    return near2


def agent_arguments(i: int, flock: FlockRows) -> Any:
    """Of agent i what every rule may ask for: position, velocity, heading and speed."""
    return {
        **row_components("", flock.position, i),
        **row_components("v", flock.velocity, i),
        **row_components("h", flock.heading, i),
        "speed": flock.speed[i],
    }


def call_agent_rule(i: int, pair: Any, shared: Any, kept: Any, mean: Any, flight: FlightView, *, metric: Metric) -> Any:
    """Call the agent rule of a metric for agent i; returns its terms and, where it has a memory, the new memory."""
    flock, numbers = flight.flock, flight.numbers
    return call_rule(
        metric.agent, **agent_arguments(i, flock), excursion=flock.excursion[i], touches=flock.touches[i],
        rays=flock.rays[i], pair=pair, shared=shared, memory=kept, mean=mean, wing=numbers.wing, q=numbers.q,
    )  # fmt: skip


def sum_agents(metric: Metric, row: int, mean: Any, flight: FlightView, n: int, memory: Any) -> Any:
    """Sum the agent rule of a metric over all agents.

    mean        : over the flock
    memory, row : table of what metrics remember, by row and agent, and the first row of this one
    """
    flock, total = flight.flock, totals()
    if metric.agent is not None:
        clear_totals(total, metric.Agent, metric)
        # One agent after another, over true states: pairs and surveys have filled their columns
        # before.
        for i in range(n):
            pair = shared_record(metric.Pair, flock.pair, i, metric) if rule_asks(metric.agent, "pair") else None
            shared = (
                shared_record(metric.Shared, flock.shared, i, metric) if rule_asks(metric.agent, "shared") else None
            )
            # What a metric remembers of an agent changes at every instant that it samples, and only
            # there.
            if rule_asks(metric.agent, "memory"):
                before = record_from_table(i, metric.Memory, memory, row)
                t, kept = call_agent_rule(i, pair, shared, before, mean, flight, metric=metric)
                for c in field_indices(metric.Memory):
                    memory[row + c, i] = kept[c]
            else:
                t = call_agent_rule(i, pair, shared, None, mean, flight, metric=metric)
            add_terms(total, t, metric.Agent, metric)
    return record_of_totals(metric.Agent, total) if metric.agent is not None else None


def measure(
    flight: FlightView, time: float, n: int, m: int, memory: Any, labels: Any, values: Any,
    excursion: Callable[..., Any], survey: Mapping[str, Callable[[], None]],
    clustered: Mapping[str, Callable[..., Any]], *, metrics: tuple[MeasuredMetric, ...], nearest: bool,
    over: Callable[[], Any] | None, abreast: bool, headed: bool, summed: str,
) -> Any:  # fmt: skip
    """Write what metrics sample at one instant into `values`; returns the least distance of a pair, m.

    memory, labels : what metrics remember, by row and agent; two rows of integers, scratch
    excursion      : the stage of this name
    survey         : runs the rule of the whole flock of a metric, by its name, where it has one
    clustered      : finds its clusters
    nearest        : whether the least distance is needed
    abreast        : whether two agents may go through the others of a pair rule together
    headed         : whether rules need speeds, headings or means of the flock
    summed         : of what the flock's mean is taken: position x, velocity v, heading h
    over           : what goes through pairs by cells; None: all pairs
    """
    plan, flock, whole, around, x = flight.plan, flight.flock, flight.whole, flight.around, flight.flock.position
    if headed:  # noqa: SIM108 - a helper of several lines stands where it is assigned
        mean = fill_headings(flock, n, plan=plan, summed=summed)
    else:
        mean = ()
    # By cells from 6,000 agents on (2,000 in a periodic box): below, all pairs in vectors are as
    # fast.
    if over is not None:  # noqa: SIM108 - a helper of several lines stands where it is assigned
        least2 = over()
    else:
        least2 = sum_pairs(flight, n, m, metrics=metrics, nearest=nearest, abreast=abreast)
    if any(rule_asks(one.metric.agent, "excursion") for one in metrics):
        for i in range(n):
            flock.excursion[i] = excursion(
                x[X][i], x[Y][i], x[Z][i], flight.numbers.w, around.edges, around.spans, whole.corners, whole.obstacles,
                around.scene,
            )  # fmt: skip
    if any(rule_asks(one.metric.agent, "touches") for one in metrics):
        find_contacts(flock, flight.numbers, n, around.scene, plan=plan)
    for one in metrics:
        if one.metric.survey is not None:
            survey[one.metric.name]()
    # The engine knows no metric by name: a metric set brings its rules, its parameters and its
    # fitness.
    for metric, value, row, _ in metrics:
        agents = sum_agents(metric, row, mean, flight, n, memory)
        clusters = clustered[metric.name](metric, mean, flight, n, m, labels)
        t = call_rule(
            metric.sample, n=real(n), mean=mean, agents=agents, clusters=clusters, dimensions=real(plan.dimensions),
            time=time, q=flight.numbers.q,
        )  # fmt: skip
        for c in field_indices(metric.Sample):
            values[value + c] = t[c]
    return math.sqrt(least2)
