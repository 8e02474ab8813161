"""Cell grid: neighbours by cells no smaller than the reach, sorted by counting; for many agents that see a short way.

A line is a row of cells along x. The agents in the cells around a line are copied side by side once, slab by slab (the
cells of one x), so that the candidates of a cell are three slabs, one piece of memory, and the loop over them runs in
whole vectors; so does the copying, which may write past the agents of a cell where the next ones overwrite it. In a
periodic box they are copied at the image that they are met at. Whatever lies at random in memory (the agents of a cell,
their sums) is kept in rows of one agent, so that it costs one cache line and not one per number; `slots` keeps it from
lying far apart. All that is kept from stage to stage lies in memory that lasts for a flight. Candidates come in the
order of slabs and within a cell by slot, whatever the number of threads. Where groups have laws of their own, each law
sorts the flock anew, into cells of its own reach, and goes through those who fly by it. Only for perception without
noise, delay and loss; there it equals all pairs but for rounding and the order of sums.
"""

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.engine.passes.build import Builder, branch, loop
from airflock.engine.plan import Plan
from airflock.engine.replace import must_replace

CELLS = 4  # at most so many cells per agent: a flock that has dispersed widely does not fill the memory
CHUNKS = 8  # parts of the flock that are counted side by side; their order is that of the agents
BLOCK = 8  # candidates taken at once
STRIP = 16  # lines side by side before those above them: three layers of so many stay in the second-level cache
SPARE = 8  # cells of the smallest periodic box
FOUND = ("square", "met", "heap", "hidden", "away0", "away1", "away2")  # rows of candidates, where some are met
OTHERS = "(integer(q) != me) & (integer(q) < many)"
KEPT = "starts, tally, cell_of, ident, packed, flat, totals_"


class Carried(NamedTuple):
    """What of candidates is laid side by side: kind of number, where that of one at `origin + s` is, that of nobody."""

    kind: str
    at: str
    nobody: str


def memory(
    plan: Plan, agents: int, rows: Callable[[tuple[int, ...], Any], Any]
) -> tuple[tuple[NDArray[Any], ...], ...]:
    """What the grid keeps of n agents during a flight, as one argument or none; `rows` makes zeros on cache lines.

    starts : first place of each cell; tally : agents by chunk and cell, in one row; cell_of : of each agent
    packed : (place, component) states and, as an integer, the slot; flat : (component, place) states; ident : agents
    Between two sorts, `tally` and `ident` are scratch of whoever looks for links by cells.
    """
    if not plan.grid:
        return ()
    real, whole = (np.float32, np.int32) if plan.bits == 32 else (np.float64, np.int64)
    components, most = 2 * plan.dimensions, CELLS * agents + SPARE
    fields = max(len(getattr(own.model.Sums, "_fields", ())) for own in plan.every)
    shapes = (
        ((most + 1,), np.int64), ((CHUNKS * most,), np.int32), ((agents,), np.int32),
        ((agents,), whole), ((agents, _width(plan)), real), ((components, agents + BLOCK), real),
        ((agents * max(1, fields),), real),
    )  # fmt: skip
    # not made anew at each step: the pages of what is given back must be zeroed again before they are used
    return (tuple(rows(shape, kind) for shape, kind in shapes),)


def _width(plan: Plan) -> int:
    """Numbers in the row of an agent, the last its slot: a power of two, so that none lies across two cache lines."""
    return 1 << (2 * plan.dimensions).bit_length()


def opened(build: Builder) -> list[str]:
    """Lines that bind what lasts for a flight, and `whose`, the slot of the agent at each place."""
    return [f"{KEPT} = cells", f"whose = packed.view(np.int{build.plan.bits})[:, {_width(build.plan) - 1}]"]


