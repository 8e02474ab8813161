"""Members: the text of a metric's member rule, whatever loop a device runs it in and however it marks a cluster."""

from typing import NamedTuple

from airflock.core.contract import Metric
from airflock.core.vocabulary import Mean, asks
from airflock.engine.passes.build import Builder
from airflock.engine.passes.decide import START


class Members(NamedTuple):
    """Lines around a member rule, in the order in which a device runs them.

    zeros  : the sums c_<row> over the cluster at zero
    rows   : rows that are summed up over the cluster
    mean   : own_mean, the cluster's means; the totals m0, m1, ... of the rule at their first values
    body   : the rule for one agent, as t
    how    : how each field of t goes into its total: sum, min or max
    record : the totals under the name `members`
    """

    zeros: list[str]
    rows: list[str]
    mean: list[str]
    body: list[str]
    how: list[str]
    record: str


def members(build: Builder, metric: Metric, at: str) -> Members:
    """Text of the member rule of a metric that has one, for the agent of index `at`; `size` counts the cluster."""
    axes, fields = build.plan.axes, metric.Member._fields  # type: ignore[union-attr]
    rows = [*axes, *(f"v{a}" for a in axes), *(f"head_{a}" for a in axes)]
    means = [f"c_{kind}{a} / real(size)" if a in axes else "ZERO" for kind in ("", "v", "head_") for a in "xyz"]
    mean = [f"own_mean = {build.source.name(Mean)}({', '.join(means)}, real(size))"]
    given = {"mean": "own_mean", "speed": f"speed[{at}]"}
    for a in "xyz":
        flown = {a: f"{a}[{at}]", f"v{a}": f"v{a}[{at}]", f"h{a}": f"head_{a}[{at}]"}
        given |= flown if a in axes else dict.fromkeys(flown, "ZERO")
    body = []
    if "pair" in asks(metric.member, "member", metric.name):  # type: ignore[arg-type]
        values = ", ".join(f"{metric.name}_{name}[{at}]" for name in metric.Pair._fields)  # type: ignore[union-attr]
        body += [f"pair = {build.source.name(metric.Pair)}({values})"]
    how = [metric.reduce.get(name, "sum") for name in fields]
    mean += [f"m{c} = {START[how[c]]}" for c in range(len(fields))]
    body += [f"t = {build.call(metric.member, 'member', given, metric.name)}"]  # type: ignore[arg-type]
    record = f"members = {build.source.name(metric.Member)}({', '.join(f'm{c}' for c in range(len(fields)))})"
    return Members([f"c_{row} = ZERO" for row in rows], rows, mean, body, how, record)
