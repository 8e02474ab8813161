"""Stage functions: each stage of a flight, specialised for a plan, as a function of its driver.

A maker takes a stage of `engine.stages`, has it specialised, and adds the function to the builder.
`driver` calls the makers in their order.
"""

import ast
from collections.abc import Callable
from typing import Any, NamedTuple

from airflock.core import PERCEPT_METHODS, Mean, Metric, Percept, fields_read
from airflock.engine.passes import flock, grid
from airflock.engine.passes.build import Builder, inline_lines
from airflock.engine.passes.grid import sorts_by_cells
from airflock.engine.plan import Plan
from airflock.engine.replace import checked_replace
from airflock.engine.specialise.known_values import StageCall, driver_argument
from airflock.engine.specialise.specialiser import specialise
from airflock.engine.stages import (
    approach,
    decide,
    faults,
    gusts,
    measure,
    meet,
    move,
    neighbours,
    noise,
    perceive,
    percept,
    receive,
    scene,
    silence,
    start,
    surfaces,
)
from airflock.engine.stages.clusters import sum_clusters
from airflock.engine.stages.links import clusters_by_cells
from airflock.engine.stages.measure import MeasuredMetric, measured_metrics
from airflock.engine.stages.near import ROUNDING_MARGIN, pairs_by_cells
from airflock.engine.stages.words import IdentityRow, nonzero_fields, rule_asks
from airflock.scenarios import FORMATIONS


def skippable_metrics(plan: Plan) -> tuple[MeasuredMetric, ...]:
    """Metrics that look for collisions, if all of them promise a distance beyond which there are none."""
    found = measured_metrics(plan, "collision")
    return found if all(one.metric.within is not None for one in found) else ()


def uses_drift(build: Builder) -> bool:
    """Return True if speeds beside the drift of the flock decide when pairs are checked, and not speeds themselves."""
    return build.can_use_drift and build.plan.flows and bool(skippable_metrics(build.plan))


def uses_nearest_pair(build: Builder) -> bool:
    """Return True if only the least distance of a pair is searched, as long as there is nothing to measure."""
    return uses_drift(build) and not build.plan.near


def add_nearest(build: Builder) -> None:
    """Function nearest: the least distance of a pair, where it is looked for alone."""
    if uses_nearest_pair(build):
        made = specialise(build, approach.nearest)
        build.function("nearest(n, m, row, whole, work)", made.lines, f"return {made.answer}", once=True)


def add_draw(build: Builder) -> noise.Draw:
    """Functions draw and normal, with rows that do not overlap; None where their loops stand in place of calls.

    Else rows are compared before the loop wherever it stands, which takes a fiftieth of a flight of
    a hundred, and the loops are compiled at each of six places.
    """
    if not build.apart or build.plan.sequential:
        return None
    if "draw" not in build.stages:
        by_place = not build.slots or _leave(build)
        _draw(build, "draw", by_place)
        if build.slots and by_place:
            _draw(build, "draw_by_number", False)
        build.function("normal(m, a, b, g, h)", ["apart()", *specialise(build, noise.normal).lines], once=True)
    return noise.DrawFunctions(build.stages["draw"], build.stages.get("draw_by_number"), build.stages["normal"])


def _leave(build: Builder) -> bool:
    """Return True if some agents may leave and the others keep the order of their numbers."""
    return build.slots and not sorts_by_cells(build.plan)


def _draw(build: Builder, name: str, by_place: bool) -> None:
    """A function that draws words for agents that lie at their own numbers, or for all by their numbers."""
    made = specialise(build, noise.draw, order=IdentityRow() if by_place else driver_argument("order"))
    known = "m, " if by_place else "m, order, "
    build.function(
        f"{name}({known}step, stream, world, seed_low, seed_high, u0, u1, u2, u3)", ["apart()", *made.lines], once=True
    )


MEET_ARGUMENTS = "i, k_, n, m, row, whole, work"  # what the stage is called with
RECEIVE_CALLS = {  # whether each pair draws for itself: what stage draws
    False: "receive(i, k_, n, m, whole, work, words)",
    True: "receive(i, j, k_, n, world, seed_low, seed_high)",
}


