"""Gradient of each wing's own induced drag with its own position, in four ways.

cells         : central difference over one cell of the grid, all circulations solved again (Dimock
                & Selig 2003, Eq. 8)
cells_frozen  : the same with the circulations of all other wings held
analytic      : derivative of the linear system by its adjoint, all wings respond
frozen        : derivative with the circulations of all other wings held

A wing's drag is a quadratic form in the wash of the others, so its derivative with that wash is
known in closed form.
"""

from airflock.core import FAR
from airflock.parts.aero.elimination import factorise, substitute_transposed
from airflock.parts.aero.filaments import add_product, add_wash, influence_slopes, influences
from airflock.parts.aero.lifting_line import SWEEPS, assemble, carry, induced_drag, meet, settle, wash_on
from airflock.parts.aero.wing import apart, circulation_sum, lanes, pitch, segments_of, shift, stiffness


def slopes(n, hx, hy, gradient, wing, work, shared):
    """Fill shared.slope_* with every wing's gradient of drag, N/m, where hx hy is the flock's forward."""
    if gradient == "analytic":
        slopes_of(n, work, wing)
    if gradient == "frozen":
        slopes_of(n, work, wing)
    for i in range(n):
        gx, gy, gz = slope_of(i, n, work, wing, gradient)
        shared.slope_x[i] = gx * hx - gy * hy
        shared.slope_y[i] = gx * hy + gy * hx
        shared.slope_z[i] = gz


def slope_of(i, n, work, wing, gradient):
    """Gradient of the drag of wing i in the air's axes, N/m (Eq. 8); zero for any other way than these four."""
    if gradient == "cells":
        return over_cells(i, n, work, wing, 0.0)
    if gradient == "cells_frozen":
        return over_cells(i, n, work, wing, 1.0)
    if gradient == "analytic":
        return analytic(i, n, work, wing, 0.0)
    if gradient == "frozen":
        return analytic(i, n, work, wing, 1.0)
    return 0.0, 0.0, 0.0


def level(i, n, work):
    """Return True if all wings fly at the height of wing i: then no drag changes to first order with it."""
    place = work.place
    far = 0.0
    for j in range(n):
        far = max(far, abs(place[2][j] - place[2][i]))
    return far == 0.0


def turn_about(i, n, m, work, keep):
    """Keep the tables of wing i (keep = 1.0), or put them back."""
    tables = work.tables
    kept = work.kept
    for j in range(n):
        for k in range(m + lanes(m)):
            if keep > 0.5:
                kept[j][k] = tables[i * n + j][k]
                kept[n + j][k] = tables[j * n + i][k]
            else:
                tables[i * n + j][k] = kept[j][k]
                tables[j * n + i][k] = kept[n + j][k]


def drag_at(i, n, work, wing, frozen):
    """Induced drag (N) of wing i where work.place has it now, the others where they were."""
    m = segments_of(wing)
    meet(n, i, work, wing)
    trial = work.trial
    circulation = work.circulation
    if frozen > 0.5:
        wash_on(i, n, m, work.tables, circulation, work.wash)
        carry(i, m, work, trial)
        return induced_drag(i, work, trial, wing)
    place = work.place
    core = wing.core * wing.span
    for j in range(n):
        if j != i:
            influences(
                work.tables, j * n + i, apart(place[0][j], place[0][i], wing), apart(place[1][j], place[1][i], wing),
                apart(place[2][j], place[2][i], wing), m, pitch(wing), core * core,
            )  # fmt: skip
        for k in range(m):
            trial[j][k] = circulation[j][k]
    settle(n, work, trial, wing)
    return induced_drag(i, work, trial, wing)


def over_cells(i, n, work, wing, frozen):
    """Gradient (N/m) of the drag of wing i by central differences over plus and minus one pitch."""
    m = segments_of(wing)
    place = work.place
    h = pitch(wing)
    flat = level(i, n, work)
    gx = 0.0
    gy = 0.0
    gz = 0.0
    # The trials write the tables of wing i only, so these are kept once for all six.
    turn_about(i, n, m, work, 1.0)
    for k in range(6):
        axis = k // 2
        if (axis < 2) | (not flat):
            side = 1.0 if k % 2 == 0 else -1.0
            here = place[axis][i]
            place[axis][i] = here + side * h
            drag = side * drag_at(i, n, work, wing, frozen) / (2.0 * h)
            place[axis][i] = here
            gx = gx + (drag if axis == 0 else 0.0)
            gy = gy + (drag if axis == 1 else 0.0)
            gz = gz + (drag if axis == 2 else 0.0)
    turn_about(i, n, m, work, 0.0)
    return gx, gy, gz


def slopes_of(n, work, wing):
    """Derivatives of all tables, and the tables backwards."""
    m = segments_of(wing)
    place = work.place
    tables = work.tables
    mirror = work.mirror
    first = shift(m)
    core = wing.core * wing.span
    for i in range(n):
        for j in range(n):
            if i != j:
                influence_slopes(
                    work.slopes, 3 * (i * n + j), place[0][i] - place[0][j], place[1][i] - place[1][j],
                    place[2][i] - place[2][j], m, pitch(wing), core * core,
                )  # fmt: skip
                for k in range(m):
                    # An influence depends on the difference of two segments only: transposed, its
                    # row reads backwards.
                    mirror[i * n + j][first + k] = tables[i * n + j][first - k]
                    mirror[i * n + j][first - k] = tables[i * n + j][first + k]


