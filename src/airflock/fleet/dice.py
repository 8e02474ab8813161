"""Outer noise of all drones of a fleet, drawn for many motion steps at once: the numbers of the simulated agents."""

import numpy as np

from airflock.core import random

BLOCK = 256  # motion steps that are drawn together
Vector = tuple[float, float, float]


class OuterNoise:
    """Normal random numbers of every drone at every motion step, to be asked in the order of time.

    seed : of the flight; count: of drones; three: in space, where a draw serves one step; in a plane it serves two
    """

    def __init__(self, seed: int, count: int, three: bool):
        self._seed, self._count, self._three = seed, count, three
        self._first, self._rows = -BLOCK, []  # type: ignore[var-annotated]

    def __call__(self, step: int, drone: int) -> Vector:
        """Three numbers N(0, 1) of a drone at a step; in a plane the third is zero."""
        if not self._first <= step < self._first + BLOCK:
            self._first = step - step % BLOCK
            self._rows = self._drawn(self._first)
        row: Vector = self._rows[step - self._first][drone]
        return row

    def _drawn(self, first: int) -> list[list[Vector]]:
        """Rows of BLOCK steps; the words come as arrays, what is made of them by the functions of one number."""
        steps = np.arange(first, first + BLOCK, 1 if self._three else 2, dtype=np.uint64)
        if not self._three:
            steps //= np.uint64(2)
        drones = np.arange(self._count, dtype=np.uint64)
        drawn = random.words(self._seed, random.OUTER, 0, steps[:, None], drones[None, :])
        tables = [np.broadcast_to(words, (len(steps), self._count)).tolist() for words in drawn]
        rows: list[list[Vector]] = []
        for a, b, c, d in zip(*tables, strict=True):
            one = [random.normal_pair(*pair) for pair in zip(a, b, strict=True)]
            two = [random.normal_pair(*pair) for pair in zip(c, d, strict=True)]
            if self._three:
                rows.append([(x, y, z) for (x, y), (z, _) in zip(one, two, strict=True)])
            else:
                rows += [[(x, y, 0.0) for x, y in pairs] for pairs in (one, two)]
        return rows