def neighbours(
    build: Builder, lines: list[str], before: list[str], inner: list[str],
    met: tuple[list[str], list[str]] | None, sums: list[int],
) -> None:  # fmt: skip
    """Function `neighbours` over a grid: `before`, then `inner` for each candidate j, for each agent; sums to rows.

    met : where an agent meets but some of whom it hears, lines before `inner` that find out: of each candidate, at last
    """
    plan, mark, law = build.plan, build.mark, build.plan.law
    for c, name in enumerate(plan.motion):
        if any(f"m{name}[i]" in line for line in before):  # not every rule asks how an agent itself moves
            before = must_replace(before, f"m{name}[i]", f"packed[e, {c}]")
    who = any("integer(j) < ii" in line for line in inner)  # a rule asks who has the lower index
    before = must_replace(before, "ii = integer(i)", "ii = ident[e]" if who else "")
    if met is None:
        inner = must_replace(inner, "integer(j) != ii", OTHERS)
    carried = {}
    if who:
        inner = must_replace(inner, "integer(j) < ii", "who[j] < ii")
        carried["who"] = Carried(f"np.int{plan.bits}", "ident[origin + s]", "integer(-1)")
    if any("group[j]" in line for line in inner):
        inner = must_replace(inner, "group[j]", "group_of[j]")
        carried["group_of"] = Carried("work.dtype", "group[whose[origin + s]]", "ZERO")
    meet = [*[line for line in before if line], "me = integer(middle[ox] - slab[ox] + e - starts[here])"]
    if met is not None:
        meet += _found(*met)
        inner = must_replace(inner, "met[j]", "met[q]")
    # an unsigned index cannot count from the end, which would turn loads of whole vectors into gathers
    meet += loop("q in range(padded)", ["j = first + np.uint64(q)", *inner])
    wide = max(1, len(sums))
    meet += ["slot = whose[e]", *[f"totals[slot, {k}] = total_{c}" for k, c in enumerate(sums)]]
    if law is not None or any("[i]" in line for line in meet):
        meet = ["i = whose[e]", *_of_law(law, meet)]
    cell = [
        "here = (oz * count[1] + oy) * count[0] + ox",
        *["if starts[here] == starts[here + 1]:", "    continue"],
        "first = np.uint64(slab[ox]); many = integer(slab[ox + 3] - slab[ox])",
        f"padded = -(-(slab[ox + 3] - slab[ox]) // {BLOCK}) * {BLOCK}",
        *loop("e in range(starts[here], starts[here + 1])", meet),
    ]
    found = re.findall(r"\w+", "\n".join(line for part in met or () for line in part))
    rows = [f"{name} = np.zeros(room + {2 * BLOCK}, work.dtype)" for name in FOUND if name in found]
    body = _line([*_slabs(build, carried), *rows, *loop("ox in range(count[0])", cell)], law)
    near = f"widest{mark}(n, row, work)" if plan.varies("p") else "near"
    lines = [*lines, *sort(build, near, f"{CELLS} * n"), f"totals = totals_[: n * {wide}].reshape(n, {wide})"]
    if who:
        number = "order[whose[e]]" if build.slots else "whose[e]"
        each = loop("e in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS)", [f"ident[e] = {number}"])
        lines += [*build.order(), *loop("chunk in prange(CHUNKS)", each)]
    lines += loop("line in prange(count[1] * count[2])", body)
    each = _of_law(law, [f"sum{c}[i] = totals[i, {k}]" for k, c in enumerate(sums)])
    back = loop("i in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS)", each)
    lines += loop("chunk in prange(CHUNKS)", back)
    lines = must_replace(lines, "CHUNKS", str(CHUNKS))
    arguments = "k_, n, m, time, late, row, whole, work, store, words, cells"
    build.function(f"neighbours{mark}({arguments})", lines, "return 0", parallel=True)


def _of_law(law: int | None, lines: list[str]) -> list[str]:
    """Lines for agent i, where it flies by this law; for every agent where there is but one."""
    return lines if law is None else branch(f"law[i] == {law}", lines)


def sort(build: Builder, near: str, most: str) -> list[str]:
    """Lines that sort agents into about `most` cells no smaller than `near` (m); they call the function `sort`."""
    if not any("def sort(" in text for text in build.functions):
        build.function(
            "cells_of(n, near, most_cells, row, work)", build.records("w"), _box(build), "return low, size, count"
        )
        lines = must_replace([*opened(build), *_sorted(build)], "CHUNKS", str(CHUNKS))
        build.function("sort(n, near, most_cells, row, work, cells)", lines, "return size, count", parallel=True)
    return [*opened(build), f"sides, count = sort(n, {near}, {most}, row, work, cells)"]


