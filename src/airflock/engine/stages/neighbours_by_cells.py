"""Neighbours by cells: sum a law's rule over those in the cells around each agent, as `neighbours` does over all pairs.

Cells are no smaller than the law reaches. Candidates of a cell are three slabs of agents that lie
side by side, so that the loop over them runs in whole vectors; the last of these ends with empty
places. Lines of cells are gone through side by side. The order of every sum is that of slabs and
places, whatever the number of threads.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from airflock.engine.stages.cells import (
    CHUNKS,
    GROUP,
    MAX_CELLS_PER_AGENT,
    WHO,
    agents_around,
    copy_line,
    line_position,
    pad_candidates,
)  # fmt: skip
from airflock.engine.stages.meet import call_topology
from airflock.engine.stages.neighbours import fill_heading, squared_reach
from airflock.engine.stages.pair import ADD, HEAR, HEAR_AND_ADD, Sums, pair
from airflock.engine.stages.records import (
    CandidateRows,
    CellLine,
    Decision,
    FlightView,
    PairLoopAgent,
    SortedCells,
    SquaredRanges,
)
from airflock.engine.stages.state import FlockRows, agent_numbers
from airflock.engine.stages.words import *


def make_line(oy: int, oz: int, flight: FlightView, work: Any, cells: SortedCells, ident: Any) -> Any:
    """All who lie in and around a line of cells, side by side."""
    plan, model = flight.plan, flight.model
    room = agents_around(oy, oz, cells.starts, cells.count, plan=plan)
    # Scratch of one line: it is small, stays in the cache and belongs to one thread.
    box = np.empty((2 * plan.dimensions, room + 2 * BLOCK), work.dtype)
    numbered, grouped = (
        rule_asks(model.neighbour, "lower"),
        plan.uses_groups and rule_asks(model.neighbour, "kin", "group"),
    )
    who = np.empty(room + 2 * BLOCK, ident.dtype) if numbered else ZERO_ROW
    group_of = np.empty(room + 2 * BLOCK, work.dtype) if grouped else ZERO_ROW
    carried = (*(((WHO, who),) if numbered else ()), *(((GROUP, group_of),) if grouped else ()))
    h, hv, away = aliases(), aliases(), aliases()
    for a in range(plan.dimensions):
        h[a] = box[a]
    for a in range(plan.dimensions):
        hv[a] = box[a + plan.dimensions]
    slab, middle, found = copy_line(oy, oz, cells, ident, box, flight, carried=carried)
    pad_candidates(found, h, hv, plan=plan, carried=carried)
    # a driver keeps only those of these rows that its topology reads
    square = np.zeros(room + 2 * BLOCK, work.dtype)
    met = np.zeros(room + 2 * BLOCK, work.dtype)
    heap = np.zeros(room + 2 * BLOCK, work.dtype)
    hidden = np.zeros(room + 2 * BLOCK, work.dtype)
    for a in range(plan.dimensions):
        away[a] = np.zeros(room + 2 * BLOCK, work.dtype)
    others = CandidateRows(who, group_of, h, hv, square, away, hidden, ZERO_ROW, met, heap, ZERO_ROW)
    return CellLine(others, slab, middle)


def sum_agent(
    e: int, line: CellLine, first: Any, many: Any, padded: int, ox: int, here: int, reach: SquaredRanges, at: Decision,
    flight: FlightView, cells: SortedCells, ident: Any, sums_of: Any, *, sums: Sums,
) -> None:  # fmt: skip
    """Sum the rule for the agent at place e over the candidates of its cell, from place `first` of the line on."""
    plan, model, flock, numbers = flight.plan, flight.model, flight.flock, flight.numbers
    who = cells.whose[e]
    own_p = agent_numbers(who, "p", flock, numbers, plan=plan)
    if plan.varies("p"):
        near2 = squared_reach(own_p, plan=plan, model=model)
    heeds = SquaredRanges(reach.radio, reach.radio_, near2 if plan.varies("p") else reach.law)
    own, v, h, total = vector(), vector(), vector(), totals()
    for a in range(plan.dimensions):
        own[a] = cells.packed[e, a]
        v[a] = cells.packed[e, a + plan.dimensions]
    fill_heading(v, h, plan=plan)
    for c, how in sums:
        total[c] = REDUCTION_START[how]
    place = integer(line.middle[ox] - line.slab[ox] + e - cells.starts[here])
    me = PairLoopAgent(who, place, ident[e], many, own, v, h, own, own_p, ZERO, ZERO, line.others, heeds, at)
    for part in (HEAR_AND_ADD,) if plan.topology is None else (HEAR, ADD):
        # With a signed index Numba adds the wraparound of negative indices, which turns vector
        # loads into gathers: 391 ns instead of 295 ns per agent-step.
        for q in range(padded):
            j = first + np.uint64(q)  # it cannot count from the end, which would turn loads of vectors into gathers
            pair(me, j, q, part, total, flight, sums=sums, images=False)
        if part == HEAR:
            call_topology(padded, line.others, flight)
    slot = cells.whose[e]
    for k, (c, _) in enumerate(sums):
        sums_of[slot, k] = total[c]


def sum_line(
    oy: int, oz: int, reach: SquaredRanges, at: Decision, flight: FlightView, work: Any, cells: SortedCells, ident: Any,
    sums_of: Any, *, sums: Sums,
) -> None:  # fmt: skip
    """The agents of a line of cells, cell by cell."""
    plan, flock = flight.plan, flight.flock
    line = make_line(oy, oz, flight, work, cells, ident)
    # Cells along the line share the slabs that were copied once: the candidates of a cell begin at
    # its left slab and end with its right one.
    for ox in range(cells.count[X]):
        here = (oz * cells.count[Y] + oy) * cells.count[X] + ox
        if cells.starts[here] == cells.starts[here + 1]:
            continue
        first = np.uint64(line.slab[ox])
        many = integer(line.slab[ox + 3] - line.slab[ox])
        # Whole blocks of candidates; what lies behind the last one is dropped by `end`.
        padded = -(-(line.slab[ox + 3] - line.slab[ox]) // BLOCK) * BLOCK
        for e in range(cells.starts[here], cells.starts[here + 1]):
            if plan.law is None or flock.own("", "law")[cells.whose[e]] == plan.law:
                sum_agent(
                    e, line, first, many, padded, ox, here, reach, at, flight, cells, ident, sums_of, sums=sums
                )  # fmt: skip


def neighbours_by_cells(
    flight: FlightView, n: int, decision: int, time: float, late: float, work: Any, starts: Any, whose: Any,
    packed: Any, flat: Any, ident: Any, totals_: Any, sort: Callable[..., Any], widest: Callable[[], Any],
    *, sums: Sums,
) -> None:  # fmt: skip
    """Sum the neighbour rule over those in the cells around each agent.

    starts, whose, packed, flat : what `sort` fills (`records.SortedCells`)
    ident, totals_ : memory for the number of the agent at each place, and for sums by agent, in one
                     row
    sort           : the stage of this name, for cells no smaller than `near`, about `most_cells`
    widest         : how far the agents see at most where that differs among them, m
    """
    plan, model, flock, numbers = flight.plan, flight.model, flight.flock, flight.numbers
    range_ = least(numbers.k.range, LIMIT)
    range2 = range_ * range_ + TINY if plan.bits == 64 else range_ * range_
    if not plan.varies("p"):
        near = least(call_rule(model.reach, p=numbers.p), LIMIT)
        near2 = near * near + TINY if plan.bits == 64 else near * near
    # Each law sorts cells of its own. One sort for all, as wide as the widest reach, would let each
    # fish look at 27 times as many candidates where one in a hundred looks three times as far.
    sides, count = call_rule(sort, near=widest() if plan.varies("p") else near, most_cells=MAX_CELLS_PER_AGENT * n)
    cells = SortedCells(starts, whose, packed, flat, count)
    sums_of = totals_[: n * max(1, len(sums))].reshape(n, max(1, len(sums)))
    if rule_asks(model.neighbour, "lower"):
        for chunk in parallel(CHUNKS):
            for e in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS):
                ident[e] = flock.number[cells.whose[e]]
    reach = SquaredRanges(range2, range2, LIMIT if plan.varies("p") else near2)
    at = Decision(decision, n, time, late, ZERO, ZERO, None)
    # Threads share lines of cells, and each line writes only the sums of its own agents: no thread
    # waits for another.
    for line in parallel(count[Y] * count[Z]):
        oy, oz = line_position(line, count)
        if plan.law is None:
            sum_line(oy, oz, reach, at, flight, work, cells, ident, sums_of, sums=sums)
        else:
            # A line without an agent of this law is not copied at all.
            begin = (oz * count[Y] + oy) * count[X]
            some = False
            for e in range(cells.starts[begin], cells.starts[begin + count[X]]):
                some |= flock.own("", "law")[cells.whose[e]] == plan.law
            if some:
                sum_line(oy, oz, reach, at, flight, work, cells, ident, sums_of, sums=sums)
    for chunk in parallel(CHUNKS):
        for i in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS):
            if plan.law is None or flock.own("", "law")[i] == plan.law:
                copy_sums(i, flock, sums_of, sums=sums)


def copy_sums(i: int, flock: FlockRows, sums_of: Any, *, sums: Sums) -> None:
    """Sums of agent i to its rows."""
    # Sums are written to the agent's slot by its own loop: fetching them afterwards was random
    # access over megabytes.
    for k, (c, _) in enumerate(sums):
        flock.sums[c][i] = sums_of[i, k]
