"""Velocity correlation within clusters and the smallest cluster (Vásárhelyi et al. 2018, Eqs 12-13).

Self pairs are excluded, as in the authors' program; a lone agent and an agent at rest contribute 0.
"""

from typing import NamedTuple

REPORTS = {"phi_corr": ("", "velocity correlation within clusters"), "n_min": ("", "size of the smallest cluster")}
FORMULAS = {
    "phi_corr": (
        r"\left\langle \frac{1}{N}\sum_i \frac{1}{N_i - 1}\sum_{j \in J_i} h_i \cdot h_j \right\rangle_t",
        "-1 to 1",
        "$J_i$ are the other agents of the cluster of $i$, which has $N_i$ members. 1: all members of each cluster "
        "fly alike.",
    ),
    "n_min": (
        r"\left\langle \min_c N_c \right\rangle_t",
        "1 to N",
        "Members of the smallest cluster, averaged over time, so not a whole number.",
    ),
}
NEEDS = {"phi_corr": ("r_cluster",), "n_min": ("r_cluster",)}

REDUCE = {"smallest": "min"}


class Cluster(NamedTuple):
    """Sum over the members of their mean correlation with the others; members."""

    correlation: float
    smallest: float


class Sample(NamedTuple):
    """Correlation in [-1, 1]; members of the smallest cluster."""

    phi_corr: float
    n_min: float


def linked(r2, q):
    """Return True if two agents at a squared distance r2 (m²) belong to one cluster."""
    return r2 < q.r_cluster * q.r_cluster


def linked_within(q):
    """Distance beyond which no two agents are linked, m."""
    return q.r_cluster


def cluster(n, hx, hy, hz, hh):
    """Sum over i of 1/(n-1) sum over j != i of the cosine between their velocities (Eq. 13)."""
    return Cluster((hx * hx + hy * hy + hz * hz - hh) / max(n - 1.0, 1.0), n)


def sample(clusters, n):
    """Correlation per agent."""
    return Sample(clusters.correlation / n, clusters.smallest)
