"""Force maps: how an individual speeds up and turns, by where a neighbour is; seen in the tracks, and by a law.

Katz et al., PNAS 108, 18720 (2011); Herbert-Read et al., PNAS 108, 18726 (2011). The acceleration that is seen is a
second difference over LAG; of the law's accelerations the same weighted mean is taken, so that both are alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.likelihood import FitModel
from airflock.estimate.inference.tracks import ABSENT, TrackScale

Array = NDArray[np.float64]
LAG = 0.3  # s; half of the window over which an acceleration is taken
CELLS = 15  # of a map, along each side
WIDE = 5.0  # nearest distances from the middle of a map to its edge
PAIRS = 1_500_000  # of which maps are made, at most
LEAST = 30  # pairs in a cell that counts


@dataclass(frozen=True)
class ForceMaps:
    """Mean acceleration by place of a neighbour, (forward or left, front-back, left-right), m/s^2.

    edges : of cells, m; seen, law : of the tracks and of the law; nan where there are too few pairs
    """

    edges: Array
    seen: Array
    law: Array


def force_maps(model: FitModel, point: Array, scale: TrackScale, spans: Sequence[int] | None = None) -> ForceMaps:
    """Maps of the tracks and of a law at a place of its numbers, on some spans."""
    edge = min(WIDE * scale.near, 0.6 * scale.far)
    edges = np.linspace(-edge, edge, CELLS + 1)
    size = CELLS * CELLS
    count, seen, law = np.zeros(size), np.zeros((2, size)), np.zeros((2, size))
    for walk, own in model.parts(spans):
        tracks, axes = walk.tracks, walk.axes
        kept, pushes = np.zeros((len(walk.seen), 2 * axes, tracks.individual_count)), np.zeros_like(tracks.seen)
        walk.errors(*model.split(point), own, kept, pushes)
        lag = max(1, round(LAG / tracks.period))
        weights = lag - np.abs(np.arange(-lag + 1, lag))
        frames = np.concatenate([np.arange(tracks.spans[s][0] + lag, tracks.spans[s][1] - lag) for s in own])
        for k in frames[:: max(1, len(frames) * tracks.individual_count**2 // PAIRS)]:
            window = tracks.seen[k - lag : k + lag + 1]
            turned = tracks.nearest(window[-1] - window[lag]) - tracks.nearest(window[lag] - window[0])
            felt = turned / (lag * tracks.period) ** 2
            told = np.tensordot(weights, pushes[k - lag + 1 : k + lag], 1) / (lag * lag * tracks.period)
            there: Any = (tracks.state[k - lag : k + lag + 1] > ABSENT).all(axis=0) & np.isfinite(felt).all(axis=0)
            cell, who, h, left = _cells(kept[k], there, tracks.state[k] > ABSENT, edge, tracks.nearest)
            count += np.bincount(cell, minlength=size)
            for table, force in ((seen, felt), (law, told)):
                for part, axis in enumerate((h, left)):
                    own_force = (axis * np.nan_to_num(force)).sum(axis=0)
                    table[part] += np.bincount(cell, own_force[who], size)
    shape, enough = (2, CELLS, CELLS), count >= LEAST
    divisor = np.maximum(count, 1.0)
    return ForceMaps(
        edges,
        np.where(enough, seen / divisor, np.nan).reshape(shape),
        np.where(enough, law / divisor, np.nan).reshape(shape),
    )


def _cells(
    motion: Array, there: NDArray[np.bool_], around: NDArray[np.bool_], edge: float, nearest: Callable[[Array], Array]
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Cell of every neighbour, whose it is, and headings and directions to the left (axis, individual)."""
    axes, n = len(motion) // 2, motion.shape[1]
    x, v = motion[:axes], motion[axes:]
    h = v / np.maximum(np.linalg.norm(v, axis=0), 1e-12)
    flat = np.maximum(np.linalg.norm(h[:2], axis=0), 1e-12)
    left = np.zeros_like(h)
    left[0], left[1] = -h[1] / flat, h[0] / flat
    d = nearest((x[:, None, :] - x[:, :, None]).reshape(axes, -1)).reshape(axes, n, n)
    places = [np.einsum("ai,aij->ij", axis, d) for axis in (h, left)]
    row, column = (np.floor((p + edge) / (2.0 * edge) * CELLS).astype(int) for p in places)
    inside = (row >= 0) & (row < CELLS) & (column >= 0) & (column < CELLS)
    inside &= there[:, None] & around[None, :] & ~np.eye(n, dtype=bool)
    who, _ = np.nonzero(inside)
    return row[inside] * CELLS + column[inside], who, h, left
