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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.passes.build import Builder, branch, loop
from airflock.engine.plan import Plan
from airflock.engine.replace import must_replace
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.text import lines_of
from airflock.engine.specialise.values import Call, argument
from airflock.engine.stages import cells
from airflock.engine.stages.cells import CELLS, CHUNKS, GROUP, SPARE, WHO
from airflock.engine.stages.words import BLOCK

FOUND = ("square", "met", "heap", "hidden", "away0", "away1", "away2")  # rows of candidates, where some are met
OTHERS = "(integer(q) != me) & (integer(q) < many)"
KEPT = "starts, tally, cell_of, ident, packed, flat, totals_"


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
    carried = {}  # what else of candidates is laid side by side, and which kind of number that is
    if who:
        inner = must_replace(inner, "integer(j) < ii", f"{WHO}[j] < ii")
        carried[WHO] = f"np.int{plan.bits}"
    if any("group[j]" in line for line in inner):
        inner = must_replace(inner, "group[j]", f"{GROUP}[j]")
        carried[GROUP] = "work.dtype"
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
    body = _line(build, [*_slabs(build, carried), *rows, *loop("ox in range(count[0])", cell)])
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
        called = "cells_of(n, near, most_cells, row, work)"
        made = specialise(build, cells.box)
        build.function(called, made.lines, f"return {made.answer}")
        made = specialise(build, cells.sort, boxed=Call(called))
        lines = [*opened(build), *made.lines]
        build.function("sort(n, near, most_cells, row, work, cells)", lines, f"return {made.answer}", parallel=True)
    return [*opened(build), f"sides, count = sort(n, {near}, {most}, row, work, cells)"]


def _found(each: list[str], last: list[str]) -> list[str]:
    """Lines that find whom an agent meets of the candidates of its cell: `met`, by number of the candidate."""
    each = must_replace(each, "integer(j) != ii", OTHERS)
    written = set(re.findall(r"\w+", "\n".join(each)))
    for name in (name for name in FOUND if name in written):  # which rows there are is a matter of the topology
        each = must_replace(each, f"{name}[j]", f"{name}[q]")
    return [*loop("q in range(padded)", ["j = first + np.uint64(q)", *each]), *last]


def _slabs(build: Builder, carried: Mapping[str, str]) -> list[str]:
    """The agents around one line, slab by slab: slab (where each begins), middle (where the own cell begins).

    carried : what else of candidates is laid side by side, and which kind of number that is
    """
    names = [*(f"h{a}" for a in build.plan.axes), *(f"hv{a}" for a in build.plan.axes)]
    rows = tuple((what, argument(what)) for what in carried)
    made = [f"box = np.empty(({len(names)}, room + {2 * BLOCK}), work.dtype)"]
    made += [f"{what} = np.empty(room + {2 * BLOCK}, {kind})" for what, kind in carried.items()]
    made += [f"{name} = box[{c}]" for c, name in enumerate(names)]
    return [
        *_lines(build, cells.room_around),
        *made,
        *_lines(build, cells.copied, carried=rows),
        *_lines(build, cells.filled_up, carried=rows),
    ]


def _line(build: Builder, body: list[str]) -> list[str]:
    """The work of a line of cells, at oy and oz; where laws differ, only where somebody in it flies by this one."""
    lines, law = _lines(build, cells.place_of_line), build.plan.law
    if law is None:
        return lines + body
    lines += ["row_of = (oz * count[1] + oy) * count[0]", "some = False"]
    lines += loop("e in range(starts[row_of], starts[row_of + count[0]])", [f"some |= law[whose[e]] == {law}"])
    return lines + branch("some", body)


def _lines(build: Builder, stage: Callable[..., Any], **known: object) -> list[str]:
    """Lines of a stage that stands in another one, which binds all that it reads."""
    made = specialise(build, stage, **known)
    return lines_of([*made.first, *made.rest])
