"""Measure: order parameters of one instant, and how instants add up. The same text scores flights and recordings."""

from typing import Any

from airflock.core.contract import Metric
from airflock.core.rules.reading import fields_read
from airflock.core.vocabulary import Mean
from airflock.engine.passes import flock, grid
from airflock.engine.passes.build import Builder, in_place
from airflock.engine.passes.move import excursion
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import Call
from airflock.engine.stages import measure as measuring
from airflock.engine.stages.clusters import clusters_of
from airflock.engine.stages.links import clusters_by_cells
from airflock.engine.stages.measure import Measured, measured
from airflock.engine.stages.near import SURE, pairs_by_cells
from airflock.engine.stages.words import wants

AVERAGED = {"x": {"x", "y", "z"}, "v": {"vx", "vy", "vz"}, "h": {"hx", "hy", "hz"}}  # fields of a mean
BY_CELLS = "n, row, whole, work, cells"  # what a search by cells is called with


def arguments(build: Builder, cells: bool = False) -> str:
    """What a measure function is called with. cells : it looks at pairs by them."""
    rest = (", scratch" if flock.surveys(build.plan) else "") + ", cells" * cells
    return f"time, n, m, row, whole, work, edges, spans, scene, memory, labels, values{rest}"


def measure(build: Builder, clock: str) -> None:
    """Function measure_<clock>: writes every Sample field into `values`.

    That of the collision clock returns the least distance of a pair, m.
    """
    metrics = measured(build.plan, clock)
    paired = [one.metric for one in metrics if one.metric.pair is not None]
    near = build.plan.near and bool(paired) and all(metric.settled is not None for metric in paired)
    looked = pairs(build, clock, metrics) if near else None
    outside = any(wants(one.metric.agent, "excursion") for one in metrics)
    parts = {f"survey_{one.metric.name}": flock.survey(build, one.metric) for one in metrics if one.metric.survey}
    clustered = {one.metric.name: clusters(build, one.metric, parts) for one in metrics}
    made = specialise(
        build, measuring.measure, metrics=metrics, nearest=clock == "collision", over=looked, abreast=build.abreast,
        headed=headed(metrics) or not build.drops, summed="xvh" if build.drops else averaged(metrics),
        excursion=excursion(build) if outside else None,
        survey={one.metric.name: Call(f"survey_{one.metric.name}()") for one in metrics},
        clustered=clustered,
    )  # fmt: skip
    lines = made.lines
    for name, part in parts.items():
        lines = in_place(lines, name, part)
    cells = near or any(linked(build, one.metric) for one in metrics)
    build.function(f"measure_{clock}({arguments(build, cells)})", lines, f"return {made.answer}")


def headed(metrics: tuple[Measured, ...]) -> bool:
    """Whether any of these metrics asks for speeds, headings or means of the flock."""
    asked = ("speed", "hx", "hy", "hz", "mean")
    return any(
        metric.survey is not None or metric.cluster is not None
        or any(wants(rule, *asked) for rule in (metric.pair, metric.agent, metric.member, metric.sample))
        for metric, *_ in metrics
    )  # fmt: skip


def averaged(metrics: tuple[Measured, ...]) -> str:
    """Of what rules read a mean over the flock: position x, velocity v, heading h."""
    found: set[str] = set()
    for one in metrics:
        for rule in (one.metric.agent, one.metric.member, one.metric.cluster, one.metric.sample):
            if wants(rule, "mean"):
                assert rule is not None
                asked = fields_read(rule, "mean")
                found |= set(Mean._fields) if asked is None else asked
    return "".join(what for what, names in AVERAGED.items() if found & names)


def pairs(build: Builder, clock: str, metrics: tuple[Measured, ...]) -> Call:
    """Function near_<clock>: the pair rules of a clock by cells of about one agent each; its call."""
    made = specialise(build, pairs_by_cells, metrics=metrics, nearest=clock == "collision")
    called = f"near_{clock}({BY_CELLS})"
    lines = [*grid.sorting(build, "real(0.001)", "n"), *made.lines]
    build.function(called, lines, f"return {made.answer}", parallel=True)
    return Call(called)


def linked(build: Builder, metric: Metric) -> bool:
    """Whether the links of a metric are looked for by cells."""
    return build.plan.near and metric.cluster is not None and metric.linked_within is not None


def clusters(build: Builder, metric: Metric, parts: dict[str, list[str]]) -> Any:
    """What finds the clusters of a metric: a stage or a call. Lines that stand in place of a call go to `parts`."""
    name = f"clusters_{metric.name}"
    if linked(build, metric):
        assert metric.linked_within is not None
        reach = f"least({build.call(metric.linked_within, 'linked_within', {})} / real({SURE}), LIMIT)"
        made = specialise(build, clusters_by_cells, metric=metric)
        called = f"{name}(mean, labels, {BY_CELLS})"
        lines = [*build.records("q"), *grid.sorting(build, reach, "n"), *made.lines]
        build.function(called, lines, f"return {made.answer}")
        return Call(called)
    if build.clusters and metric.cluster:
        parts[name] = build.clusters(metric)
        return Call(f"{name}()")
    return clusters_of
