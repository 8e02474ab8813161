"""Scene: goals on their way and shapes that appear, as functions of a driver."""

from airflock.engine.passes.build import Builder
from airflock.engine.specialise.stage import specialise
from airflock.engine.stages import scene


def aim(build: Builder) -> None:
    """Function aim_: the goal of the flock."""
    made = specialise(build, scene.aim)
    build.function("aim_(time, elapsed, n, work, row, scene)", made.lines, f"return {made.answer}")


def glide(build: Builder) -> None:
    """Function glide_: each agent's own goal."""
    made = specialise(build, scene.glide)
    build.function("glide_(time, n, work, row, scene)", made.lines, f"return {made.answer}")


def appear(build: Builder) -> None:
    """Function appear_: shapes that are due."""
    made = specialise(build, scene.appear)
    build.function("appear_(time, n, work, row, scene)", made.lines, f"return {made.answer}")