def add_error_functions(build: Builder) -> perceive.ErrorFunctions | None:
    """Functions wander and err, with rows that do not overlap; None where their loops stand in place of calls."""
    plan = build.plan
    if not build.apart or plan.sequential or not plan.has_sensor_error or plan.senses:
        return None
    made = specialise(build, perceive.wander)
    build.function("wander(m, q, u, g, row, work)", ["apart()", *made.lines], once=True)
    made = specialise(build, perceive.err)
    build.function("err(m, place, rate, x, v, q, u)", ["apart()", *made.lines], once=True)
    return perceive.ErrorFunctions(build.stages["wander"], build.stages["err"])


def add_ring(build: Builder, stage: Callable[..., Any]) -> None:
    """Function of a stage that writes or reads a slot of the ring: snapshot, first_command, queue or obey."""
    made = specialise(build, stage)
    build.function(f"{stage.__name__}(slot, m, work, ring)", ["apart()"] * build.apart, made.lines, once=True)


def add_meet(build: Builder) -> None:
    """Function meet, where a topology chooses among the agents heard: fills row met for one agent."""
    plan = build.plan
    if plan.topology is not None and not plan.grid:
        made = specialise(build, meet.meet, decision=driver_argument("k_"))
        build.function(f"meet({', '.join([MEET_ARGUMENTS, *world_arguments(plan)])})", made.lines, "return 0")


def world_arguments(plan: Plan) -> tuple[str, ...]:
    """Further arguments of two stages: the world, where it may hide neighbours or shade the radio."""
    return ("edges", "spans", "scene") if plan.hides or plan.shades else ()


def pair_word(plan: Plan) -> str:
    """Text that draws the random word of a pair, for agents i and j, which may lie elsewhere than by their number."""
    called = RECEIVE_CALLS[True]
    return checked_replace([called], "(i, j, k_, n,", "(order[i], order[j], k_, born,")[0] if plan.absence else called


def add_receive(build: Builder) -> None:
    """Function receive, where packets are lost: random words of what is sent to four agents, or to one of a pair."""
    if not build.plan.draws:
        return
    made = specialise(build, receive.word if build.draws_per_pair else receive.draw, decision=driver_argument("k_"))
    build.function(RECEIVE_CALLS[build.draws_per_pair], made.lines, f"return {made.answer}")


FIELDS = ("half_x", "half_y", "half_z", "agent", "step", "world", "seed_low", "seed_high", "corners", "obstacles")
CASTS = ("shapes", "nodes", "links", "near", "counts", "gathered")
METHODS: dict[str, tuple[Callable[..., Any], str]] = {
    "ray": (percept.ray, "percept, ux, uy, uz, length"),
    "cast": (percept.cast, "percept, ux, uy, uz, length, radius"),
    "normal": (percept.normal, "percept, draw"),
    "uniform": (percept.uniform, "percept, draw"),
}


def add_record(build: Builder) -> str:
    """Record that a driver hands to `decide`: the public fields, then what the bound methods need."""
    casts = CASTS if build.plan.model.sight is not None else CASTS[:3] if build.plan.scene else ()
    return build.source.record(f"PERCEPT{build.mark}", (*Percept._fields, *FIELDS, "edges", "spans", *casts))


def add_methods(build: Builder) -> None:
    """Functions percept_ray, percept_cast, percept_normal and percept_uniform, those of them that a rule calls."""
    marked = {name: f"percept_{name}{build.mark}" for name in PERCEPT_METHODS}
    called = [name for name in PERCEPT_METHODS if any(f"{marked[name]}(" in text for text in build.source.blocks)]
    for name in called:
        method, arguments = METHODS[name]
        made = specialise(build, method)
        build.function(f"{marked[name]}({arguments})", made.lines, f"return {made.answer}")


def add_neighbours(build: Builder) -> None:
    """Function neighbours: the neighbour rule over all others in range of each agent, all pairs or by cells."""
    plan, model = build.plan, build.plan.model
    fields = model.Sums._fields  # type: ignore[union-attr]
    sums = tuple(
        (c, model.reduce.get(fields[c], "sum")) for c in _asked(build, nonzero_fields(model.Sums, plan.dimensions))
    )
    # Four receivers share a draw on a CPU; on a GPU each thread draws for its own pair, as no row
    # per agent would fit.
    draw, drawn = (
        (None, StageCall(pair_word(plan))) if build.draws_per_pair else (StageCall(RECEIVE_CALLS[False]), None)
    )
    more = world_arguments(plan)
    meet = StageCall(f"meet({', '.join([MEET_ARGUMENTS, *more])})")
    if plan.grid:
        grid.add_neighbours(build, sums)
        return
    made = specialise(
        build,
        neighbours.neighbours,
        n=driver_argument("n"),
        decision=driver_argument("k_"),
        draw=draw,
        drawn=drawn,
        meet=meet,
        sums=sums,
        images=build.images,
        looks=False,
    )
    arguments = ", ".join(["k_, n, m, time, late, row, whole, work, store, words", *more])
    name = f"neighbours{build.mark}"
    build.stage(name, arguments, made.once, made.body, made.answer, apart=plan.topology is None)


