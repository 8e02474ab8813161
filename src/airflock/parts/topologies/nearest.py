"""The k nearest of those who are heard, by their distance in metres: topological neighbours (Ballerini et al. 2008).

All who are as near as the k-th are met as well, so that no number of an agent decides.
"""

from airflock.parts.topologies.ranking import kth_least

NEAR = True  # no agent farther than the k-th changes the choice


def meet(n, r2, met, heap, t):
    """Fill `met`: 1.0 for each of the first n who is no farther than the k-th nearest.

    r2 : squared distances, m²; heap: scratch; t.k: how many
    """
    limit = kth_least(n, r2, heap, int(t.k))
    for j in range(n):
        met[j] = 1.0 if r2[j] <= limit else 0.0
