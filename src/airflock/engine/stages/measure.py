"""Measure: the rules of order parameters at one instant, for pairs, for agents, for clusters and for the flock."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from airflock.core.contract import Metric
from airflock.core.maths import norm
from airflock.core.vocabulary import Mean
from airflock.engine.plan import Plan
from airflock.engine.stages.records import Surroundings
from airflock.engine.stages.scene import contacts
from airflock.engine.stages.state import Axes, Flock, entry_of
from airflock.engine.stages.words import (
    FAR,
    ONE,
    SIDES,
    START,
    TINY,
    ZERO,
    X,
    Y,
    Z,
    ask,
    choose,
    fields,
    integer,
    least,
    real,
    reduced,
    totals,
    vector,
    wants,
)  # fmt: skip
from airflock.world.edges import nearest_image


class Measured(NamedTuple):
    """An order parameter that is measured, and where its numbers lie.

    value : the first of its values among those of all
    row   : the first row of what it remembers in the table of what all remember
    total : the first of what it sums up over pairs, among those of all with the same clock
    """

    metric: Metric
    value: int
    row: int
    total: int


def measured(plan: Plan, clock: str) -> tuple[Measured, ...]:
    """Metrics of a clock, and where their numbers lie."""
    found, value, row, total = [], 0, 0, 0
    for metric in plan.metrics:
        if metric.clock == clock:
            found.append(Measured(metric, value, row, total))
            total += len(fields(metric.Pair))
        value += len(fields(metric.Sample))
        row += len(fields(metric.Memory))
    return tuple(found)


def means(total: Any, n: int, *, plan: Plan) -> Any:
    """Mean of a vector over n agents, from its sum."""
    return [total[a] / real(n) if a < plan.dimensions else ZERO for a in (X, Y, Z)]


def headings(flock: Flock, n: int, *, plan: Plan, summed: str) -> Any:
    """Speed and heading of each agent; returns the means of the flock.

    summed : of what a mean is taken: position x, velocity v, heading h
    """
    axes, x, v, h = range(plan.dimensions), flock.position, flock.velocity, flock.heading
    for i in range(n):
        flock.speed[i] = norm(v[X][i], v[Y][i], v[Z][i])
        f = ONE / flock.speed[i]
        for a in axes:
            h[a][i] = f * v[a][i]
    sx, sv, sh = vector(), vector(), vector()
    for total in (sx, sv, sh):
        for a in axes:
            total[a] = ZERO
    for i in range(n):
        for total, row in ((sx, x), (sv, v), (sh, h)):
            for a in axes:
                total[a] = total[a] + row[a][i]
    return Mean(  # type: ignore[call-arg]
        *(means(sx, n, plan=plan) if "x" in summed else (ZERO, ZERO, ZERO)),
        *(means(sv, n, plan=plan) if "v" in summed else (ZERO, ZERO, ZERO)),
        *(means(sh, n, plan=plan) if "h" in summed else (ZERO, ZERO, ZERO)),
        real(n),
    )


def names_of(record: Any) -> tuple[str, ...]:
    """Names of the fields of a record."""
    return tuple(record._fields)


def ways(record: Any, metric: Metric) -> list[str]:
    """How each field of a record of a metric adds up: sum, min or max."""
    return [metric.reduce.get(name, "sum") for name in names_of(record)]


def clear(total: Any, record: Any, metric: Metric) -> None:
    """Totals of a record before its first term."""
    for c, way in enumerate(ways(record, metric)):
        total[c] = START[way]


def add(total: Any, t: Any, record: Any, metric: Metric) -> None:
    """Add what a rule returns to the totals of a record."""
    for c, way in enumerate(ways(record, metric)):
        total[c] = reduced(way, total[c], t[c])


def filled(record: Any, total: Any) -> Any:
    """A record of totals."""
    return record(*[total[c] for c in fields(record)])


def found(record: Any, columns: Callable[[str, str], Any], i: int, metric: Metric) -> Any:
    """A record of agent i from columns that a rule of a metric has filled."""
    return record(*[columns(metric.name, name)[i] for name in names_of(record)])


def offset(d: Any, own: Any, x: Axes, j: int, w: Any, *, plan: Plan) -> Any:
    """Put the offset from a place to agent j into the vector d, m; returns its square."""
    for a in range(plan.dimensions):
        d[a] = x[a][j] - own[a]
    if plan.periodic:
        for a in range(plan.dimensions):
            d[a] = nearest_image(d[a], getattr(w, SIDES[a]))
    return sum(d[a] * d[a] for a in range(plan.dimensions)) + TINY


def pairs(
    flock: Flock, numbers: Any, n: int, m: int, *, plan: Plan, metrics: tuple[Measured, ...], nearest: bool,
    abreast: bool,
) -> Any:  # fmt: skip
    """Sum the pair rules of all metrics over the others of each agent; returns the least squared distance, m².

    nearest : whether the least distance is asked for. Only then: two minima of the same squares in one loop are not
              vectorised (7 times slower)
    abreast : whether two agents go through the others together, where it is not. One reading of the others serves
              both; and LLVM, which repeats a short loop of minima four times for vectors of 64 agents, does so twice
    """
    least2 = FAR
    if any(one.metric.pair is not None for one in metrics):
        if abreast and not nearest:
            for h in range((n + 1) // 2):
                i = 2 * h
                last = min(i + 1, n - 1)  # of an odd flock the last one goes with itself
                near2 = pairs_of((i, last), flock, numbers, n, m, plan=plan, metrics=metrics, nearest=nearest)
        else:
            for i in range(n):
                near2 = pairs_of((i,), flock, numbers, n, m, plan=plan, metrics=metrics, nearest=nearest)
                if nearest:
                    least2 = least(least2, near2)
    return least2


def pairs_of(
    agents: tuple[int, ...], flock: Flock, numbers: Any, n: int, m: int,
    *, plan: Plan, metrics: tuple[Measured, ...], nearest: bool,
) -> Any:  # fmt: skip
    """The same of these agents, one or two."""
    axes, x = range(plan.dimensions), flock.position
    paired = [one for one in metrics if one.metric.pair is not None]
    own, other, sums, others = vector(), vector(), totals(), totals()
    near2 = FAR
    nn = integer(n)
    sides = tuple(zip(agents, (own, other), (sums, others), strict=False))
    for e, at, total in sides:
        for a in axes:
            at[a] = x[a][e]
        for metric, _, _, first in paired:
            for c, way in enumerate(ways(metric.Pair, metric)):
                total[first + c] = START[way]
    for j in range(m):
        for e, at, total in sides:
            d = vector()
            r2 = offset(d, at, x, j, numbers.w, plan=plan)
            r = math.sqrt(r2)
            ok = (integer(j) != integer(e)) & (integer(j) < nn)
            for metric, _, _, first in paired:
                t = ask(
                    metric.pair, dx=d[X], dy=d[Y], dz=d[Z], r=r, r2=r2, q=numbers.q,
                    lower=(ONE if integer(j) < integer(e) else ZERO),
                )  # fmt: skip
                for c, way in enumerate(ways(metric.Pair, metric)):
                    total[first + c] = reduced(way, total[first + c], choose(ok, t[c], START[way]))
            if nearest:
                near2 = least(near2, choose(ok, r2, FAR))
    for e, _, total in sides:
        for metric, _, _, first in paired:
            for c, name in enumerate(names_of(metric.Pair)):
                flock.pair(metric.name, name)[e] = total[first + c]
    return near2


def moving(i: int, flock: Flock) -> Any:
    """Of agent i what every rule may ask for: position, velocity, heading and speed."""
    return {
        "x": flock.position[X][i], "y": flock.position[Y][i], "z": flock.position[Z][i], "speed": flock.speed[i],
        "vx": flock.velocity[X][i], "vy": flock.velocity[Y][i], "vz": flock.velocity[Z][i],
        "hx": flock.heading[X][i], "hy": flock.heading[Y][i], "hz": flock.heading[Z][i],
    }  # fmt: skip


def judged(
    i: int, pair: Any, shared: Any, kept: Any, mean: Any, flock: Flock, numbers: Any, *, metric: Metric
) -> Any:  # fmt: skip
    """What the agent rule of a metric says of agent i; and, where it remembers, what it is to remember."""
    return ask(
        metric.agent, **moving(i, flock), excursion=flock.excursion[i], touches=flock.touches[i], rays=flock.rays[i],
        pair=pair, shared=shared, memory=kept, mean=mean, wing=numbers.wing, q=numbers.q,
    )  # fmt: skip


def agents_of(metric: Metric, row: int, mean: Any, flock: Flock, numbers: Any, n: int, memory: Any) -> Any:
    """Sum the agent rule of a metric over all agents.

    mean        : over the flock
    memory, row : table of what metrics remember, by row and agent, and the first row of this one
    """
    total = totals()
    if metric.agent is not None:
        clear(total, metric.Agent, metric)
        for i in range(n):
            pair = found(metric.Pair, flock.pair, i, metric) if wants(metric.agent, "pair") else None
            shared = found(metric.Shared, flock.shared, i, metric) if wants(metric.agent, "shared") else None
            if wants(metric.agent, "memory"):
                before = entry_of(i, metric.Memory, memory, row)
                t, kept = judged(i, pair, shared, before, mean, flock, numbers, metric=metric)
                for c in fields(metric.Memory):
                    memory[row + c, i] = kept[c]
            else:
                t = judged(i, pair, shared, None, mean, flock, numbers, metric=metric)
            add(total, t, metric.Agent, metric)
    return filled(metric.Agent, total) if metric.agent is not None else None


def measure(
    flock: Flock, numbers: Any, whole: Any, around: Surroundings, time: float, n: int, m: int, memory: Any, labels: Any,
    values: Any,
    excursion: Callable[..., Any], survey: Mapping[str, Callable[[], None]],
    clustered: Mapping[str, Callable[..., Any]],
    *, plan: Plan, metrics: tuple[Measured, ...], nearest: bool, over: Callable[[], Any] | None,
    abreast: bool, headed: bool, summed: str,
) -> Any:  # fmt: skip
    """Write what metrics sample at one instant into `values`; returns the least distance of a pair, m.

    memory, labels : what metrics remember, by row and agent; two rows of integers, scratch
    excursion      : the stage of this name
    survey         : runs the rule of the whole flock of a metric, by its name, where it has one
    clustered      : finds its clusters
    nearest        : whether the least distance is asked for
    abreast        : whether two agents may go through the others of a pair rule together
    headed         : whether speeds, headings or means of the flock are asked for
    summed         : of what the flock's mean is taken: position x, velocity v, heading h
    over           : what goes through pairs by cells; None: all pairs
    """
    x = flock.position
    if headed:  # noqa: SIM108 - a helper of several lines stands where it is assigned
        mean = headings(flock, n, plan=plan, summed=summed)
    else:
        mean = ()
    if over is not None:  # noqa: SIM108 - a helper of several lines stands where it is assigned
        least2 = over()
    else:
        least2 = pairs(flock, numbers, n, m, plan=plan, metrics=metrics, nearest=nearest, abreast=abreast)
    if any(wants(one.metric.agent, "excursion") for one in metrics):
        for i in range(n):
            flock.excursion[i] = excursion(
                x[X][i], x[Y][i], x[Z][i], numbers.w, around.edges, around.spans, whole.corners, whole.obstacles,
                around.scene,
            )  # fmt: skip
    if any(wants(one.metric.agent, "touches") for one in metrics):
        contacts(flock, numbers, n, around.scene, plan=plan)
    for one in metrics:
        if one.metric.survey is not None:
            survey[one.metric.name]()
    for metric, value, row, _ in metrics:
        agents = agents_of(metric, row, mean, flock, numbers, n, memory)
        clusters = clustered[metric.name](metric, mean, flock, numbers, n, m, labels, plan=plan)
        t = ask(
            metric.sample, n=real(n), mean=mean, agents=agents, clusters=clusters, dimensions=real(plan.dimensions),
            time=time, q=numbers.q,
        )  # fmt: skip
        for c in fields(metric.Sample):
            values[value + c] = t[c]
    return math.sqrt(least2)
