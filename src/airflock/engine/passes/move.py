"""Start and move: where agents begin, and one motion step of all of them."""

import ast

from airflock.engine.passes.approach import skippable_metrics, uses_drift
from airflock.engine.passes.build import Builder, inline_lines
from airflock.engine.passes.noise import add_draw
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import StageCall, driver_argument
from airflock.engine.stages import faults, gusts as air, move as motion, noise as outer, start
from airflock.scenarios import FORMATIONS

NOISE, GUSTS = "step, m, row, whole, work, words", "step, row, whole, gust"  # what these stages are called with


def add_begin(build: Builder) -> None:
    """Function begin: all agents at their places; returns minus the first agent (from 1) that found no room."""
    drawn = not build.plan.given_start and build.plan.start not in FORMATIONS
    made = specialise(build, start.begin, excursion=add_excursion(build) if drawn else None)
    build.function("begin(n, m, row, whole, work, edges, spans, start, scene)", made.lines, f"return {made.answer}")


def add_excursion(build: Builder) -> ast.Name:
    """Function excursion, once; its name for stages that call it."""
    if not any("def excursion(" in text for text in build.functions):
        made = specialise(build, start.excursion, w=driver_argument("w"))
        build.function(
            "excursion(x, y, z, w, edges, spans, corners, obstacles, scene)", made.lines, f"return {made.answer}"
        )
    return driver_argument("excursion")


def add_move(build: Builder) -> None:
    """Function move, with what the stages noise and gusts do once per step, where the body and the wind have them.

    They stand in its own lines, which compile to the same bits as ever; where agents move in turn they are functions.
    Where rows of faults are read beside those of states, all are told to lie apart: else those that are written are
    compared with every other at every step. Not where a body remembers: the last
    bit of a quadrotor would change.
    """
    plan = build.plan
    struck = plan.struck and build.ranges
    if struck:
        found = specialise(build, faults.struck, kept=not plan.edge_rule)
        build.function("struck(time, m, row, work)", found.lines, f"return {found.answer}")
    made = specialise(
        build,
        motion.move,
        noise=StageCall(f"noise({NOISE})"),
        gusts=StageCall(f"gusts({GUSTS})"),
        watched=bool(skippable_metrics(plan)) or not build.can_use_drift,
        drifts=uses_drift(build),
        kept=struck and not plan.edge_rule,
    )
    parts: dict[str, tuple[str, list[str]]] = {}
    if build.rule_asks(plan.body.move, "move", "gx", "gy", "gz"):
        parts["noise"] = NOISE, [*specialise(build, outer.noise, drawn=add_draw(build)).lines, "return 0"]
    if plan.windy:
        blown = specialise(build, air.gusts)
        parts["gusts"] = GUSTS, [*blown.lines, f"return {blown.answer}"]
    once = made.once
    for name, (arguments, lines) in parts.items():
        if plan.sequential:
            build.function(f"{name}({arguments})", lines)
        else:
            once = inline_lines(once, name, lines)
    lanes = ", hurt_first, hurt_end" * struck
    many = bool(plan.suffers("motion")) and not plan.body.Memory
    held = "held, " * uses_drift(build)
    head = f"step, n, m, {held}row, whole, work, words, gust{lanes}"
    build.stage("move", head, once, made.body, made.answer, apart=many)
