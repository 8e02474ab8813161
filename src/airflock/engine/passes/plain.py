"""Plain: stages that become functions of a driver as they stand; the others have a pass of their own."""

from collections.abc import Callable
from typing import Any, NamedTuple

from airflock.engine.passes.build import Builder
from airflock.engine.passes.noise import add_draw
from airflock.engine.passes.perceive import add_error_functions
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import driver_argument
from airflock.engine.stages import faults, perceive, scene, silence, surfaces


class PlainStage(NamedTuple):
    """A stage, and what its function in a driver is called with.

    decision : the argument that is the number of the decision
    draws    : it draws random numbers
    own      : it goes through agents, so that in a sequential update it is of the agent in turn
    """

    stage: Callable[..., Any]
    arguments: str
    decision: str = "k_"
    own: bool = False
    needs_random: bool = False


PLAIN = {
    "perceive": PlainStage(perceive.perceive, "k, slot, m, row, whole, work, ring, words", "k", needs_random=True),
    "tune": PlainStage(faults.tune, "k_, m, row, whole, work"),
    "boundaries": PlainStage(surfaces.boundaries, "n, row, whole, work, faces, edges, spans, scene", own=True),
    "stop": PlainStage(silence.stop, "n, time, row, work, store", own=True),
    "overrule": PlainStage(faults.overrule, "n, time, row, work", own=True),
    "aim_": PlainStage(scene.move_goal, "time, elapsed, n, work, row, scene"),
    "glide_": PlainStage(scene.move_own_goals, "time, n, work, row, scene"),
    "appear_": PlainStage(scene.let_appear, "time, n, work, row, scene"),
}


def add_plain_stage(build: Builder, name: str) -> None:
    """The function of one of these stages; of a stage that asks a law, that for the law of the builder."""
    one = PLAIN[name]
    known = (
        {"drawn": add_draw(build) if build.plan.has_sensor_error else None, "shared": add_error_functions(build)}
        if one.needs_random
        else {}
    )
    made = specialise(build, one.stage, decision=driver_argument(one.decision), **known)
    if one.own:
        build.stage(f"{name}{build.mark}", one.arguments, made.once, made.body, made.answer)
    else:
        build.function(f"{name}({one.arguments})", made.lines, f"return {made.answer}")
