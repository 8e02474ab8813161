"""Collisions of the flights on a page: which are listed, and which of them are still going on."""

from collections.abc import Iterable
from typing import NamedTuple

MAX_KEPT = 2000  # collisions that are remembered; of more the latest
MAX_LISTED = 40  # that are listed: the latest
BOTH_PANES = -1  # side of what happened before a fork: it belongs to both
AgentPair = tuple[int, int]


class Collision(NamedTuple):
    """Two agents nearer than a collision: since when, s, on which side, and who."""

    time: float
    side: int
    first: int
    second: int


class CollisionList:
    """All collisions up to now, as a page saw them from frame to frame.

    A pair that stays near is one collision. What lies ahead of an earlier moment is forgotten when the flight goes back
    to it, for another future may follow; a pair that touches again is a collision again.
    """

    def __init__(self) -> None:
        self._last_seen: dict[Collision, float] = {}  # in the order of their begin; when each was last seen, s
        self._ongoing: dict[tuple[int, AgentPair], Collision] = {}

    @property
    def listed(self) -> list[Collision]:
        """The latest, newest first."""
        return sorted(self._last_seen, reverse=True)[:MAX_LISTED]

    def add_frame(self, time: float, pane: int, touching: Iterable[AgentPair]) -> None:
        """Take the pairs of a side that are nearer than a collision at a time, s."""
        pairs = set(touching)
        for key in [key for key in self._ongoing if key[0] == pane and key[1] not in pairs]:
            del self._ongoing[key]
        for pair in sorted(pairs):
            found = self._ongoing.setdefault((pane, pair), Collision(time, pane, *pair))
            self._last_seen[found] = time
        while len(self._last_seen) > MAX_KEPT:
            del self._last_seen[next(iter(self._last_seen))]

    def go_back(self, time: float, pane_count: int) -> None:
        """Forget what began after a time, s, and what belongs to a side that is gone; the rest may go on from there."""
        kept = {c: min(last, time) for c, last in self._last_seen.items() if c.time <= time and c.side < pane_count}
        still = [c for c, last in self._last_seen.items() if c in kept and last >= time]
        self._last_seen = kept
        self._ongoing = {
            (side, c[2:]): c for c in still for side in (range(pane_count) if c.side == BOTH_PANES else [c.side])
        }

    def fork(self) -> None:
        """A second side begins with the past of the first."""
        self._renamed({0: BOTH_PANES, BOTH_PANES: BOTH_PANES})

    def join(self, pane: int) -> None:
        """One side goes on alone."""
        self._renamed({pane: 0, BOTH_PANES: 0})

    def _renamed(self, names: dict[int, int]) -> None:
        going = {c: key for key, c in self._ongoing.items()}
        self._last_seen = {
            c._replace(side=names[c.side]): last for c, last in self._last_seen.items() if c.side in names
        }
        self._ongoing = {}
        for c, (_, pair) in going.items():
            if c.side in names:
                new = c._replace(side=names[c.side])
                self._ongoing |= {(side, pair): new for side in ((0, 1) if new.side == BOTH_PANES else (0,))}

    def clear(self) -> None:
        """Forget all: other flights."""
        self._last_seen, self._ongoing = {}, {}
