"""Sorting into cells, as the stages stand: everybody lies in the own cell, and around a line lie all who are near."""

from types import SimpleNamespace

import numpy as np
import pytest

from inside import FlightView, Flock, Itself, SortedCells, stages_cells as cells, stages_words as words

HALF = {2: (6.0, 9.0, 0.0), 3: (6.0, 9.0, 4.0)}  # of the periodic box, m
KINDS = [(dimensions, periodic) for dimensions in (2, 3) for periodic in (False, True)]


class Sorted:
    """A flock at random places, sorted into cells no smaller than `near`."""

    def __init__(self, seed, dimensions, periodic, n=120, near=2.0):
        rng = np.random.default_rng(seed)
        self.plan = SimpleNamespace(dimensions=dimensions, periodic=periodic)
        half = np.array(HALF[dimensions])
        self.numbers = SimpleNamespace(w=SimpleNamespace(**dict(zip(words.HALF_SIZES, half, strict=True))))
        self.n, self.half, self.near = n, half[:dimensions], near
        self.states = np.concatenate(
            [rng.uniform(-1, 1, (dimensions, n)) * self.half[:, None], rng.normal(size=(dimensions, n))]
        )
        axes = "xyz"[:dimensions]
        rows = dict(zip([*axes, *(f"v{a}" for a in axes)], self.states, strict=True))
        self.heard = np.empty((2 * dimensions, 20 * n))
        heard = dict(zip([*(f"h{a}" for a in axes), *(f"hv{a}" for a in axes)], self.heard, strict=True))
        self.flock = Flock((rows | heard).__getitem__, dimensions, Itself())
        most = cells.MAX_CELLS_PER_AGENT * n + cells.SPARE
        self.starts, self.tally = np.zeros(most + 1, int), np.zeros(cells.CHUNKS * most, int)
        self.cell_of, self.whose = np.zeros(n, int), np.zeros(n, int)
        self.packed, self.flat = np.zeros((n, 2 * dimensions)), np.zeros((2 * dimensions, n + words.BLOCK))
        boxed = cells.cell_box(
            n, near, cells.MAX_CELLS_PER_AGENT * n, self.flock, self.numbers, self.states, plan=self.plan
        )
        self.low = boxed[0]
        self.sides, self.count = cells.sort_by_cells(
            n, self.flock, self.starts, self.tally, self.cell_of, self.packed, self.flat, self.whose, lambda: boxed,
            plan=self.plan,
        )  # fmt: skip

    def around(self, line):
        """States of all who lie around a line of cells at the image they are met at, and where slabs begin."""
        oy, oz = cells.line_position(line, self.count)
        room = cells.agents_around(oy, oz, self.starts, self.count, plan=self.plan)
        box, who = self.heard[:, : room + 2 * words.BLOCK], np.zeros(room + 2 * words.BLOCK, int)
        slab, middle, found = cells.copy_line(
            oy, oz, SortedCells(self.starts, self.whose, self.packed, self.flat, self.count), self.whose, box,
            FlightView(self.plan, None, self.flock, self.numbers, None, None), carried=((cells.WHO, who),),
        )  # fmt: skip
        assert found <= room
        cells.pad_candidates(found, box, box[self.plan.dimensions :], plan=self.plan, carried=((cells.WHO, who),))
        return (oy, oz), box, who, slab, middle, found


@pytest.mark.parametrize(("dimensions", "periodic"), KINDS)
def test_everybody_lies_once_in_the_own_cell_and_cells_are_wide_enough(dimensions, periodic, seed):
    flock = Sorted(seed, dimensions, periodic)
    assert (flock.sides[:dimensions] >= flock.near).all() and np.prod(
        flock.count
    ) <= cells.MAX_CELLS_PER_AGENT * flock.n + cells.SPARE
    assert sorted(flock.whose) == list(range(flock.n))
    np.testing.assert_array_equal(flock.packed, flock.states[:, flock.whose].T)
    np.testing.assert_array_equal(flock.flat[:, : flock.n], flock.packed.T)
    at = (flock.states[:dimensions] - flock.low[:dimensions, None]) / flock.sides[:dimensions, None]
    place = np.clip(at.astype(int), 0, flock.count[:dimensions, None] - 1)
    cell = np.ravel_multi_index(tuple(place[::-1]), tuple(flock.count[:dimensions][::-1]))
    for number in range(np.prod(flock.count)):
        members = flock.whose[flock.starts[number] : flock.starts[number + 1]]
        assert sorted(members) == list(np.flatnonzero(cell == number))


@pytest.mark.parametrize(("dimensions", "periodic"), KINDS)
def test_around_each_agent_lie_all_who_are_near_each_once(dimensions, periodic, seed):
    flock = Sorted(seed, dimensions, periodic)
    x, near, met = flock.states[:dimensions], flock.near, 0
    for line in range(flock.count[1] * flock.count[2]):
        (oy, oz), box, who, slab, middle, found = flock.around(line)
        assert (box[:dimensions, found : found + words.BLOCK] == words.AWAY).all()
        assert (who[found : found + words.BLOCK] == -1).all()
        for ox in range(flock.count[0]):
            here = (oz * flock.count[1] + oy) * flock.count[0] + ox
            first, end = slab[ox], slab[ox + 3]
            for e in range(flock.starts[here], flock.starts[here + 1]):
                own = flock.whose[e]
                offset = box[:dimensions, first:end] - x[:, own, None]
                close = np.linalg.norm(offset, axis=0) <= near
                straight = x - x[:, own, None]
                if periodic:
                    straight -= 2.0 * flock.half[:, None] * np.round(straight / (2.0 * flock.half[:, None]))
                expected = np.flatnonzero(np.linalg.norm(straight, axis=0) <= near)
                assert sorted(who[first:end][close]) == list(expected)
                assert who[middle[ox] + e - flock.starts[here]] == own
                met += len(expected) - 1
    assert met > 0
