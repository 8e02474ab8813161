"""Noise: what draws random words for all agents, as a function of a driver."""

from airflock.engine.passes.build import Builder
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
        made = specialise(build, noise.draw, order=argument("order") if build.slots else Itself())
        order = "order, " * build.slots
        build.function(
            f"draw(m, {order}step, stream, world, seed_low, seed_high, u0, u1, u2, u3)", ["apart()", *made.lines]
        )
    return build.stages["draw"]  # type: ignore[no-any-return]