def _found(each: list[str], last: list[str]) -> list[str]:
    """Lines that find whom an agent meets of the candidates of its cell: `met`, by number of the candidate."""
    each = must_replace(each, "integer(j) != ii", OTHERS)
    written = set(re.findall(r"\w+", "\n".join(each)))
    for name in (name for name in FOUND if name in written):  # which rows there are is a matter of the topology
        each = must_replace(each, f"{name}[j]", f"{name}[q]")
    return [*loop("q in range(padded)", ["j = first + np.uint64(q)", *each]), *last]


def _box(build: Builder) -> list[str]:
    """Lower corner, cell size (m) and number of cells per axis: of the periodic box, or around the flock.

    Cells are no smaller than `near`, and about `most_cells` at most; never more than there is memory for.
    """
    axes, periodic = build.plan.axes, build.plan.periodic
    lines = ["low = np.zeros(3, work.dtype); size = np.ones(3, work.dtype); count = np.ones(3, np.int64)"]
    lines += ["width = np.ones(3, work.dtype); volume = ONE"]
    for c, a in enumerate(axes):
        lines += build.bind([a])
        if periodic:
            lines += [f"low[{c}] = -w.half_{a}; width[{c}] = w.half_{a} + w.half_{a}"]
        else:
            lines += ["least_ = FAR; most_ = -FAR"]
            lines += loop("i in range(n)", [f"least_ = least(least_, {a}[i]); most_ = most(most_, {a}[i])"])
            lines += [f"low[{c}] = least_; width[{c}] = most(most_ - least_, near)"]
        lines += [f"volume *= most(width[{c}] / near, ONE)"]
    coarse = f"(volume / real(most_cells)) ** real({1.0 / len(axes)})"
    lines += [f"side = near * most(ONE, {coarse})"]
    fewest = 2 if periodic else 1  # an agent is met at two images of which at most one is in reach
    fit = [f"count[{c}] = max({fewest}, int(width[{c}] / side))" for c in range(len(axes))]
    # a flock that has dispersed along a line or in a plane still has too many
    fit += branch(f"count[0] * count[1] * count[2] <= {CELLS} * n + {SPARE}", ["break"]) + ["side *= real(1.25)"]
    lines += loop("attempt in range(1000)", fit)
    return lines + [f"size[{c}] = width[{c}] / real(count[{c}])" for c in range(len(axes))]


def _sorted(build: Builder) -> list[str]:
    """Agents sorted by cell: starts (first of each cell), place (of each agent), packed (agent, position and velocity).

    Each chunk of agents counts for itself; the counts of a cell, chunk by chunk, become the places of its agents.
    """
    axes = build.plan.axes
    names = build.plan.motion
    lines = [*build.bind(names), "low, size, count = cells_of(n, near, most_cells, row, work)"]
    lines += ["total = count[0] * count[1] * count[2]"]
    inside = [f"per_{a} = ONE / size[{c}]; low_{a} = low[{c}]; top_{a} = count[{c}] - 1" for c, a in enumerate(axes)]
    part = "i in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS)"
    at = {a: f"min(max(int(({a}[i] - low_{a}) * per_{a}), 0), top_{a})" for a in axes}
    index = f"({at['z']} * count[1] + {at['y']})" if "z" in axes else at["y"]
    count = [f"cell = {index} * count[0] + {at['x']}", "cell_of[i] = cell; tally[head + cell] += 1"]
    none = ["head = chunk * total", *loop("cell in range(total)", ["tally[head + cell] = 0"])]
    lines += loop("chunk in prange(CHUNKS)", [*none, *inside, *loop(part, count)])
    add = ["held = tally[share * total + cell]; tally[share * total + cell] = before; before += held"]
    lines += ["before = 0"]
    lines += loop("cell in range(total)", ["starts[cell] = before", *loop("share in range(CHUNKS)", add)])
    lines += ["starts[total] = before"]
    put = ["d = tally[head + cell_of[i]]; tally[head + cell_of[i]] = d + 1; whose[d] = i"]
    put += [f"packed[d, {c}] = {name}[i]" for c, name in enumerate(names)]
    lines += loop("chunk in prange(CHUNKS)", ["head = chunk * total", *loop(part, put)])
    each = [f"flat[{c}, e] = packed[e, {c}]" for c in range(len(names))]
    return lines + loop("chunk in prange(CHUNKS)", loop(must_replace(part, "i in", "e in"), each))


