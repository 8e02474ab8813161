"""Approach: whether a driver looks for collisions at all, and how it knows that it need not at a step."""

from airflock.engine.passes.build import Builder
from airflock.engine.plan import Plan
from airflock.engine.specialise.stage import specialise
from airflock.engine.stages import approach
from airflock.engine.stages.measure import Measured, measured


def watched(plan: Plan) -> tuple[Measured, ...]:
    """Metrics that look for collisions, if all of them promise a distance beyond which there are none."""
    found = measured(plan, "collision")
    return found if all(one.metric.within is not None for one in found) else ()


def drifts(build: Builder) -> bool:
    """Whether what counts is how fast agents are beside the drift of the flock, and not how fast they are."""
    return build.drifts and build.plan.flows and bool(watched(build.plan))


def foretold(build: Builder) -> bool:
    """Whether the least distance of a pair is looked for alone, as long as there is nothing to measure."""
    return drifts(build) and not build.plan.near


def nearest(build: Builder) -> None:
    """Function nearest: the least distance of a pair, where it is looked for alone."""
    if foretold(build):
        made = specialise(build, approach.nearest)
        build.function("nearest(n, m, row, whole, work)", made.lines, f"return {made.answer}", once=True)
