"""Number of sub-swarms and stragglers: agents that are linked over distances below q.r_cluster form one (Kidger)."""

from typing import NamedTuple

REPORTS = {
    "n_clusters": ("", "number of sub-swarms, stragglers included"),
    "n_stragglers": ("", "number of agents that are alone"),
}
FORMULAS = {
    "n_clusters": (r"\left\langle |\{c\}| \right\rangle_t", "1 to N"),
    "n_stragglers": (r"\left\langle |\{i : N_i = 1\}| \right\rangle_t", "0 to N"),
}
NEEDS = {"n_clusters": ("r_cluster",), "n_stragglers": ("r_cluster",)}


class Cluster(NamedTuple):
    """Sub-swarms (two agents or more); agents that are alone."""

    swarm: float
    straggler: float


class Sample(NamedTuple):
    """Clusters of any size; those of one agent."""

    n_clusters: float
    n_stragglers: float


def linked(r2, q):
    """Return True if two agents at a squared distance r2 (m²) belong to one cluster."""
    return r2 < q.r_cluster * q.r_cluster


def linked_within(q):
    """Distance beyond which no two agents are linked, m."""
    return q.r_cluster


def cluster(n):
    """A swarm or a straggler."""
    alone = 1.0 if n < 1.5 else 0.0
    return Cluster(1.0 - alone, alone)


def sample(clusters):
    """Numbers of this instant."""
    return Sample(clusters.swarm + clusters.straggler, clusters.straggler)