def _slabs(build: Builder, carried: Mapping[str, Carried]) -> list[str]:
    """The agents around one line, slab by slab: slab (where each begins), middle (where the own cell begins).

    carried : what else of candidates is laid side by side, by name
    """
    axes, periodic = build.plan.axes, build.plan.periodic
    names = [*(f"h{a}" for a in axes), *(f"hv{a}" for a in axes)]
    shifts = {f"h{a}": f"shift_{a}" for a in axes} if periodic else {}
    across = axes[1:]
    lines = ["room = 0"]
    rows = ["base = " + ("(cz * count[1] + cy)" if "z" in axes else "cy") + " * count[0]"]
    span = ["room += starts[base + count[0]] - starts[base]"]
    ends = "room += starts[base + 1] - starts[base] + starts[base + count[0]] - starts[base + count[0] - 1]"
    span += [ends] * periodic
    lines += _around(build, across, rows + span, False)
    lines += [f"box = np.empty(({len(names)}, room + {2 * BLOCK}), work.dtype)"]
    lines += [f"{name} = np.empty(room + {2 * BLOCK}, {each.kind})" for name, each in carried.items()]
    lines += [f"{name} = box[{c}]" for c, name in enumerate(names)]
    lines += ["slab = np.zeros(count[0] + 3, np.int64); middle = np.zeros(count[0] + 1, np.int64); found = 0"]
    copy = [
        f"copy_block(box, {c}, found + s, flat, origin + s, {shifts.get(name, 'ZERO')})" for c, name in enumerate(names)
    ]
    kept = [f"{name}[found + s] = {each.at}" for name, each in carried.items()]
    ids = loop("s in range(inside)", kept) if kept else []
    own = "(qy == oy) & (qz == oz)" if "z" in axes else "qy == oy"
    each = [*rows, f"if {own}:", "    middle[min(max(qx, 0), count[0])] = found"]
    each += ["origin = starts[base + cx]; inside = starts[base + cx + 1] - origin"]
    each += [*loop(f"s in range(0, inside, {BLOCK})", copy), *ids, "found += inside"]
    first, last = ("-1", "count[0] + 1") if periodic else ("0", "count[0]")
    wrap = ["cx = qx"]
    if periodic:
        lines += ["width_x = w.half_x + w.half_x"]
        wrap = ["cx = (qx + count[0]) % count[0]", "shift_x = real((qx - cx) // count[0]) * width_x"]
    slab = ["slab[qx + 1] = found", *wrap, *_around(build, across, each, True)]
    lines += loop(f"qx in range({first}, {last})", slab)
    lines += [f"slab[{'count[0] + 2' if periodic else 'count[0] + 1'}] = found"]
    lines += [] if periodic else ["slab[count[0] + 2] = found"]
    rest = [f"h{a}[s] = AWAY; hv{a}[s] = ZERO" for a in axes]
    rest += [f"{name}[s] = {each.nobody}" for name, each in carried.items()]
    return lines + loop(f"s in range(found, found + {BLOCK})", rest)


def _line(body: list[str], law: int | None) -> list[str]:
    """The work of a line of cells, at oy and oz; where laws differ, only where somebody in it flies by this one."""
    lines = [f"wide = {STRIP} * count[2]; strip = line // wide; high = min({STRIP}, count[1] - strip * {STRIP})"]
    lines += [f"oz = (line - strip * wide) // high; oy = strip * {STRIP} + (line - strip * wide) % high"]
    if law is None:
        return lines + body
    lines += ["row_of = (oz * count[1] + oy) * count[0]", "some = False"]
    lines += loop("e in range(starts[row_of], starts[row_of + count[0]])", [f"some |= law[whose[e]] == {law}"])
    return lines + branch("some", body)


def _around(build: Builder, across: tuple[str, ...], body: list[str], shifted: bool) -> list[str]:
    """Loops over the rows of cells beside a line, at cy (and cz), and how far their images are shifted."""
    for a in across:
        c = "xyz".index(a)
        if build.plan.periodic:
            at = [f"c{a} = (q{a} + count[{c}]) % count[{c}]"]
            at += [f"shift_{a} = real((q{a} - c{a}) // count[{c}]) * (w.half_{a} + w.half_{a})"] * shifted
            body = loop(f"q{a} in range(o{a} - 1, o{a} + 2)", [*at, *body])
        else:
            body = loop(f"q{a} in range(max(o{a} - 1, 0), min(o{a} + 2, count[{c}]))", [f"c{a} = q{a}", *body])
    return body
