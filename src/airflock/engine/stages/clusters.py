"""Clusters: linked agents, found one after another, and the rules of an order parameter over each cluster.

A cluster grows from its first agent, which is expanded, then the next of its members, until all
are. The array `state` is 0 for an agent in no cluster yet, 1 for a member of the growing cluster, 2
for a member of an earlier one; `expanded` is 1 for agents with all links checked.
"""

import math
from typing import Any

from airflock.core import Mean, Metric
from airflock.engine.plan import Plan
from airflock.engine.stages.measure import (
    add_terms,
    agent_arguments,
    clear_totals,
    mean_of_sum,
    offset,
    record_of_totals,
    shared_record,
)
from airflock.engine.stages.records import FlightView
from airflock.engine.stages.words import *


def expand_agent(e: int, state: Any, expanded: Any, flight: FlightView, n: int, *, metric: Metric) -> Any:
    """Add the agents that are linked to agent e, and in no cluster yet, to the growing cluster; return their number."""
    plan, flock, numbers, own = flight.plan, flight.flock, flight.numbers, vector()
    for a in range(plan.dimensions):
        own[a] = flock.position[a][e]
    expanded[e] = 1
    fresh = integer(0)
    for j in range(n):
        d = vector()
        r2 = offset(d, own, flock.position, j, numbers.w, plan=plan)
        r = math.sqrt(r2)
        # No branch: `state` and `fresh` are updated by masks, so that the loop over all agents
        # stays a vector loop.
        joins = integer(call_rule(metric.linked, r=r, r2=r2, q=numbers.q) & (state[j] == 0))
        state[j] |= joins
        fresh += joins
    return fresh


def first_unexpanded(state: Any, expanded: Any, n: int) -> Any:
    """The first member of the cluster that grows whose links have not been looked at; -1 if there is none."""
    e = -1
    # A short scan with a break, once per member; it is no part of the loop over pairs.
    for j in range(n):
        if state[j] == 1 and expanded[j] == 0:
            e = j
            break
    return e


def grow_cluster(
    first: int, done: int, state: Any, expanded: Any, flight: FlightView, n: int, *, metric: Metric
) -> Any:
    """Let the cluster of agent `first` grow, where earlier ones hold `done` agents; returns how many it holds."""
    state[first] = 1
    size = 1
    e = first
    while e >= 0:
        fresh = expand_agent(e, state, expanded, flight, n, metric=metric)
        size += fresh
        # Mostly one cluster holds everybody; then the rest need not be expanded.
        if done + size == n:
            break
        e = first_unexpanded(state, expanded, n)
    return size


def call_member(i: int, mean: Any, flight: FlightView, *, metric: Metric) -> Any:
    """Call the member rule of a metric for agent i; mean : over its cluster."""
    flock = flight.flock
    pair = shared_record(metric.Pair, flock.pair, i, metric) if rule_asks(metric.member, "pair") else None
    return call_rule(metric.member, **agent_arguments(i, flock), pair=pair, mean=mean, q=flight.numbers.q)


def mean_from_sums(size: int, s: Any, v: Any, h: Any, mean: Any, *, plan: Plan, metric: Metric) -> Any:
    """Means of a cluster of so many members, from sums, where a rule for members asks for them; else of the flock."""
    return (
        Mean(
            *mean_of_sum(s, size, plan=plan),
            *mean_of_sum(v, size, plan=plan),
            *mean_of_sum(h, size, plan=plan),
            real(size),
        )  # type: ignore[call-arg]
        if metric.member is not None
        else mean
    )


def cluster_mean(size: int, mean: Any, state: Any, flight: FlightView, n: int, *, metric: Metric) -> Any:
    """Means of the cluster that has grown, which has so many members; those of the flock where no rule is for them."""
    plan, flock = flight.plan, flight.flock
    cx, cv, ch = vector(), vector(), vector()
    if metric.member is not None:
        for total in (cx, cv, ch):
            for a in range(plan.dimensions):
                total[a] = ZERO
        # A second pass over the flock, which only metrics with a rule for members pay for.
        for j in range(n):
            if state[j] == 1:
                for total, row in ((cx, flock.position), (cv, flock.velocity), (ch, flock.heading)):
                    for a in range(plan.dimensions):
                        total[a] = total[a] + row[a][j]
    return mean_from_sums(size, cx, cv, ch, mean, plan=plan, metric=metric)


def sum_members(mean: Any, state: Any, flight: FlightView, n: int, *, metric: Metric) -> Any:
    """Sum the member rule of a metric over the cluster that has grown."""
    k = totals()
    if metric.member is not None:
        clear_totals(k, metric.Member, metric)
        # Runs only for metrics with a rule for members, whose terms need the mean of the cluster
        # first.
        for j in range(n):
            if state[j] == 1:
                t = call_member(j, mean, flight, metric=metric)
                add_terms(k, t, metric.Member, metric)
    return record_of_totals(metric.Member, k) if metric.member is not None else None


def sum_clusters(metric: Metric, mean: Any, flight: FlightView, n: int, m: int, labels: Any) -> Any:
    """Sum the cluster rule of a metric over all clusters.

    labels : two rows of integers: `state` and `expanded`
    """
    axes, h = range(flight.plan.dimensions), flight.flock.heading
    u = totals()
    if metric.cluster is not None:
        state = labels[0]
        expanded = labels[1]
        clear_totals(u, metric.Cluster, metric)
        for i in range(m):
            state[i] = 0
            expanded[i] = 0
        done = 0
        first = 0
        # Clusters are found one after another, from the lowest agent in none yet: their order, and
        # so that of all sums, does not depend on who is linked.
        while done < n:
            # `first` never goes back: all before it are in clusters, so looking for starts costs
            # one pass over the flock in all.
            while state[first] != 0:
                first += 1
            size = grow_cluster(first, done, state, expanded, flight, n, metric=metric)
            s = vector()
            for a in axes:
                s[a] = ZERO
            hh = ZERO
            # A mask, not a branch: agents outside the cluster add zero, and the loop over all stays
            # one of vectors.
            for j in range(n):
                inside = ONE if state[j] == 1 else ZERO
                for a in axes:
                    s[a] = s[a] + inside * h[a][j]
                hh += inside * sum(h[a][j] * h[a][j] for a in axes)
                # Members are marked as done in this pass, unless their own rule still has to find
                # them by state 1.
                if metric.member is None:
                    state[j] = integer(2) if state[j] != 0 else integer(0)
            own_mean = cluster_mean(size, mean, state, flight, n, metric=metric)
            members = sum_members(own_mean, state, flight, n, metric=metric)
            if metric.member is not None:
                for j in range(n):
                    state[j] = integer(2) if state[j] != 0 else integer(0)
            done += size
            t = call_rule(
                metric.cluster, n=real(size), **components("h", s), hh=hh, members=members,
                mean=own_mean, q=flight.numbers.q,
            )  # fmt: skip
            add_terms(u, t, metric.Cluster, metric)
    return record_of_totals(metric.Cluster, u) if metric.cluster is not None else None
