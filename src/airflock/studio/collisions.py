"""Collisions of the flights on a page: which are listed, and which of them are still going on."""

from collections.abc import Iterable
from typing import NamedTuple

KEPT = 2000  # collisions that are remembered; of more the latest
LISTED = 40  # that are listed: the latest
BOTH = -1  # side of what happened before a fork: it belongs to both
Pair = tuple[int, int]


class Collision(NamedTuple):
    """Two agents nearer than a collision: since when, s, on which side, and who."""

    time: float
    side: int
    first: int
    second: int


class Collisions:
    """All collisions up to now, as a page saw them from frame to frame.

    A pair that stays near is one collision. What lies ahead of an earlier moment is forgotten when the flight goes back
    to it, for another future may follow; a pair that touches again is a collision again.
    """

    def __init__(self) -> None:
        self._last: dict[Collision, float] = {}  # in the order of their begin; when each was last seen, s
        self._on: dict[tuple[int, Pair], Collision] = {}

    @property
    def listed(self) -> list[Collision]:
        """The latest, newest first."""
        return sorted(self._last, reverse=True)[:LISTED]

    def see(self, time: float, side: int, touching: Iterable[Pair]) -> None:
        """Take the pairs of a side that are nearer than a collision at a time, s."""
        pairs = set(touching)
        for key in [key for key in self._on if key[0] == side and key[1] not in pairs]:
            del self._on[key]
        for pair in sorted(pairs):
            found = self._on.setdefault((side, pair), Collision(time, side, *pair))
            self._last[found] = time
        while len(self._last) > KEPT:
            del self._last[next(iter(self._last))]

    def back(self, time: float, sides: int) -> None:
        """Forget what began after a time, s, and what belongs to a side that is gone; the rest may go on from there."""
        kept = {c: min(last, time) for c, last in self._last.items() if c.time <= time and c.side < sides}
        still = [c for c, last in self._last.items() if c in kept and last >= time]
        self._last = kept
        self._on = {(side, c[2:]): c for c in still for side in (range(sides) if c.side == BOTH else [c.side])}

    def fork(self) -> None:
        """A second side begins with the past of the first."""
        self._renamed({0: BOTH, BOTH: BOTH})

    def join(self, side: int) -> None:
        """One side goes on alone."""
        self._renamed({side: 0, BOTH: 0})

    def _renamed(self, names: dict[int, int]) -> None:
        going = {c: key for key, c in self._on.items()}
        self._last = {c._replace(side=names[c.side]): last for c, last in self._last.items() if c.side in names}
        self._on = {}
        for c, (_, pair) in going.items():
            if c.side in names:
                new = c._replace(side=names[c.side])
                self._on |= {(side, pair): new for side in ((0, 1) if new.side == BOTH else (0,))}

    def clear(self) -> None:
        """Forget all: other flights."""
        self._last, self._on = {}, {}