def own_part(i, work, wing):
    """Derivative of the drag of wing i with the wash on it, over density times pitch, m²/s: row i of `source`.

    With drag = circulation · (own wash + wash) and circulation = alone - response · wash, and
    because the response undoes the wing's own equation, it is alone + 2 speed · response ·
    circulation / stiffness.
    """
    m = segments_of(wing)
    source = work.source
    f = 2.0 * wing.speed / stiffness(wing)
    for k in range(m):
        source[i][k] = 0.0
    add_product(source, i, work.response, work.circulation, i, m)
    for k in range(m):
        source[i][k] = work.alone[0][k] + f * source[i][k]


def sensitivities(i, n, work, wing):
    """Solve for the dependence of the drag of wing i on the wash on every wing: rows of `adjoint`, mirrored tables."""
    m = segments_of(wing)
    adjoint = work.adjoint
    source = work.source
    wash = work.wash
    spare = work.spare
    limit = wing.tolerance * circulation_sum(wing)
    for j in range(n):
        for k in range(m):
            adjoint[j][k] = source[i][k] if j == i else 0.0
    change = FAR
    for _ in range(SWEEPS):
        change = 0.0
        for e in range(n):
            # The wing itself first: its row alone has a source, which then reaches all others in
            # the first sweep.
            j = (i + e) % n
            back_wash(j, n, m, work.mirror, adjoint, wash)
            for k in range(m):
                spare[0][k] = 0.0
            add_product(spare, 0, work.response, wash, j, m)
            for k in range(m):
                fresh = source[i][k] - spare[0][k] if j == i else -spare[0][k]
                change = max(change, abs(fresh - adjoint[j][k]))
                adjoint[j][k] = fresh
        if change <= limit:
            break
    # Wings that nearly overlap do not settle; one factorisation answers, as in
    # `lifting_line.solve`.
    if change > 1000.0 * limit:
        assemble(n, m, work)
        factorise(work.dense, work.pivots, n * m)
        unspread(i, n, m, work)


def back_wash(j, n, m, mirror, adjoint, wash):
    """Sum the sensitivities of all other wings to a unit circulation on wing j."""
    for k in range(m):
        wash[j][k] = 0.0
    for i in range(n):
        if i != j:
            add_wash(wash, j, mirror, i * n + j, adjoint, i, m)


def unspread(i, n, m, work):
    """Solve from the factors of the dense system: one factorisation serves all right-hand sides."""
    column = work.column
    adjoint = work.adjoint
    wash = work.wash
    spare = work.spare
    for j in range(n):
        for k in range(m):
            wash[j][k] = 0.0
        if j != i:
            add_wash(wash, j, work.mirror, i * n + j, work.source, i, m)
        for k in range(m):
            column[0][j * m + k] = wash[j][k]
    substitute_transposed(work.dense, work.pivots, column, 0, n * m)
    for j in range(n):
        for k in range(m):
            wash[j][k] = column[0][j * m + k]
            spare[0][k] = 0.0
        add_product(spare, 0, work.response, wash, j, m)
        for k in range(m):
            adjoint[j][k] = (work.source[i][k] if j == i else 0.0) - spare[0][k]


def bilinear(weights, i, slopes, row, circulation, j, m, spare):
    """Weight what the circulations of wing j induce by one row of slopes over the control points of wing i."""
    for k in range(m):
        spare[0][k] = 0.0
    add_wash(spare, 0, slopes, row, circulation, j, m)
    s = 0.0
    for k in range(m):
        s = s + weights[i][k] * spare[0][k]
    return s


def analytic(i, n, work, wing, frozen):
    """Gradient (N/m) of the drag of wing i; `solve` and `slopes_of` come before, washes are overwritten."""
    m = segments_of(wing)
    flat = level(i, n, work)
    circulation = work.circulation
    slopes = work.slopes
    spare = work.spare
    gx = 0.0
    gy = 0.0
    gz = 0.0
    own_part(i, work, wing)
    if frozen < 0.5:
        sensitivities(i, n, work, wing)
    for j in range(n):
        if j != i:
            row = 3 * (i * n + j)
            if frozen > 0.5:
                gx = gx + bilinear(work.source, i, slopes, row, circulation, j, m, spare)
                gy = gy + bilinear(work.source, i, slopes, row + 1, circulation, j, m, spare)
                if not flat:
                    gz = gz + bilinear(work.source, i, slopes, row + 2, circulation, j, m, spare)
            else:
                adjoint = work.adjoint
                gx = gx + bilinear(adjoint, i, slopes, row, circulation, j, m, spare)
                gy = gy + bilinear(adjoint, i, slopes, row + 1, circulation, j, m, spare)
                row = 3 * (j * n + i)
                # What wing i induces on another one changes by the opposite offset, hence the
                # minus.
                gx = gx - bilinear(adjoint, j, slopes, row, circulation, i, m, spare)
                gy = gy - bilinear(adjoint, j, slopes, row + 1, circulation, i, m, spare)
                if not flat:
                    gz = gz - bilinear(adjoint, j, slopes, row + 2, circulation, i, m, spare)
                    row = 3 * (i * n + j)
                    gz = gz + bilinear(adjoint, i, slopes, row + 2, circulation, j, m, spare)
    f = wing.density * pitch(wing)
    return f * gx, f * gy, f * gz
