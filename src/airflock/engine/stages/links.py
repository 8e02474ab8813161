"""Links by cells: linked agents of a large flock, and the rules of an order parameter over each cluster.

A cluster grows from its first agent: each member in turn looks at the cells around its own, which
are as wide as links reach. The first `left` places of a cell hold its agents in no cluster yet; an
agent that joins leaves them, so that none is visited twice. Results are those of `clusters` except
for the order of sums.
"""

import math
from typing import Any

from airflock.core import Mean, Metric
from airflock.engine.stages.clusters import call_member, mean_from_sums
from airflock.engine.stages.measure import add_terms, clear_totals, record_of_totals
from airflock.engine.stages.near import apart, cell_position, wrap_cell
from airflock.engine.stages.records import FlightView, GrowingClusters, SortedCells
from airflock.engine.stages.words import *


def join_cell(
    here: int, tail: int, own: Any, flight: FlightView, cells: SortedCells, grown: GrowingClusters, *, metric: Metric
) -> Any:
    """Add the linked agents of one cell to the growing cluster; return the new length of `reached`."""
    k = cells.starts[here]
    end = k + grown.left[here]
    while k < end:
        f = grown.places[k]
        d = vector()
        r2 = apart(d, own, cells.flat, f, flight)
        r = math.sqrt(r2)
        if call_rule(metric.linked, r=r, r2=r2, q=flight.numbers.q):
            # An agent that joins is swapped behind those left in the cell, so no agent is visited
            # twice, however dense the flock.
            end -= 1
            grown.places[k] = grown.places[end]
            grown.reached[tail] = f
            grown.cell[tail] = here
            tail += 1
        else:
            k += 1
    grown.left[here] = end - cells.starts[here]
    return tail


def expand_member(
    f: int, own_cell: int, tail: int, flight: FlightView, cells: SortedCells, grown: GrowingClusters, *, metric: Metric
) -> Any:
    """Add the linked agents of all cells around the agent at place f; return the new length of `reached`."""
    plan, own, at, low, high, count = flight.plan, vector(), vector(), vector(), vector(), cells.count
    for a in range(plan.dimensions):
        own[a] = cells.flat[a, f]
    cell_position(at, own_cell, count)
    # Outside a periodic box the range of cells ends at its border; inside one it wraps around.
    for a in range(plan.dimensions):
        low[a] = at[a] - 1 if plan.periodic else max(at[a] - 1, 0)
        high[a] = at[a] + 2 if plan.periodic else min(at[a] + 2, count[a])
    if plan.dimensions == 2:
        low[Z] = 0
        high[Z] = 1
    # Links are no longer than a cell is wide, so the 9 cells of a plane, or 27 in space, hold all
    # partners.
    for qz in range(low[Z], high[Z]):
        for qy in range(low[Y], high[Y]):
            row = wrap_cell(qz, count[Z], plan=plan) * count[Y] + wrap_cell(qy, count[Y], plan=plan)
            for qx in range(low[X], high[X]):
                here = row * count[X] + wrap_cell(qx, count[X], plan=plan)
                tail = join_cell(here, tail, own, flight, cells, grown, metric=metric)
    return tail


def cluster_sums(
    done: int, tail: int, s: Any, v: Any, h: Any, flight: FlightView, whose: Any, reached: Any, *, metric: Metric
) -> Any:
    """Sums of position, velocity and heading of a cluster, into vectors; returns that of squared headings."""
    plan, flock = flight.plan, flight.flock
    for a in range(plan.dimensions):
        h[a] = ZERO
    if metric.member is not None:
        for total in (s, v):
            for a in range(plan.dimensions):
                total[a] = ZERO
    hh = ZERO
    # Only headings are always summed; positions and velocities are read where a rule for members
    # needs their means.
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


def sum_members(
    done: int, tail: int, mean: Any, flight: FlightView, whose: Any, reached: Any, *, metric: Metric
) -> Any:  # fmt: skip
    """Sum the member rule of a metric over a cluster."""
    k = totals()
    if metric.member is not None:
        clear_totals(k, metric.Member, metric)
        # Members lie side by side in `reached`: no other agent is visited.
        for e in range(done, tail):
            j = whose[reached[e]]
            t = call_member(j, mean, flight, metric=metric)
            add_terms(k, t, metric.Member, metric)
    return record_of_totals(metric.Member, k) if metric.member is not None else None


def clusters_by_cells(
    metric: Metric, mean: Mean, flight: FlightView, n: int, labels: Any, cells: SortedCells, tally: Any, ident: Any
) -> Any:
    """Sum the cluster rule of one metric over all clusters, by cells that are no smaller than links are long.

    labels       : two rows of integers, scratch: places of all agents, cluster by cluster, and
                   their cells
    tally, ident : integers, scratch: how many of a cell are left, and at which places
    """
    u, count, starts = totals(), cells.count, cells.starts
    reached = labels[0]
    cell = labels[1]
    grown = GrowingClusters(tally, ident, reached, cell)
    clear_totals(u, metric.Cluster, metric)
    for c in range(count[X] * count[Y] * count[Z]):
        tally[c] = starts[c + 1] - starts[c]
    for e in range(n):
        ident[e] = e
    done = 0
    # One core: growing is sequential by nature. Sums over a cluster come in the order in which
    # members are reached, so they differ from all pairs in the last bits; counts do not.
    for here in range(count[X] * count[Y] * count[Z]):
        while tally[here] > 0:
            tally[here] -= 1
            reached[done] = ident[starts[here] + tally[here]]
            cell[done] = here
            tail = done + 1
            e = done
            # `reached` is the queue of the search, and its finished part the list of members: e
            # follows, tail leads.
            while e < tail:
                tail = expand_member(reached[e], cell[e], tail, flight, cells, grown, metric=metric)
                e += 1
            s, v, h = vector(), vector(), vector()
            hh = cluster_sums(done, tail, s, v, h, flight, cells.whose, reached, metric=metric)
            own_mean = mean_from_sums(tail - done, s, v, h, mean, plan=flight.plan, metric=metric)
            members = sum_members(done, tail, own_mean, flight, cells.whose, reached, metric=metric)
            t = call_rule(
                metric.cluster, n=real(tail - done), **components("h", h), hh=hh, members=members, mean=own_mean,
                q=flight.numbers.q,
            )  # fmt: skip
            add_terms(u, t, metric.Cluster, metric)
            done = tail
    return record_of_totals(metric.Cluster, u)
