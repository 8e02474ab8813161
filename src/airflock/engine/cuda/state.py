"""State: where everything of one flock and of one thread lies: rows of the arguments, shared tables, registers."""

import re

from airflock.core import initial_values
from airflock.engine.cuda.build import MAX_TOTALS, CudaBuilder, reciprocal_lines
from airflock.engine.cuda.start import table_widths
from airflock.engine.passes import flock
from airflock.engine.passes.build import loop_lines, sampled_columns
from airflock.engine.plan import INTEGER_NAMES, Plan
from airflock.engine.stages.decide import MAX_GATHERED
from airflock.engine.stages.state import SCENE_ARRAYS, own_row


def memory_lines(build: CudaBuilder) -> list[str]:
    """Where everything of this flock and this thread lies."""
    plan, shape = build.plan, build.shape
    lines = ["block = cuda.blockIdx.x; tid = integer(cuda.threadIdx.x)"]
    lines += ["i = integer(tid // PER_AGENT); sub = integer(tid % PER_AGENT)"]
    lines += ["row = rows[block]; whole = wholes[block]"]
    lines += ["faces = all_faces[block]; edges = all_edges[block]; spans = all_spans[block]"]
    lines += ["goals = all_goals[block]; reached = all_reached[block]; past = pasts[block]; store = stores[block]"]
    lines += ["differing = owns[block]"]
    lines += _across(build)
    lines += ["due = all_due[block]; hits = all_hits[block]"] if plan.faults else []
    lines += ["later = all_later[block]; shapes = all_shapes[block % all_shapes.shape[0]]"]
    lines += [*number_lines(build), "late = real(delay) * row_c.dt"]
    kind, align = f"np.float{plan.bits}", "" if shape.simulated else ", alignment=16"
    if shape.registers:
        for table, width in table_widths(build).items():
            lines += [f"{table} = cuda.shared.array((LANES, {width}), {kind}{align})"]
        lines += ["links_ = cuda.local.array(WORDS, np.uint32)"]
        lines += ["seen = cuda.shared.array(WORDS, np.uint32)", "grown = cuda.shared.array(WORDS, np.uint32)"]
    else:
        lines += ["work = works[block]; words = all_words[block]; mem = all_mem[block]; memory = all_memory[block]"]
    lines += [f"reduced = cuda.shared.array((2, WARPS, {MAX_TOTALS}), {kind})"]
    lines += [f"moved_up = cuda.shared.array(THREADS, {kind})"] if plan.absence and shape.registers else []
    lines += ["found = cuda.shared.array(1, np.int32)"] if plan.absence else []
    count = len(sampled_columns(plan.metrics))
    lines += [f"totals = cuda.shared.array(({max(count, 1)}, 2), {kind})"]
    parts = 5 if plan.dryden else 3
    lines += [f"gust = cuda.local.array({parts}, {kind})", "; ".join(f"gust[{c}] = ZERO" for c in range(parts))]
    lines += [f"aim = cuda.local.array(4, {kind})", "counts = cuda.local.array(2, np.int32)"]
    lines += [f"near = cuda.local.array({MAX_GATHERED}, np.int32)", "counts[0] = 0; counts[1] = 0; aim[3] = ZERO"]
    lines += ["aim[0] = ZERO; aim[1] = ZERO; aim[2] = ZERO"]
    lines += [f"aim[{c}] = goals[0, {c}]" for c in range(3)] if plan.goals else []
    lines += [f"scene = ({', '.join(SCENE_ARRAYS)})"]
    return [*lines, *_scratch(plan), *_registers(build)]


def _across(build: CudaBuilder) -> list[str]:
    """Rows over the others that each agent has to itself; zeros, as not every flight has what fills each of them."""
    if not build.across:
        return []
    rows = loop_lines(
        "c in range(across.shape[0])", loop_lines("j in range(across.shape[2])", ["across[c, e, j] = ZERO"])
    )
    zeros = loop_lines("e in range(tid, across.shape[1], THREADS)", rows)
    return ["across = all_across[block]", *zeros, "cuda.syncthreads()"]


def _scratch(plan: Plan) -> list[str]:
    """Scratch of the rules of the whole flock: rows of one table, each array the rows from its first on; zeros."""
    sizes = flock.scratch_sizes(plan, None, 1)
    if not sizes:
        return []
    made, first = [], 0
    for arrays in sizes:
        made += [
            ", ".join(f"room[scratch_rows[{c}] : scratch_rows[{c + 1}]]" for c in range(first, first + len(arrays)))
        ]
        first += len(arrays)
    zeros = loop_lines(
        "e in range(tid, room.shape[0], THREADS)", loop_lines("c in range(room.shape[1])", ["room[e, c] = ZERO"])
    )
    return ["room = scratches[block]", *zeros, f"scratch = ({' '.join(f'({arrays}),' for arrays in made)})"]


def number_lines(build: CudaBuilder) -> list[str]:
    """Integers and records of numbers of this world, once per kernel."""
    wide = {"seed_low": "u32", "seed_high": "u32"}
    lines = [
        f"{'slots' if w == 'ring' else w} = {wide.get(w, 'integer')}(whole[{c}])" for c, w in enumerate(INTEGER_NAMES)
    ]
    return [
        *lines,
        "n = agents",
        *["m = n"] * bool(build.across),
        *build.numbers(build.plan.records, "row_"),
        *reciprocal_lines(build.reciprocals),
    ]


def _registers(build: CudaBuilder) -> list[str]:
    """First values of all registers; the memories of model and metrics at their start values."""
    lines = []
    names = {r for stage in build.stages.values() for r in (*stage.arguments, *stage.results)}
    names |= {"order_i"} if build.slots and build.shape.registers else set()
    for name in sorted(names):
        if re.fullmatch(r"u[0-3]_i", name):
            lines += [f"{name} = u32(0)"]
        elif name.endswith("_i"):
            lines += [f"{name} = {_first_value(build, name)}"]
    rows = {own_row(*key): c for c, key in enumerate(build.plan.columns)}
    if build.shape.registers:
        return lines
    tables = [f"work[{build.row(name)}, i] = differing[{c}, i]" for name, c in rows.items() if name in build.names]
    tables += [f"work[{build.row('order')}, i] = real(i)"] * build.slots
    return [*loop_lines("i in range(tid, n, THREADS)", tables), "cuda.syncthreads()"] if tables else []


def _first_value(build: CudaBuilder, name: str) -> str:
    """First value of one register."""
    kept = re.fullmatch(r"(mem|kept)(\d+)_i", name)
    differing = [own_row(*key) for key in build.plan.columns]
    if name == "order_i":
        return "real(i)"
    if name[:-2] in differing:
        return f"differing[{differing.index(name[:-2])}, i]"
    if not kept:
        return "ZERO"
    if kept[1] == "mem" and build.plan.laws:
        return f"all_mem[block, {kept[2]}, i]"
    records = [build.plan.model.Memory] if kept[1] == "mem" else [metric.Memory for metric in build.plan.metrics]
    starts = [start for record in records for start in initial_values(record)]
    return f"real({starts[int(kept[2])]})"
