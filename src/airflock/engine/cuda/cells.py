"""Cells: kernels of one big flock, whose neighbours lie in the cells around each agent.

Six launches per decision: agents are counted per cell, the counts are summed up (two launches), agents are listed by
cell and copied in the order of cells, within a cell by their number; then each meets its neighbours, decides and moves.
So the order of every sum, and with it every bit, is the same in each run. Only for perception without noise, delay and
loss.
"""

from typing import Any

from airflock.core import initial_values
from airflock.engine.cuda.build import CudaBuilder
from airflock.engine.cuda.shape import BlockLayout
from airflock.engine.cuda.sorting import LOAD_FOURS_TEXT, SIMULATED_FOURS_TEXT, SORT_TEXT
from airflock.engine.cuda.start import heading_off, try_place_lines
from airflock.engine.cuda.state import number_lines
from airflock.engine.passes.build import branch_lines, loop_lines
from airflock.engine.passes.driver import STAGE_MAKERS
from airflock.engine.plan import Plan
from airflock.engine.replace import checked_replace
from airflock.engine.schedule import stages_of_events
from airflock.engine.stages import start
from airflock.engine.stages.decide import MAX_GATHERED as GATHERED
from airflock.engine.stages.state import SCENE_ARRAYS

NEIGHBOUR_COLUMNS = 8  # columns of the table that neighbours read: x y z number, vx vy vz nothing
GUSTS = 3  # deviations from the mean wind, one per axis
COMMON_ARGUMENTS = ("row", "whole", "faces", "edges", "spans", "shapes", "nodes", "links", "box", "count")
AROUND = (
    "for qz in range(low_z, high_z):",
    "for qy in range(low_y, high_y):",
    "line = ((qz % count[2]) * count[1] + qy % count[1]) * count[0]",
    "{image}",
    "for part in range(parts):",
    "first = low_x; last = high_x; base_x = own_x",
    "{across}",
)
# Across a face of a periodic box neighbours are met at their image: where the agent would be, seen from there.
IMAGE = (
    "base_{a} = own_{a} + (row_w.half_{a} * real(2.0) if q{a} < count[{c}] else "
    "(row_w.half_{a} * real(-2.0) if q{a} >= 2 * count[{c}] else ZERO))"
)
ACROSS = (
    "if part == 1:",
    "    base_x = own_x + row_w.half_x * real(2.0)",
    "    first = count[0] - 1; last = count[0] if ox == 0 else first",
    "if part == 2:",
    "    base_x = own_x - row_w.half_x * real(2.0)",
    "    first = 0; last = 1 if ox == count[0] - 1 else 0",
)


def large_flock_text(plan: Plan, simulated: bool = False) -> str:
    """Text of the driver of one big flock."""
    threads = 4 if simulated else 128
    build = CellBuilder(plan, BlockLayout(32, 1, threads, simulated=simulated))
    for name in _stages(build):
        STAGE_MAKERS[name](build)
    options = "fastmath=True" + ("" if simulated else ", cache=True")
    kernels = [SORT_TEXT.format(options=options, scan=8 if simulated else 1024, near=NEIGHBOUR_COLUMNS)]
    kernels += ["\n".join(_kernel(options, "begin", "near", "rest", *COMMON_ARGUMENTS, body=_begin(build)))]
    given = ("near", "rest", "sorted_", "rest_sorted", "starts", "meet", "step", *COMMON_ARGUMENTS)
    kernels += ["\n".join(_kernel(options, "advance", *given, body=_advance(build)))]
    fours = LOAD_FOURS_TEXT if plan.bits == 32 and not simulated else SIMULATED_FOURS_TEXT
    parts = [build.head, fours, *build.source.blocks, *build.functions, *kernels]
    constants = [f"REST = {private_columns(plan)}", f"SCAN = {8 if simulated else 1024}"]
    return "\n\n".join([*parts, *constants]) + "\n"


def _stages(build: CudaBuilder) -> tuple[str, ...]:
    """What an agent does in a step: nobody is told anything but the truth, so nothing is perceived."""
    events = stages_of_events(build.plan)
    return tuple(name for name in (*events["decide"], *events["move"]) if name != "perceive")