def add_observe(build: Builder) -> None:
    """Function observe: what each agent observes, as rows side by side, by the loop over the others that laws have."""
    plan = build.plan
    for columns in plan.observed.values():
        for c in columns:
            build.row(f"seen{c}")
    meet = StageCall(f"meet({', '.join([MEET_ARGUMENTS, *world_arguments(plan)])})")
    draws = plan.model.neighbour is None or not plan.packets  # else the law has received already
    made = specialise(
        build, neighbours.neighbours, n=driver_argument("n"), decision=driver_argument("k_"),
        draw=StageCall(RECEIVE_CALLS[False]) if draws else None, drawn=None, meet=meet, sums=(),
        images=build.images, looks=True,
    )  # fmt: skip
    arguments = "k_, n, m, time, late, row, whole, work, store, words, edges, spans, scene"
    build.stage(f"observe{build.mark}", arguments, made.once, made.body, made.answer, apart=plan.topology is None)


def add_decide(build: Builder) -> None:
    """Function decide: the law's rule for the command of each agent, and those that its percept is bound to."""
    plan, model = build.plan, build.plan.model
    summed = nonzero_fields(model.Sums, plan.dimensions) if model.neighbour is not None else []
    made = specialise(
        build, decide.decide, decision=driver_argument("k_"), percept_of=driver_argument(f"PERCEPT{build.mark}"),
        summed=_asked(build, summed) if decide.law_asks(model, "sums") else [],
        walled=nonzero_fields(model.Walls, plan.dimensions) if model.boundary is not None else [],
    )  # fmt: skip
    if decide.law_asks(model, "percept"):
        add_record(build)
    add_methods(build)
    arguments = "k_, n, time, row, whole, work, mem, edges, spans, scene"
    build.stage(f"decide{build.mark}", arguments, made.once, made.body, made.answer)


def _asked(build: Builder, sums: list[int]) -> list[int]:
    """Of these fields of Sums those that `add_decide` can read, with its choices made: the others are never summed."""
    model = build.plan.model
    build.source.name(model.decide)
    # A field that no rule reads is not summed: in the pair loop each sum is an addition per pair.
    text = "\n".join(build.source.blocks)
    fields = model.Sums._fields  # type: ignore[union-attr]
    return [c for c in sums if f".{fields[c]}" in text] if "sums[" not in text and "*sums" not in text else sums


NOISE, GUSTS = "step, m, row, whole, work, words", "step, row, whole, gust"  # what these stages are called with


def add_begin(build: Builder) -> None:
    """Function begin: all agents at their places; returns minus the first agent (from 1) that found no room."""
    drawn = not build.plan.given_start and build.plan.start not in FORMATIONS
    made = specialise(build, start.begin, excursion=add_excursion(build) if drawn else None)
    build.function("begin(n, m, row, whole, work, edges, spans, start, scene)", made.lines, f"return {made.answer}")


def add_excursion(build: Builder) -> ast.Name:
    """Function excursion, once; its name for stages that call it."""
    if not any("def excursion(" in text for text in build.functions):
        made = specialise(build, start.excursion, w=driver_argument("w"))
        build.function(
            "excursion(x, y, z, w, edges, spans, corners, obstacles, scene)", made.lines, f"return {made.answer}"
        )
    return driver_argument("excursion")


