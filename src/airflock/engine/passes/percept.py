"""Percept: the record that a driver hands to `decide`, and the functions that its methods are bound to."""

from collections.abc import Callable
from typing import Any

from airflock.core import PERCEPT_METHODS, Percept
from airflock.engine.passes.build import Builder
from airflock.engine.specialise.stage import specialise
from airflock.engine.stages import percept as perceiving

FIELDS = ("half_x", "half_y", "half_z", "agent", "step", "world", "seed_low", "seed_high", "corners", "obstacles")
CASTS = ("shapes", "nodes", "links", "near", "counts", "gathered")
METHODS: dict[str, tuple[Callable[..., Any], str]] = {
    "ray": (perceiving.ray, "percept, ux, uy, uz, length"),
    "cast": (perceiving.cast, "percept, ux, uy, uz, length, radius"),
    "normal": (perceiving.normal, "percept, draw"),
    "uniform": (perceiving.uniform, "percept, draw"),
}


def add_record(build: Builder) -> str:
    """Record that a driver hands to `decide`: the public fields, then what the bound methods need."""
    casts = CASTS if build.plan.model.sight is not None else CASTS[:3] if build.plan.scene else ()
    return build.source.record(f"PERCEPT{build.mark}", (*Percept._fields, *FIELDS, "edges", "spans", *casts))


def add_methods(build: Builder) -> None:
    """Functions percept_ray, percept_cast, percept_normal and percept_uniform, those of them that a rule calls."""
    marked = {name: f"percept_{name}{build.mark}" for name in PERCEPT_METHODS}
    called = [name for name in PERCEPT_METHODS if any(f"{marked[name]}(" in text for text in build.source.blocks)]
    for name in called:
        method, arguments = METHODS[name]
        made = specialise(build, method)
        build.function(f"{marked[name]}({arguments})", made.lines, f"return {made.answer}")
