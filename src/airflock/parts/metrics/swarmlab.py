"""Order, safety, union and connectivity of a swarm (Soria, Schiano and Floreano 2020, SwarmLab).

Neighbours are all within metrics.r_comm, by true positions, so the graph is symmetric whatever a
law or a radio makes of it. SwarmLab calls the radius of an agent r_coll; here metrics.r_coll is the
distance of two centres, twice that.
"""

import math
from typing import NamedTuple

REPORTS = {
    "order": ("", "mean cosine between an agent's velocity and those of its neighbours"),
    "safety": ("", "share of pairs that are not in contact"),
    "union": ("", "1 where all agents are linked, 0 where each is alone"),
    "connectivity": ("", "algebraic connectivity of the neighbour graph per agent"),
}
FORMULAS = {
    "order": (
        r"\left\langle \frac{1}{N}\sum_i \frac{1}{|M_i|}\sum_{j \in M_i} h_i \cdot h_j \right\rangle_t",
        "-1 to 1",
        "$M_i$ are the others within $r_{comm}$; an agent without any contributes 0.",
    ),
    "safety": (
        r"1 - \left\langle \frac{1}{N(N-1)}\sum_{i \ne j} \Theta(r_{coll} - r_{ij}) \right\rangle_t",
        "0 to 1",
    ),
    "union": (r"\left\langle \frac{N - N_{parts}}{N - 1} \right\rangle_t", "0 to 1"),
    "connectivity": (
        r"\left\langle \frac{\lambda_2}{N} \right\rangle_t",
        "0 to 1",
        r"$\lambda_2$ is the second smallest eigenvalue of the graph's Laplacian: 0 where it is in parts, N where each "
        "agent is a neighbour of all others. Costs a time that grows with $N^3$.",
    ),
}
NEEDS = {"order": ("r_comm",), "safety": ("r_coll",), "union": ("r_comm",), "connectivity": ("r_comm",)}

REDUCE = {"connectivity": "max"}
HALVINGS = 40  # of the interval that holds the eigenvalue: to N / 2^40, below the last bit of single precision


class Shared(NamedTuple):
    """Of an agent: mean cosine to its neighbours, agents within r_coll; of the flock: connectivity."""

    order: float
    contacts: float
    connectivity: float


class Scratch(NamedTuple):
    """Laplacian of the neighbour graph; diagonal and secondary diagonal of its tridiagonal form; a reflection's normal
    and the normal's image.
    """

    graph: tuple[int, int]
    diagonal: tuple[int, int]
    beside: tuple[int, int]
    normal: tuple[int, int]
    image: tuple[int, int]


class Agent(NamedTuple):
    """Mean cosine, contacts, and the connectivity of the flock."""

    order: float
    contacts: float
    connectivity: float


class Cluster(NamedTuple):
    """One part of the graph."""

    parts: float


class Sample(NamedTuple):
    """Order in [-1, 1]; safety, union and connectivity in [0, 1]."""

    order: float
    safety: float
    union: float
    connectivity: float


def errors(q, largest, edges):
    """Refuse a periodic world, where the nearest image of an agent is not at its position."""
    if edges == "periodic":
        return ["metrics swarmlab: not defined with world.edges = 'periodic'; give bounce or open"]
    return []


def linked(r2, q):
    """Return True if two agents at a squared distance r2 (m²) are neighbours."""
    return r2 < q.r_comm * q.r_comm


def linked_within(q):
    """Distance beyond which no two agents are linked, m."""
    return q.r_comm


def cluster():
    """Count one part."""
    return Cluster(1.0)


def workspace(n, q, wing):
    """One row for each agent, and some vectors."""
    return Scratch(graph=(n, n), diagonal=(1, n), beside=(1, n), normal=(1, n), image=(1, n))


