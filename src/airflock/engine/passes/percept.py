"""Percept: what the methods of `Percept` are bound to in a driver: the arena's rays and the stream MODEL."""

from airflock.core import random
from airflock.core.vocabulary import BOUND, Percept
from airflock.engine.passes import scene
from airflock.engine.passes.build import Builder, loop
from airflock.world import bvh, polygon, rays

FIELDS = ("half_x", "half_y", "half_z", "agent", "step", "world", "seed_low", "seed_high", "corners", "obstacles")
REST = "w.half_x, w.half_y, w.half_z, {}, k_, world, seed_low, seed_high, corners, obstacles, edges, spans"


def record(build: Builder) -> str:
    """Record that a driver hands to `decide`: the public fields, then what the bound methods need."""
    casts = scene.carried(build)
    return build.source.record("PERCEPT", (*Percept._fields, *FIELDS, "edges", "spans", *casts))


def values(build: Builder) -> str:
    """What agent i at its measured position puts into that record."""
    axes, plan = build.plan.axes, build.plan
    position = ", ".join(f"-m{a}[i]" if a in axes else "ZERO" for a in "xyz")
    aims = [f"goal_{a}[i]" if plan.own else f"aim[{c}]" for c, a in enumerate("xyz")]
    known = axes if plan.goals or plan.own else ()
    goal = ", ".join(f"{aim} - m{a}[i]" if a in known else "ZERO" for aim, a in zip(aims, "xyz", strict=True))
    casts = scene.carried(build)
    return ", ".join(["time", position, goal, REST.format(build.who), *casts])


def bind(build: Builder) -> None:
    """Functions percept_ray, percept_normal and percept_uniform, those of them that a rule calls."""
    called = [name for name in BOUND if any(f"percept_{name}(" in text for text in build.source.blocks)]
    who = "percept.agent, percept.step, {} + 256 * draw, percept.world, percept.seed_low, percept.seed_high"
    draw = f"w0, w1, w2, w3 = {{}}({who.format(random.MODEL)})"
    if "ray" in called:
        build.function("percept_ray(percept, ux, uy, uz, length)", _ray(build))
    if "cast" in called:
        build.function("percept_cast(percept, ux, uy, uz, length, radius)", scene.cast(build))
    if "normal" in called:
        philox, pair = build.source.name(random.draw), build.source.name(random.normal_pair)
        build.function("percept_normal(percept, draw)", [draw.format(philox), f"a, b = {pair}(w0, w1)", "return a"])
    if "uniform" in called:
        philox, uniform = build.source.name(random.draw), build.source.name(random.uniform)
        build.function("percept_uniform(percept, draw)", [draw.format(philox), f"return {uniform}(w0)"])


def _ray(build: Builder) -> list[str]:
    rule = build.source.name(build.plan.ray)
    lines = ["x = -percept.centre_x; y = -percept.centre_y; z = -percept.centre_z"]
    rest = "percept.half_x, percept.half_y, percept.half_z, percept.edges, percept.corners"
    height = "z - percept.edges[percept.corners, 0]" if build.plan.raised else "z"
    lines += [f"t = least(length, {rule}(x, y, {height}, ux, uy, uz, {rest}))"]
    if build.plan.obstacles:
        prisms = build.plan.obstacle is polygon.prism
        edge = build.source.name(polygon.ray_to_prism if prisms else rays.to_edges)
        given = "x, y, z, ux, uy, uz" if prisms else "x, y, ux, uy"
        spans = "percept.edges, percept.spans[o, 0], percept.spans[o, 1]"
        lines += loop("o in range(percept.obstacles)", [f"t = least(t, {edge}({given}, {spans}))"])
    if build.plan.scene:
        tree = build.source.name(bvh.cast)
        given = "x, y, z, ux, uy, uz, t, ZERO, percept.shapes, percept.nodes, percept.links"
        lines += [f"t = least(t, {tree}({given}))"]
    return [*lines, "return t"]
