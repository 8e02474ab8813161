"""Pairs by cells: the pair rules of order parameters over those around an agent, until nobody else could change them.

An agent looks at its own cell and the ring of cells around that, at the next ring, and so on. What
is found is that of all pairs but for the order of sums. Parts of the flock are looked at side by
side.
"""

import math
from typing import Any

import numpy as np

from airflock.engine.plan import Plan
from airflock.engine.stages.measure import MeasuredMetric, field_names, reductions
from airflock.engine.stages.records import FlightView, HomeCell, SortedCells
from airflock.engine.stages.words import *
from airflock.world import nearest_image

# Rounding may put an agent into the cell beside its own, so a ring is trusted only up to 0.999 of
# its width.
ROUNDING_MARGIN = (
    0.999  # of what rings are wide: the cell of an agent at its cell's edge may be that beside it, by rounding
)
# A fixed number of parts, not the number of threads: the order of sums must not depend on the
# machine.
PARTS = 64  # of the flock, whatever the number of threads


def cell_position(at: Any, cell: Any, count: Any) -> None:
    """Put the place of a cell along each axis into the vector `at`."""
    at[X] = cell % count[X]
    at[Y] = cell // count[X] % count[Y]
    at[Z] = cell // (count[X] * count[Y])


def wrap_cell(c: Any, count: Any, *, plan: Plan) -> Any:
    """Number of a cell along an axis, where a periodic box goes on at its other end."""
    return c + (count if c < 0 else 0) - (count if c >= count else 0) if plan.periodic else c


def apart(d: Any, own: Any, flat: Any, f: int, flight: FlightView) -> Any:
    """Put the offset from a place to the agent at place f into the vector d, m; returns its square, m²."""
    plan, w = flight.plan, flight.numbers.w
    # Reads sorted rows by component and place, so that a run of places is read in order.
    for a in range(plan.dimensions):
        d[a] = flat[a, f] - own[a]
    if plan.periodic:
        for a in range(plan.dimensions):
            d[a] = nearest_image(d[a], getattr(w, HALF_SIZES[a]))
    return sum(d[a] * d[a] for a in range(plan.dimensions)) + TINY


def sum_run(
    first: Any, last: Any, e: int, ii: Any, near2: Any, own: Any, sums: Any, flight: FlightView, cells: SortedCells,
    *, paired: list[MeasuredMetric], nearest: bool,
) -> Any:  # fmt: skip
    """Add all pairs with those at places first to last - 1 to the sums of the agent at place e; its least square."""
    # A run of places that lie side by side: the inner loop of this search, written like that over
    # all pairs.
    for f in range(first, last):
        d = vector()
        r2 = apart(d, own, cells.flat, f, flight)
        r = math.sqrt(r2)
        ok = f != e
        for metric, _, _, start in paired:
            t = call_rule(
                metric.pair, **components("d", d), r=r, r2=r2, q=flight.numbers.q,
                lower=(ONE if integer(flight.flock.number[cells.whose[f]]) < ii else ZERO),
            )  # fmt: skip
            for c, way in enumerate(reductions(metric.Pair, metric)):
                sums[start + c] = reduce_term(way, sums[start + c], choose(ok, t[c], REDUCTION_START[way]))
        if nearest:
            near2 = least(near2, choose(ok, r2, FAR))
    return near2


def in_ring(
    ring: int, home: HomeCell, e: int, ii: Any, near2: Any, own: Any, sums: Any, flight: FlightView, cells: SortedCells,
    *, paired: list[MeasuredMetric], nearest: bool,
) -> Any:  # fmt: skip
    """Add the pairs with all agents in one ring of cells around the own cell; the first ring includes its inside.

    Cells side by side along x are one run of places; a run that goes over the ends of a periodic
    box is cut there.
    """
    plan, at, low, high, count, starts = flight.plan, home.at, home.low, home.high, cells.count, cells.starts
    # The ring is a shell of cells: full rows on its top, bottom and sides, and of the rows through
    # its middle the two ends. The first ring also takes the cell itself and those beside it.
    for oz in range(max(-ring, low[Z]), min(ring, high[Z]) + 1):
        for oy in range(max(-ring, low[Y]), min(ring, high[Y]) + 1):
            row = wrap_cell(at[Z] + oz, count[Z], plan=plan) * count[Y] + wrap_cell(at[Y] + oy, count[Y], plan=plan)
            full = (ring == 1) | (abs(oz) == ring) | (abs(oy) == ring)
            for end in range(1 if full else 2):  # of a row that passes through the ring its two ends
                west = at[X] + max(-ring if end == 0 else ring, low[X])
                east = at[X] + min(ring if full or end == 1 else -ring, high[X])
                # Cells along x lie side by side in memory, so nine runs replace 27 cells in space;
                # a run over the end of a periodic box is cut there.
                for turn in range(
                    -1 if plan.periodic and west < 0 else 0, 2 if plan.periodic and east >= count[X] else 1
                ):
                    begin = max(west - turn * count[X], 0)
                    stop = min(east - turn * count[X], count[X] - 1) + 1
                    if begin < stop:
                        near2 = sum_run(
                            starts[row * count[X] + begin], starts[row * count[X] + stop], e, ii, near2, own, sums,
                            flight, cells, paired=paired, nearest=nearest,
                        )  # fmt: skip
    return near2


