"""Meet neighbours, decide: two of the loop nests of a decision, with what their stages are handed."""

from airflock.engine.passes import grid, perceive, percept
from airflock.engine.passes.build import Builder
from airflock.engine.passes.perceive import RECEIVE_CALLS
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import StageCall, driver_argument
from airflock.engine.stages import decide as deciding, neighbours as meeting
from airflock.engine.stages.words import nonzero_fields


def add_neighbours(build: Builder) -> None:
    """Function neighbours: the neighbour rule over all others in range of each agent, all pairs or by cells."""
    plan, model = build.plan, build.plan.model
    fields = model.Sums._fields  # type: ignore[union-attr]
    sums = tuple(
        (c, model.reduce.get(fields[c], "sum")) for c in _asked(build, nonzero_fields(model.Sums, plan.dimensions))
    )
    draw, drawn = (
        (None, StageCall(perceive.pair_word(plan))) if build.draws_per_pair else (StageCall(RECEIVE_CALLS[False]), None)
    )
    more = perceive.world_arguments(plan)
    meet = StageCall(f"meet({', '.join([perceive.MEET_ARGUMENTS, *more])})")
    if plan.grid:
        grid.add_neighbours(build, sums)
        return
    made = specialise(
        build,
        meeting.neighbours,
        n=driver_argument("n"),
        decision=driver_argument("k_"),
        draw=draw,
        drawn=drawn,
        meet=meet,
        sums=sums,
        images=build.images,
    )
    arguments = ", ".join(["k_, n, m, time, late, row, whole, work, store, words", *more])
    name = f"neighbours{build.mark}"
    build.stage(name, arguments, made.once, made.body, made.answer, apart=plan.topology is None)


def add_decide(build: Builder) -> None:
    """Function decide: the law's rule for the command of each agent, and those that its percept is bound to."""
    plan, model = build.plan, build.plan.model
    summed = nonzero_fields(model.Sums, plan.dimensions) if model.neighbour is not None else []
    made = specialise(
        build, deciding.decide, decision=driver_argument("k_"), percept_of=driver_argument(f"PERCEPT{build.mark}"),
        summed=_asked(build, summed) if deciding.law_asks(model, "sums") else [],
        walled=nonzero_fields(model.Walls, plan.dimensions) if model.boundary is not None else [],
    )  # fmt: skip
    if deciding.law_asks(model, "percept"):
        percept.add_record(build)
    percept.add_methods(build)
    arguments = "k_, n, time, row, whole, work, mem, edges, spans, scene"
    build.stage(f"decide{build.mark}", arguments, made.once, made.body, made.answer)


def _asked(build: Builder, sums: list[int]) -> list[int]:
    """Of these fields of Sums those that `add_decide` can read, with its choices made: the others are never summed."""
    model = build.plan.model
    build.source.name(model.decide)
    text = "\n".join(build.source.blocks)
    fields = model.Sums._fields  # type: ignore[union-attr]
    return [c for c in sums if f".{fields[c]}" in text] if "sums[" not in text and "*sums" not in text else sums
