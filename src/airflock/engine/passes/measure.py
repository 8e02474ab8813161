"""Measure: order parameters of one instant, and how instants add up. The same text scores flights and recordings."""

from typing import Any

from airflock.core import Mean, Metric, fields_read
from airflock.engine.passes import flock, grid
from airflock.engine.passes.build import Builder, inline_lines
from airflock.engine.passes.move import add_excursion
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import StageCall
from airflock.engine.stages import measure as measuring
from airflock.engine.stages.clusters import sum_clusters
from airflock.engine.stages.links import clusters_by_cells
from airflock.engine.stages.measure import MeasuredMetric, measured_metrics
from airflock.engine.stages.near import ROUNDING_MARGIN, pairs_by_cells
from airflock.engine.stages.words import rule_asks

AVERAGED = {"x": {"x", "y", "z"}, "v": {"vx", "vy", "vz"}, "h": {"hx", "hy", "hz"}}  # fields of a mean
BY_CELLS = "n, row, whole, work, cells"  # what a search by cells is called with


def measure_arguments(build: Builder, cells: bool = False) -> str:
    """What a measure function is called with. cells : it looks at pairs by them."""
    rest = (", scratch" if flock.survey_rules(build.plan) else "") + ", cells" * cells
    return f"time, n, m, row, whole, work, edges, spans, scene, memory, labels, values{rest}"


def add_measure(build: Builder, clock: str) -> None:
    """Function measure_<clock>: writes every Sample field into `values`.

    That of the collision clock returns the least distance of a pair, m.
    """
    metrics = measured_metrics(build.plan, clock)
    paired = [one.metric for one in metrics if one.metric.pair is not None]
    near = build.plan.near and bool(paired) and all(metric.settled is not None for metric in paired)
    looked = add_pairs_by_cells(build, clock, metrics) if near else None
    outside = any(rule_asks(one.metric.agent, "excursion") for one in metrics)
    parts = {f"survey_{one.metric.name}": flock.survey_lines(build, one.metric) for one in metrics if one.metric.survey}
    clustered = {one.metric.name: add_clusters(build, one.metric, parts) for one in metrics}
    made = specialise(
        build,
        measuring.measure,
        metrics=metrics,
        nearest=clock == "collision",
        over=looked,
        abreast=build.pairs_two_agents,
        headed=needs_headings(metrics) or not build.drops_unread_sums,
        summed="xvh" if build.drops_unread_sums else needed_means(metrics),
        excursion=add_excursion(build) if outside else None,
        survey={one.metric.name: StageCall(f"survey_{one.metric.name}()") for one in metrics},
        clustered=clustered,
    )
    lines = made.lines
    for name, part in parts.items():
        lines = inline_lines(lines, name, part)
    cells = near or any(links_by_cells(build, one.metric) for one in metrics)
    build.function(f"measure_{clock}({measure_arguments(build, cells)})", lines, f"return {made.answer}")


def needs_headings(metrics: tuple[MeasuredMetric, ...]) -> bool:
    """Whether any of these metrics asks for speeds, headings or means of the flock."""
    asked = ("speed", "hx", "hy", "hz", "mean")
    return any(
        metric.survey is not None or metric.cluster is not None
        or any(rule_asks(rule, *asked) for rule in (metric.pair, metric.agent, metric.member, metric.sample))
        for metric, *_ in metrics
    )  # fmt: skip


def needed_means(metrics: tuple[MeasuredMetric, ...]) -> str:
    """Of what rules read a mean over the flock: position x, velocity v, heading h."""
    found: set[str] = set()
    for one in metrics:
        for rule in (one.metric.agent, one.metric.member, one.metric.cluster, one.metric.sample):
            if rule_asks(rule, "mean"):
                assert rule is not None
                asked = fields_read(rule, "mean")
                found |= set(Mean._fields) if asked is None else asked
    return "".join(what for what, names in AVERAGED.items() if found & names)


def add_pairs_by_cells(build: Builder, clock: str, metrics: tuple[MeasuredMetric, ...]) -> StageCall:
    """Function near_<clock>: the pair rules of a clock by cells of about one agent each; its call."""
    made = specialise(build, pairs_by_cells, metrics=metrics, nearest=clock == "collision")
    called = f"near_{clock}({BY_CELLS})"
    lines = [*grid.sort_lines(build, "real(0.001)", "n"), *made.lines]
    build.function(called, lines, f"return {made.answer}", parallel=True)
    return StageCall(called)


def links_by_cells(build: Builder, metric: Metric) -> bool:
    """Whether the links of a metric are looked for by cells."""
    return build.plan.near and metric.cluster is not None and metric.linked_within is not None


def add_clusters(build: Builder, metric: Metric, parts: dict[str, list[str]]) -> Any:
    """What finds the clusters of a metric: a stage or a call. Lines that stand in place of a call go to `parts`."""
    name = f"clusters_{metric.name}"
    if links_by_cells(build, metric):
        assert metric.linked_within is not None
        reach = f"least({build.call(metric.linked_within, 'linked_within', {})} / real({ROUNDING_MARGIN}), LIMIT)"
        made = specialise(build, clusters_by_cells, metric=metric)
        called = f"{name}(mean, labels, {BY_CELLS})"
        lines = [*build.records("q"), *grid.sort_lines(build, reach, "n"), *made.lines]
        build.function(called, lines, f"return {made.answer}")
        return StageCall(called)
    if build.clusters and metric.cluster:
        parts[name] = build.clusters(metric)
        return StageCall(f"{name}()")
    return sum_clusters
