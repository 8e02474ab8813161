"""The k strongest signals of those who are heard, by path loss over distance with log-normal fading.

A signal loses 10 · exponent decibels with each tenfold distance, `wall` decibels behind something
that stands in the world, and a normal number of `fading` decibels that is drawn for each pair and
decision, the same both ways. On board nothing is drawn: there the distance and the map decide. All
who are as strong as the k-th are met as well. Our definition.
"""

import math

from airflock.parts.topologies.ranking import HEARD_LIMIT, kth_least

DECIBELS = 10.0 / math.log(10.0)


def loss(r2, hidden, fade, t):
    """Path loss over a squared distance (m²), dB above that over 1 m without fading.

    hidden : 1.0 where something stands in between; fade : normal number of the pair
    """
    return 0.5 * t.exponent * DECIBELS * math.log(r2) + t.wall * hidden + t.fading * fade


def meet(n, r2, hidden, fade, met, weak, heap, t):
    """Fill `met`: 1.0 for each of the first n whose signal is no weaker than the k-th strongest.

    weak, heap : scratch
    """
    for j in range(n):
        weak[j] = loss(r2[j], hidden[j], fade[j], t) if r2[j] < HEARD_LIMIT else 2.0 * HEARD_LIMIT
    limit = kth_least(n, weak, heap, int(t.k))
    for j in range(n):
        met[j] = 1.0 if weak[j] <= limit and r2[j] < HEARD_LIMIT else 0.0
