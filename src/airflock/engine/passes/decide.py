"""Meet neighbours, meet surfaces, decide: the three loop nests of one decision."""

from airflock.core.contract import Model
from airflock.core.maths import norm
from airflock.core.vocabulary import Own, asks
from airflock.engine.passes import flock, grid, percept, scene
from airflock.engine.passes.build import Builder, branch, loop
from airflock.world import arena, bvh

EXTREME = {"min": "least", "max": "most"}
START = {"sum": "ZERO", "min": "FAR", "max": "-FAR"}


def combine(how: str, total: str, term: str) -> str:
    """Text that reduces one more term into a total."""
    return f"{total} += {term}" if how == "sum" else f"{total} = {EXTREME[how]}({total}, {term})"


def live(fields: tuple[str, ...], dimensions: int) -> list[int]:
    """Fields that can differ from zero: in a plane, a field that ends in z cannot."""
    return [c for c, name in enumerate(fields) if dimensions == 3 or not name.endswith("z")]


def neighbours(build: Builder) -> None:
    """Sum the neighbour rule over all agents in range of each agent (all pairs)."""
    plan, axes, model = build.plan, build.plan.axes, build.plan.model
    rule, fields = model.neighbour, getattr(model.Sums, "_fields", ())
    if rule is None:
        return
    used = set(asks(rule, "neighbour", model.name))
    sums = _asked(build, live(fields, plan.dimensions))
    how = {c: model.reduce.get(fields[c], "sum") for c in sums}
    heard = "eh" if plan.links else "h"
    truth = axes if plan.noisy or plan.delayed or plan.links else ()
    rows = [f"m{a}" for a in axes] + [f"mv{a}" for a in axes] + [f"{heard}{a}" for a in axes]
    rows += [f"{heard}v{a}" for a in axes] + list(truth) + [f"sum{c}" for c in sums]
    selective = plan.lossy or plan.links
    rows += ["heard", "age"] if selective else []
    lines = build.records("p k c w" if plan.periodic else "p k c") + build.bind(rows)
    # A neighbour at exactly the range or the reach counts. Squares of distances that carry the guard TINY, which only
    # double precision can tell, are compared with squares that carry it, too.
    guard = " + TINY" if plan.bits == 64 else ""
    lines += ["range_ = least(k.range, LIMIT)", f"range2 = range_ * range_{'' if truth else guard}"]
    if model.reach is not None:
        lines += [f"near = least({build.call(model.reach, 'reach', {})}, LIMIT)", f"near2 = near * near{guard}"]
    outer = ["ii = integer(i)"]
    if selective:
        outer += ["receive(i, k_, n, time, late, row, whole, work, store)"]
    outer += [f"own_{a} = m{a}[i]; v{a} = mv{a}[i]" for a in axes]
    outer += [] if plan.dimensions == 3 else ["vz = ZERO"]
    outer += [f"true_{a} = {a}[i]" for a in truth]
    if used & {"hx", "hy", "hz"}:
        outer += [
            f"f = ONE / {build.source.name(norm)}(vx, vy, vz)",
            "own_hx = f * vx; own_hy = f * vy; own_hz = f * vz",
        ]
    outer += [f"t{c} = {START[how[c]]}" for c in sums]
    inner = [f"d{a} = {heard}{a}[j] - own_{a}; dv{a} = {heard}v{a}[j] - v{a}" for a in axes]
    inner += build.image(axes)
    inner += [] if plan.dimensions == 3 else ["dz = ZERO; dvz = ZERO"]
    inner += ["r2 = " + " + ".join(f"d{a} * d{a}" for a in axes) + " + TINY"]
    inner += ["r = math.sqrt(r2)"] if "r" in used else []
    if "dv" in used:
        inner += ["dv = math.sqrt(" + " + ".join(f"dv{a} * dv{a}" for a in axes) + " + TINY)"]
    if used & {"nhx", "nhy", "nhz"}:
        inner += [f"g = ONE / {build.source.name(norm)}(vx + dvx, vy + dvy, vz + dvz)"]
        inner += [f"nh{a} = g * (v{a} + dv{a})" for a in "xyz"]
    if truth:
        inner += [f"o{a} = {a}[j] - true_{a}" for a in truth] + build.image(truth, "o{}")
        inner += ["ok = (" + " + ".join(f"o{a} * o{a}" for a in truth) + " <= range2) & (integer(j) != ii)"]
    else:
        inner += ["ok = (r2 <= range2) & (integer(j) != ii)"]
    inner += ["ok = ok & (r2 <= near2)"] if model.reach is not None else []
    inner += ["ok = ok & (heard[j] > HALF)"] if selective else []
    given = {"age": "age[j]" if selective else "late", "lower": "(ONE if integer(j) < ii else ZERO)"}
    given |= {f"h{a}": f"own_h{a}" for a in "xyz"}
    inner += [f"t = {build.call(rule, 'neighbour', given, model.name)}"]
    inner += [combine(how[c], f"t{c}", f"choose(ok, t[{c}], {START[how[c]]})") for c in sums]
    after = [f"sum{c}[i] = t{c}" for c in sums]
    if plan.grid:
        inner = [line for line in inner if line not in build.image(axes)]  # candidates come at their image
        kept = [line for line in lines if not line.startswith((heard, *(f"m{a} =" for a in axes), "mv"))]
        grid.neighbours(build, kept, outer, inner, sums)
        return
    outer += loop("j in range(m)", inner) + after
    build.stage("neighbours", "k_, n, m, time, late, row, whole, work, store", lines, build.each(outer))