def private_columns(plan: Plan) -> int:
    """Columns that only the agent itself reads, in whole vectors: command, the model's memory, and gusts.

    Each agent keeps the gusts of the flock: they go on from step to step, and no launch can hand them to all others.
    """
    memory = len(getattr(plan.model.Memory, "_fields", ()))
    return -(-(3 + memory + (GUSTS if plan.windy else 0)) // 4) * 4


class CellBuilder(CudaBuilder):
    """Pair loops run over the cells around an agent; agent i has the number that the table gives it."""

    def columns(self) -> dict[str, tuple[str, int]]:
        """What neighbours read of each other."""
        found = {name: ("sorted_", c) for c, a in enumerate("xyz") for name in (a, f"h{a}")}
        return found | {f"hv{a}": ("sorted_", 4 + c) for c, a in enumerate("xyz")}

    def cells(self) -> tuple[str, ...]:
        """Lines around a pair loop."""
        periodic, axes = self.plan.periodic, self.plan.axes[1:]
        image = [IMAGE.format(a=a, c="xyz".index(a)) if periodic else f"base_{a} = own_{a}" for a in axes]
        found: list[str] = []
        for line in AROUND:
            found += image if line == "{image}" else ACROSS if line == "{across}" and periodic else [line]
        return tuple(line for line in found if line != "{across}")

    @property
    def images(self) -> bool:
        """Never: candidates come at their image."""
        return False

    def prepare_stage(self, name: str, lines: list[str]) -> list[str]:
        """Numbers of agents instead of places in the table; noise of an odd step is drawn again."""
        if name == "neighbours":
            lines = checked_replace(lines, "integer(j)", "sorted_[j, 3]")
            lines = checked_replace(lines, "ii = integer(i)", "ii = real(i)")
            for a in self.plan.axes:
                lines = checked_replace(lines, f"[j] - own_{a}", f"[j] - base_{a}")
        return checked_replace(lines, "if step % 2 == 0:", "if step >= 0:") if self.draws_two_steps(name) else lines


def _kernel(options: str, name: str, *arguments: str, body: list[str]) -> list[str]:
    return [f"@cuda.jit({options})", f"def {name}({', '.join(arguments)}):", *(f"    {line}" for line in body)]


def _common(build: CellBuilder) -> list[str]:
    """What every kernel of a flock knows."""
    lines, local = number_lines(build), f"np.float{build.plan.bits}"
    lines += ["sub = integer(0); tid = integer(0); slot = integer(cuda.grid(1)); late = ZERO"]
    lines += [f"gust = cuda.local.array({GUSTS}, {local})", f"aim = cuda.local.array(4, {local})"]
    lines += [f"near_ = cuda.local.array({GATHERED}, np.int32)", "counts = cuda.local.array(2, np.int32)"]
    names = {"near": "near_", "goals": "edges", "reached": "aim", "later": "edges"}
    return [*lines, f"scene = ({', '.join(names.get(part, part) for part in SCENE_ARRAYS)})"]


def _begin(build: CellBuilder) -> list[str]:
    """Every agent at a random place, whoever else is there."""
    plan = build.plan
    draw = try_place_lines(build, "i")
    draw += branch_lines("free", ["placed = True", "break"])
    turn = heading_off(build, ("vx", "vy", "vz"))
    body = ["i = slot; placed = False; s_x = ZERO; s_y = ZERO; s_z = ZERO; vx = ZERO; vy = ZERO; vz = ZERO"]
    body += [*loop_lines(f"attempt in range({start.ATTEMPTS})", draw), *branch_lines("row_w.speed > ZERO", turn)]
    put = ("s_x", "s_y", "s_z", "real(i if placed else -1 - i)", "vx", "vy", "vz", "ZERO")
    body += [f"near[i, {c}] = {value}" for c, value in enumerate(put)]
    values = ["ZERO"] * 3 + [f"real({start})" for start in initial_values(plan.model.Memory)]
    body += [f"rest[i, {c}] = {v}" for c, v in enumerate(values + ["ZERO"] * (private_columns(plan) - len(values)))]
    return [*_common(build), *branch_lines("slot < n", body)]


def _advance(build: CellBuilder) -> list[str]:
    """One step of one agent: from the sorted tables where it decides, else from the tables as they are."""
    plan, axes = build.plan, build.plan.axes
    memory = len(getattr(plan.model.Memory, "_fields", ()))
    registers = sorted({r for s in build.stages.values() for r in (*s.arguments, *s.results) if r.endswith("_i")})
    state = {f"{a}_i": ("near", c) for c, a in enumerate(axes)} | {
        f"v{a}_i": ("near", 4 + c) for c, a in enumerate(axes)
    }
    state |= {f"c{a}_i": ("rest", c) for c, a in enumerate(axes)} | {
        f"mem{c}_i": ("rest", 3 + c) for c in range(memory)
    }
    state |= {f"gust[{c}]": ("rest", 3 + memory + c) for c in range(GUSTS if plan.windy else 0)}
    sorted_ = {"near": "sorted_", "rest": "rest_sorted"}
    body = ["time = real(step) * row_c.dt; answer = ZERO"]
    body += ["counts[0] = 0; counts[1] = 0"]
    body += [f"{r} = {'u32(0)' if r[0] == 'u' and r[1].isdigit() else 'ZERO'}" for r in registers if r not in state]
    load = [f"{name} = {table}[slot, {c}]" for name, (table, c) in state.items()]
    fetch = [f"{name} = {sorted_[table]}[slot, {c}]" for name, (table, c) in state.items()]
    meet = ["i = integer(sorted_[slot, 3])", *fetch, *_edges(build)]
    meet += ["number = step // decide_every"]
    meet += [build.stages[name].call(k_="number") for name in _stages(build)[:-1]]
    body += ["i = integer(near[slot, 3])", *load, *branch_lines("meet != 0", meet), build.stages["move"].call()]
    store = [f"{table}[slot, {c}] = {name}" for name, (table, c) in state.items()]
    return [*_common(build), *branch_lines("slot < n", [*body, *store, "near[slot, 3] = real(i)"])]


def _edges(build: CellBuilder) -> list[str]:
    """Cells around the own one: along z and y from low to high, along x in one run and, across a face, two more.

    In a periodic box cells are counted from one box before the first, so that the count says at which image they lie.
    In a box of one or two cells a cell comes more than once, each time at another image; one of them is in reach.
    """
    lines = ["parts = 1"]
    for c, a in enumerate("xyz"):
        flown = a in build.plan.axes
        own = f"{a}_i" if flown else "ZERO"
        lines += [f"o{a} = cell_along({own}, box[{c}], box[{3 + c}], count[{c}]); many = count[{c}]"]
        if build.plan.periodic and flown and a != "x":
            lines += [f"low_{a} = o{a} - 1 + many; high_{a} = low_{a} + 3"]
        else:
            lines += [f"low_{a} = max(o{a} - 1, 0); high_{a} = min(o{a} + 2, many)"]
    return [*lines, "parts = 3 if ox == 0 or ox == count[0] - 1 else 1"] if build.plan.periodic else lines


def signatures(bits: int) -> dict[str, tuple[Any, ...]]:
    """Numba types of the arguments of every kernel of a crowd."""
    from numba import types

    real = types.float32 if bits == 32 else types.float64
    whole, word = types.int32, types.uint32
    line, table = types.Array(real, 1, "C"), types.Array(real, 2, "C")
    wholes, words, numbers = (types.Array(kind, 1, "C") for kind in (whole, word, types.int64))
    spans = types.Array(types.int64, 2, "C")
    common = (line, numbers, table, table, spans, table, table, spans, line, wholes)
    return {
        "count_agents": (table, line, wholes, wholes, wholes, wholes),
        "sum_within": (wholes, words, wholes),
        "sum_before": (wholes, words, wholes),
        "list_agents": (table, wholes, wholes, words, wholes, wholes),
        "copy_agents": (table, table, wholes, words, wholes, table, table),
        "begin": (table, table, *common),
        "advance": (*[table] * 4, words, whole, whole, *common),
    }
