"""Neighbours by cells: sum a law's rule over those in the cells around each agent, as `neighbours` does over all pairs.

Cells are no smaller than the law reaches. Candidates of a cell are three slabs of agents that lie side by side, so that
the loop over them runs in whole vectors; the last of these holds some that are nobody. Lines of cells are gone through
side by side. The order of every sum is that of slabs and places, whatever the number of threads.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from airflock.core.contract import Model
from airflock.engine.plan import Plan
from airflock.engine.stages.cells import (
    CELLS,
    CHUNKS,
    GROUP,
    WHO,
    copied,
    filled_up,
    place_of_line,
    room_around,
)  # fmt: skip
from airflock.engine.stages.meet import chosen
from airflock.engine.stages.neighbours import headed, squared_reach
from airflock.engine.stages.pair import ADD, BOTH, HEAR, pair
from airflock.engine.stages.records import Cells, Decision, Hearer, Line, Others, Reach, Surroundings
from airflock.engine.stages.state import Flock, numbers_of
from airflock.engine.stages.words import (
    BLOCK,
    LIMIT,
    NOTHING,
    START,
    TINY,
    ZERO,
    X,
    Y,
    Z,
    aliases,
    ask,
    integer,
    least,
    side_by_side,
    totals,
    vector,
    wants,
)  # fmt: skip

Sums = tuple[tuple[int, str], ...]  # each field of Sums that is summed, and how it is reduced


def line_of_cells(
    oy: int, oz: int, flock: Flock, numbers: Any, work: Any, cells: Cells, ident: Any, *, plan: Plan, model: Model
) -> Any:  # fmt: skip
    """All who lie in and around a line of cells, side by side."""
    room = room_around(oy, oz, cells.starts, cells.count, plan=plan)
    box = np.empty((2 * plan.dimensions, room + 2 * BLOCK), work.dtype)
    numbered, grouped = wants(model.neighbour, "lower"), plan.grouped and wants(model.neighbour, "kin", "group")
    who = np.empty(room + 2 * BLOCK, ident.dtype) if numbered else NOTHING
    group_of = np.empty(room + 2 * BLOCK, work.dtype) if grouped else NOTHING
    carried = (*(((WHO, who),) if numbered else ()), *(((GROUP, group_of),) if grouped else ()))
    h, hv, away = aliases(), aliases(), aliases()
    for a in range(plan.dimensions):
        h[a] = box[a]
    for a in range(plan.dimensions):
        hv[a] = box[a + plan.dimensions]
    slab, middle, found = copied(
        oy, oz, cells.starts, cells.flat, ident, cells.whose, box, cells.count, flock, numbers, plan=plan,
        carried=carried,
    )  # fmt: skip
    filled_up(found, h, hv, plan=plan, carried=carried)
    # of what an agent makes of its candidates, a driver has the rows that its topology asks for
    square = np.zeros(room + 2 * BLOCK, work.dtype)
    met = np.zeros(room + 2 * BLOCK, work.dtype)
    heap = np.zeros(room + 2 * BLOCK, work.dtype)
    hidden = np.zeros(room + 2 * BLOCK, work.dtype)
    for a in range(plan.dimensions):
        away[a] = np.zeros(room + 2 * BLOCK, work.dtype)
    others = Others(who, group_of, h, hv, square, away, hidden, NOTHING, met, heap, NOTHING)
    return Line(others, slab, middle)


def each_agent(
    e: int, line: Line, first: Any, many: Any, padded: int, ox: int, here: int, reach: Reach, at: Decision,
    flock: Flock, numbers: Any, whole: Any, around: Surroundings, cells: Cells, ident: Any, sums_of: Any,
    *, plan: Plan, model: Model, sums: Sums,
) -> None:  # fmt: skip
    """Sum the rule for the agent at place e over the candidates of its cell, from place `first` of the line on."""
    who = cells.whose[e]
    own_p = numbers_of(who, "p", flock, numbers, plan=plan)
    if plan.varies("p"):
        near2 = squared_reach(own_p, plan=plan, model=model)
    heeds = Reach(reach.radio, reach.radio_, near2 if plan.varies("p") else reach.law)
    own, v, h, total = vector(), vector(), vector(), totals()
    for a in range(plan.dimensions):
        own[a] = cells.packed[e, a]
        v[a] = cells.packed[e, a + plan.dimensions]
    headed(v, h, plan=plan)
    for c, how in sums:
        total[c] = START[how]
    place = integer(line.middle[ox] - line.slab[ox] + e - cells.starts[here])
    me = Hearer(who, place, ident[e], many, own, v, h, own, own_p, ZERO, ZERO)
    for part in (BOTH,) if plan.topology is None else (HEAR, ADD):
        for q in range(padded):
            j = first + np.uint64(q)  # it cannot count from the end, which would turn loads of vectors into gathers
            pair(
                me, j, q, part, total, heeds, at, flock, line.others, numbers, whole, around, plan=plan, model=model,
                sums=sums, images=False,
            )  # fmt: skip
        if part == HEAR:
            chosen(padded, line.others, numbers, plan=plan)
    slot = cells.whose[e]
    for k, (c, _) in enumerate(sums):
        sums_of[slot, k] = total[c]


def each_cell(
    oy: int, oz: int, reach: Reach, at: Decision, flock: Flock, numbers: Any, whole: Any, around: Surroundings,
    work: Any, cells: Cells, ident: Any, sums_of: Any, *, plan: Plan, model: Model, sums: Sums,
) -> None:  # fmt: skip
    """The agents of a line of cells, cell by cell."""
    line = line_of_cells(oy, oz, flock, numbers, work, cells, ident, plan=plan, model=model)
    for ox in range(cells.count[X]):
        here = (oz * cells.count[Y] + oy) * cells.count[X] + ox
        if cells.starts[here] == cells.starts[here + 1]:
            continue
        first = np.uint64(line.slab[ox])
        many = integer(line.slab[ox + 3] - line.slab[ox])
        padded = -(-(line.slab[ox + 3] - line.slab[ox]) // BLOCK) * BLOCK
        for e in range(cells.starts[here], cells.starts[here + 1]):
            if plan.law is None or flock.own("", "law")[cells.whose[e]] == plan.law:
                each_agent(
                    e, line, first, many, padded, ox, here, reach, at, flock, numbers, whole, around, cells, ident,
                    sums_of, plan=plan, model=model, sums=sums,
                )  # fmt: skip


def neighbours_by_cells(
    flock: Flock, numbers: Any, whole: Any, around: Surroundings, n: int, decision: int, time: float, late: float,
    work: Any, starts: Any, whose: Any, packed: Any, flat: Any, ident: Any, totals_: Any, sort: Callable[..., Any],
    widest: Callable[[], Any], *, plan: Plan, model: Model, sums: Sums,
) -> None:  # fmt: skip
    """Sum the neighbour rule over those in the cells around each agent.

    starts, whose, packed, flat : what `sort` fills (`records.Cells`)
    ident, totals_ : memory for the number of the agent at each place, and for sums by agent, in one row
    sort           : the stage of this name, for cells no smaller than `near`, about `most_cells`
    widest         : how far the agents see at most where that differs among them, m
    """
    range_ = least(numbers.k.range, LIMIT)
    range2 = range_ * range_ + TINY if plan.bits == 64 else range_ * range_
    if not plan.varies("p"):
        near = least(ask(model.reach, p=numbers.p), LIMIT)
        near2 = near * near + TINY if plan.bits == 64 else near * near
    sides, count = ask(sort, near=widest() if plan.varies("p") else near, most_cells=CELLS * n)
    cells = Cells(starts, whose, packed, flat, count)
    sums_of = totals_[: n * max(1, len(sums))].reshape(n, max(1, len(sums)))
    if wants(model.neighbour, "lower"):
        for chunk in side_by_side(CHUNKS):
            for e in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS):
                ident[e] = flock.number[cells.whose[e]]
    reach = Reach(range2, range2, LIMIT if plan.varies("p") else near2)
    at = Decision(decision, n, time, late, ZERO, ZERO, None)
    for line in side_by_side(count[Y] * count[Z]):
        oy, oz = place_of_line(line, count)
        if plan.law is None:
            each_cell(
                oy, oz, reach, at, flock, numbers, whole, around, work, cells, ident, sums_of, plan=plan, model=model,
                sums=sums,
            )  # fmt: skip
        else:
            begin = (oz * count[Y] + oy) * count[X]
            some = False
            for e in range(cells.starts[begin], cells.starts[begin + count[X]]):
                some |= flock.own("", "law")[cells.whose[e]] == plan.law
            if some:
                each_cell(
                    oy, oz, reach, at, flock, numbers, whole, around, work, cells, ident, sums_of, plan=plan,
                    model=model, sums=sums,
                )  # fmt: skip
    for chunk in side_by_side(CHUNKS):
        for i in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS):
            if plan.law is None or flock.own("", "law")[i] == plan.law:
                hand_over(i, flock, sums_of, sums=sums)


def hand_over(i: int, flock: Flock, sums_of: Any, *, sums: Sums) -> None:
    """Sums of agent i to its rows."""
    for k, (c, _) in enumerate(sums):
        flock.sums[c][i] = sums_of[i, k]
