"""Noise: what draws random words for all agents, and makes normal numbers of them, as functions of a driver."""

from airflock.engine.passes.build import Builder
from airflock.engine.passes.slots import sorted_by_cells
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import argument
from airflock.engine.stages import noise
from airflock.engine.stages.words import Itself


def draw(build: Builder) -> noise.Draw:
    """Functions draw and normal, whose rows are told to lie apart; None where their loops stand where they are needed.

    Else rows are compared before the loop wherever it stands, which takes a fiftieth of a flight of a hundred, and the
    loops are compiled at each of six places.
    """
    if not build.apart or build.plan.sequential:
        return None
    if "draw" not in build.stages:
        leave = build.slots and not sorted_by_cells(build.plan)
        made = specialise(build, noise.draw, order=argument("order") if build.slots else Itself(), leave=leave)
        known = "n, " * leave + "m, " + "order, " * build.slots
        build.function(
            f"draw({known}step, stream, world, seed_low, seed_high, u0, u1, u2, u3)", ["apart()", *made.lines],
            once=True,
        )  # fmt: skip
        build.function("normal(m, a, b, g, h)", ["apart()", *specialise(build, noise.normal).lines], once=True)
    return noise.Drawn(build.stages["draw"], build.stages["normal"])
