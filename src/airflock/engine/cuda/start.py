"""Start on a GPU: the agents of a flock take their places one after another; all threads look for room at once."""

from collections.abc import Callable, Iterable
from typing import Any

from airflock.engine.cuda.build import CudaBuilder
from airflock.engine.passes.build import branch, loop
from airflock.engine.passes.move import excursion
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import Components, argument
from airflock.engine.stages import start
from airflock.scenarios.wings import FORMATIONS


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
    if plan.given_start:
        given = [f"{own(build, name)} = starts[block, {c}, i]" for c, name in enumerate(plan.motion)]
        return [*lines, *agents(build, given), "cuda.syncthreads()", *_heard_at_start(build)]
    if plan.start in FORMATIONS:
        lines_, _ = by_stage(build, start.in_formation, s=Components("s", "vector"))
        placed = [*lines_, *(f"{own(build, a)} = s_{a}" for a in axes), f"{own(build, 'vx')} = row_w.speed"]
        return [*lines, *agents(build, placed), "cuda.syncthreads()", *_heard_at_start(build)]
    draw = tried(build, "e")
    gap = " + ".join(f"(s_{a} - {place(build, 'j', a)}) * (s_{a} - {place(build, 'j', a)})" for a in axes)
    near = loop(
        "j in range(tid, e, THREADS)", branch(f"{gap} < row_w.separation * row_w.separation", ["crowded = integer(1)"])
    )
    crowd = ["crowded = integer(0)", *near, "free = cuda.syncthreads_or(crowded) == 0"]
    draw += branch("free and row_w.separation > ZERO", crowd)
    draw += branch("free", ["placed = True", "break"])
    seat = [f"{place(build, 'e', a)} = s_{a}" for a in axes]
    body = ["placed = False", *(f"s_{a} = ZERO" for a in axes), *loop(f"attempt in range({start.ATTEMPTS})", draw)]
    body += branch("not placed", [*branch("tid == 0", ["statuses[block] = -(e + 1)"]), "return"])
    body += [*branch("tid == 0", seat), "cuda.syncthreads()"]
    turn = heading_off(build, [own(build, f"v{a}") for a in axes])
    seated = [f"{own(build, a)} = {place(build, 'i', a)}" for a in axes]
    turning = [*branch("row_w.speed > ZERO", turn)]
    return [
        *lines, *loop("e in range(n)", body), *agents(build, [*seated, *turning]), "cuda.syncthreads()",
        *_heard_at_start(build),
    ]  # fmt: skip


def by_stage(build: CudaBuilder, helper: Callable[..., Any], **known: object) -> tuple[list[str], str]:
    """Lines of a helper of the start as a kernel runs it, for agent i, and what it returns."""
    made = specialise(build, helper, w=argument("row_w"), **known)
    return made.lines, made.answer


def tried(build: CudaBuilder, agent: str) -> list[str]:
    """Lines that draw a place s_x s_y s_z of an agent, and find whether it is `free`, whoever else is there."""
    s = Components("s", "vector")
    lines, _ = by_stage(build, start.tried, i=argument(agent), s=s, excursion=excursion(build))
    room, _ = by_stage(build, start.roomy, s=s)
    return [*lines, *room]


def heading_off(build: CudaBuilder, to: Iterable[str]) -> list[str]:
    """Lines that draw the velocity of agent i at the start."""
    lines, velocity = by_stage(build, start.heading_off)
    return [*lines, f"ux, uy, uz = {velocity}", *(f"{name} = u{a}" for name, a in zip(to, "xyz", strict=False))]


def own(build: CudaBuilder, name: str) -> str:
    """A row of the own agent in the kernel's text."""
    return f"{build.same(name)}_i" if build.shape.registers else f"work[{build.row(name)}, i]"


def agents(build: CudaBuilder, body: Iterable[str]) -> list[str]:
    """Lines for every agent of this thread."""
    return branch("i < n", body) if build.shape.registers else loop("i in range(tid, n, THREADS)", body)


def _heard_at_start(build: CudaBuilder) -> list[str]:
    if not build.plan.late:
        return []
    return loop("slot in range(slots)", [build.stages["snapshot"].call()])
