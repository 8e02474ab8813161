"""What a law leaves over: how much better the next step would be predicted with a free sum of forces added to it.

The differences that a law leaves are regressed on what neighbours do in shells of distance: sums of directions towards
them and of velocities relative to one's own, along and to the left of the heading. Fitted on every other span and
judged on the rest, so that noise explains nothing. This is a test of lack of fit that knows no law.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from airflock.infer.likelihood import Model
from airflock.infer.tracks import ABSENT, COUNTED

Array = NDArray[np.float64]
SHELLS = (0.0, 1.5, 3.0, 6.0, math.inf)  # nearest distances
RIDGE = 1e-3  # share of a feature's power


def left_over(model: Model, place: Array, spans: Sequence[int]) -> float:
    """Log-likelihood that a free sum of forces would still gain on the spans; 0 or more."""
    features, differences, half = [], [], []
    order = 0
    for walk, own in model.parts(spans):
        tracks, axes = walk.tracks, walk.axes
        kept = np.zeros((len(walk.seen), 2 * axes, tracks.individuals))
        e = walk.errors(*model.split(place), own, kept)
        for s in own:
            order += 1
            begin, end = tracks.spans[s]
            for k in range(begin + 1, end):
                counted = tracks.state[k] == COUNTED
                if not counted.any():
                    continue
                found = _around(kept[k - 1], tracks.state[k - 1] > ABSENT, tracks.nearest, model.scale.near)
                features.append(found[:, :, counted])
                differences.append(e[k, :2, counted])
                half.append(np.full(int(counted.sum()), order % 2))
    if not features:
        return 0.0
    x, y, part = np.concatenate(features, axis=2), np.concatenate(differences), np.concatenate(half)
    gained = 0.0
    for c in (0, 1):
        a, b = x[c].T, y[:, c]
        before, after = 0.0, 0.0
        for side in (0, 1):
            fit, judge = part == side, part != side
            if fit.sum() < 100 or judge.sum() < 100:
                return 0.0
            power = a[fit].T @ a[fit]
            ridge = RIDGE * np.trace(power) / len(power) + 1e-12
            weights = np.linalg.solve(power + ridge * np.eye(len(power)), a[fit].T @ b[fit])
            before += float((b[judge] ** 2).sum())
            after += float(((b[judge] - a[judge] @ weights) ** 2).sum())
        gained += 0.5 * len(b) * math.log(before / after)
    return max(gained, 0.0)


def _around(motion: Array, there: NDArray[np.bool_], nearest: Callable[[Array], Array], near: float) -> Array:
    """Features (along or left, shell and kind, individual) of what neighbours of each individual do."""
    axes, n = len(motion) // 2, motion.shape[1]
    x, v = motion[:axes], motion[axes:]
    size = np.maximum(np.linalg.norm(v, axis=0), 1e-12)
    h = v / size
    left = np.zeros_like(h)
    flat = np.maximum(np.linalg.norm(h[:2], axis=0), 1e-12)
    left[0], left[1] = -h[1] / flat, h[0] / flat
    d = nearest((x[:, None, :] - x[:, :, None]).reshape(axes, -1)).reshape(axes, n, n)  # from i (first) to j
    apart = np.linalg.norm(d, axis=0)
    pair = there[:, None] & there[None, :] & (apart > 0.0)
    towards = np.where(pair, d / np.maximum(apart, 1e-12), 0.0)
    relative = np.where(pair, v[:, None, :] - v[:, :, None], 0.0)
    shell = np.digitize(apart / near, SHELLS[1:-1])
    rows = []
    for axis in (h, left):
        row = []
        for field in (towards, relative):
            along = np.einsum("ai,aij->ij", axis, field)
            row += [np.where(pair & (shell == s), along, 0.0).sum(axis=1) for s in range(len(SHELLS) - 1)]
        rows.append(row)
    return np.array(rows)