def add_move(build: Builder) -> None:
    """Function move, with what the stages noise and gusts do once per step, where the body and the wind have them.

    They stand in its own lines, which compile to the same bits as ever; where agents move in turn
    they are functions. Where rows of faults are read beside those of states, all are marked as
    lying apart: else written rows are compared with every other at every step. Not where a body
    remembers: the last bit of a quadrotor would change.
    """
    plan = build.plan
    struck = plan.struck and build.ranges
    if struck:
        found = specialise(build, faults.struck, kept=not plan.edge_rule)
        build.function("struck(time, m, row, work)", found.lines, f"return {found.answer}")
    made = specialise(
        build,
        move.move,
        noise=StageCall(f"noise({NOISE})"),
        gusts=StageCall(f"gusts({GUSTS})"),
        watched=bool(skippable_metrics(plan)) or not build.can_use_drift,
        drifts=uses_drift(build),
        kept=struck and not plan.edge_rule,
    )
    parts: dict[str, tuple[str, list[str]]] = {}
    if build.rule_asks(plan.body.move, "move", "gx", "gy", "gz"):
        parts["noise"] = NOISE, [*specialise(build, noise.noise, drawn=add_draw(build)).lines, "return 0"]
    if plan.windy:
        blown = specialise(build, gusts.gusts)
        parts["gusts"] = GUSTS, [*blown.lines, f"return {blown.answer}"]
    once = made.once
    for name, (arguments, lines) in parts.items():
        if plan.sequential:
            build.function(f"{name}({arguments})", lines)
        else:
            once = inline_lines(once, name, lines)
    lanes = ", hurt_first, hurt_end" * struck
    # Rows are parts of one table, so LLVM compares the places of all rows before each loop (217
    # instructions before a loop of 59). As arguments marked noalias they need no comparison: 120 s
    # of 30 drones, 3.9 -> 2.9 ms.
    many = bool(plan.suffers("motion")) and not plan.body.Memory
    held = "held, " * uses_drift(build)
    head = f"step, n, m, {held}row, whole, work, words, gust{lanes}"
    build.stage("move", head, once, made.body, made.answer, apart=many)


AVERAGED = {"x": {"x", "y", "z"}, "v": {"vx", "vy", "vz"}, "h": {"hx", "hy", "hz"}}  # fields of a mean
BY_CELLS = "n, row, whole, work, cells"  # what a search by cells is called with


def measure_arguments(build: Builder, cells: bool = False) -> str:
    """Arguments of a measure function. cells : it goes through pairs by cells."""
    rest = (", scratch" if flock.survey_rules(build.plan) else "") + ", cells" * cells
    return f"time, n, m, row, whole, work, edges, spans, scene, memory, labels, values{rest}"


def add_measure(build: Builder, clock: str) -> None:
    """Function measure_<clock>: writes every Sample field into `values`.

    That of the collision clock returns the least distance of a pair, m.
    """
    metrics = measured_metrics(build.plan, clock)
    paired = [one.metric for one in metrics if one.metric.pair is not None]
    near = build.plan.near and bool(paired) and all(metric.settled is not None for metric in paired)
    looked = add_pairs_by_cells(build, clock, metrics) if near else None
    outside = any(rule_asks(one.metric.agent, "excursion") for one in metrics)
    parts = {f"survey_{one.metric.name}": flock.survey_lines(build, one.metric) for one in metrics if one.metric.survey}
    clustered = {one.metric.name: add_clusters(build, one.metric, parts) for one in metrics}
    made = specialise(
        build,
        measure.measure,
        metrics=metrics,
        nearest=clock == "collision",
        over=looked,
        abreast=build.pairs_two_agents,
        headed=needs_headings(metrics) or not build.drops_unread_sums,
        summed="xvh" if build.drops_unread_sums else needed_means(metrics),
        excursion=add_excursion(build) if outside else None,
        survey={one.metric.name: StageCall(f"survey_{one.metric.name}()") for one in metrics},
        clustered=clustered,
    )
    lines = made.lines
    # A metric with a rule for the whole flock stands in the lines of the stage, in place of its
    # call, so that a kernel keeps its rows in registers.
    for name, part in parts.items():
        lines = inline_lines(lines, name, part)
    cells = near or any(links_by_cells(build, one.metric) for one in metrics)
    build.function(f"measure_{clock}({measure_arguments(build, cells)})", lines, f"return {made.answer}")


def needs_headings(metrics: tuple[MeasuredMetric, ...]) -> bool:
    """Return True if any of these metrics takes speeds, headings or means of the flock."""
    asked = ("speed", "hx", "hy", "hz", "mean")
    return any(
        metric.survey is not None or metric.cluster is not None
        or any(rule_asks(rule, *asked) for rule in (metric.pair, metric.agent, metric.member, metric.sample))
        for metric, *_ in metrics
    )  # fmt: skip


