"""Kernel: a whole flight of one flock per block, as the order in which the stages run."""

import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import initial_values
from airflock.engine.cuda.block_layout import BlockLayout
from airflock.engine.cuda.cuda_builder import MAX_TOTALS, CudaBuilder, reciprocal_lines
from airflock.engine.passes import flock
from airflock.engine.passes.build import branch_lines, loop_lines, sampled_columns
from airflock.engine.passes.driver import make_stages
from airflock.engine.passes.flock import flock_rules
from airflock.engine.passes.stage_functions import add_excursion, add_ring
from airflock.engine.plan import INTEGER_NAMES, Plan
from airflock.engine.schedule import sequential_stages, stages_of_events
from airflock.engine.specialise.known_values import LocalVector, driver_argument
from airflock.engine.specialise.specialiser import specialise
from airflock.engine.stages import move, start
from airflock.engine.stages.approach import SLACK
from airflock.engine.stages.decide import MAX_GATHERED
from airflock.engine.stages.measure import measured_metrics
from airflock.engine.stages.state import SCENE_ARRAYS, fault_row, own_row as agent_number_row
from airflock.engine.stages.words import REDUCTION_START, ZERO
from airflock.engine.tables import WorldTables
from airflock.scenarios import FORMATIONS


def table_widths(build: CudaBuilder) -> dict[str, int]:
    """Shared tables and their widths: whole vectors of two or four numbers."""
    found: dict[str, int] = {}
    for table, column in build.columns().values():
        found[table] = max(found.get(table, 0), column + 1)
    return {table: 2 if width <= 2 else -(-width // 4) * 4 for table, width in found.items()}


def position_text(build: CudaBuilder, agent: str, row: str) -> str:
    """Text of the position of an agent as other threads read it."""
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
        return [*lines, *agent_loop(build, given), "cuda.syncthreads()", *_ring_at_start(build)]
    if plan.start in FORMATIONS:
        lines_, _ = helper_lines(build, start.place_in_formation, s=LocalVector("s", "vector"))
        placed = [*lines_, *(f"{own_row(build, a)} = s_{a}" for a in axes), f"{own_row(build, 'vx')} = row_w.speed"]
        return [*lines, *agent_loop(build, placed), "cuda.syncthreads()", *_ring_at_start(build)]
    draw = try_place_lines(build, "e")
    gap = " + ".join(
        f"(s_{a} - {position_text(build, 'j', a)}) * (s_{a} - {position_text(build, 'j', a)})" for a in axes
    )
    # Agents take places one after another, but all threads test one place against those before it,
    # and vote.
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
        *_ring_at_start(build),
    ]  # fmt: skip


def helper_lines(build: CudaBuilder, helper: Callable[..., Any], **known: object) -> tuple[list[str], str]:
    """Lines of a helper of the start as a kernel runs it, for agent i, and what it returns."""
    made = specialise(build, helper, w=driver_argument("row_w"), **known)
    return made.lines, made.answer


def try_place_lines(build: CudaBuilder, agent: str) -> list[str]:
    """Lines that draw a place s_x s_y s_z of an agent, and find out if it is `free`, other agents aside."""
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


def _ring_at_start(build: CudaBuilder) -> list[str]:
    """What is heard, and what bodies follow, before anything was sent or decided."""
    stages = ["snapshot"] * build.plan.late + ["first_command"] * build.plan.lags
    return [line for name in stages for line in loop_lines("slot in range(slots)", [build.stages[name].call()])]


def memory_lines(build: CudaBuilder) -> list[str]:
    """Lines that name all memory of this flock and this thread."""
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
    # States that other threads read lie in shared memory; all else of an agent is registers, as
    # long as a block has a thread per agent.
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
    # Kernels have few arguments: all scratch of a flock lies in one table as wide as the widest
    # array, 82 kB for five wings.
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
        f"{'slots' if w == 'ring' else w} = {wide.get(w, 'integer')}(whole[{c}])"
        for c, w in enumerate(INTEGER_NAMES)
        if w != "lag" or build.plan.lags
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
    rows = {agent_number_row(*key): c for c, key in enumerate(build.plan.columns)}
    if build.shape.registers:
        return lines
    tables = [f"work[{build.row(name)}, i] = differing[{c}, i]" for name, c in rows.items() if name in build.names]
    tables += [f"work[{build.row('order')}, i] = real(i)"] * build.slots
    return [*loop_lines("i in range(tid, n, THREADS)", tables), "cuda.syncthreads()"] if tables else []


def _first_value(build: CudaBuilder, name: str) -> str:
    """First value of one register."""
    kept = re.fullmatch(r"(mem|kept)(\d+)_i", name)
    differing = [agent_number_row(*key) for key in build.plan.columns]
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


STEP, KIND, AGENT, LEAVES = range(4)  # columns of the table of whole numbers; that of reals: how long, then numbers


def onset_tables(plan: Plan, jobs: Sequence[WorldTables], real: Any) -> dict[str, NDArray[Any]]:
    """Tables of what begins in each flock, by argument name; a step that never comes where there is no more."""
    kinds = {kind.name: number for number, kind in enumerate(plan.faults)}
    found = [[onset for onset in tables.due if onset.kind in kinds] for tables in jobs]
    most, width = max(map(len, found), default=0), max((len(kind.fields) for kind in plan.faults), default=0)
    whole = np.full((len(jobs), max(most, 1), 4), -1, np.int64)
    hits = np.zeros((len(jobs), max(most, 1), 1 + width), real)
    for block, onsets in enumerate(found):
        for place, onset in enumerate(onsets):
            whole[block, place] = onset.step, kinds[onset.kind], onset.agent, int(onset.leaves)
            hits[block, place, : 1 + len(onset.numbers)] = onset.lasts, *onset.numbers
    return {"all_due": whole, "all_hits": hits}


def presence_results(tables: WorldTables, flown: int) -> tuple[float, NDArray[np.bool_]]:
    """Share of agents and instants at which an agent was there, and who is absent at the end.

    flown : the last step that was flown
    """
    n = tables.integers["agents"]
    gone: dict[int, int] = {}
    for onset in tables.due:
        if onset.leaves and onset.step <= flown:
            gone.setdefault(onset.agent, onset.step)
    there = n * (flown + 1) - sum(flown + 1 - step for step in gone.values())
    return there / (n * (flown + 1)), np.array([agent in gone for agent in range(n)])


def begin_fault_lines(build: CudaBuilder) -> list[str]:
    """Lines that let begin what is due before a step."""
    if not build.plan.faults:
        return []
    # A launch flies the whole flight, so there is no place between two steps for Python: onsets are
    # drawn before the launch.
    number = f"integer({own_row(build, 'order')})" if build.slots else "i"
    hit: list[str] = []
    for place, kind in enumerate(build.plan.faults):
        written = {"onset": "time", "lasts": "hits[begun, 0]"}
        written |= {name: f"hits[begun, {1 + c}]" for c, name in enumerate(kind.fields)}
        known = {name: name.removeprefix("at_") for name in kind.onset_names}
        written |= {name: own_row(build, row) for name, row in known.items() if row in build.names}
        rows = {name: fault_row(kind.name, name) for name in written}
        lines = [
            f"{own_row(build, rows[name])} = {said}" for name, said in written.items() if rows[name] in build.names
        ]
        hit += branch_lines(f"due[begun, {KIND}] == {place}", lines) if lines else []
    here = branch_lines(f"{number} == due[begun, {AGENT}]", hit or ["pass"])
    body = agent_loop(build, here)
    if build.slots:
        body = [
            *branch_lines(f"due[begun, {LEAVES}] == 0", body),
            *branch_lines(f"due[begun, {LEAVES}] != 0", _leave(build)),
        ]
    body += ["begun = integer(begun + 1)"]
    test = f"begun < due.shape[0] and due[begun, {STEP}] == step"
    return [f"while {test}:", *[f"    {line}" for text in body for line in text.splitlines()]]


def _leave(build: CudaBuilder) -> list[str]:
    """Lines that put an agent behind the others."""
    plan, registers = build.plan, build.shape.registers
    find = branch_lines(f"integer({own_row(build, 'order')}) == due[begun, {AGENT}]", ["found[0] = i"])
    lines = [
        "cuda.syncthreads()",
        *branch_lines("tid == 0", ["found[0] = -1"]),
        "cuda.syncthreads()",
        *agent_loop(build, find),
    ]
    lines += ["cuda.syncthreads()", "gone = integer(found[0])", "last = integer(n - 1)"]
    # As on a CPU, agents behind the one that leaves move up by one. A mark tested in every loop
    # would touch each metric.
    up = _in_registers(build) if registers else _in_tables()
    if plan.remembers:
        up += _shifted("past", "slots * past.shape[1]", "e // past.shape[1], e % past.shape[1], {c}")
    if plan.packets:
        up += [*_shifted("store", "store.shape[0] * LANES", "e // LANES, e % LANES, {c}"), "cuda.syncthreads()"]
        up += _shifted("store", "store.shape[0] * LANES", "e // LANES, {c}, e % LANES")
    if registers:
        for table, width in table_widths(build).items():
            blank = [f"{table}[last, {c}] = {'AWAY' if c < len(plan.axes) else 'ZERO'}" for c in range(width)]
            up += branch_lines("tid == 0", blank)
    if flock_rules(plan):  # rules of the whole flock start again
        up += loop_lines(
            "e in range(tid, room.shape[0], THREADS)", loop_lines("c in range(room.shape[1])", ["room[e, c] = ZERO"])
        )
    up += ["n = last", *["m = n"] * bool(build.across), "cuda.syncthreads()"]
    return [*lines, *branch_lines("gone >= 0", up)]


def _in_registers(build: CudaBuilder) -> list[str]:
    """Each thread takes over what the same thread of the next agent carries; the last one keeps who has left."""
    carried = {name for stage in build.stages.values() for name in (*stage.arguments, *stage.results)}
    carried = {name for name in carried if name.endswith("_i") and not re.fullmatch(r"u[0-3]_i", name)}
    lines = []
    for name in sorted(carried | {own_row(build, "order")}):
        lines += [f"moved_up[tid] = {name}", "cuda.syncthreads()"]
        lines += branch_lines("gone <= i < last", [f"{name} = moved_up[tid + PER_AGENT]"])
        lines += branch_lines("i == last", [f"{name} = moved_up[gone * PER_AGENT + sub]"])
        lines += ["cuda.syncthreads()"]
    return lines


def _in_tables() -> list[str]:
    """Lines that move rows of tables up, each by one thread."""
    lines = []
    for table in ("work", "mem", "memory"):
        lines += _shifted(table, f"{table}.shape[0]", "e, {c}")
    return [*lines, "cuda.syncthreads()"]


def _shifted(table: str, rows: str, place: str) -> list[str]:
    """Lines that move up all entries behind one of each row; that one goes to the last place."""
    at = [f"{table}[{place.format(c=c)}]" for c in ("gone", "c", "c + 1", "last")]
    body = [f"kept = {at[0]}", *loop_lines("c in range(gone, last)", [f"{at[1]} = {at[2]}"]), f"{at[3]} = kept"]
    return loop_lines(f"e in range(tid, {rows}, THREADS)", body)


ARGUMENTS = (
    "rows", "wholes", "all_faces", "all_edges", "all_spans", "all_shapes", "all_later", "nodes", "links", "all_goals",
    "starts", "owns", "pasts", "stores", "works", "all_words", "all_mem", "all_memory", "statuses", "states",
    "all_sums", "all_reached", "all_frames", "scratches", "scratch_rows", "all_across", "all_due", "all_hits",
)  # fmt: skip


def flight_text(plan: Plan, shape: BlockLayout) -> str:
    """Text of the driver that flies one flock per block: kernel `fly`."""
    build = CudaBuilder(plan, shape)
    make_stages(build)
    if plan.lags:
        add_ring(build, move.first_command)
    body = _time(build)  # first: it may still name rules
    lines = [*memory_lines(build), *begin_lines(build), *body, *_end(build)]
    options = "fastmath=True" + ("" if shape.simulated else f", launch_bounds={shape.bounds}, cache=True")
    text = [f"@cuda.jit({options})", f"def fly({', '.join(ARGUMENTS)}):", *(f"    {line}" for line in lines)]
    parts = [build.head, *build.source.blocks, *build.functions, "\n".join(text)]
    parts += [f"ROWS = {len(build.rows)}", f"COLUMNS = {len(sampled_columns(plan.metrics))}"]
    return "\n\n".join(parts) + "\n"


def _time(build: CudaBuilder) -> list[str]:
    """Lines of the loop over time. Most steps only move: one test covers all that happens now and then."""
    plan = build.plan
    count = len(sampled_columns(plan.metrics))
    first = [REDUCTION_START.get(how, ZERO).spelled for _, how, _ in sampled_columns(plan.metrics)]
    lines = branch_lines(
        "tid == 0", [f"totals[{c}, 0] = {s}; totals[{c}, 1] = ZERO" for c, s in enumerate(first)] or ["pass"]
    )
    lines += ["count_sample = integer(0); count_collision = integer(0); k = integer(0); slot_out = integer(0)"]
    lines += ["next_decide = integer(0); next_sample = integer(0); next_collide = integer(0); next_ = integer(0)"]
    lines += ["moved = ZERO; gap = ZERO; looked = integer(0); look = False; frame = integer(0); answer = ZERO"]
    lines += [f"value{c} = ZERO" for c in range(count)]
    if plan.late:
        lines += ["next_hear = integer((decide_every - delay % decide_every) % decide_every)"]
        lines += ["slot_in = integer(((delay + decide_every - 1) // decide_every) % slots)"]
    if plan.lags:  # one round of the ring is added: the number of the decision begins negative
        lines += ["next_obey = integer(lag % decide_every)"]
        lines += ["slot_obey = integer((next_obey - lag + slots * decide_every) // decide_every % slots)"]
    lines += ["begun = integer(0)"] * bool(plan.faults)
    step = ["time = real(step) * row_c.dt", *begin_fault_lines(build)]
    if plan.struck:  # once any fault has begun, all lanes are tested: each thread tests its own agent
        step += ["hurt_first = integer(0)", "hurt_end = integer(n) if begun > 0 else integer(0)"]
    if plan.absence:  # an instant of one of several agents, or of none, is not counted
        step += ["counted = integer(1) if n >= least(integer(2), born) else integer(0)"]
    send, world = _send(build), _world(build)
    step += [*send, *world, *_look(build)] if world else _look(build)
    now_and_then = [*_decide(build), *_watch(build), *branch_lines("take", _taken(build)), *_next(build)]
    step += branch_lines("look or step == next_", now_and_then if world else [*send, *now_and_then])
    step += [*branch_lines("step == steps", ["break"]), *_advance(build)]
    # counted by hand in 32 bits: a range counts in 64, twice
    turn = [f"    {line}" for text in [*step, "step = integer(step + 1)"] for line in text.splitlines()]
    return [*lines, "step = integer(0)", "while True:", *turn]


def _next(build: CudaBuilder) -> list[str]:
    """The next step at which anything is due but motion, and a look for collisions."""
    # A step tests once if anything is due: four counters with a branch each were a fifth of a
    # motion step.
    due = ["next_sample"] if build.plan.sequential else ["next_decide", "next_sample"]
    found = due[0]
    for other in [*due[1:], *["next_hear"] * build.plan.late]:
        found = f"least({found}, {other})"
    return [f"next_ = {found}"]


def _send(build: CudaBuilder) -> list[str]:
    """The state that is sent goes into the slot of the ring from which it will be heard."""
    if not build.plan.late:
        return []
    put = ["slot = slot_in", build.stages["snapshot"].call(), "next_hear = integer(step + decide_every)"]
    put += ["slot_in = integer(slot_in + 1) if slot_in + 1 < slots else integer(0)"]
    return branch_lines("step == next_hear", put)


def _world(build: CudaBuilder) -> list[str]:
    """Goals go on their way, and what is due appears; a shepherd and what appears look at every agent."""
    plan = build.plan
    lines = [build.stages["aim_"].call(elapsed="row_c.dt")] if plan.goals else []
    if plan.is_shepherd:
        lines = ["cuda.syncthreads()", *_shown(build), "cuda.syncthreads()", *lines, "cuda.syncthreads()"]
    lines += [build.stages["glide_"].call()] if plan.own else []
    if plan.scene:
        due = ["cuda.syncthreads()", *_shown(build), "cuda.syncthreads()", build.stages["appear_"].call()]
        lines += branch_lines("later[0, 6] >= ZERO or later.shape[0] > 1", [*due, "cuda.syncthreads()"])
    return lines


def _decide(build: CudaBuilder) -> list[str]:
    """Lines that publish the states of agents if anything of this step reads them; then a decision."""
    meets, watched = not build.plan.sequential, bool(stages_of_events(build.plan)["watch"])
    lines = ["meet = step == next_decide" if meets else "meet = False", "take = step == next_sample"]
    shown = [*branch_lines("meet", _perceived(build))] if meets else []
    show = ["cuda.syncthreads()", *_shown(build), *shown, "cuda.syncthreads()"]
    lines += branch_lines(" or ".join(["meet", "take", *["look"] * watched]), show)
    return [*lines, *branch_lines("meet", _choose(build))] if meets else lines


def _watch(build: CudaBuilder) -> list[str]:
    """Look for collisions, and stop at the first one where a scenario says so."""
    lines = branch_lines("look", _looked(build)) if stages_of_events(build.plan)["watch"] else []
    if build.plan.stop:
        found = [name for name, _, _ in sampled_columns(build.plan.metrics)].index("n_coll")
        lines += branch_lines(f"value{found} > HALF", ["break"])
    return lines


def _look(build: CudaBuilder) -> list[str]:
    """Lines that decide if pairs are checked for collisions: a vote of all threads, by how far agents have moved."""
    if not stages_of_events(build.plan)["watch"]:
        return []
    watched = _within(build) is not None
    vote = "cuda.syncthreads_or(integer(1) if moved >= gap else integer(0)) != 0" if watched else "True"
    body = [f"look = {vote}", "next_collide = integer(step + collide_every)"]
    # Looks are counted where not every one counts; else their number follows from that of the steps.
    body += ["count_collision = integer(count_collision + counted)"] * build.plan.absence
    return ["look = False", *branch_lines("step == next_collide", body)]


def _within(build: CudaBuilder) -> str | None:
    """Distance (m) beyond which nothing collides, as text; None if a metric gives no such promise."""
    metrics = [metric for metric in build.plan.metrics if metric.clock == "collision"]
    if not all(metric.within is not None for metric in metrics):
        return None
    width = "ZERO"
    for metric in metrics:
        width = f"most({width}, {build.call(metric.within, 'within', {'q': 'row_q'})})"  # type: ignore[arg-type]
    return width


def _forget(build: CudaBuilder) -> list[str]:
    """Memories of the collision metrics back at their start values."""
    lines = []
    for metric, _, first, _ in measured_metrics(build.plan, "collision"):
        for c, value in enumerate(initial_values(metric.Memory)):
            own = f"kept{first + c}_i" if build.shape.registers else f"memory[{first + c}, i]"
            lines += agent_loop(build, [f"{own} = real({value})"])
    return lines


def _shown(build: CudaBuilder) -> list[str]:
    """The own true state, where the others of the block see it."""
    if not build.shape.registers:
        return []
    found = {column: row for row, (table, column) in build.columns().items() if table == "truth" and row in build.names}
    lines = [f"truth[i, {c}] = {own_row(build, row)}" for c, row in sorted(found.items())]
    return branch_lines("i < n and sub == 0", lines)


def _perceived(build: CudaBuilder) -> list[str]:
    """Both errors advance; what the others hear goes into the shared table."""
    lines = ["slot = slot_out", build.stages["perceive"].call()]
    lines += [build.stages["tune"].call(k_="k")] if "tune" in build.stages else []
    told = [f"{table}[i, {c}] = {row}_i" for row, (table, c) in build.columns().items() if table in ("said", "tuned")]
    if told and build.shape.registers:
        lines += branch_lines("i < n and sub == 0", told)
    return lines


def _choose(build: CudaBuilder) -> list[str]:
    """Meet neighbours and surfaces, decide."""
    barrier = [] if build.shape.registers else ["cuda.syncthreads()"]
    lines = []
    for name in stages_of_events(build.plan)["decide"][1:]:
        if name == "tune":
            continue  # runs before, in _perceived
        lines += [build.stages[name].call(k_="k"), *barrier]
    lines += ["slot = slot_out", build.stages["queue"].call()] if build.plan.lags else []
    lines += ["k = integer(k + 1); next_decide = integer(step + decide_every)"]
    return [*lines, "slot_out = integer(slot_out + 1) if slot_out + 1 < slots else integer(0)"]


def _looked(build: CudaBuilder) -> list[str]:
    """Lines that measure contacts at this instant. After instants that were skipped, memories start from zero."""
    lines = [build.stages["measure_collision"].call(), *_added(build, "collision")]
    width = _within(build)
    if width is None:
        return lines
    forget = _forget(build)
    anew = branch_lines("step - looked > collide_every", forget) if forget else []
    return [*anew, *lines, f"gap = answer - {width} - real({SLACK})", "moved = ZERO; looked = step"]


def _taken(build: CudaBuilder) -> list[str]:
    """One sample: order parameters and, where they are kept, positions, velocities and commands."""
    plan, one = build.plan, "counted" if build.plan.absence else "1"
    lines = ["next_sample = integer(step + sample_every)", f"count_sample = integer(count_sample + {one})"]
    if stages_of_events(plan)["sample"]:
        lines += [build.stages["measure_sample"].call(), *_added(build, "sample")]
    if plan.record:
        names = [*plan.motion, *(f"c{a}" for a in plan.axes)]
        who = _number(build)
        body = [f"all_frames[block, frame, {c}, {who}] = {own_row(build, name)}" for c, name in enumerate(names)]
        lines += [*agent_loop(build, body), "frame = integer(frame + 1)"]
    return lines


def _added(build: CudaBuilder, clock: str) -> list[str]:
    """The values of one instant go into the sums over time; one thread keeps them."""
    lines = []
    for c, (_, how, when) in enumerate(sampled_columns(build.plan.metrics)):
        if when == clock:
            # Sums over a flight go to two numbers (Kahan): in single precision a plain sum of many
            # samples loses digits.
            add = f"totals[{c}, 0], totals[{c}, 1] = add_exactly(totals[{c}, 0], totals[{c}, 1], value{c})"
            kept = f"totals[{c}, 0] = {'least' if how == 'min' else 'most'}(totals[{c}, 0], value{c})"
            lines += [add if how in ("mean", "sum") else kept]
    counted = "tid == 0 and counted != 0" if build.plan.absence else "tid == 0"
    return branch_lines(counted, lines) if lines else []


def _number(build: CudaBuilder) -> str:
    """Number of the agent of this thread."""
    return f"integer({own_row(build, 'order')})" if build.slots else "i"


def _advance(build: CudaBuilder) -> list[str]:
    """One motion step; with a sequential update each agent in turn meets, decides and moves."""
    further = "moved += real(2.0) * math.sqrt(answer) * row_c.dt"
    if not build.plan.sequential:
        return [*_obey(build), build.stages["move"].call(), further]
    due = sequential_stages(build.plan)
    met = [name for name in due if name.startswith("neighbours")]  # one for each law
    turn = [*(build.stages[name].call(k_="step") for name in met), *["cuda.syncthreads()"] * bool(met)]
    alone = [build.stages[name].call(k_="step") for name in due if name not in met]
    turn += [*branch_lines("tid == 0", [*alone, "fastest_ = most(fastest_, answer)"]), "cuda.syncthreads()"]
    return ["fastest_ = ZERO", *loop_lines("i in range(n)", turn), "answer = fastest_", further]


def _obey(build: CudaBuilder) -> list[str]:
    """Take the commands that are due out of the ring."""
    if not build.plan.lags:
        return []
    take = ["slot = slot_obey", build.stages["obey"].call(), "next_obey = integer(step + decide_every)"]
    take += ["slot_obey = integer(slot_obey + 1) if slot_obey + 1 < slots else integer(0)"]
    return branch_lines("step == next_obey", take)


def _end(build: CudaBuilder) -> list[str]:
    """Lines that write the results of a flight."""
    who = _number(build)
    left = [f"states[block, {c}, {who}] = {own_row(build, name)}" for c, name in enumerate(build.plan.motion)]
    lines = agent_loop(build, left)
    if stages_of_events(build.plan)["watch"] and not build.plan.absence:
        lines += ["count_collision = integer(step // collide_every + 1)"]
    count = len(sampled_columns(build.plan.metrics))
    last = [f"all_sums[block, {c}, {h}] = totals[{c}, {h}]" for c in range(count) for h in range(2)]
    last += [
        f"all_sums[block, {count}, 0] = real(count_sample)",
        f"all_sums[block, {count + 1}, 0] = real(count_collision)",
        *[f"all_sums[block, {count + 2}, 0] = real(least(step, steps))"] * build.plan.absence,
    ]
    return [*lines, *branch_lines("tid == 0", [*last, "statuses[block] = 0"])]
