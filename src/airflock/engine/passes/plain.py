"""Plain: stages that become functions of a driver as they stand; the others have a pass of their own."""

from collections.abc import Callable
from typing import Any, NamedTuple

from airflock.engine.passes.build import Builder
from airflock.engine.passes.noise import draw
from airflock.engine.passes.perceive import shared
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import argument
from airflock.engine.stages import faults, perceive, scene, silence, surfaces


class Plain(NamedTuple):
    """A stage, and what its function in a driver is called with.

    decision : the argument that is the number of the decision
    draws    : it draws random numbers
    own      : it goes through agents, so that in a sequential update it is of the agent in turn
    """

    stage: Callable[..., Any]
    arguments: str
    decision: str = "k_"
    own: bool = False
    draws: bool = False


PLAIN = {
    "perceive": Plain(perceive.perceive, "k, slot, m, row, whole, work, ring, words", "k", draws=True),
    "tune": Plain(faults.tune, "k_, m, row, whole, work"),
    "boundaries": Plain(surfaces.boundaries, "n, row, whole, work, faces, edges, spans, scene", own=True),
    "stop": Plain(silence.stop, "n, time, row, work, store", own=True),
    "overrule": Plain(faults.overrule, "n, time, row, work", own=True),
    "aim_": Plain(scene.aim, "time, elapsed, n, work, row, scene"),
    "glide_": Plain(scene.glide, "time, n, work, row, scene"),
    "appear_": Plain(scene.appear, "time, n, work, row, scene"),
}


def plain(build: Builder, name: str) -> None:
    """The function of one of these stages; of a stage that asks a law, that for the law of the builder."""
    one = PLAIN[name]
    known = {"drawn": draw(build) if build.plan.noisy else None, "shared": shared(build)} if one.draws else {}
    made = specialise(build, one.stage, decision=argument(one.decision), **known)
    if one.own:
        build.stage(f"{name}{build.mark}", one.arguments, made.once, made.body, made.answer)
    else:
        build.function(f"{name}({one.arguments})", made.lines, f"return {made.answer}")