def boundaries(build: Builder) -> None:
    """Sum the boundary rule over all surfaces: walls outside, agents inside the loop nest.

    Of the scene two surfaces are felt: the ground, and the nearest point of what stands on it.
    """
    plan, axes, model = build.plan, build.plan.axes, build.plan.model
    rule, fields = model.boundary, getattr(model.Walls, "_fields", ())
    if rule is None:
        return
    walls = live(fields, plan.dimensions)
    given = {name: f"f.{name}" for name in ("distance", "nx", "ny", "nz")} | {"vz": build.z("vz")}
    term = build.call(rule, "boundary", given, model.name)
    position = f"m{axes[0]}[i], m{axes[1]}[i], {build.z('mz[i]')}"
    add = [f"v{a} = mv{a}[i]" for a in axes] + [f"t = {term}"] + [f"wall{c}[i] += t[{c}]" for c in walls]
    lines = build.records("p") + build.bind([f"m{a}" for a in axes] + [f"mv{a}" for a in axes])
    lines += build.bind([f"wall{c}" for c in walls]) + build.whole("obstacles", "faces_0", "faces_1")
    body = build.each([f"wall{c}[i] = ZERO" for c in walls])
    bounds = ("0", "faces_0", "faces_0 + faces_1")
    for family, surface in enumerate(plan.surfaces):
        face = "ea = faces[e, 0]; eb = faces[e, 1]; ec = faces[e, 2]; ed = faces[e, 3]"
        name = build.source.name(surface)
        inner = build.each([f"f = {name}({position}, ea, eb, ec, ed)", *add])
        body += loop(f"e in range({bounds[family]}, {bounds[family + 1]})", [face, *inner])
    if plan.obstacles and model.sight is None:  # who casts meets them in the scene
        name = build.source.name(arena.convex_obstacle)
        inner = build.each([f"f = {name}({position}, edges, spans[o, 0], spans[o, 1])", *add])
        body += loop("o in range(obstacles)", inner)
    if plan.scene:
        lines += scene.parts("shapes", "nodes", "links")
        look = "LIMIT" if model.wall_reach is None else build.call(model.wall_reach, "wall_reach", {}, model.name)
        lines += [f"look = least({look}, LIMIT)"]
        name = build.source.name(bvh.nearest_of)
        for ground in ("ZERO", "ONE") if plan.dimensions == 3 else ("ZERO",):
            inner = [f"f = {name}({position}, look, {ground}, shapes, nodes, links)"]
            body += build.each([*inner, *branch("f.distance < look", add)])
    build.stage("boundaries", "n, row, whole, work, faces, edges, spans, scene", lines, body)


def decide(build: Builder) -> None:
    """Call the decide rule for each agent and keep its command."""
    plan, axes, model = build.plan, build.plan.axes, build.plan.model
    used = set(asks(model.decide, "decide", model.name))
    memory = getattr(model.Memory, "_fields", ()) if "memory" in used else ()
    lines = build.records(" ".join(["p c", *(name for name in ("wing", "aero") if name in used)]))
    lines += build.bind([f"m{a}" for a in axes] + [f"mv{a}" for a in axes])
    lines += build.bind([f"c{a}" for a in axes])
    body = [f"v{a} = mv{a}[i]" for a in axes] + ([] if plan.dimensions == 3 else ["vz = ZERO"])
    if "own" in used:
        body += [f"f = ONE / {build.source.name(norm)}(vx, vy, vz)"]
        body += [f"own = {build.source.name(Own)}(vx, vy, vz, f * vx, f * vy, f * vz)"]
    for record, word, rows in ((model.Sums, "sums", "sum"), (model.Walls, "walls", "wall")):
        if word in used and record is not None:
            kept = live(record._fields, plan.dimensions)  # type: ignore[attr-defined]
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
    body += [f"o = {build.call(model.decide, 'decide', {'period': 'c.period'}, model.name)}"]
    body += [f"c{a}[i] = o[{c}]" for c, a in enumerate(axes)]
    body += [f"mem[{c}, i] = o[3][{c}]" for c in range(len(memory))]
    if "percept" in used and model.sight is not None:
        lines += build.bind(["rays_"])
        body += ["rays_[i] = real(counts[0])"]
    percept.bind(build)
    build.stage("decide", "k_, n, time, row, whole, work, mem, edges, spans, scene", lines, build.each(body))


def _asked(build: Builder, sums: list[int]) -> list[int]:
    """Of these fields of Sums those that `decide` can read, with its choices made: the others are never summed."""
    model = build.plan.model
    build.source.name(model.decide)
    text = "\n".join(build.source.blocks)
    fields = model.Sums._fields  # type: ignore[union-attr]
    return [c for c in sums if f".{fields[c]}" in text] if "sums[" not in text and "*sums" not in text else sums


def _present(model: Model, word: str) -> bool:
    return (model.neighbour if word == "sums" else model.boundary) is not None
