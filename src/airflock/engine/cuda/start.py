"""Start on a GPU: the agents of a flock take their places one after another; all threads look for room at once."""

from collections.abc import Callable, Iterable
from typing import Any

from airflock.engine.cuda.build import CudaBuilder
from airflock.engine.passes.build import branch_lines, loop_lines
from airflock.engine.passes.move import add_excursion
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import LocalVector, driver_argument
from airflock.engine.stages import start
from airflock.scenarios import FORMATIONS


def table_widths(build: CudaBuilder) -> dict[str, int]:
    """Shared tables and their widths: whole vectors of two or four numbers."""
    found: dict[str, int] = {}
    for table, column in build.columns().values():
        found[table] = max(found.get(table, 0), column + 1)
    return {table: 2 if width <= 2 else -(-width // 4) * 4 for table, width in found.items()}


def position_text(build: CudaBuilder, agent: str, row: str) -> str:
    """Where the position of an agent stands for the others."""
    return f"truth[{agent}, {build.columns()[row][1]}]" if build.shape.registers else f"work[{build.row(row)}, {agent}]"


def begin_lines(build: CudaBuilder) -> list[str]:
    """Agents at their places: as given, or each where it finds room beside those before it."""
    plan, axes, registers = build.plan, build.plan.axes, build.shape.registers
    lines = []
    if registers:
        for table, width in table_widths(build).items():
            far = [f"{table}[e, {c}] = {'AWAY' if c < len(axes) else 'ZERO'}" for c in range(width)]
            lines += loop_lines("e in range(tid, LANES, THREADS)", far)
    if plan.beginnings:
        lines += agent_loop(
            build, [f"{own_row(build, name)} = real({start})" for name, start in plan.beginnings.items()]
        )
    lines += ["cuda.syncthreads()"]
    if plan.given_start:
        given = [f"{own_row(build, name)} = starts[block, {c}, i]" for c, name in enumerate(plan.motion)]
        return [*lines, *agent_loop(build, given), "cuda.syncthreads()", *_heard_at_start(build)]
    if plan.start in FORMATIONS:
        lines_, _ = helper_lines(build, start.place_in_formation, s=LocalVector("s", "vector"))
        placed = [*lines_, *(f"{own_row(build, a)} = s_{a}" for a in axes), f"{own_row(build, 'vx')} = row_w.speed"]
        return [*lines, *agent_loop(build, placed), "cuda.syncthreads()", *_heard_at_start(build)]
    draw = try_place_lines(build, "e")
    gap = " + ".join(
        f"(s_{a} - {position_text(build, 'j', a)}) * (s_{a} - {position_text(build, 'j', a)})" for a in axes
    )
    near = loop_lines(
        "j in range(tid, e, THREADS)",
        branch_lines(f"{gap} < row_w.separation * row_w.separation", ["crowded = integer(1)"]),
    )
    crowd = ["crowded = integer(0)", *near, "free = cuda.syncthreads_or(crowded) == 0"]
    draw += branch_lines("free and row_w.separation > ZERO", crowd)
    draw += branch_lines("free", ["placed = True", "break"])
    seat = [f"{position_text(build, 'e', a)} = s_{a}" for a in axes]
    body = [
        "placed = False",
        *(f"s_{a} = ZERO" for a in axes),
        *loop_lines(f"attempt in range({start.ATTEMPTS})", draw),
    ]
    body += branch_lines("not placed", [*branch_lines("tid == 0", ["statuses[block] = -(e + 1)"]), "return"])
    body += [*branch_lines("tid == 0", seat), "cuda.syncthreads()"]
    turn = heading_off(build, [own_row(build, f"v{a}") for a in axes])
    seated = [f"{own_row(build, a)} = {position_text(build, 'i', a)}" for a in axes]
    turning = [*branch_lines("row_w.speed > ZERO", turn)]
    return [
        *lines, *loop_lines("e in range(n)", body), *agent_loop(build, [*seated, *turning]), "cuda.syncthreads()",
        *_heard_at_start(build),
    ]  # fmt: skip


def helper_lines(build: CudaBuilder, helper: Callable[..., Any], **known: object) -> tuple[list[str], str]:
    """Lines of a helper of the start as a kernel runs it, for agent i, and what it returns."""
    made = specialise(build, helper, w=driver_argument("row_w"), **known)
    return made.lines, made.answer


def try_place_lines(build: CudaBuilder, agent: str) -> list[str]:
    """Lines that draw a place s_x s_y s_z of an agent, and find whether it is `free`, whoever else is there."""
    s = LocalVector("s", "vector")
    lines, _ = helper_lines(build, start.try_place, i=driver_argument(agent), s=s, excursion=add_excursion(build))
    room, _ = helper_lines(build, start.is_free, s=s)
    return [*lines, *room]


def heading_off(build: CudaBuilder, to: Iterable[str]) -> list[str]:
    """Lines that draw the velocity of agent i at the start."""
    lines, velocity = helper_lines(build, start.heading_off)
    return [*lines, f"ux, uy, uz = {velocity}", *(f"{name} = u{a}" for name, a in zip(to, "xyz", strict=False))]


def own_row(build: CudaBuilder, name: str) -> str:
    """A row of the own agent in the kernel's text."""
    return f"{build.same(name)}_i" if build.shape.registers else f"work[{build.row(name)}, i]"


def agent_loop(build: CudaBuilder, body: Iterable[str]) -> list[str]:
    """Lines for every agent of this thread."""
    return branch_lines("i < n", body) if build.shape.registers else loop_lines("i in range(tid, n, THREADS)", body)


def _heard_at_start(build: CudaBuilder) -> list[str]:
    if not build.plan.late:
        return []
    return loop_lines("slot in range(slots)", [build.stages["snapshot"].call()])
