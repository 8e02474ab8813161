"""Start on a GPU: the agents of a flock take their places one after another; all threads look for room at once."""

from collections.abc import Iterable

from airflock.core import random
from airflock.engine.cuda.build import CudaBuilder
from airflock.engine.passes import scene
from airflock.engine.passes.build import branch, loop
from airflock.engine.passes.move import ATTEMPTS, beyond, heading_off, in_formation
from airflock.engine.replace import must_replace
from airflock.scenarios.wings import FORMATIONS
from airflock.world import start as start_rules


def tables(build: CudaBuilder) -> dict[str, int]:
    """Shared tables and their widths: whole vectors of two or four numbers."""
    found: dict[str, int] = {}
    for table, column in build.columns().values():
        found[table] = max(found.get(table, 0), column + 1)
    return {table: 2 if width <= 2 else -(-width // 4) * 4 for table, width in found.items()}


def place(build: CudaBuilder, agent: str, row: str) -> str:
    """Where the position of an agent stands for the others."""
    return f"truth[{agent}, {build.columns()[row][1]}]" if build.shape.registers else f"work[{build.row(row)}, {agent}]"


def begin(build: CudaBuilder) -> list[str]:
    """Agents at their places: as given, or each where it finds room beside those before it."""
    plan, axes, registers = build.plan, build.plan.axes, build.shape.registers
    lines = []
    if registers:
        for table, width in tables(build).items():
            far = [f"{table}[e, {c}] = {'AWAY' if c < len(axes) else 'ZERO'}" for c in range(width)]
            lines += loop("e in range(tid, LANES, THREADS)", far)
    if plan.beginnings:
        lines += agents(build, [f"{own(build, name)} = real({start})" for name, start in plan.beginnings.items()])
    lines += ["cuda.syncthreads()"]
    names = [*axes, *(f"v{a}" for a in axes)]
    if plan.given_start:
        given = [f"{own(build, name)} = starts[block, {c}, i]" for c, name in enumerate(names)]
        return [*lines, *agents(build, given), "cuda.syncthreads()", *_heard_at_start(build)]
    if plan.start in FORMATIONS:
        placed = in_formation(build, "s_{}", "row_w")
        placed += [*(f"{own(build, a)} = s_{a}" for a in axes), f"{own(build, 'vx')} = row_w.speed"]
        return [*lines, *agents(build, placed), "cuda.syncthreads()", *_heard_at_start(build)]
    philox, uniform = build.source.name(random.draw), build.source.name(random.uniform)
    spread = build.source.name(start_rules.spread)
    draw = [f"w0, w1, w2, w3 = {philox}(e, attempt, {random.START}, world, seed_low, seed_high)"]
    draw += [f"s{a} = {spread}({uniform}(w{c}), -row_w.extent_{a}, row_w.extent_{a})" for c, a in enumerate(axes)]
    draw += [] if plan.dimensions == 3 else ["sz = ZERO"]
    draw += [f"free = {must_replace(beyond(build), ', w,', ', row_w,')} <= ZERO"]
    if plan.start == "ball":
        draw += [f"free = free & {build.source.name(start_rules.in_ball)}(sx, sy, sz, row_w.extent_x)"]
    draw += must_replace(scene.room(build), "w.clearance", "row_w.clearance") if plan.scene else []
    gap = " + ".join(f"(s{a} - {place(build, 'j', a)}) * (s{a} - {place(build, 'j', a)})" for a in axes)
    near = loop(
        "j in range(tid, e, THREADS)", branch(f"{gap} < row_w.separation * row_w.separation", ["crowded = integer(1)"])
    )
    crowd = ["crowded = integer(0)", *near, "free = cuda.syncthreads_or(crowded) == 0"]
    draw += branch("free and row_w.separation > ZERO", crowd)
    draw += branch("free", ["placed = True", "break"])
    seat = [f"{place(build, 'e', a)} = s{a}" for a in axes]
    body = ["placed = False; sx = ZERO; sy = ZERO; sz = ZERO", *loop(f"attempt in range({ATTEMPTS})", draw)]
    body += branch("not placed", [*branch("tid == 0", ["statuses[block] = -(e + 1)"]), "return"])
    body += [*branch("tid == 0", seat), "cuda.syncthreads()"]
    turn = [*heading_off(build, "row_w"), *[f"{own(build, f'v{a}')} = u{a}" for a in axes]]
    seated = [f"{own(build, a)} = {place(build, 'i', a)}" for a in axes]
    turning = [*branch("row_w.speed > ZERO", turn)]
    return [
        *lines, *loop("e in range(n)", body), *agents(build, [*seated, *turning]), "cuda.syncthreads()",
        *_heard_at_start(build),
    ]  # fmt: skip


def own(build: CudaBuilder, name: str) -> str:
    """A row of the own agent in the kernel's text."""
    return f"{build.same(name)}_i" if build.shape.registers else f"work[{build.row(name)}, i]"


def agents(build: CudaBuilder, body: Iterable[str]) -> list[str]:
    """Lines for every agent of this thread."""
    return branch("i < n", body) if build.shape.registers else loop("i in range(tid, n, THREADS)", body)


def _heard_at_start(build: CudaBuilder) -> list[str]:
    plan = build.plan
    if not (plan.noisy or plan.delayed):
        return []
    return loop("slot in range(slots)", [build.stages["snapshot"].call()])
