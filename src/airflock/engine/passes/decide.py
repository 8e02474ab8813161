"""Meet neighbours, meet surfaces, decide: the three loop nests of one decision."""

import ast

from airflock.core.contract import Model
from airflock.core.maths import norm
from airflock.core.vocabulary import Own, asks
from airflock.engine.passes import flock, grid, perceive, percept, scene
from airflock.engine.passes.build import Builder
from airflock.engine.specialise.stage import Specialised, lines_of, specialise
from airflock.engine.specialise.values import Call, argument
from airflock.engine.stages import faults, surfaces
from airflock.engine.stages import meet as meeting_whom
from airflock.engine.stages import neighbours as meeting
from airflock.engine.stages.state import own_row
from airflock.engine.stages.words import live

EXTREME = {"min": "least", "max": "most"}
START = {"sum": "ZERO", "min": "FAR", "max": "-FAR"}


def combine(how: str, total: str, term: str) -> str:
    """Text that reduces one more term into a total."""
    return f"{total} += {term}" if how == "sum" else f"{total} = {EXTREME[how]}({total}, {term})"


def neighbours(build: Builder) -> None:
    """Function neighbours: the neighbour rule over all others in range of each agent, all pairs or by cells."""
    plan, model = build.plan, build.plan.model
    if model.neighbour is None:
        return
    fields = model.Sums._fields  # type: ignore[union-attr]
    sums = tuple((c, model.reduce.get(fields[c], "sum")) for c in _asked(build, live(model.Sums, plan.dimensions)))
    hear = Call("receive(i, k_, n, time, late, row, whole, work, store)")
    more = perceive.around(plan)
    meet = Call(f"meet({', '.join(['i, k_, n, m, row, whole, work', *more])})")
    images = build.images and not plan.grid  # candidates that come by cells come at their image
    made = specialise(build, meeting.neighbours, receive=hear, meet=meet, sums=sums, images=images)
    if plan.grid:
        grid.neighbours(build, *_for_cells(build, made), [c for c, _ in sums])
        return
    arguments = ", ".join(["k_, n, m, time, late, row, whole, work, store", *more])
    build.stage("neighbours", arguments, made.once, made.body, made.answer)


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
    (agents,) = made.rest
    assert isinstance(agents, ast.For)
    at = next(k for k, statement in enumerate(agents.body) if isinstance(statement, ast.For))
    candidates = agents.body[at]
    assert isinstance(candidates, ast.For)
    before = lines_of(agents.body[:at])
    if plan.topology is None:
        return lines, before, lines_of(candidates.body), None
    made_of = specialise(build, meeting_whom.meet, m=argument("padded"))
    again = agents.body[at + 2]
    assert isinstance(again, ast.For)
    lines += [line for line in made_of.bindings if " = work[" not in line]
    return lines, before, lines_of(again.body), (lines_of(candidates.body), lines_of(made_of.first))


def boundaries(build: Builder) -> None:
    """Function boundaries: the boundary rule over all surfaces."""
    if build.plan.model.boundary is None:
        return
    made = specialise(build, surfaces.boundaries)
    arguments = "n, row, whole, work, faces, edges, spans, scene"
    build.stage("boundaries", arguments, made.once, made.body, made.answer)


def decide(build: Builder) -> None:
    """Call the decide rule for each agent and keep its command."""
    plan, axes, model = build.plan, build.plan.axes, build.plan.model
    used = set(asks(model.decide, "decide", model.name))
    memory = getattr(model.Memory, "_fields", ()) if "memory" in used else ()
    lines = build.records(" ".join(["p c", *(name for name in ("wing", "aero") if name in used)]))
    lines += build.bind([own_row(letter, name) for letter, name in plan.varied if letter == "p"])
    lines += build.bind([f"m{a}" for a in axes] + [f"mv{a}" for a in axes])
    lines += build.bind([f"c{a}" for a in axes])
    body = [f"v{a} = mv{a}[i]" for a in axes] + ([] if plan.dimensions == 3 else ["vz = ZERO"])
    if "own" in used:
        body += [f"f = ONE / {build.source.name(norm)}(vx, vy, vz)"]
        body += [f"own = {build.source.name(Own)}(vx, vy, vz, f * vx, f * vy, f * vz)"]
    for record, word, rows in ((model.Sums, "sums", "sum"), (model.Walls, "walls", "wall")):
        if word in used and record is not None:
            kept = live(record, plan.dimensions)
            kept = _asked(build, kept) if word == "sums" else kept
            present = _present(model, word)
            lines += build.bind([f"{rows}{c}" for c in kept]) if present else []
            values = [f"{rows}{c}[i]" if c in kept and present else "ZERO" for c in range(len(record._fields))]  # type: ignore[attr-defined]
            body += [f"{word} = {build.source.name(record)}({', '.join(values)})"]
    if "shared" in used:
        lines += flock.columns_of(build, model.Shared, "model")
        body += flock.shared(build, model.Shared, "model", bound=True)
    if memory:
        values = [f"mem[{c}, i]" for c in range(len(memory))]
        body += [f"memory = {build.source.name(model.Memory)}({', '.join(values)})"]
    if "percept" in used:
        lines += build.records("w") + build.whole("world", "seed_low", "seed_high", "corners", "obstacles")
        lines += build.order()
        body += scene.parts("aim") if plan.goals else []
        lines += build.bind([f"goal_{a}" for a in axes]) if plan.own else []
        body += scene.look(build, model)
        body += [f"percept = {percept.record(build)}({percept.values(build)})"]
    own, p = build.own("p")
    body = [*own, *body]
    body += [f"o = {build.call(model.decide, 'decide', {'period': 'c.period', 'p': p}, model.name)}"]
    body += [f"c{a}[i] = o[{c}]" for c, a in enumerate(axes)]
    body += [f"mem[{c}, i] = o[3][{c}]" for c in range(len(memory))]
    if "percept" in used and model.sight is not None:
        lines += build.bind(["rays_"])
        body += ["rays_[i] = real(counts[0])"]
    percept.bind(build)
    build.stage("decide", "k_, n, time, row, whole, work, mem, edges, spans, scene", lines, build.each(body))


def overrule(build: Builder) -> None:
    """Function overrule: faults of the commands, where there are such kinds."""
    if build.plan.suffers("overrule"):
        made = specialise(build, faults.overrule, time=argument("time"))
        build.stage("overrule", "n, time, row, work", made.once, made.body, made.answer)


def _asked(build: Builder, sums: list[int]) -> list[int]:
    """Of these fields of Sums those that `decide` can read, with its choices made: the others are never summed."""
    model = build.plan.model
    build.source.name(model.decide)
    text = "\n".join(build.source.blocks)
    fields = model.Sums._fields  # type: ignore[union-attr]
    return [c for c in sums if f".{fields[c]}" in text] if "sums[" not in text and "*sums" not in text else sums


def _present(model: Model, word: str) -> bool:
    return (model.neighbour if word == "sums" else model.boundary) is not None