def unsettled(beyond: Any, near2: Any, sums: Any, numbers: Any, *, paired: list[MeasuredMetric], nearest: bool) -> Any:
    """Return 1 if an agent farther than `beyond` (m) could still change the sums, else 0."""
    open_ = 0
    # All metrics of the clock share one search, so the slowest of them decides how far it goes.
    for metric, _, _, first in paired:
        pair = metric.Pair(*[sums[first + c] for c in field_indices(metric.Pair)])  # type: ignore[misc]
        if not call_rule(metric.settled, pair=pair, beyond=beyond, q=numbers.q):
            open_ = 1
    if nearest:  # noqa: SIM102 - the outer one is of the plan
        if near2 > beyond * beyond:
            open_ = 1
    return open_


def sum_pairs_of_place(
    e: int, home: HomeCell, flight: FlightView, cells: SortedCells, side: Any, rings: int,
    *, paired: list[MeasuredMetric], nearest: bool,
) -> Any:  # fmt: skip
    """Sum the pair rules for the agent at place e, ring by ring; returns the square of its least distance, m²."""
    i = cells.whose[e]
    ii = integer(flight.flock.number[i])
    own, sums = vector(), totals()
    for a in range(flight.plan.dimensions):
        own[a] = cells.flat[a, e]
    for metric, _, _, first in paired:
        for c, way in enumerate(reductions(metric.Pair, metric)):
            sums[first + c] = REDUCTION_START[way]
    near2 = FAR
    ring = 1
    going = 1
    # Rings grow until each metric's `settled` holds: a nearest neighbour is known after one ring in
    # a dense flock. A rule that says so too early gives wrong numbers, as a wrong `within` does.
    while going == 1:
        near2 = in_ring(ring, home, e, ii, near2, own, sums, flight, cells, paired=paired, nearest=nearest)
        beyond = real(ROUNDING_MARGIN) * real(ring) * side
        open_ = unsettled(beyond, near2, sums, flight.numbers, paired=paired, nearest=nearest)
        going = open_ if ring < rings else 0
        ring += 1
    for metric, _, _, first in paired:
        for c, name in enumerate(field_names(metric.Pair)):
            flight.flock.pair(metric.name, name)[i] = sums[first + c]
    return near2


def pairs_by_cells(
    flight: FlightView, cells: SortedCells, sides: Any, *, metrics: tuple[MeasuredMetric, ...], nearest: bool
) -> Any:
    """Sum the pair rules by cells, as `sum_pairs` does, for metrics that say when their pairs are `settled`.

    sides : size of a cell along each axis, m
    """
    plan, paired = flight.plan, [one for one in metrics if one.metric.pair is not None]
    count, starts = cells.count, cells.starts
    total = count[X] * count[Y] * count[Z]
    side = sides[X]
    rings = count[X]
    for a in range(1, plan.dimensions):
        side = least(side, sides[a])
        rings = max(rings, count[a])
    nearest2 = np.empty(PARTS, np.float64)
    for part in parallel(PARTS):
        part2 = FAR
        at, low, high = vector(), vector(), vector()
        home = HomeCell(at, low, high)
        # A part is a run of cells, empty ones among them: parts of a dispersed flock differ in
        # work, hence more parts than threads.
        for here in range(total * part // PARTS, total * (part + 1) // PARTS):
            if starts[here] < starts[here + 1]:
                cell_position(at, here, count)
                # In a periodic box half of the cells lie on either side, so that nobody is met at
                # two images.
                for a in (X, Y, Z):  # a periodic box has no ends: half of its cells lie on either side
                    low[a] = -((count[a] - 1) // 2) if plan.periodic else -at[a]
                    high[a] = count[a] // 2 if plan.periodic else count[a] - 1 - at[a]
                for e in range(starts[here], starts[here + 1]):
                    near2 = sum_pairs_of_place(e, home, flight, cells, side, rings, paired=paired, nearest=nearest)
                    if nearest:
                        part2 = least(part2, near2)
        nearest2[part] = part2
    least2 = FAR
    if nearest:
        # The least of the parts is taken by one thread, in their order.
        for c in repeat(PARTS):
            least2 = least(least2, real(nearest2[c]))
    return least2
