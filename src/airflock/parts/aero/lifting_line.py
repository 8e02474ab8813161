"""Lifting line of a flock: n equal wings, each carrying its weight, in each other's wash.

On every segment circulation = stiffness · (alpha - downwash / speed), and on every wing the
circulations add up to what carries the weight, which fixes alpha: the zero-lift angle cancels and
the whole system is linear. A wing's own block is the same for all and is eliminated once:
circulation = alone - response · (wash of the others). What is left couples wings that are apart,
and is settled wing by wing, front to back; where wings lie on top of each other and that does not
settle, by one dense factorisation. There is no case without an answer.

Dimock & Selig 2003, Eqs 5-7; theory after Katz and Plotkin, Low-Speed Aerodynamics, chapter 8.
"""

from typing import NamedTuple

from airflock.core import FAR
from airflock.parts.aero.elimination import factorise, invert_definite, substitute
from airflock.parts.aero.filaments import add_product, add_wash, influences
from airflock.parts.aero.wing import apart, circulation_sum, lanes, pitch, segments_of, shift, stiffness

SWEEPS = 60  # over all wings, before the dense system is factorised; flocks without overlap need three to eight


class Work(NamedTuple):
    """Scratch of one flock of n wings with m segments, kept from one call to the next.

    Columns of sources are filled up with zeros to w = lanes(m).

    place       : (3, n) where the aerodynamics sees the wings, m
    alone       : (3, w) circulation without wash; its share per sum of 1; [2][0] is 1 once all this
                  is prepared,
                  [2][1] the sum of a wing's response to one radian
    response    : (w, m) change of circulation per wash, m
    square      : (m, 2 m) for the self block and its inverse
    tables      : (n n, m + w) influence of wing j on wing i in row i n + j, 1/m
    circulation : (n, w) m²/s; wash : (n, w) downwash of all other wings, m/s
    spare       : (1, m) any product
    kept, trial : (2 n + 1, m + w) and (n, w) while one wing is moved to see what its drag would be
    slopes      : (3 n n, m + w) derivatives of the tables; mirror : (n n, m + w) the tables
                  backwards
    adjoint     : (n, w) sensitivity of one wing's drag to all washes; source : (n, w) its own part
    dense       : (n m, n m) factors; pivots, column : (1, n m); touched only where sweeps do not
                  settle
    WITHIN      : what is written before it is read in each call; the rest is carried from call to
                  call
    """

    WITHIN = ("dense", "pivots", "column")  # type: ignore[misc]

    place: object
    alone: object
    response: object
    square: object
    tables: object
    circulation: object
    wash: object
    spare: object
    kept: object
    trial: object
    slopes: object
    mirror: object
    adjoint: object
    source: object
    dense: object
    pivots: object
    column: object


def shapes(n, m, gradient):
    """Shapes (rows, columns) of the scratch; gradient: "none" or a way of `gradients`."""
    w = lanes(m)
    cells = gradient in ("cells", "cells_frozen")
    slope = gradient in ("analytic", "frozen")
    return Work(
        place=(3, n), alone=(3, w), response=(w, m), square=(m, 2 * m), tables=(n * n, m + w), circulation=(n, w),
        wash=(n, w), spare=(1, m), kept=(2 * n + 1 if cells else 1, m + w), trial=(n, w),
        slopes=(3 * n * n if slope else 1, m + w), mirror=(n * n if slope else 1, m + w),
        adjoint=(n if slope else 1, w), source=(n if slope else 1, w),
        dense=(n * m, n * m), pivots=(1, n * m), column=(1, n * m),
    )  # fmt: skip


def prepare(work, wing):
    """Eliminate a wing's own block: fill `alone` and `response`, once per flight."""
    m = segments_of(wing)
    square = work.square
    alone = work.alone
    response = work.response
    kept = work.kept
    first = shift(m)
    influences(kept, 0, 0.0, 0.0, 0.0, m, pitch(wing), 0.0)
    for i in range(m):
        for j in range(m):
            square[i][j] = kept[0][i - j + first] / wing.speed
        square[i][i] = square[i][i] + 1.0 / stiffness(wing)
    invert_definite(square, m)
    total = 0.0
    for i in range(m):
        s = 0.0
        for j in range(m):
            s = s + square[i][m + j]
        alone[1][i] = s
        total = total + s
    for i in range(m):
        alone[1][i] = alone[1][i] / total
        alone[0][i] = alone[1][i] * circulation_sum(wing)
    for i in range(m):
        for j in range(m):
            response[i][j] = (square[i][m + j] - total * alone[1][i] * alone[1][j]) / wing.speed
    alone[2][0] = 1.0
    alone[2][1] = total


