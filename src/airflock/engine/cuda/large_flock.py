"""Cells: kernels of one big flock, whose neighbours lie in the cells around each agent.

Six launches per decision: agents are counted per cell, the counts are summed up (two launches),
agents are listed by cell and copied in the order of cells, within a cell by their number; then each
meets its neighbours, decides and moves. So the order of every sum, and with it every bit, is the
same in each run. Only for perception without noise, delay and loss.
"""

import math
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import initial_values
from airflock.engine.cpu import DriverResult
from airflock.engine.cuda.block_layout import BlockLayout
from airflock.engine.cuda.cuda_builder import CudaBuilder
from airflock.engine.cuda.flight_kernel import heading_off, number_lines, try_place_lines
from airflock.engine.cuda.launch import MAX_MEMORY_SHARE, configure_kernel, memory_message
from airflock.engine.measuring import score_tables
from airflock.engine.passes.build import branch_lines, loop_lines, sampled_columns
from airflock.engine.passes.driver import STAGE_MAKERS
from airflock.engine.passes.flock import flock_rules
from airflock.engine.plan import Plan
from airflock.engine.replace import checked_replace
from airflock.engine.schedule import stages_of_events
from airflock.engine.stages import start
from airflock.engine.stages.decide import MAX_GATHERED as GATHERED
from airflock.engine.stages.state import SCENE_ARRAYS
from airflock.engine.store import load_driver
from airflock.engine.tables import WorldTables, world_tables
from airflock.engine.totals import combine_sums
from airflock.scenarios import FORMATIONS, Scenario, step_counts
from airflock.support import DeviceError, cuda_runtime, free_gpu_memory, is_simulated, require_gpu

