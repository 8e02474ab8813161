"""Start and move: where agents begin, and one motion step of all of them."""

from airflock.core import random
from airflock.engine.passes import scene
from airflock.engine.passes.build import Builder, branch, in_place, loop
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import Call
from airflock.engine.stages import gusts as air
from airflock.engine.stages import move as motion
from airflock.engine.stages import noise as outer
from airflock.scenarios.wings import FORMATIONS
from airflock.world import start as start_rules

NOISE, GUSTS = "step, m, row, whole, work, words", "step, row, whole, gust"  # what these stages are called with
ATTEMPTS = 20_000  # draws per agent before a start is given up; the border refuses crowded arenas beforehand


def begin(build: Builder) -> None:
    """Place all agents at rest or at start speed; returns minus the first agent (from 1) that found no room."""
    plan, axes = build.plan, build.plan.axes
    rows = [*axes, *(f"v{a}" for a in axes)]
    lines = (
        build.records("w") + build.bind(rows) + build.whole("world", "seed_low", "seed_high", "corners", "obstacles")
    )
    lines += loop("i in range(m)", [f"{a}[i] = AWAY; v{a}[i] = ZERO" for a in axes])
    if plan.given_start:
        lines += loop("i in range(n)", [f"{name}[i] = start[{c}, i]" for c, name in enumerate(rows)])
        build.function("begin(n, m, row, whole, work, edges, spans, start, scene)", lines, "return 0")
        return
    if plan.start in FORMATIONS:
        body = loop("i in range(n)", [*in_formation(build), "vx[i] = w.speed"])
        build.function("begin(n, m, row, whole, work, edges, spans, start, scene)", lines, body, "return 0")
        return
    philox, uniform = build.source.name(random.draw), build.source.name(random.uniform)
    spread = build.source.name(start_rules.spread)
    draw = [f"w0, w1, w2, w3 = {philox}(i, attempt, {random.START}, world, seed_low, seed_high)"]
    draw += [f"s{a} = {spread}({uniform}(w{c}), -w.extent_{a}, w.extent_{a})" for c, a in enumerate(axes)]
    draw += [] if plan.dimensions == 3 else ["sz = ZERO"]
    draw += [f"free = {beyond(build)} <= ZERO"]
    gap = " + ".join(f"(s{a} - {a}[j]) * (s{a} - {a}[j])" for a in axes)
    if plan.start == "ball":
        draw += [f"free = free & {build.source.name(start_rules.in_ball)}(sx, sy, sz, w.extent_x)"]
    draw += loop(
        "j in range(i if w.separation > ZERO else 0)", [f"free = free & ({gap} >= w.separation * w.separation)"]
    )
    draw += scene.room(build)
    place = [f"{a}[i] = s{a}" for a in axes]
    draw += branch("free", [*place, "placed = True", "break"])
    body = ["placed = False", *loop(f"attempt in range({ATTEMPTS})", draw), "if not placed:", "    return -(i + 1)"]
    turn = [*heading_off(build), *[f"v{a}[i] = u{a}" for a in axes]]
    lines += loop("i in range(n)", [*body, *branch("w.speed > ZERO", turn)])
    build.function("begin(n, m, row, whole, work, edges, spans, start, scene)", lines, "return 0")


def heading_off(build: Builder, w: str = "w") -> list[str]:
    """Lines that draw the velocity ux uy uz of agent i at the start; w : name of the arena's record."""
    philox, pair = build.source.name(random.draw), build.source.name(random.normal_pair)
    return [
        f"w0, w1, w2, w3 = {philox}(i, 0, {random.START + 256}, world, seed_low, seed_high)",
        f"gx, gy = {pair}(w0, w1); gz, _ = {pair}(w2, w3)",
        f"ux, uy, uz = {build.source.name(start_rules.heading_off)}(gx, gy, {build.z('gz')}, {w}.speed)",
    ]


def in_formation(build: Builder, put: str = "{}[i]", w: str = "w") -> list[str]:
    """Lines that place agent i in a formation, off its place by start.jitter. Its velocity is straight ahead.

    put : where a coordinate goes, with the axis for its braces; w : name of the arena's record
    """
    axes = build.plan.axes
    philox, pair = build.source.name(random.draw), build.source.name(random.normal_pair)
    place = build.source.name(FORMATIONS[build.plan.start])
    return [
        f"sx, sy, sz = {place}(i, {w}.spacing_x, {w}.spacing_y, {w}.spacing_z)",
        f"w0, w1, w2, w3 = {philox}(i, 0, {random.START + 512}, world, seed_low, seed_high)",
        f"gx, gy = {pair}(w0, w1); gz, _ = {pair}(w2, w3)",
        *[f"{put.format(a)} = s{a} + {w}.jitter * g{a}" for a in axes],
    ]


def beyond(build: Builder) -> str:
    """Call of the excursion of position sx sy sz, obstacles included."""
    name = "excursion"
    if not any(f"def {name}(" in text for text in build.functions):
        rule = build.source.name(build.plan.excursion)
        height = "z - edges[corners, 0]" if build.plan.raised else "z"
        lines = [f"e = {rule}(x, y, {height}, w.half_x, w.half_y, w.half_z, edges, corners)"]
        if build.plan.obstacles:
            obstacle = build.source.name(build.plan.obstacle)
            lines += loop(
                "o in range(obstacles)",
                [f"e = most(e, -{obstacle}(x, y, z, edges, spans[o, 0], spans[o, 1]).distance)"],
            )
        lines += scene.excursion(build)
        build.function(f"{name}(x, y, z, w, edges, spans, corners, obstacles, scene)", lines, "return e")
    return f"{name}(sx, sy, sz, w, edges, spans, corners, obstacles, scene)"


def move(build: Builder) -> None:
    """Function move, with what the stages noise and gusts do once per step, where the body and the wind have them.

    They stand in its own lines, which compile to the same bits as ever; where agents move in turn they are functions.
    """
    plan = build.plan
    made = specialise(build, motion.move, noise=Call(f"noise({NOISE})"), gusts=Call(f"gusts({GUSTS})"))
    parts: dict[str, tuple[str, list[str]]] = {}
    if build.wants(plan.body.move, "move", "gx", "gy", "gz"):
        parts["noise"] = NOISE, [*specialise(build, outer.noise).lines, "return 0"]
    if plan.windy:
        blown = specialise(build, air.gusts)
        parts["gusts"] = GUSTS, [*blown.lines, f"return {blown.answer}"]
    once = made.once
    for name, (arguments, lines) in parts.items():
        if plan.sequential:
            build.function(f"{name}({arguments})", lines)
        else:
            once = in_place(once, name, lines)
    build.stage("move", "step, n, m, row, whole, work, words, gust", once, made.body, made.answer)
