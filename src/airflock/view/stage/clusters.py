"""Clusters of a flock at one moment: agents that are linked by others, each nearer to the next than a distance."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

FIRST_LINKS = 9  # nearest agents that are linked first: in a dense flock they join nearly everybody


def cluster_labels(position: NDArray[Any], distance: float, period: NDArray[Any] | None = None) -> NDArray[np.intp]:
    """Of each agent the smallest number of an agent in its cluster, or -1 if it is alone: (agent,).

    position : (agent, axis), m; distance : m, links are shorter; box : sides of a periodic world, m
    """
    points = np.asarray(position, float)
    count = len(points)
    if count < 2 or not distance > 0.0:
        return np.full(count, -1, np.intp)
    tree = cKDTree(points if period is None else np.mod(points + 0.5 * period, period), boxsize=period)
    apart, other = tree.query(tree.data, k=min(FIRST_LINKS, count), distance_upper_bound=distance)
    near = np.isfinite(apart) & (np.arange(count)[:, None] != other)
    label = _component_labels(np.nonzero(near)[0], other[near], count)
    rest = np.flatnonzero(label != np.bincount(label).argmax())
    if len(rest):  # whatever joins two clusters has an end outside the largest
        far = np.nextafter(distance, 0.0)
        links = cKDTree(tree.data[rest], boxsize=period).sparse_distance_matrix(tree, far, output_type="coo_matrix")
        first = np.concatenate([np.nonzero(near)[0], rest[links.row]])
        label = _component_labels(first, np.concatenate([other[near], links.col]), count)
    least = np.full(label.max() + 1, count, np.intp)
    np.minimum.at(least, label, np.arange(count))
    return np.where(np.bincount(label)[label] > 1, least[label], -1)


def _component_labels(first: NDArray[Any], second: NDArray[Any], count: int) -> NDArray[np.intp]:
    """Labels (agent,) of what links between agents join."""
    links = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], np.intp)


def cluster_distance(scenario: Any) -> float:
    """Distance within which two agents of a scenario belong to one cluster, m; nan where that is not said."""
    return float(scenario.resolved_metrics().r_cluster or math.nan)