# Rows of near are two vectors of four. A compiler that knows nothing of their place loads number by
# number, seven times as often: one instruction of the GPU loads four. (Tables begin at multiples of
# 256 bytes.)
LOAD_FOURS_TEXT = """
from llvmlite import ir
from numba.cuda import types
from numba.cuda.extending import intrinsic


def four_at(offset):
    @intrinsic
    def four(typingctx, table, row):
        def codegen(context, builder, signature, arguments):
            array = context.make_array(signature.args[0])(context, builder, arguments[0])
            word, number = ir.IntType(64), ir.FloatType()
            place = builder.mul(builder.zext(arguments[1], word), word(32))
            address = builder.add(builder.add(builder.ptrtoint(array.data, word), place), word(offset))
            kind = ir.FunctionType(ir.LiteralStructType([number] * 4), [word])
            load = ir.InlineAsm(kind, "ld.global.nc.v4.f32 {$0, $1, $2, $3}, [$4];", "=f,=f,=f,=f,l")
            found = builder.call(load, [address])
            values = [builder.extract_value(found, c) for c in range(4)]
            return context.make_tuple(builder, signature.return_type, values)

        return types.UniTuple(types.float32, 4)(table, row), codegen

    return four


four_low = four_at(0)
four_high = four_at(16)
"""
SIMULATED_FOURS_TEXT = """
@njit()
def four_low(table, row):
    return table[row, 0], table[row, 1], table[row, 2], table[row, 3]


@njit()
def four_high(table, row):
    return table[row, 4], table[row, 5], table[row, 6], table[row, 7]
"""
# An agent's place in its cell is the number of lower-numbered agents there: atomic ranks would
# change last bits from run to run. A loop over one cell is short.
SORT_TEXT = """
@njit()
def cell_along(x, low, size, count):
    return min(max(integer((x - low) / size), integer(0)), integer(count - 1))


@njit()
def cell_of(x, y, z, box, count):
    cx = cell_along(x, box[0], box[3], count[0])
    cy = cell_along(y, box[1], box[4], count[1])
    cz = cell_along(z, box[2], box[5], count[2])
    return integer((cz * count[1] + cy) * count[0] + cx)


@cuda.jit({options})
def count_agents(near, box, count, counts, cell, rank):
    a = cuda.grid(1)
    if a < near.shape[0]:
        c = cell_of(near[a, 0], near[a, 1], near[a, 2], box, count)
        cell[a] = c
        rank[a] = cuda.atomic.add(counts, c, 1)


@cuda.jit({options})
def sum_within(counts, starts, sums):
    part = cuda.shared.array({scan}, np.int32)
    t = cuda.threadIdx.x
    c = cuda.grid(1)
    own = counts[c] if c < counts.shape[0] else 0
    part[t] = own
    cuda.syncthreads()
    reach = 1
    while reach < {scan}:
        before = part[t - reach] if t >= reach else 0
        cuda.syncthreads()
        part[t] += before
        cuda.syncthreads()
        reach *= 2
    if c < counts.shape[0]:
        starts[c] = part[t] - own
    if t == {scan} - 1:
        sums[cuda.blockIdx.x] = part[t]


@cuda.jit({options})
def sum_before(counts, starts, sums):
    part = cuda.shared.array({scan}, np.int32)
    t = cuda.threadIdx.x
    c = cuda.grid(1)
    before = 0
    b = t
    while b < cuda.blockIdx.x:
        before += sums[b]
        b += {scan}
    part[t] = before
    cuda.syncthreads()
    half = {scan} // 2
    while half > 0:
        if t < half:
            part[t] += part[t + half]
        cuda.syncthreads()
        half //= 2
    if c < counts.shape[0]:
        starts[c] = starts[c] + part[0]
        if c == counts.shape[0] - 1:
            starts[c + 1] = starts[c] + counts[c]


@cuda.jit({options})
def list_agents(near, cell, rank, starts, counts, listed):
    a = cuda.grid(1)
    if a < near.shape[0]:
        listed[starts[cell[a]] + rank[a]] = integer(near[a, 3])
    if a < counts.shape[0]:
        counts[a] = 0


@cuda.jit({options})
def copy_agents(near, rest, cell, starts, listed, sorted_, rest_sorted):
    a = cuda.grid(1)
    if a < near.shape[0]:
        own = integer(near[a, 3])
        place = integer(starts[cell[a]])
        for s in range(integer(starts[cell[a]]), integer(starts[cell[a] + 1])):
            place += 1 if listed[s] < own else 0
        for c in range({near}):
            sorted_[place, c] = near[a, c]
        for c in range(rest.shape[1]):
            rest_sorted[place, c] = rest[a, c]
"""


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
# Across a face of a periodic box neighbours are met at their image: where the agent would be, seen
# from there. The agent is moved by a box once per row of cells instead of folding every offset: a
# quarter of a pair's instructions.
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
    """Return the stages of a step; perception is exact here, so the stage `perceive` is left out."""
    events = stages_of_events(build.plan)
    return tuple(name for name in (*events["decide"], *events["move"]) if name != "perceive")


