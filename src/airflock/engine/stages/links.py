"""Links by cells: who is linked to whom in a large flock, and the rules of an order parameter over each cluster.

A cluster grows from its first agent: each member in turn looks at the cells around its own, which are as wide as links
reach. Of a cell `left` are those in no cluster yet, in its first places; whoever is reached leaves them, so that nobody
is looked at once more. What is found is that of `clusters` but for the order of sums.
"""

import math
from typing import Any

from airflock.core.contract import Metric
from airflock.core.vocabulary import Mean
from airflock.engine.plan import Plan
from airflock.engine.stages.clusters import mean_over, member
from airflock.engine.stages.measure import add, clear, filled
from airflock.engine.stages.near import apart, placed, wrapped
from airflock.engine.stages.records import Cells, Growing
from airflock.engine.stages.state import Flock
from airflock.engine.stages.words import ZERO, X, Y, Z, ask, real, totals, vector


def joined(
    here: int, tail: int, own: Any, numbers: Any, cells: Cells, grown: Growing, *, plan: Plan, metric: Metric
) -> Any:  # fmt: skip
    """Take whoever is left in a cell and linked to a place into the cluster; returns how many have been reached."""
    k = cells.starts[here]
    end = k + grown.left[here]
    while k < end:
        f = grown.places[k]
        d = vector()
        r2 = apart(d, own, cells.flat, f, numbers.w, plan=plan)
        r = math.sqrt(r2)
        if ask(metric.linked, r=r, r2=r2, q=numbers.q):
            end -= 1
            grown.places[k] = grown.places[end]
            grown.reached[tail] = f
            grown.cell[tail] = here
            tail += 1
        else:
            k += 1
    grown.left[here] = end - cells.starts[here]
    return tail


def expanded(
    f: int, own_cell: int, tail: int, numbers: Any, cells: Cells, grown: Growing, *, plan: Plan, metric: Metric
) -> Any:  # fmt: skip
    """The same of all cells around that of the agent at place f."""
    own, at, low, high, count = vector(), vector(), vector(), vector(), cells.count
    for a in range(plan.dimensions):
        own[a] = cells.flat[a, f]
    placed(at, own_cell, count)
    for a in range(plan.dimensions):
        low[a] = at[a] - 1 if plan.periodic else max(at[a] - 1, 0)
        high[a] = at[a] + 2 if plan.periodic else min(at[a] + 2, count[a])
    if plan.dimensions == 2:
        low[Z] = 0
        high[Z] = 1
    for qz in range(low[Z], high[Z]):
        for qy in range(low[Y], high[Y]):
            row = wrapped(qz, count[Z], plan=plan) * count[Y] + wrapped(qy, count[Y], plan=plan)
            for qx in range(low[X], high[X]):
                here = row * count[X] + wrapped(qx, count[X], plan=plan)
                tail = joined(here, tail, own, numbers, cells, grown, plan=plan, metric=metric)
    return tail


def sums_over(
    done: int, tail: int, s: Any, v: Any, h: Any, flock: Flock, whose: Any, reached: Any, *, plan: Plan, metric: Metric
) -> Any:  # fmt: skip
    """Sums of position, velocity and heading of a cluster, into vectors; returns that of squared headings."""
    for a in range(plan.dimensions):
        h[a] = ZERO
    if metric.member is not None:
        for total in (s, v):
            for a in range(plan.dimensions):
                total[a] = ZERO
    hh = ZERO
    for e in range(done, tail):
        j = whose[reached[e]]
        for a in range(plan.dimensions):
            h[a] = h[a] + flock.heading[a][j]
        hh += sum(flock.heading[a][j] * flock.heading[a][j] for a in range(plan.dimensions))
        if metric.member is not None:
            for total, row in ((s, flock.position), (v, flock.velocity)):
                for a in range(plan.dimensions):
                    total[a] = total[a] + row[a][j]
    return hh


def members_of(
    done: int, tail: int, mean: Any, flock: Flock, numbers: Any, whose: Any, reached: Any, *, metric: Metric
) -> Any:  # fmt: skip
    """Sum the member rule of a metric over a cluster."""
    k = totals()
    if metric.member is not None:
        clear(k, metric.Member, metric)
        for e in range(done, tail):
            j = whose[reached[e]]
            t = member(j, mean, flock, numbers, metric=metric)
            add(k, t, metric.Member, metric)
    return filled(metric.Member, k) if metric.member is not None else None


def clusters_by_cells(
    metric: Metric, mean: Mean, flock: Flock, numbers: Any, n: int, labels: Any, cells: Cells, tally: Any, ident: Any,
    *, plan: Plan,
) -> Any:  # fmt: skip
    """Sum the cluster rule of one metric over all clusters, by cells that are no smaller than links are long.

    labels       : two rows of integers, scratch: places of all agents, cluster by cluster, and their cells
    tally, ident : integers, scratch: how many of a cell are left, and at which places
    """
    u, count, starts = totals(), cells.count, cells.starts
    reached = labels[0]
    cell = labels[1]
    grown = Growing(tally, ident, reached, cell)
    clear(u, metric.Cluster, metric)
    for c in range(count[X] * count[Y] * count[Z]):
        tally[c] = starts[c + 1] - starts[c]
    for e in range(n):
        ident[e] = e
    done = 0
    for here in range(count[X] * count[Y] * count[Z]):
        while tally[here] > 0:
            tally[here] -= 1
            reached[done] = ident[starts[here] + tally[here]]
            cell[done] = here
            tail = done + 1
            e = done
            while e < tail:
                tail = expanded(reached[e], cell[e], tail, numbers, cells, grown, plan=plan, metric=metric)
                e += 1
            s, v, h = vector(), vector(), vector()
            hh = sums_over(done, tail, s, v, h, flock, cells.whose, reached, plan=plan, metric=metric)
            own_mean = mean_over(tail - done, s, v, h, mean, plan=plan, metric=metric)
            members = members_of(done, tail, own_mean, flock, numbers, cells.whose, reached, metric=metric)
            t = ask(
                metric.cluster, n=real(tail - done), hx=h[X], hy=h[Y], hz=h[Z], hh=hh, members=members, mean=own_mean,
                q=numbers.q,
            )  # fmt: skip
            add(u, t, metric.Cluster, metric)
            done = tail
    return filled(metric.Cluster, u)
