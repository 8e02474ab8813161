"""Meet neighbours, decide: two of the loop nests of a decision, with what their stages are handed."""

import ast

from airflock.engine.passes import grid, perceive, percept
from airflock.engine.passes.build import Builder
from airflock.engine.passes.perceive import RECEIVE
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.text import Specialised, lines_of
from airflock.engine.specialise.values import Call, argument
from airflock.engine.stages import decide as deciding
from airflock.engine.stages import meet as meeting_whom
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
    images = build.images and not plan.grid  # candidates that come by cells come at their image
    made = specialise(
        build, meeting.neighbours, n=argument("n"), decision=argument("k_"), draw=draw, drawn=drawn, meet=meet,
        sums=sums, images=images,
    )  # fmt: skip
    if plan.grid:
        if plan.varies("p"):
            wide = specialise(build, meeting.widest)
            build.function(f"widest{build.mark}(n, row, work)", wide.lines, f"return {wide.answer}")
        grid.neighbours(build, *_for_cells(build, made), [c for c, _ in sums])
        return
    arguments = ", ".join(["k_, n, m, time, late, row, whole, work, store, words", *more])
    name = f"neighbours{build.mark}"
    build.stage(name, arguments, made.once, made.body, made.answer, apart=plan.topology is None)


def _for_cells(
    build: Builder, made: Specialised
) -> tuple[list[str], list[str], list[str], tuple[list[str], list[str]] | None]:
    """Of `neighbours`: what is done once, for an agent, and for each candidate, for the grid's own loops.

    And where an agent meets but some of whom it hears, what finds out: for each candidate, and at last.
    """
    plan, axes = build.plan, build.plan.axes
    found = {f"{kind}{a}" for kind in ("m", "mv", "h", "hv") for a in axes}  # the grid lays them out in its own way
    found |= set(grid.FOUND)
    lines = [line for line in made.once if line.partition(" = ")[0] not in found]
    lines = list(dict.fromkeys([*(build.records("w") if build.plan.periodic else []), *lines]))
    *first, agents = made.rest
    assert isinstance(agents, ast.For)
    body = agents.body
    if plan.law is not None:  # who does not fly by this law is left out by the grid
        (own,) = body
        assert isinstance(own, ast.If)
        body = own.body
    at = next(k for k, statement in enumerate(body) if isinstance(statement, ast.For))
    candidates = body[at]
    assert isinstance(candidates, ast.For)
    before = lines_of([*first, *body[:at]])
    if plan.topology is None:
        return lines, before, lines_of(candidates.body), None
    made_of = specialise(build, meeting_whom.meet, m=argument("padded"))
    again = body[at + 2]
    assert isinstance(again, ast.For)
    lines += [line for line in made_of.bindings if " = work[" not in line]
    return lines, before, lines_of(again.body), (lines_of(candidates.body), lines_of(made_of.first))


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
