"""Moments kept while flights go on, to go back to: every few seconds at first, thinner the longer they last."""

from bisect import bisect_right

from airflock.engine import Snapshot

MAX_BYTES = 256 * 2**20  # bytes of all moments together
MAX_SNAPSHOTS = 400  # moments at most


class KeptSnapshots:
    """Snapshots in the order of their time; where there are too many, every second moment is dropped.

    every : flight seconds between two of them; doubles whenever they are thinned
    """

    def __init__(self, every: float = 2.0):
        self.interval = every
        self._kept: list[tuple[Snapshot, ...]] = []
        self._times: list[float] = []

    def __len__(self) -> int:
        return len(self._kept)

    def due(self, time: float) -> bool:
        """Whether the next moment should be kept at this time, s."""
        return not self._times or time >= self._times[-1] + self.interval - 1e-9

    def keep(self, time: float, snapshots: tuple[Snapshot, ...]) -> None:
        """Keep a moment, s, one snapshot a flight; those after it belong to a past that is given up."""
        self.forget_after(time)
        self._kept.append(snapshots)
        self._times.append(time)
        if len(self._kept) > MAX_SNAPSHOTS or sum(len(s.bytes) for moment in self._kept for s in moment) > MAX_BYTES:
            self._kept, self._times = self._kept[::2], self._times[::2]
            self.interval *= 2.0

    def forget_after(self, time: float) -> None:
        """Drop all moments at or after a time, s."""
        count = bisect_right(self._times, time - 1e-9)
        del self._kept[count:], self._times[count:]

    def at(self, time: float) -> tuple[Snapshot, ...] | None:
        """The last moment up to a time, s; the first of all if there is none before."""
        if not self._kept:
            return None
        return self._kept[max(bisect_right(self._times, time + 1e-9) - 1, 0)]
