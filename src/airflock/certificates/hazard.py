"""Whether events come evenly: a rate per hour says something of longer and shorter flights only if they do."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import binomtest

FEWEST = 10  # events below which nothing is said
SUSPICIOUS = 0.01  # a chance of less than this is no chance


@dataclass(frozen=True)
class EventTiming:
    """Events of the first half of flights against what an even rate would give.

    events, early : first events of a flight, and those in its first half
    expected : share in the first half if the rate is even; chance : of a difference as large as this one
    """

    events: int
    early: int
    expected: float
    chance: float

    @property
    def verdict(self) -> str:
        """even, uneven, or too few events to say."""
        if self.events < FEWEST:
            return "too few events to say"
        return "uneven" if self.chance < SUSPICIOUS else "even"


def event_timing(times: Sequence[float], flights: int, duration: float) -> EventTiming:
    """Compare the times (s) of first events of so many flights with an even rate.

    An even rate h leaves 1 - p = exp(-h T) of the flights without an event, and of those with one the share
    (1 - sqrt(1 - p)) / p has it in the first half.
    """
    events, early = len(times), sum(1 for t in times if t <= 0.5 * duration)
    p = min(events / max(flights, 1), 1.0 - 1e-9)
    expected = 0.5 if p <= 0.0 else (1.0 - math.sqrt(1.0 - p)) / p
    chance = float(binomtest(early, events, expected).pvalue) if events else 1.0
    return EventTiming(events, early, expected, chance)