def survey(n, x, y, z, vx, vy, vz, q, work, shared):
    """Fill the graph's Laplacian and the cosines between neighbours; find the connectivity."""
    graph = work.graph
    for i in range(n):
        speed = math.sqrt(vx[i] * vx[i] + vy[i] * vy[i] + vz[i] * vz[i])
        cosines = 0.0
        degree = 0.0
        contacts = 0.0
        for j in range(n):
            dx = x[j] - x[i]
            dy = y[j] - y[i]
            dz = z[j] - z[i]
            r2 = dx * dx + dy * dy + dz * dz
            other = 1.0 if j != i else 0.0
            near = other if r2 < q.r_comm * q.r_comm else 0.0
            both = speed * math.sqrt(vx[j] * vx[j] + vy[j] * vy[j] + vz[j] * vz[j])
            # an agent at rest has no heading: it contributes 0, as in `correlation`
            moving = near if both > 0.0 else 0.0
            cosines += moving * (vx[i] * vx[j] + vy[i] * vy[j] + vz[i] * vz[j]) / max(both, 1e-30)
            degree += near
            contacts += other if r2 < q.r_coll * q.r_coll else 0.0
            graph[i][j] = -near
        graph[i][i] = degree
        shared.order[i] = cosines / max(degree, 1.0)
        shared.contacts[i] = contacts
    tridiagonalise(n, work)
    value = second_smallest(n, work) / n
    for i in range(n):
        shared.connectivity[i] = value


def tridiagonalise(n, work):
    """Bring the symmetric matrix `graph` to tridiagonal form by reflections (Householder 1958)."""
    a = work.graph
    v = work.normal[0]
    p = work.image[0]
    for k in range(n - 2):
        norm2 = 0.0
        for i in range(k + 1, n):
            v[i] = a[i][k]
            norm2 += v[i] * v[i]
        # The sign that adds up: a difference of nearly equal numbers would lose all digits.
        edge = -math.sqrt(norm2) if v[k + 1] > 0.0 else math.sqrt(norm2)
        v[k + 1] -= edge
        vv = 0.0
        for i in range(k + 1, n):
            vv += v[i] * v[i]
        work.diagonal[0][k] = a[k][k]
        work.beside[0][k] = edge
        if vv > 0.0:
            along = 0.0
            for i in range(k + 1, n):
                total = 0.0
                for j in range(k + 1, n):
                    total += a[i][j] * v[j]
                p[i] = 2.0 * total / vv
                along += p[i] * v[i]
            for i in range(k + 1, n):
                p[i] -= along / vv * v[i]
            for i in range(k + 1, n):
                for j in range(k + 1, n):
                    a[i][j] -= v[i] * p[j] + p[i] * v[j]
    for k in range(max(n - 2, 0), n):
        work.diagonal[0][k] = a[k][k]
        work.beside[0][k] = a[n - 1][n - 2] if k < n - 1 else 0.0


def second_smallest(n, work):
    """Return the second smallest eigenvalue of the tridiagonal matrix, by halving [0, n] (Sturm's count); 0 if n = 1.

    A Laplacian has none below 0, and none above n.
    """
    low = 0.0
    high = float(n) if n > 1 else 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = 0.0
        pivot = 1.0
        for i in range(n):
            square = work.beside[0][i - 1] * work.beside[0][i - 1] if i > 0 else 0.0
            pivot = work.diagonal[0][i] - middle - square / pivot
            pivot = pivot if abs(pivot) > 1e-20 else -1e-20
            below += 1.0 if pivot < 0.0 else 0.0
        low = low if below > 1.5 else middle
        high = middle if below > 1.5 else high
    return high


def agent(shared):
    """Terms of one agent."""
    return Agent(shared.order, shared.contacts, shared.connectivity)


def sample(agents, clusters, n):
    """Values of one instant; a lone agent is safe, and neither ordered nor connected."""
    return Sample(
        agents.order / n,
        1.0 - agents.contacts / max(n * (n - 1.0), 1.0),
        (n - clusters.parts) / max(n - 1.0, 1.0),
        agents.connectivity,
    )
