"""Kernel: a whole flight of one flock per block, as the order in which the stages run."""

from airflock.core import initial_values
from airflock.engine.cuda.build import CudaBuilder
from airflock.engine.cuda.individuals import begin_fault_lines
from airflock.engine.cuda.shape import BlockLayout
from airflock.engine.cuda.start import agent_loop, begin_lines, own_row
from airflock.engine.cuda.state import memory_lines
from airflock.engine.passes.build import branch_lines, loop_lines, sampled_columns
from airflock.engine.passes.driver import make_stages
from airflock.engine.plan import Plan
from airflock.engine.schedule import sequential_stages, stages_of_events
from airflock.engine.stages.approach import SLACK
from airflock.engine.stages.measure import measured_metrics
from airflock.engine.stages.words import REDUCTION_START, ZERO

ARGUMENTS = (
    "rows", "wholes", "all_faces", "all_edges", "all_spans", "all_shapes", "all_later", "nodes", "links", "all_goals",
    "starts", "owns", "pasts", "stores", "works", "all_words", "all_mem", "all_memory", "statuses", "states",
    "all_sums", "all_reached", "all_frames", "scratches", "scratch_rows", "all_across", "all_due", "all_hits",
)  # fmt: skip


def flight_text(plan: Plan, shape: BlockLayout) -> str:
    """Text of the driver that flies one flock per block: kernel `fly`."""
    build = CudaBuilder(plan, shape)
    make_stages(build)
    body = _time(build)  # first: it may still name rules
    lines = [*memory_lines(build), *begin_lines(build), *body, *_end(build)]
    options = "fastmath=True" + ("" if shape.simulated else f", launch_bounds={shape.bounds}, cache=True")
    text = [f"@cuda.jit({options})", f"def fly({', '.join(ARGUMENTS)}):", *(f"    {line}" for line in lines)]
    parts = [build.head, *build.source.blocks, *build.functions, "\n".join(text)]
    parts += [f"ROWS = {len(build.rows)}", f"COLUMNS = {len(sampled_columns(plan.metrics))}"]
    return "\n\n".join(parts) + "\n"


# ------------------------------------------------------------------------------------------------------------ time


def _time(build: CudaBuilder) -> list[str]:
    """The loop over time. Most steps only move: what happens now and then is asked for together."""
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
    lines += ["begun = integer(0)"] * bool(plan.faults)
    step = ["time = real(step) * row_c.dt", *begin_fault_lines(build)]
    if plan.struck:  # once anything has begun all are asked: a thread asks for its own agent at no one's cost
        step += ["hurt_first = integer(0)", "hurt_end = integer(n) if begun > 0 else integer(0)"]
    if plan.absence:  # an instant of one of several agents, or of none, is not counted
        step += ["counted = integer(1) if n >= least(integer(2), born) else integer(0)"]
    send, world = _send(build), _world(build)
    step += [*send, *world, *_look(build)] if world else _look(build)
    now_and_then = [*_decide(build), *_watch(build), *_sample(build), *_next(build)]
    step += branch_lines("look or step == next_", now_and_then if world else [*send, *now_and_then])
    step += [*branch_lines("step == steps", ["break"]), *_advance(build)]
    # counted by hand in 32 bits: a range counts in 64, twice
    turn = [f"    {line}" for text in [*step, "step = integer(step + 1)"] for line in text.splitlines()]
    return [*lines, "step = integer(0)", "while True:", *turn]


def _next(build: CudaBuilder) -> list[str]:
    """The next step at which anything is due but motion, and a look for collisions."""
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
    """What is due of all that looks at the others, who show themselves for it once; then a decision."""
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


def _sample(build: CudaBuilder) -> list[str]:
    return branch_lines("take", _taken(build))


def _look(build: CudaBuilder) -> list[str]:
    """Whether to look for collisions: while nobody can have come near enough, a vote of all threads says no."""
    if not stages_of_events(build.plan)["watch"]:
        return []
    watched = _within(build) is not None
    vote = "cuda.syncthreads_or(integer(1) if moved >= gap else integer(0)) != 0" if watched else "True"
    body = [f"look = {vote}", "next_collide = integer(step + collide_every)", *_counted(build)]
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
        for c, start in enumerate(initial_values(metric.Memory)):
            own = f"kept{first + c}_i" if build.shape.registers else f"memory[{first + c}, i]"
            lines += agent_loop(build, [f"{own} = real({start})"])
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
            continue  # told to the others before they meet
        lines += [build.stages[name].call(k_="k"), *barrier]
    lines += ["k = integer(k + 1); next_decide = integer(step + decide_every)"]
    return [*lines, "slot_out = integer(slot_out + 1) if slot_out + 1 < slots else integer(0)"]


def _looked(build: CudaBuilder) -> list[str]:
    """Contacts at this instant. Who was not looked at since an earlier one was in none: memories begin anew."""
    lines = [build.stages["measure_collision"].call(), *_added(build, "collision")]
    width = _within(build)
    if width is None:
        return lines
    forget = _forget(build)
    anew = branch_lines("step - looked > collide_every", forget) if forget else []
    return [*anew, *lines, f"gap = answer - {width} - real({SLACK})", "moved = ZERO; looked = step"]


def _taken(build: CudaBuilder) -> list[str]:
    """One sample: order parameters and, where they are kept, positions, velocities and commands."""
    plan = build.plan
    lines = ["next_sample = integer(step + sample_every)", f"count_sample = integer(count_sample + {_one(build)})"]
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
            add = f"totals[{c}, 0], totals[{c}, 1] = add_exactly(totals[{c}, 0], totals[{c}, 1], value{c})"
            kept = f"totals[{c}, 0] = {'least' if how == 'min' else 'most'}(totals[{c}, 0], value{c})"
            lines += [add if how in ("mean", "sum") else kept]
    counted = "tid == 0 and counted != 0" if build.plan.absence else "tid == 0"
    return branch_lines(counted, lines) if lines else []


def _one(build: CudaBuilder) -> str:
    """What an instant counts."""
    return "counted" if build.plan.absence else "1"


def _counted(build: CudaBuilder) -> list[str]:
    """Looks for collisions are counted where not every one counts; else their number follows from that of the steps."""
    return ["count_collision = integer(count_collision + counted)"] * build.plan.absence


def _number(build: CudaBuilder) -> str:
    """Number of the agent of this thread."""
    return f"integer({own_row(build, 'order')})" if build.slots else "i"


def _advance(build: CudaBuilder) -> list[str]:
    """One motion step; with a sequential update each agent in turn meets, decides and moves."""
    further = "moved += real(2.0) * math.sqrt(answer) * row_c.dt"
    if not build.plan.sequential:
        return [build.stages["move"].call(), further]
    due = sequential_stages(build.plan)
    met = [name for name in due if name.startswith("neighbours")]  # one for each law
    turn = [*(build.stages[name].call(k_="step") for name in met), *["cuda.syncthreads()"] * bool(met)]
    alone = [build.stages[name].call(k_="step") for name in due if name not in met]
    turn += [*branch_lines("tid == 0", [*alone, "fastest_ = most(fastest_, answer)"]), "cuda.syncthreads()"]
    return ["fastest_ = ZERO", *loop_lines("i in range(n)", turn), "answer = fastest_", further]


def _end(build: CudaBuilder) -> list[str]:
    """What a flight leaves behind."""
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
