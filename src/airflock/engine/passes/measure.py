"""Measure: order parameters of one instant, and how instants add up. The same text scores flights and recordings."""

from airflock.engine.passes import flock, grid
from airflock.engine.passes.build import Builder, in_place
from airflock.engine.passes.move import excursion
from airflock.engine.plan import Plan
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import Call
from airflock.engine.stages import measure as measuring
from airflock.engine.stages.clusters import clusters_of
from airflock.engine.stages.measure import Measured
from airflock.engine.stages.near import pairs_by_cells
from airflock.engine.stages.words import fields, wants

CLOCKS = ("sample", "collision")


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
    cells = build.plan.grid and bool(paired) and all(metric.settled is not None for metric in paired)
    outside = any(wants(one.metric.agent, "excursion") for one in metrics)
    parts = {f"survey_{one.metric.name}": flock.survey(build, one.metric) for one in metrics if one.metric.survey}
    grouped = {one.metric.name: build.clusters(one.metric) for one in metrics if build.clusters and one.metric.cluster}
    parts |= {f"clusters_{name}": lines for name, lines in grouped.items()}
    made = specialise(
        build, measuring.measure, metrics=metrics, nearest=clock == "collision",
        over=pairs_by_cells if cells else None, abreast=build.abreast,
        excursion=excursion(build) if outside else None,
        survey={one.metric.name: Call(f"survey_{one.metric.name}()") for one in metrics},
        clustered={
            one.metric.name: Call(f"clusters_{one.metric.name}()") if one.metric.name in grouped else clusters_of
            for one in metrics
        },
    )  # fmt: skip
    lines = [*(grid.sort(build) if cells else []), *made.lines]
    for name, part in parts.items():
        lines = in_place(lines, name, part)
    build.function(f"measure_{clock}({arguments(build, cells)})", lines, f"return {made.answer}")


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
