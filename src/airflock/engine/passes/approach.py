"""Approach: whether a driver looks for collisions at all, and how it knows that it need not at a step."""

from airflock.engine.passes.build import Builder
from airflock.engine.plan import Plan
from airflock.engine.specialise.stage import specialise
from airflock.engine.stages import approach
from airflock.engine.stages.measure import MeasuredMetric, measured_metrics


def skippable_metrics(plan: Plan) -> tuple[MeasuredMetric, ...]:
    """Metrics that look for collisions, if all of them promise a distance beyond which there are none."""
    found = measured_metrics(plan, "collision")
    return found if all(one.metric.within is not None for one in found) else ()


def uses_drift(build: Builder) -> bool:
    """Whether what counts is how fast agents are beside the drift of the flock, and not how fast they are."""
    return build.can_use_drift and build.plan.flows and bool(skippable_metrics(build.plan))


def uses_nearest_pair(build: Builder) -> bool:
    """Whether the least distance of a pair is looked for alone, as long as there is nothing to measure."""
    return uses_drift(build) and not build.plan.near


def add_nearest(build: Builder) -> None:
    """Function nearest: the least distance of a pair, where it is looked for alone."""
    if uses_nearest_pair(build):
        made = specialise(build, approach.nearest)
        build.function("nearest(n, m, row, whole, work)", made.lines, f"return {made.answer}", once=True)
