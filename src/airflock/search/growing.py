"""Growing flights: a search begins with short flights and ends with whole ones.

Most of what a search tries first does not fly at all, and an eighth of a flight tells so. The length doubles as soon
as half of a generation is as good as the best of the first generation of that length; also where all are equal, and
at the latest after a share of all generations. This compares values of one length with each other and nothing else,
so it holds for any objective. Lengths follow from stored fitness alone: a search that is continued comes to the same
ones.
"""

from collections.abc import Sequence
from statistics import median

SHARES = (0.125, 0.25, 0.5, 1.0)  # of the scenario's duration
LONGEST = 8  # of all generations, at most one in so many has each length but the last


class FlightLength:
    """Share of a whole flight that the next generation flies; told of each generation's first objective."""

    def __init__(self, generations: int, maximise: bool, *, growing: bool):
        """`generations` of the whole run; without `growing` all flights are whole."""
        self.left = list(SHARES) if growing else [1.0]
        self.most, self.sign = max(1, generations // LONGEST), 1.0 if maximise else -1.0
        self.flown, self.aim = 0, 0.0

    @property
    def share(self) -> float:
        """Of the scenario's duration."""
        return self.left[0]

    @property
    def whole(self) -> bool:
        """Whether flights are as long as the scenario says."""
        return len(self.left) == 1

    def end_generation(self, values: Sequence[float | None]) -> None:
        """First objective of all candidates of a generation; None: failed, worse than all others."""
        if self.whole:
            return
        found = [-float("inf") if value is None else self.sign * value for value in values]
        if not self.flown:
            self.aim = max(found)
        self.flown += 1
        reached = self.flown > 1 and median(found) >= self.aim
        if reached or max(found) == min(found) or self.flown >= self.most:
            self.left, self.flown = self.left[1:], 0
