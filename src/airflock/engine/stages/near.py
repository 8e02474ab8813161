"""Pairs by cells: the pair rules of order parameters over those around an agent, until nobody else could change them.

An agent looks at its own cell, at the ring of cells around that, at the next ring, and so on. What is found is that of
all pairs but for the order of sums.
"""

import math
from typing import Any

from airflock.engine.plan import Plan
from airflock.engine.stages.measure import Measured, names_of, ways
from airflock.engine.stages.state import Flock
from airflock.engine.stages.words import (
    FAR,
    ONE,
    SIDES,
    START,
    TINY,
    ZERO,
    X,
    Y,
    Z,
    ask,
    choose,
    fields,
    integer,
    least,
    real,
    reduced,
    totals,
    vector,
)  # fmt: skip
from airflock.world.edges import nearest_image

SURE = 0.999  # of what rings are wide: the cell of an agent at its cell's edge may be that beside it, by rounding


def pairs_by_cells(  # noqa: C901 - tests of the plan leave one way through
    flock: Flock, numbers: Any, n: int, starts: Any, whose: Any, cell_of: Any, flat: Any, sides: Any, count: Any,
    *, plan: Plan, metrics: tuple[Measured, ...], nearest: bool,
) -> Any:  # fmt: skip
    """What `pairs` finds, for metrics that say when their pairs are `settled`.

    starts, whose, cell_of, flat : first place of each cell, who is at each place, the cell of each, and their states
    sides, count                 : size of a cell (m), and number of cells, along each axis
    """
    axes, x = range(plan.dimensions), flock.position
    paired = [one for one in metrics if one.metric.pair is not None]
    least2 = FAR
    side = sides[X]
    rings = count[X]
    for a in axes:
        side = least(side, sides[a])
        rings = max(rings, count[a])
    for e in range(n):
        i = whose[e]
        ii = integer(flock.number[i])
        own, sums = vector(), totals()
        for a in axes:
            own[a] = x[a][i]
        for metric, _, _, first in paired:
            for c, way in enumerate(ways(metric.Pair, metric)):
                sums[first + c] = START[way]
        near2 = FAR
        at_x = cell_of[i] % count[X]
        at_y = cell_of[i] // count[X] % count[Y]
        at_z = cell_of[i] // (count[X] * count[Y])
        # a periodic box has no ends: half of its cells lie on either side
        west = -((count[X] - 1) // 2) if plan.periodic else -at_x
        east = count[X] // 2 if plan.periodic else count[X] - 1 - at_x
        south = -((count[Y] - 1) // 2) if plan.periodic else -at_y
        north = count[Y] // 2 if plan.periodic else count[Y] - 1 - at_y
        down = -((count[Z] - 1) // 2) if plan.periodic else -at_z
        up = count[Z] // 2 if plan.periodic else count[Z] - 1 - at_z
        ring = 0
        going = 1
        while going == 1:
            for oz in range(max(-ring, down), min(ring, up) + 1):
                for oy in range(max(-ring, south), min(ring, north) + 1):
                    outer = (abs(oz) == ring) | (abs(oy) == ring)
                    for ox in range(-ring, ring + 1, 1 if outer else 2 * ring):
                        if (ox >= west) & (ox <= east):
                            row = (at_z + oz) % count[Z] * count[Y] + (at_y + oy) % count[Y]
                            here = row * count[X] + (at_x + ox) % count[X]
                            for f in range(starts[here], starts[here + 1]):
                                d = vector()
                                for a in axes:
                                    d[a] = flat[a, f] - own[a]
                                if plan.periodic:
                                    for a in axes:
                                        d[a] = nearest_image(d[a], getattr(numbers.w, SIDES[a]))
                                r2 = sum(d[a] * d[a] for a in axes) + TINY
                                r = math.sqrt(r2)
                                ok = f != e
                                for metric, _, _, first in paired:
                                    t = ask(
                                        metric.pair, dx=d[X], dy=d[Y], dz=d[Z], r=r, r2=r2, q=numbers.q,
                                        lower=(ONE if integer(flock.number[whose[f]]) < ii else ZERO),
                                    )  # fmt: skip
                                    for c, way in enumerate(ways(metric.Pair, metric)):
                                        sums[first + c] = reduced(way, sums[first + c], choose(ok, t[c], START[way]))
                                if nearest:
                                    near2 = least(near2, choose(ok, r2, FAR))
            beyond = real(SURE) * real(ring) * side
            going = 0 if ring >= rings else 1
            open_ = 0
            for metric, _, _, first in paired:
                pair = metric.Pair(*[sums[first + c] for c in fields(metric.Pair)])  # type: ignore[misc]
                if not ask(metric.settled, pair=pair, beyond=beyond, q=numbers.q):
                    open_ = 1
            if nearest:  # noqa: SIM102 - the outer one is of the plan
                if near2 > beyond * beyond:
                    open_ = 1
            going = going * open_
            ring += 1
        for metric, _, _, first in paired:
            for c, name in enumerate(names_of(metric.Pair)):
                flock.pair(metric.name, name)[i] = sums[first + c]
        if nearest:
            least2 = least(least2, near2)
    return least2
