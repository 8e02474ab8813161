"""Noise: what draws random words for all agents, as a function of a driver."""

from airflock.engine.passes.build import Builder
from airflock.engine.passes.slots import sorted_by_cells
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import Function, argument
from airflock.engine.stages import noise
from airflock.engine.stages.words import Itself


def draw(build: Builder) -> Function | None:
    """Function draw, once, whose rows are told to lie apart; None where its loop stands in the stages that ask for it.

    Else rows are compared before the loop wherever it stands, which takes a fiftieth of a flight of a hundred.
    """
    if not build.apart or build.plan.sequential:
        return None
    if "draw" not in build.stages:
        leave = build.slots and not sorted_by_cells(build.plan)
        made = specialise(build, noise.draw, order=argument("order") if build.slots else Itself(), leave=leave)
        known = "n, " * leave + "m, " + "order, " * build.slots
        build.function(
            f"draw({known}step, stream, world, seed_low, seed_high, u0, u1, u2, u3)", ["apart()", *made.lines]
        )
    return build.stages["draw"]  # type: ignore[no-any-return]
