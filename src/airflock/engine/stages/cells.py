"""Cells: agents sorted into cells, by counting, and all that lies around a line of cells copied side by side.

A line is a row of cells along x; of the agents around it those with one x are a slab. Candidates
come in the order of slabs and within a cell by place, whatever the number of threads: the agents
are counted in a fixed number of parts.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from airflock.engine.plan import Plan
from airflock.engine.stages.records import FlightView, SortedCells
from airflock.engine.stages.state import FlockRows
from airflock.engine.stages.words import *

# A dispersed flock must not fill the memory with empty cells: at most four cells per agent, then
# cells grow.
MAX_CELLS_PER_AGENT = 4  # at most so many cells per agent: a flock that has dispersed widely does not fill the memory
SPARE = 8  # cells of the smallest periodic box
# Counted in eight chunks whose order is that of the agents, so that the number of threads changes
# no bit.
CHUNKS = 8  # parts of the flock that are counted side by side; their order is that of the agents
# The order of lines decides what stays in the second-level cache; results do not depend on it.
STRIP = 16  # lines side by side before those above them: three layers of so many stay in the second-level cache
WHO, GROUP = "who", "group_of"  # what else of candidates is laid side by side: their numbers, their groups


def cell_box(n: int, near: Any, most_cells: int, flock: FlockRows, numbers: Any, work: Any, *, plan: Plan) -> Any:
    """Lower corner (m), cell size (m) and number of cells per axis: of the periodic box, or around the flock.

    Cells are no smaller than `near` (m), and about `most_cells` at most; never more than there is
    memory for.
    """
    w, x = numbers.w, flock.position
    low = np.zeros(3, work.dtype)
    size = np.ones(3, work.dtype)
    count = np.ones(3, np.int64)
    width = np.ones(3, work.dtype)
    volume = ONE
    for a in range(plan.dimensions):
        if plan.periodic:
            low[a] = -getattr(w, HALF_SIZES[a])
            width[a] = getattr(w, HALF_SIZES[a]) + getattr(w, HALF_SIZES[a])
        else:
            lowest = FAR
            highest = REDUCTION_START["max"]
            for i in range(n):
                lowest = least(lowest, x[a][i])
                highest = most(highest, x[a][i])
            low[a] = lowest
            width[a] = most(highest - lowest, near)
        volume *= most(width[a] / near, ONE)
    # The first guess spreads the intended number of cells over the volume, never below the width
    # that the search needs.
    side = near * most(ONE, (volume / real(most_cells)) ** (1.0 / plan.dimensions))
    fewest = 2 if plan.periodic else 1  # an agent is met at two images of which at most one is in reach
    # Cells grow by a quarter until there are few enough; the loop has a bound because a driver
    # cannot raise an error.
    for _ in repeat(1000):
        for a in range(plan.dimensions):
            count[a] = max(fewest, int(width[a] / side))
        # a flock that has dispersed along a line or in a plane still has too many
        if count[X] * count[Y] * count[Z] <= MAX_CELLS_PER_AGENT * n + SPARE:
            break
        side *= 1.25
    for a in range(plan.dimensions):
        size[a] = width[a] / real(count[a])
    return low, size, count


def cell_along(a: int, i: int, flock: FlockRows, first: Any, per: Any, last: Any) -> Any:
    """Number of the cell of agent i along one axis."""
    return min(max(int((flock.position[a][i] - first[a]) * per[a]), 0), last[a])


def sort_by_cells(
    n: int, flock: FlockRows, starts: Any, tally: Any, cell_of: Any, packed: Any, flat: Any, whose: Any,
    boxed: Callable[[], Any], *, plan: Plan,
) -> Any:  # fmt: skip
    """Sort agents by cell; returns cell size (m) and number of cells per axis.

    Each chunk of agents counts for itself; the counts of a cell, chunk by chunk, become the places
    of its agents.

    starts, tally   : first place of each cell; agents by chunk and cell, in one row
    cell_of, whose  : cell of each agent, agent at each place
    packed, flat    : states by place and component, and by component and place
    boxed           : the stage `cell_box`
    """
    axes = range(plan.dimensions)
    states = [*[flock.position[a] for a in axes], *[flock.velocity[a] for a in axes]]
    low, size, count = boxed()
    total = count[X] * count[Y] * count[Z]
    # A counting sort. Ranks from atomic counters would make the order within a cell, hence the last
    # bits of every sum, differ from run to run.
    for chunk in parallel(CHUNKS):
        head = chunk * total
        for cell in range(total):
            tally[head + cell] = 0
        first, per, last = vector(), vector(), vector()
        for a in axes:
            per[a] = ONE / size[a]
            first[a] = low[a]
            last[a] = count[a] - 1
        for i in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS):
            cell = (
                cell_along(Z, i, flock, first, per, last) * count[Y] + cell_along(Y, i, flock, first, per, last)
                if plan.dimensions == 3
                else cell_along(Y, i, flock, first, per, last)
            ) * count[X] + cell_along(X, i, flock, first, per, last)
            cell_of[i] = cell
            tally[head + cell] += 1
    # Counts become first places: cell by cell and, within a cell, chunk by chunk. One thread, as
    # each sum follows the last.
    before = 0
    for cell in range(total):
        starts[cell] = before
        for share in repeat(CHUNKS):
            held = tally[share * total + cell]
            tally[share * total + cell] = before
            before += held
    starts[total] = before
    for chunk in parallel(CHUNKS):
        head = chunk * total
        for i in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS):
            place = tally[head + cell_of[i]]
            tally[head + cell_of[i]] = place + 1
            whose[place] = i
            # By place and component first, since sorted access is random: one cache line per agent
            # instead of eleven.
            for c, row in enumerate(states):
                packed[place, c] = row[i]
    # Now by component and place, which is what vector loops read; both sides of this copy run in
    # order.
    for chunk in parallel(CHUNKS):
        for e in range(n * chunk // CHUNKS, n * (chunk + 1) // CHUNKS):
            for c in range(2 * plan.dimensions):
                flat[c, e] = packed[e, c]
    return size, count


def line_position(line: int, count: Any) -> Any:
    """Return the position of a line of cells along y and z; lines come strip by strip."""
    wide = STRIP * count[Z]
    strip = line // wide
    high = min(STRIP, count[Y] - strip * STRIP)
    oz = (line - strip * wide) // high
    oy = strip * STRIP + (line - strip * wide) % high
    return oy, oz


def cells_beside(o: Any, count: Any, *, plan: Plan) -> Any:
    """The cell o along an axis and those beside it; of a periodic box also beyond its ends."""
    return range(o - 1, o + 2) if plan.periodic else range(max(o - 1, 0), min(o + 2, count))


def wrap_cell(q: Any, count: Any, *, plan: Plan) -> Any:
    """Number of a cell along an axis, of a periodic box that goes on at its other end."""
    return (q + count) % count if plan.periodic else q


def first_cell_of_row(cy: Any, cz: Any, count: Any, *, plan: Plan) -> Any:
    """Number of the first cell of a row along x."""
    return (cz * count[Y] + cy if plan.dimensions == 3 else cy) * count[X]


def agents_around(oy: int, oz: int, starts: Any, count: Any, *, plan: Plan) -> Any:
    """Count the agents in and around a line of cells."""
    room = 0
    for qz in cells_beside(oz, count[Z], plan=plan) if plan.dimensions == 3 else (0,):
        cz = wrap_cell(qz, count[Z], plan=plan)
        for qy in cells_beside(oy, count[Y], plan=plan):
            cy = wrap_cell(qy, count[Y], plan=plan)
            base = first_cell_of_row(cy, cz, count, plan=plan)
            room += starts[base + count[X]] - starts[base]
            if plan.periodic:  # its ends are met beyond its other ends, too
                room += starts[base + 1] - starts[base] + starts[base + count[X]] - starts[base + count[X] - 1]
    return room


def image_shift(q: Any, c: Any, count: Any, width: Any) -> Any:
    """Return the shift (m) along an axis of the image q of cell c, in a periodic box of this width (m)."""
    # Agents are copied at the image where they are met, so that the pair loop knows no periodic
    # box.
    return real((q - c) // count) * width


def copy_cell(
    origin: int, inside: int, found: int, shift: Any, cells: SortedCells, ident: Any, box: Any, flight: FlightView,
    *, carried: tuple[tuple[str, Any], ...],
) -> None:  # fmt: skip
    """Copy the agents at places from `origin` on to `cell_box`, behind those found so far, shifted to their image."""
    # Copied in vectors of eight past the end of the cell, where the next cell overwrites them:
    # copying one number at a time took 40 % of an agent-step (203 ns, 159 ns with vectors).
    for s in range(0, inside, BLOCK):  # past the end of a cell, where the next ones overwrite it
        for a in range(flight.plan.dimensions):
            copy_block(box, a, found + s, cells.flat, origin + s, shift[a])
        for a in range(flight.plan.dimensions):
            copy_block(box, a + flight.plan.dimensions, found + s, cells.flat, origin + s, ZERO)
    if carried:
        for s in range(inside):
            for what, row in carried:
                row[found + s] = (
                    ident[origin + s] if what == WHO else flight.flock.own("", "group")[cells.whose[origin + s]]
                )


def copy_line(
    oy: int, oz: int, cells: SortedCells, ident: Any, box: Any, flight: FlightView,
    *, carried: tuple[tuple[str, Any], ...],
) -> Any:  # fmt: skip
    """Copy the agents in and around a line of cells to `cell_box`, slab by slab, at the images that they are met at.

    Returns where each slab begins, where in it the own cell begins, and how many were copied.

    ident   : number of the agent at each place
    carried : what else is copied (WHO, GROUP), and to which rows
    """
    plan, w = flight.plan, flight.numbers.w
    slab = np.zeros(cells.count[X] + 3, np.int64)
    middle = np.zeros(cells.count[X] + 1, np.int64)
    found = 0
    shift = vector()
    if plan.periodic:
        width_x = w.half_x + w.half_x
    # Slab by slab around a whole line of cells: each agent is copied nine times, not 27 as around
    # each cell, and the candidates of a cell are three slabs in a row. 534 -> 231 ns per agent-step
    # at 100,000 boids.
    for qx in range(-1, cells.count[X] + 1) if plan.periodic else range(0, cells.count[X]):
        slab[qx + 1] = found
        cx = wrap_cell(qx, cells.count[X], plan=plan)
        if plan.periodic:
            shift[X] = image_shift(qx, cx, cells.count[X], width_x)
        for qz in cells_beside(oz, cells.count[Z], plan=plan) if plan.dimensions == 3 else (0,):
            cz = wrap_cell(qz, cells.count[Z], plan=plan)
            if plan.periodic and plan.dimensions == 3:
                shift[Z] = image_shift(qz, cz, cells.count[Z], w.half_z + w.half_z)
            for qy in cells_beside(oy, cells.count[Y], plan=plan):
                cy = wrap_cell(qy, cells.count[Y], plan=plan)
                if plan.periodic:
                    shift[Y] = image_shift(qy, cy, cells.count[Y], w.half_y + w.half_y)
                base = first_cell_of_row(cy, cz, cells.count, plan=plan)
                if (qy == oy) & (qz == oz) if plan.dimensions == 3 else qy == oy:
                    middle[min(max(qx, 0), cells.count[X])] = found
                origin = cells.starts[base + cx]
                inside = cells.starts[base + cx + 1] - origin
                copy_cell(origin, inside, found, shift, cells, ident, box, flight, carried=carried)
                found += inside
    slab[cells.count[X] + 2 if plan.periodic else cells.count[X] + 1] = found
    if not plan.periodic:
        slab[cells.count[X] + 2] = found
    return slab, middle, found


def pad_candidates(found: int, h: Any, hv: Any, *, plan: Plan, carried: tuple[tuple[str, Any], ...]) -> None:
    """Nobody, behind the last candidate: loops take them in whole blocks. h, hv : rows of positions and velocities."""
    # Vector loops run past the last candidate; those lanes must lie beyond every reach, not at the
    # origin.
    for s in range(found, found + BLOCK):
        for a in range(plan.dimensions):
            h[a][s] = AWAY
            hv[a][s] = ZERO
        for what, row in carried:
            row[s] = integer(-1) if what == WHO else ZERO
