"""Formations of wings for tests, in plain Python: where they are, and their lifting lines."""

import numpy as np

from airflock.parts.aero import lifting_line, wing
from airflock.parts.aero.filaments import influences

FOOT, POUND = 0.3048, 4.4482216152605
FT_LBF = FOOT * POUND  # W in a ft lbf/s
BARE = {"core": 0.0, "tolerance": 1e-13, "speed": 30.0 * FOOT, "weight": 10.0 * POUND, "stall": "noted"}


def wing_of(**changes):
    """The paper's wing at the paper's speed: no core, profile drag or stall check unless asked for."""
    return wing.Parameters(**{**BARE, **{k: str(v) if k == "segments" else v for k, v in changes.items()}})


def vee(n, sx, sy, sz=0.0):
    """Positions (n, 3), m, of a V whose tip is wing 0; sx, sy, sz: distances of two ranks."""
    side = [0.0, *(1.0 if i % 2 else -1.0 for i in range(1, n))]
    rank = [(i + 1) // 2 for i in range(n)]
    return np.array([(-k * sx, s * k * sy, k * sz) for k, s in zip(rank, side, strict=True)])


def scratch(n, w, gradient="none"):
    """Scratch of a flock as lists of lists."""
    found = lifting_line.shapes(n, wing.segments_of(w), gradient)
    return lifting_line.Work(*[[[0.0] * columns for _ in range(rows)] for rows, columns in found])


def solved(positions, w, gradient="none"):
    """Scratch with the solution for wings at these positions (n, 3), m."""
    work = scratch(len(positions), w, gradient)
    for axis in range(3):
        work.place[axis][:] = [float(p[axis]) for p in positions]
    lifting_line.solve(len(positions), work, w)
    return work


def drags(positions, w):
    """Induced drag of each wing, N."""
    work = solved(positions, w)
    return np.array([lifting_line.induced_drag(i, work, work.circulation, w) for i in range(len(positions))])


def power(positions, w):
    """Mean power per bird in ft lbf/s, the unit of Dimock & Selig 2003."""
    return float(drags(positions, w).mean() * w.speed / FT_LBF)


def block(offset, m, h, core=0.0):
    """Influence matrix (control point, segment) of a wing on one that lies at `offset` (m) from it."""
    row = [[0.0] * (m + wing.lanes(m))]
    influences(row, 0, *(float(d) for d in offset), m, h, core * core)
    k, e = np.indices((m, m))
    return np.array(row[0])[k - e + wing.lanes(m) - 1]


def influence_matrix(positions, m, h, core=0.0):
    """Influence of all segments on all control points (n m, n m); the core acts between wings only."""
    known = {}

    def found(i, j):
        d = tuple(np.round(np.subtract(positions[i], positions[j]), 12))
        if (d, i == j) not in known:
            known[d, i == j] = block(d, m, h, 0.0 if i == j else core)
        return known[d, i == j]

    n = len(positions)
    return np.block([[found(i, j) for j in range(n)] for i in range(n)])


def best_load(positions, m, h):
    """Circulations of least total drag at one unit per wing, and that drag over density (Munk's quadratic form)."""
    n = len(positions)
    a = influence_matrix(positions, m, h)
    form = 0.5 * (a + a.T)
    wings = np.kron(np.eye(n), np.ones((1, m)))
    system = np.block([[2.0 * form, -wings.T], [wings, np.zeros((n, n))]])
    load = np.linalg.solve(system, np.concatenate([np.zeros(n * m), np.full(n, 1.0 / h)]))[: n * m]
    return load, float(h * load @ form @ load)
