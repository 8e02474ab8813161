"""Bounds on the probability of an event, from counts: exact, one-sided, and valid at every look together.

A look counts the events of the first n flights. Looks are at sizes that are fixed beforehand, and the j-th look pays
alpha / (j (j + 1)) of what may go wrong, which sums up to alpha over all looks that could ever be taken. So all upper
bounds hold together with the confidence that was asked for, whenever and for whatever reason counting stops, and so do
all lower ones. Upper bounds are paid for from the first size that could show the limit, lower bounds, which refute it,
from a few flights on.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count

from airflock.recordings import upper_probability_bound

EARLY = 16  # flights at the first look that could refute
GROWTH = 1.5  # ratio of two sizes: a limit is shown after at most so many times the flights that would do


def lower_bound(events: int, flights: int, confidence: float) -> float:
    """Smallest probability of an event per flight that so many events allow (Clopper and Pearson 1934, one-sided)."""
    return 1.0 - upper_probability_bound(flights - events, flights, confidence)


def alpha_share(look: int) -> float:
    """Share of alpha that look 1, 2, 3, ... pays; all of them sum up to 1."""
    return 1.0 / (look * (look + 1.0))


def flights_needed(limit: float, alpha: float) -> int:
    """Flights without any event after which the bound lies below a limit per flight."""
    return max(1, math.ceil(math.log(alpha) / math.log1p(-limit)))


def look_schedule(limit: float, alpha: float) -> Iterator[tuple[int, float, float]]:
    """Looks in their order: flights, and the alpha of the upper bound (0: not looked at) and of the lower one."""
    shows, turn, size = flights_needed(limit, alpha * alpha_share(1)), 0, float(EARLY)
    while math.ceil(size) < shows:
        turn += 1
        yield math.ceil(size), 0.0, alpha * alpha_share(turn)
        size *= GROWTH
    for k in count():
        yield math.ceil(shows * GROWTH**k), alpha * alpha_share(k + 1), alpha * alpha_share(turn + k + 1)


@dataclass(frozen=True)
class InterimLook:
    """Events among the first flights, and what they say.

    above, below : alpha that the upper and the lower bound pay; 0: it was not looked at
    low, high    : probability per flight, one-sided bounds
    """

    flights: int
    events: int
    above: float
    below: float
    low: float
    high: float


def take_look(flights: int, events: int, upper_alpha: float, lower_alpha: float) -> InterimLook:
    """Both bounds, the upper one with confidence 1 - above, the lower one with 1 - below."""
    low = lower_bound(events, flights, 1.0 - lower_alpha) if lower_alpha > 0.0 else 0.0
    high = upper_probability_bound(events, flights, 1.0 - upper_alpha) if upper_alpha > 0.0 else 1.0
    return InterimLook(flights, events, upper_alpha, lower_alpha, low, high)


def rate_per_hour(probability: float, hours: float) -> float:
    """Rate (1/h) of first events, averaged over a flight of so many hours, from the probability of one."""
    return math.inf if probability >= 1.0 else -math.log1p(-probability) / hours


def probability_per_flight(rate: float, hours: float) -> float:
    """Probability of an event in a flight of so many hours, from the rate (1/h) of first events."""
    return -math.expm1(-rate * hours)