def begin(n, work, wing):
    """Prepare on the first call of a flight: every wing carries its weight as if alone."""
    if work.alone[2][0] < 0.5:
        prepare(work, wing)
        circulation = work.circulation
        alone = work.alone
        for i in range(n):
            for k in range(segments_of(wing)):
                circulation[i][k] = alone[0][k]


def meet(n, i, work, wing):
    """Influence of every other wing on wing i."""
    place = work.place
    core = wing.core * wing.span
    for j in range(n):
        if j != i:
            influences(
                work.tables, i * n + j, apart(place[0][i], place[0][j], wing), apart(place[1][i], place[1][j], wing),
                apart(place[2][i], place[2][j], wing), segments_of(wing), pitch(wing), core * core,
            )  # fmt: skip


def wash_on(i, n, m, tables, circulation, wash):
    """Downwash of all other wings on wing i, m/s, from their circulations."""
    for k in range(m):
        wash[i][k] = 0.0
    for j in range(n):
        if j != i:
            add_wash(wash, i, tables, i * n + j, circulation, j, m)


def carry(i, m, work, circulation):
    """Circulation of wing i in its wash, with lift equal to weight; returns the largest change, m²/s."""
    spare = work.spare
    alone = work.alone
    for k in range(m):
        spare[0][k] = 0.0
    add_product(spare, 0, work.response, work.wash, i, m)
    change = 0.0
    for k in range(m):
        fresh = alone[0][k] - spare[0][k]
        change = max(change, abs(fresh - circulation[i][k]))
        circulation[i][k] = fresh
    return change


def settle(n, work, circulation, wing):
    """Circulations (n, m) and washes of all wings for the influences in work.tables; starts from what is there."""
    m = segments_of(wing)
    limit = wing.tolerance * circulation_sum(wing)
    change = FAR
    # Three to eight sweeps settle a formation, each with m² multiplications for a pair; for five
    # wings of 20 segments that is 60,000 instead of 330,000 by elimination.
    for _ in range(SWEEPS):
        change = 0.0
        for i in range(n):
            wash_on(i, n, m, work.tables, circulation, work.wash)
            change = max(change, carry(i, m, work, circulation))
        if change <= limit:
            break
    # Wings that nearly overlap do not converge. One dense factorisation then answers, so that no
    # penalty value has to stand for a fitness.
    if change > 1000.0 * limit:
        assemble(n, m, work)
        factorise(work.dense, work.pivots, n * m)
        spread(n, m, work, circulation)


def assemble(n, m, work):
    """Dense matrix of all circulations: the unit matrix, and response times influence between two wings."""
    dense = work.dense
    response = work.response
    tables = work.tables
    last = shift(m)
    for i in range(n):
        for j in range(n):
            for k in range(m):
                for e in range(m):
                    s = 0.0
                    if i != j:
                        for first in range(m):
                            s = s + response[k][first] * tables[i * n + j][first - e + last]
                    elif k == e:
                        s = 1.0
                    dense[i * m + k][j * m + e] = s


def spread(n, m, work, circulation):
    """Solve the factorised system for circulations, and their washes."""
    column = work.column
    alone = work.alone
    for i in range(n):
        for k in range(m):
            column[0][i * m + k] = alone[0][k]
    substitute(work.dense, work.pivots, column, 0, n * m)
    for i in range(n):
        for k in range(m):
            circulation[i][k] = column[0][i * m + k]
    for i in range(n):
        wash_on(i, n, m, work.tables, circulation, work.wash)


def angle_of_attack(i, work, wing):
    """Angle of attack of wing i from its zero-lift line at which lift is weight, rad."""
    m = segments_of(wing)
    s = 0.0
    for k in range(m):
        s = s + work.alone[1][k] * work.wash[i][k]
    return circulation_sum(wing) / work.alone[2][1] + s / wing.speed


def induced_drag(i, work, circulation, wing):
    """Induced drag of wing i, N (Eq. 7): circulation times downwash, which is speed · (alpha - circulation / k)."""
    m = segments_of(wing)
    angle = angle_of_attack(i, work, wing)
    s = 0.0
    for k in range(m):
        s = s + circulation[i][k] * (angle - circulation[i][k] / stiffness(wing))
    return wing.density * wing.speed * pitch(wing) * s


def solo_drag(work, wing):
    """Induced drag of a lone wing of the same discretisation, N."""
    m = segments_of(wing)
    angle = circulation_sum(wing) / work.alone[2][1]
    s = 0.0
    for k in range(m):
        s = s + work.alone[0][k] * (angle - work.alone[0][k] / stiffness(wing))
    return wing.density * wing.speed * pitch(wing) * s


def solve(n, work, wing):
    """Circulations and washes of n wings at work.place, m."""
    begin(n, work, wing)
    for i in range(n):
        meet(n, i, work, wing)
    settle(n, work, work.circulation, wing)
