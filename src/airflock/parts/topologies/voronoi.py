"""Neighbours by Voronoi cells in a plane: those whose cell shares an edge with the own one.

A point x lies nearer to the agent than to a neighbour at offset d where x · d ≤ d · d / 2. The cell
is where this holds for all, and its polar dual is the convex hull of the agent itself (0) and of
the inverted offsets d / (d · d): whoever is a corner of that hull bounds the cell, also where the
cell is open to infinity. The hull is wrapped from one corner to the next (Jarvis 1973), so that no
polygon is kept and cells without end need no box around them.

Who shares but a corner of a cell, as four on one circle do, is not met: an inverted offset within
STRAIGHT (rad) of a side of the hull is no corner. Those at the very same place are met together.
Each is taken at its nearest image.
"""

from airflock.parts.topologies.ranking import HEARD_LIMIT

FLAT = True  # cells of a plane

STRAIGHT = 1e-5  # rad; resolution of single precision
SAME = 1e-9  # m²; so near that no cell divides the two


def corner(k, n, dx, dy, r2):
    """Inverted offset of number k, 1/m; 0, 0 of the agent itself, which has the number n."""
    if k == n:
        return 0.0, 0.0
    return dx[k] / r2[k], dy[k] / r2[k]


def following(at, n, dx, dy, r2, met):
    """The corner of the hull that follows corner `at` counter-clockwise; who lies at the same place as it is met."""
    px, py = corner(at, n, dx, dy, r2)
    slack = STRAIGHT * STRAIGHT
    size = px * px + py * py
    found = at
    qx = 0.0
    qy = 0.0
    q2 = 0.0
    for j in range(n + 1):
        if j == n or (r2[j] < HEARD_LIMIT and r2[j] > SAME):
            x, y = corner(j, n, dx, dy, r2)
            x = x - px
            y = y - py
            s = x * x + y * y
            if s <= slack * size:
                if j < n and at < n:
                    met[j] = 1.0
            else:
                turn = qx * y - qy * x
                straight = turn * turn <= slack * s * q2
                if (straight and s > q2) or (turn < 0.0 and not straight):
                    found = j
                    qx = x
                    qy = y
                    q2 = s
    return found


def meet(n, dx, dy, r2, met):
    """Fill `met`: 1.0 for each of the first n who shares an edge of the cell.

    dx, dy : offsets, m; r2 : their squares, m²
    """
    # Neighbours are the corners of the convex hull of the inverted offsets d / |d|², the polar dual
    # of the cell: open cells need no box, and nothing is sorted (gift wrapping, n steps for each
    # neighbour).
    first = n
    for j in range(n):
        met[j] = 1.0 if r2[j] <= SAME else 0.0
        if r2[j] > SAME and r2[j] < HEARD_LIMIT and (first == n or r2[j] < r2[first]):
            first = j
    if first < n:
        ax, ay = corner(first, n, dx, dy, r2)
        at = first
        turns = 0
        # At most n turns, so that rounding cannot wrap round the hull for ever.
        while turns <= n:
            turns = turns + 1
            if at < n:
                met[at] = 1.0
            at = following(at, n, dx, dy, r2, met)
            bx, by = corner(at, n, dx, dy, r2)
            apart = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
            if apart <= STRAIGHT * STRAIGHT * (ax * ax + ay * ay):
                turns = n + 1