def needed_means(metrics: tuple[MeasuredMetric, ...]) -> str:
    """Of what rules read a mean over the flock: position x, velocity v, heading h."""
    # Reads the text of rules to find which means are used: on a GPU each unread mean is a shuffle
    # in every sample.
    found: set[str] = set()
    for one in metrics:
        for rule in (one.metric.agent, one.metric.member, one.metric.cluster, one.metric.sample):
            if rule_asks(rule, "mean"):
                assert rule is not None
                asked = fields_read(rule, "mean")
                found |= set(Mean._fields) if asked is None else asked
    return "".join(what for what, names in AVERAGED.items() if found & names)


def add_pairs_by_cells(build: Builder, clock: str, metrics: tuple[MeasuredMetric, ...]) -> StageCall:
    """Function near_<clock>: the pair rules of a clock by cells of about one agent each; its call."""
    made = specialise(build, pairs_by_cells, metrics=metrics, nearest=clock == "collision")
    called = f"near_{clock}({BY_CELLS})"
    lines = [*grid.sort_lines(build, "real(0.001)", "n"), *made.lines]
    build.function(called, lines, f"return {made.answer}", parallel=True)
    return StageCall(called)


def links_by_cells(build: Builder, metric: Metric) -> bool:
    """Return True if the links of a metric are found by cells."""
    return build.plan.near and metric.cluster is not None and metric.linked_within is not None


def add_clusters(build: Builder, metric: Metric, parts: dict[str, list[str]]) -> Any:
    """Return the stage or the call that finds the clusters of a metric; lines in place of a call go to `parts`."""
    name = f"clusters_{metric.name}"
    # Three ways to the same clusters: by cells in a large flock, by all threads of a block on a
    # GPU, else agent by agent.
    if links_by_cells(build, metric):
        assert metric.linked_within is not None
        reach = f"least({build.call(metric.linked_within, 'linked_within', {})} / real({ROUNDING_MARGIN}), LIMIT)"
        made = specialise(build, clusters_by_cells, metric=metric)
        called = f"{name}(mean, labels, {BY_CELLS})"
        lines = [*build.records("q"), *grid.sort_lines(build, reach, "n"), *made.lines]
        build.function(called, lines, f"return {made.answer}")
        return StageCall(called)
    if build.clusters and metric.cluster:
        parts[name] = build.clusters(metric)
        return StageCall(f"{name}()")
    return sum_clusters


class PlainStage(NamedTuple):
    """A stage, and what its function in a driver is called with.

    decision : the argument that is the number of the decision
    draws    : it draws random numbers
    own      : it goes through agents, so that in a sequential update it is of the agent in turn
    """

    stage: Callable[..., Any]
    arguments: str
    decision: str = "k_"
    own: bool = False
    needs_random: bool = False


PLAIN = {
    "perceive": PlainStage(perceive.perceive, "k, slot, m, row, whole, work, ring, words", "k", needs_random=True),
    "tune": PlainStage(faults.tune, "k_, m, row, whole, work"),
    "boundaries": PlainStage(surfaces.boundaries, "n, row, whole, work, faces, edges, spans, scene", own=True),
    "stop": PlainStage(silence.stop, "n, time, row, work, store", own=True),
    "overrule": PlainStage(faults.overrule, "n, time, row, work", own=True),
    "aim_": PlainStage(scene.move_goal, "time, elapsed, n, work, row, scene"),
    "glide_": PlainStage(scene.move_own_goals, "time, n, work, row, scene"),
    "appear_": PlainStage(scene.let_appear, "time, n, work, row, scene"),
}


def add_plain_stage(build: Builder, name: str) -> None:
    """The function of one of these stages; of a stage that asks a law, that for the law of the builder."""
    one = PLAIN[name]
    known = (
        {"drawn": add_draw(build) if build.plan.has_sensor_error else None, "shared": add_error_functions(build)}
        if one.needs_random
        else {}
    )
    made = specialise(build, one.stage, decision=driver_argument(one.decision), **known)
    if one.own:
        build.stage(f"{name}{build.mark}", one.arguments, made.once, made.body, made.answer)
    else:
        build.function(f"{name}({one.arguments})", made.lines, f"return {made.answer}")
