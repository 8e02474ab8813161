"""Chance: how likely an event looks, from fewer flights than would show it; an estimate to compare with, no bound.

A search compares candidates that flew twice, and an event that it must avoid happens once in a thousand flights. What
two flights do tell is how far from the limit they ended: by the reliability index of Cornell (1969), the mean distance
from the limit in standard deviations. A normal variate lies beyond it with the probability of the event.

From ENOUGH flights on a candidate has a tail of its own. The flights that came nearest, a tenth of all, show how fast
distances become rarer: as an exponential tail does, the one between tails that end and tails that are heavy (Pickands
1975). A normal tail falls faster, so that it looks more dangerous than it is, by 2 at three standard deviations. What
was counted counts, too: the smaller index is the estimate.

Of fewer flights, means are shrunk towards the mean of all candidates as far as chance explains their differences (James
& Stein 1961), and so are standard deviations, from that of the LIKE nearest to that of all. Else those that were lucky
would win. The deviation is that below the mean (Markowitz 1959): wide distances are no danger. A score that repeats
itself in more than a tenth of all flights, such as a count or an excursion that is mostly zero, has no distance from
its limit: events are counted.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from airflock.certificates.limit import EventLimit

ENOUGH = 30  # flights of one candidate
NEAREST, FEWEST = 0.1, 10  # share of its flights that show how its tail falls, and at least so many
REPEATED = 0.1  # share of flights; distances in single precision meet by chance, some of ten thousand
LIKE = 8  # candidates that share a deviation as far as they differ: wide flocks' distances vary more than narrow ones'
LEAST = 0.1  # share of a difference that is left where chance explains all: so the order of candidates stays
ScoreRow = Mapping[str, Any] | None  # scores of a flight; None: it failed


def reliability_indices(limit: EventLimit, flights: Sequence[Sequence[ScoreRow]]) -> NDArray[np.float64]:
    """Reliability index of each candidate (candidate,): standard deviations between its mean and the limit's event.

    flights : of each candidate; a flight that failed counts as the event
    """
    counted = [sum(row is None or limit.has_happened(row) for row in rows) for rows in flights]
    rooms = [np.array([_room(limit, row) for row in rows]) for rows in flights]
    every = np.concatenate(rooms)
    known = every[np.isfinite(every)]
    if len(known) < 2 or len(np.unique(known)) < (1.0 - REPEATED) * len(known):
        return np.array([_of_share(events, len(room)) for events, room in zip(counted, rooms, strict=True)])
    found = np.array([_of_share(events, len(room)) for events, room in zip(counted, rooms, strict=True)])
    sound = [bool(np.isfinite(room).all()) for room in rooms]
    few = [i for i, room in enumerate(rooms) if sound[i] and len(room) < ENOUGH]
    if few:
        found[few] = _together([rooms[i] for i in few])
    for i, room in enumerate(rooms):
        if sound[i] and len(room) >= ENOUGH:
            found[i] = min(found[i], _of_tail(room))
    return found


def estimated_probability(limit: EventLimit, flights: Sequence[ScoreRow]) -> float:
    """Estimated probability of the limit's event per flight of one candidate: no less than what was counted."""
    counted = sum(row is None or limit.has_happened(row) for row in flights) / len(flights)
    return max(counted, float(norm.sf(reliability_indices(limit, [flights])[0])) if counted < 1.0 else 1.0)


def reliability_index(probability: float) -> float:
    """The reliability index beyond which an event has this probability."""
    return float(norm.isf(probability))


def _of_share(events: int, flights: int) -> float:
    """Index of a share of flights; infinite where nothing happened, finite where it always did."""
    return reliability_index(min(events, flights - 0.5) / flights) if events else math.inf


def _of_tail(room: NDArray[np.float64]) -> float:
    """Index of one candidate, from how far its nearest flights are from the limit; infinite where that cannot tell."""
    nearest = np.sort(room)[: max(FEWEST, round(NEAREST * len(room))) + 1]
    begin, excess = nearest[-1], float((nearest[-1] - nearest[:-1]).mean())
    if begin <= 0.0 or excess == 0.0:
        return math.inf
    return reliability_index((len(nearest) - 1) / len(room) * math.exp(-begin / excess))


def _together(rooms: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Index of each candidate (candidate,), from how far their flights are from the limit."""
    sizes, own = np.array([len(room) for room in rooms]), np.array([room.mean() for room in rooms])
    squares, freedom = np.array([((room - room.mean()) ** 2).sum() for room in rooms]), sizes - 1
    left, flat = 1.0, not freedom.any()  # left of each difference, after what chance explains
    if not flat and len(rooms) > 1:
        within, between = float(squares.sum()) / int(freedom.sum()), float(own.var(ddof=1))
        left = max(LEAST, 1.0 - within * float((1.0 / sizes).mean()) / between) if between > 0.0 else LEAST
    means = own.mean() + left * (own - own.mean())
    around = np.full(len(rooms), own.mean()) if flat else means  # where each flew once: around the common mean
    away = np.concatenate([room - mean for room, mean in zip(rooms, around, strict=True)])
    below = away[away < 0.0]
    counted = len(away) - (1.0 if flat else left * len(rooms))
    variance = float((below**2).mean()) * len(away) / counted if len(below) else 0.0
    alike = variance
    if not flat:
        near = np.argsort(np.abs(own[:, None] - own[None, :]), axis=1, kind="stable")[:, :LIKE]
        alike = squares[near].sum(axis=1) / np.maximum(freedom[near].sum(axis=1), 1)
    spread = np.sqrt(left * alike + (1.0 - left) * variance)
    if len(rooms) == 1:
        spread = np.array([math.sqrt(variance)])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(spread > 0.0, means / spread, np.copysign(math.inf, means)), float)


def _room(limit: EventLimit, row: ScoreRow) -> float:
    """How far a flight's score lies on the safe side of the event, in its unit; nan where there is none."""
    found = math.nan if row is None or row.get(limit.score) is None else float(row[limit.score])
    return found - limit.value if limit.sign in ("<", "<=") else limit.value - found
