"""Meet neighbours, decide: two of the loop nests of a decision, with what their stages are handed."""

from airflock.engine.passes import grid, perceive, percept
from airflock.engine.passes.build import Builder
from airflock.engine.passes.perceive import RECEIVE
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import Call, argument
from airflock.engine.stages import decide as deciding
from airflock.engine.stages import neighbours as meeting
from airflock.engine.stages.words import live


def neighbours(build: Builder) -> None:
    """Function neighbours: the neighbour rule over all others in range of each agent, all pairs or by cells."""
    plan, model = build.plan, build.plan.model
    fields = model.Sums._fields  # type: ignore[union-attr]
    sums = tuple((c, model.reduce.get(fields[c], "sum")) for c in _asked(build, live(model.Sums, plan.dimensions)))
    draw, drawn = (None, Call(perceive.word(plan))) if build.by_pairs else (Call(RECEIVE[False]), None)
    more = perceive.around(plan)
    meet = Call(f"meet({', '.join([perceive.MEET, *more])})")
    if plan.grid:
        grid.neighbours(build, sums)
        return
    made = specialise(
        build, meeting.neighbours, n=argument("n"), decision=argument("k_"), draw=draw, drawn=drawn, meet=meet,
        sums=sums, images=build.images,
    )  # fmt: skip
    arguments = ", ".join(["k_, n, m, time, late, row, whole, work, store, words", *more])
    name = f"neighbours{build.mark}"
    build.stage(name, arguments, made.once, made.body, made.answer, apart=plan.topology is None)


def decide(build: Builder) -> None:
    """Function decide: the law's rule for the command of each agent, and those that its percept is bound to."""
    plan, model = build.plan, build.plan.model
    summed = live(model.Sums, plan.dimensions) if model.neighbour is not None else []
    made = specialise(
        build, deciding.decide, decision=argument("k_"), percept_of=argument(f"PERCEPT{build.mark}"),
        summed=_asked(build, summed) if deciding.asks(model, "sums") else [],
        walled=live(model.Walls, plan.dimensions) if model.boundary is not None else [],
    )  # fmt: skip
    if deciding.asks(model, "percept"):
        percept.record(build)
    percept.bind(build)
    arguments = "k_, n, time, row, whole, work, mem, edges, spans, scene"
    build.stage(f"decide{build.mark}", arguments, made.once, made.body, made.answer)


def _asked(build: Builder, sums: list[int]) -> list[int]:
    """Of these fields of Sums those that `decide` can read, with its choices made: the others are never summed."""
    model = build.plan.model
    build.source.name(model.decide)
    text = "\n".join(build.source.blocks)
    fields = model.Sums._fields  # type: ignore[union-attr]
    return [c for c in sums if f".{fields[c]}" in text] if "sums[" not in text and "*sums" not in text else sums