def private_columns(plan: Plan) -> int:
    """Columns that only the agent itself reads, in whole vectors: command, the model's memory, and gusts.

    Each agent keeps the gusts of the flock: they go on from step to step, and no launch can hand
    them to all others.
    """
    memory = len(getattr(plan.model.Memory, "_fields", ()))
    return -(-(3 + memory + (GUSTS if plan.windy else 0)) // 4) * 4


class CellBuilder(CudaBuilder):
    """Pair loops run over the cells around an agent; agent i has the number that the table gives it."""

    def columns(self) -> dict[str, tuple[str, int]]:
        """Columns of the table that neighbours read of each other."""
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
    """Lines at the head of every kernel of a flock."""
    lines, local = number_lines(build), f"np.float{build.plan.bits}"
    lines += ["sub = integer(0); tid = integer(0); slot = integer(cuda.grid(1)); late = ZERO"]
    lines += [f"gust = cuda.local.array({GUSTS}, {local})", f"aim = cuda.local.array(4, {local})"]
    lines += [f"near_ = cuda.local.array({GATHERED}, np.int32)", "counts = cuda.local.array(2, np.int32)"]
    names = {"near": "near_", "goals": "edges", "reached": "aim", "later": "edges"}
    return [*lines, f"scene = ({', '.join(names.get(part, part) for part in SCENE_ARRAYS)})"]


def _begin(build: CellBuilder) -> list[str]:
    """Lines that put every agent at a random place, without regard to the others."""
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
    # Between decisions agents stay where the last sort put them: only a decision reads the sorted
    # tables and writes back in their order.
    meet = ["i = integer(sorted_[slot, 3])", *fetch, *_edges(build)]
    meet += ["number = step // decide_every"]
    meet += [build.stages[name].call(k_="number") for name in _stages(build)[:-1]]
    body += ["i = integer(near[slot, 3])", *load, *branch_lines("meet != 0", meet), build.stages["move"].call()]
    store = [f"{table}[slot, {c}] = {name}" for name, (table, c) in state.items()]
    return [*_common(build), *branch_lines("slot < n", [*body, *store, "near[slot, 3] = real(i)"])]


def _edges(build: CellBuilder) -> list[str]:
    """Cells around the own one: along z and y from low to high, along x in one run and, across a face, two more.

    In a periodic box cells are counted from one box before the first, so that the count says at
    which image they lie. In a box of one or two cells a cell comes more than once, each time at
    another image; one of them is in reach.
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


CELLS = 4  # at most so many cells per agent, as on the CPU
PAIRED = 20_000  # agents from which order parameters that look at all pairs are refused


@cache
def large_flock_driver(plan: Plan, simulated: bool) -> ModuleType:
    """Driver of one big flock."""
    return load_driver(large_flock_text(plan, simulated), f"{plan.model.name}_crowd")


def cell_plan_error(plan: Plan, agents: int) -> str | None:
    """Why a plan cannot be flown by cells on a GPU; None if it can."""
    # The kernel of one large flock knows a part of the plan only; each refusal names the part, and
    # the CPU flies the rest.
    if not plan.grid:
        return "cells need at least 1000 agents, a model of finite reach and perception without noise or delay"
    if plan.columns:
        return "one big flock with groups flies on cpu"
    if plan.faults or plan.absence:
        return "one big flock with faults, or whose agents leave, flies on cpu"
    if plan.topology is not None:
        return f"one big flock with topology.kind = {plan.topology.name} flies on cpu"
    if flock_rules(plan):
        return f"{plan.model.name} or its order parameters solve for the whole flock"
    if plan.start in FORMATIONS and not plan.given_start:
        return f"one big flock starts at random or given places, not in start.kind = {plan.start}"
    if plan.dryden:
        return "one big flock in Dryden turbulence flies on cpu"
    if plan.lags:
        return "one big flock whose commands wait for body.delay flies on cpu"
    if plan.body.Memory is not None:
        return f"a body that remembers ({plan.body.name}) flies on cpu in one big flock"
    if plan.goals or plan.own or plan.scene or plan.stop:
        return "one big flock with goals, in a scene, or up to its first collision flies on cpu"
    if any(metric.clock == "collision" for metric in plan.metrics):
        return "one big flock is not watched for collisions on a GPU; choose metrics.kind = order, or device = cpu"
    if agents > PAIRED and any(metric.pair or metric.cluster for metric in plan.metrics):
        return f"order parameters of pairs take too long for {agents} agents; choose metrics.kind = order"
    return None


def cell_grid(scenario: Scenario, plan: Plan, tables: WorldTables) -> tuple[list[float], list[float], list[int]]:
    """Lower corner and size of the cells (m), and their number, per axis. Who is outside is in the nearest cell."""
    row = dict(zip([f"{k}.{f}" for k, fields in plan.records.items() for f in fields], tables.row, strict=True))
    assert scenario.model.reach is not None
    near = min(float(scenario.model.reach(scenario.parameters)), float(scenario.radio.range), 1e8)
    half = [float(row[f"w.half_{a}"]) if a in plan.axes else 0.0 for a in "xyz"]
    if not plan.periodic:  # an arena without walls has no size: where the agents start is as good a box as any
        half = [h if 0.0 < h < 1e7 else float(row[f"w.extent_{a}"]) for h, a in zip(half, "xyz", strict=True)]
    width = [2.0 * h for h in half]
    volume = math.prod(max(w / near, 1.0) for w in width)
    # As on the CPU: cells grow where a wide arena would have more of them than memory is meant for.
    side = near * max(1.0, (volume / (CELLS * scenario.agents)) ** (1.0 / plan.dimensions))
    count = [max(1, int(w / side)) for w in width]
    size = [w / c if w > 0.0 else 1.0 for w, c in zip(width, count, strict=True)]
    return [-h for h in half], size, count


def memory_error(scenario: Scenario, plan: Plan) -> str | None:
    """Why a flock does not fit into the GPU's free memory: what it needs and how many agents fit; None if it does."""
    each = (
        2 * (NEIGHBOUR_COLUMNS + private_columns(plan)) * plan.bits // 8 + 12
    )  # two copies of the tables; cell, rank, number
    each += 8 * CELLS  # at most so many cells, each with a count and a first agent
    room = int(MAX_MEMORY_SHARE * free_gpu_memory())
    n = scenario.agents
    return None if n * each <= room else memory_message(n, n * each, room, room // each)


class LargeFlock:
    """One big flock in the GPU's memory.

    Its tables are in the order of the cells of the last decision: near (agent, 8) holds x y z
    number vx vy vz nothing, rest (agent, columns) command and memory of the model.
    """

    def __init__(self, scenario: Scenario, plan: Plan, seed: int = 0, start: Any = None):
        require_gpu(is_simulated())
        self.plan = plan.built(grid=True)
        self.scenario, self.agents, self.step = scenario, scenario.agents, 0
        fault = cell_plan_error(self.plan, self.agents)
        if fault is not None:
            raise DeviceError(f"device = cuda: {fault}")
        if scenario.separation() > 0.0 and start is None:
            raise DeviceError("device = cuda: one big flock starts at random places; set start.separation = 0")
        self.tables: WorldTables = world_tables(scenario, self.plan, seed)
        self.times = step_counts(scenario)
        self.driver = large_flock_driver(self.plan, is_simulated())
        self._allocate()
        self._begin(start)

    def _allocate(self) -> None:
        """All tables."""
        cuda, real, n = cuda_runtime(), self.tables.row.dtype, self.agents
        low, size, count = cell_grid(self.scenario, self.plan, self.tables)
        cells = int(np.prod(count))
        fault = None if is_simulated() else memory_error(self.scenario, self.plan)
        if fault is not None:
            raise DeviceError(f"device = cuda: {fault}")
        t = self.tables
        shapes = t.shapes if len(t.shapes) else np.zeros((1, 16), real)
        whole = [t.faces, t.edges, t.spans, shapes, t.nodes.reshape(-1, 6), t.links.reshape(-1, 3)]
        arrays = [t.row, t.whole, *(a if len(a) else np.zeros((1, a.shape[1]), a.dtype) for a in whole[:3]), *whole[3:]]
        given = [*arrays, np.array([*low, *size], real), np.array(count, np.int32)]
        self.common = [cuda.to_device(np.ascontiguousarray(array)) for array in given]
        assert len(self.common) == len(COMMON_ARGUMENTS)
        self.near, self.sorted = (cuda.to_device(np.zeros((n, NEIGHBOUR_COLUMNS), real)) for _ in range(2))
        self.rest, self.rest_sorted = (cuda.to_device(np.zeros((n, self.driver.REST), real)) for _ in range(2))
        self.cell, self.rank, self.listed = (cuda.to_device(np.zeros(n, np.int32)) for _ in range(3))
        self.counts = cuda.to_device(np.zeros(cells, np.int32))
        self.starts = cuda.to_device(np.zeros(cells + 1, np.uint32))
        self.blocks = -(-cells // self.driver.SCAN)
        self.sums = cuda.to_device(np.zeros(self.blocks, np.int32))

    def _begin(self, start: Any) -> None:
        """Agents at random places, or at given ones: (component, agent)."""
        dims = self.plan.dimensions
        if start is None:
            configure_kernel(self.driver.begin, *self._grid(self.agents))(self.near, self.rest, *self.common)
            return
        near = np.zeros((self.agents, NEIGHBOUR_COLUMNS), self.tables.row.dtype)
        near[:, :dims], near[:, 4 : 4 + dims] = np.asarray(start)[:dims].T, np.asarray(start)[dims:].T
        near[:, 3] = np.arange(self.agents)
        rest = np.zeros((self.agents, self.driver.REST), near.dtype)
        for c, value in enumerate(initial_values(self.plan.model.Memory)):
            rest[:, 3 + c] = value
        self.near, self.rest = cuda_runtime().to_device(near), cuda_runtime().to_device(rest)

    def _grid(self, work: int) -> tuple[int, int]:
        """Blocks and threads for this many threads."""
        return -(-work // self.driver.THREADS), int(self.driver.THREADS)

    def advance(self, steps: int = 1) -> None:
        """Fly this many motion steps; returns while the GPU may still be at work."""
        each, scan = self._grid(self.agents), (self.blocks, int(self.driver.SCAN))
        most = self._grid(max(self.agents, len(self.counts)))
        count, within, before, list_, copy, move = (
            configure_kernel(getattr(self.driver, name), *grid)
            for name, grid in (("count_agents", each), ("sum_within", scan), ("sum_before", scan),
                               ("list_agents", most), ("copy_agents", each), ("advance", each))
        )  # fmt: skip
        # Five small kernels sort at each decision; launches follow each other on one stream, so
        # nothing waits on the host.
        for _ in range(steps):
            meet = self.step % self.times["decide_every"] == 0
            if meet:
                count(self.near, self.common[-2], self.common[-1], self.counts, self.cell, self.rank)
                within(self.counts, self.starts, self.sums)
                before(self.counts, self.starts, self.sums)
                list_(self.near, self.cell, self.rank, self.starts, self.counts, self.listed)
                copy(self.near, self.rest, self.cell, self.starts, self.listed, self.sorted, self.rest_sorted)
            state = (self.near, self.rest, self.sorted, self.rest_sorted, self.starts)
            move(*state, np.int32(meet), np.int32(self.step), *self.common)
            self.step += 1

    def state(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """(component, agent) position and velocity; and the commands, agents in the order of their numbers."""
        near, rest, dims = self.near.copy_to_host(), self.rest.copy_to_host(), self.plan.dimensions
        order = np.argsort(near[:, 3])
        parts = [near[order, :dims].T, near[order, 4 : 4 + dims].T]
        return np.concatenate(parts), rest[order, :dims].T

    def neighbours(self, sample: int = 200) -> float:
        """Mean number of others within the reach of an agent, over some of them."""
        assert self.scenario.model.reach is not None
        reach, dims = float(self.scenario.model.reach(self.scenario.parameters)), self.plan.dimensions
        places, _ = self.state()
        x, half = places[:dims].T.astype(float), np.array(self.common[-2].copy_to_host()[:dims], float)
        found = []
        for i in range(0, self.agents, max(1, self.agents // sample)):
            d = x - x[i]
            d -= 2.0 * np.abs(half) * np.round(d / (2.0 * np.abs(half))) if self.plan.periodic else 0.0
            found.append(float((np.einsum("ij,ij->i", d, d) < reach * reach).sum() - 1))
        return float(np.mean(found))


def fly_large_flock(scenario: Scenario, plan: Plan, seed: int, start: Any = None) -> DriverResult:
    """Fly one big flock and measure it at each sample."""
    flock = LargeFlock(scenario, plan, seed, start)
    every, steps = flock.times["sample_every"], flock.times["steps"]
    once = plan.built(grid=True, record=False)
    table = flock.tables.changed(sample_every=1)
    frames, series = [], []
    places = flock.state()[0]
    for step in range(0, steps + 1, every):
        flock.advance(step - flock.step)
        places = flock.state()[0]
        series.append(score_tables(once, table, places[None])[1][0])
        if plan.record:  # the command of this instant is decided by the step that follows
            flock.advance()
            frames.append(np.concatenate([places, flock.state()[1]]))
    if flock.step < steps:
        flock.advance(steps - flock.step)
        places = flock.state()[0]
    status = min(0, int(flock.near.copy_to_host()[:, 3].min()))
    kept = np.stack(frames) if plan.record else None
    return DriverResult(combine_sums(plan, _sums(plan, np.array(series))), kept, places, status)


def _sums(plan: Plan, series: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over time as a driver keeps them, from the values of every sample."""
    found = []
    for c, (_, how, _) in enumerate(sampled_columns(plan.metrics)):
        found.append({"min": np.min, "max": np.max}.get(how, np.sum)(series[:, c]))
    return np.array([*found, float(len(series)), 0.0])
