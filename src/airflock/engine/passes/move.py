"""Start and move: where agents begin, and one motion step of all of them."""

import ast

from airflock.engine.passes.approach import drifts, watched
from airflock.engine.passes.build import Builder, in_place
from airflock.engine.passes.noise import draw
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import Call, argument
from airflock.engine.stages import faults, start
from airflock.engine.stages import gusts as air
from airflock.engine.stages import move as motion
from airflock.engine.stages import noise as outer
from airflock.scenarios.wings import FORMATIONS

NOISE, GUSTS = "step, m, row, whole, work, words", "step, row, whole, gust"  # what these stages are called with


def begin(build: Builder) -> None:
    """Function begin: all agents at their places; returns minus the first agent (from 1) that found no room."""
    drawn = not build.plan.given_start and build.plan.start not in FORMATIONS
    made = specialise(build, start.begin, excursion=excursion(build) if drawn else None)
    build.function("begin(n, m, row, whole, work, edges, spans, start, scene)", made.lines, f"return {made.answer}")


def excursion(build: Builder) -> ast.Name:
    """Function excursion, once; its name for stages that call it."""
    if not any("def excursion(" in text for text in build.functions):
        made = specialise(build, start.excursion, w=argument("w"))
        build.function(
            "excursion(x, y, z, w, edges, spans, corners, obstacles, scene)", made.lines, f"return {made.answer}"
        )
    return argument("excursion")


def move(build: Builder) -> None:
    """Function move, with what the stages noise and gusts do once per step, where the body and the wind have them.

    They stand in its own lines, which compile to the same bits as ever; where agents move in turn they are functions.
    Where rows of faults are read beside those of states, all are told to lie apart: else those that are written are
    compared with every other at every step. Not where a body remembers: the last
    bit of a quadrotor would change.
    """
    plan = build.plan
    struck = plan.struck and build.ranges
    if struck:
        found = specialise(build, faults.struck, kept=not plan.edge)
        build.function("struck(time, m, row, work)", found.lines, f"return {found.answer}")
    made = specialise(
        build, motion.move, noise=Call(f"noise({NOISE})"), gusts=Call(f"gusts({GUSTS})"),
        watched=bool(watched(plan)) or not build.drifts, drifts=drifts(build), kept=struck and not plan.edge,
    )  # fmt: skip
    parts: dict[str, tuple[str, list[str]]] = {}
    if build.wants(plan.body.move, "move", "gx", "gy", "gz"):
        parts["noise"] = NOISE, [*specialise(build, outer.noise, drawn=draw(build)).lines, "return 0"]
    if plan.windy:
        blown = specialise(build, air.gusts)
        parts["gusts"] = GUSTS, [*blown.lines, f"return {blown.answer}"]
    once = made.once
    for name, (arguments, lines) in parts.items():
        if plan.sequential:
            build.function(f"{name}({arguments})", lines)
        else:
            once = in_place(once, name, lines)
    lanes = ", hurt_first, hurt_end" * struck
    many = bool(plan.suffers("motion")) and not plan.body.Memory
    held = "held, " * drifts(build)
    head = f"step, n, m, {held}row, whole, work, words, gust{lanes}"
    build.stage("move", head, once, made.body, made.answer, apart=many)
