"""Noise: what draws random words for all agents, and makes normal numbers of them, as functions of a driver."""

from airflock.engine.passes.build import Builder
from airflock.engine.passes.slots import sorts_by_cells
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import driver_argument
from airflock.engine.stages import noise
from airflock.engine.stages.words import IdentityRow


def add_draw(build: Builder) -> noise.Draw:
    """Functions draw and normal, whose rows are told to lie apart; None where their loops stand where they are needed.

    Else rows are compared before the loop wherever it stands, which takes a fiftieth of a flight of a hundred, and the
    loops are compiled at each of six places.
    """
    if not build.apart or build.plan.sequential:
        return None
    if "draw" not in build.stages:
        by_place = not build.slots or _leave(build)
        _draw(build, "draw", by_place)
        if build.slots and by_place:
            _draw(build, "draw_by_number", False)
        build.function("normal(m, a, b, g, h)", ["apart()", *specialise(build, noise.normal).lines], once=True)
    return noise.DrawFunctions(build.stages["draw"], build.stages.get("draw_by_number"), build.stages["normal"])


def _leave(build: Builder) -> bool:
    """Whether some agents may leave, of whose numbers the others keep the order."""
    return build.slots and not sorts_by_cells(build.plan)


def _draw(build: Builder, name: str, by_place: bool) -> None:
    """A function that draws words for agents that lie at their own numbers, or for all by their numbers."""
    made = specialise(build, noise.draw, order=IdentityRow() if by_place else driver_argument("order"))
    known = "m, " if by_place else "m, order, "
    build.function(
        f"{name}({known}step, stream, world, seed_low, seed_high, u0, u1, u2, u3)", ["apart()", *made.lines], once=True
    )
