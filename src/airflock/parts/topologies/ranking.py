"""Ranking: the k-th least of many numbers, by a heap of the k least so far."""

from airflock.core import FAR

HEARD_LIMIT = 0.5 * FAR  # what lies beyond belongs to nobody who is heard


def kth_least(n, values, heap, k):
    """The k-th least of the first n numbers that lie below HEARD; HEARD if there are fewer.

    heap : scratch of n numbers; the greatest of the k least lies in front
    """
    # A heap of the k least in one pass: k is small and n may be thousands, and sorting would need
    # memory in a kernel. The limit is compared with the very numbers among which it was found, so
    # that rounding cannot lose the k-th.
    size = 0
    worst = HEARD_LIMIT
    for j in range(n):
        value = values[j]
        if value < worst:
            if size < k:
                at = size
                size = size + 1
                while at > 0 and heap[(at - 1) // 2] < value:
                    heap[at] = heap[(at - 1) // 2]
                    at = (at - 1) // 2
                heap[at] = value
            else:
                at = 0
                below = 1
                while below < size:
                    if below + 1 < size and heap[below + 1] > heap[below]:
                        below = below + 1
                    if heap[below] <= value:
                        below = size
                    else:
                        heap[at] = heap[below]
                        at = below
                        below = 2 * at + 1
                heap[at] = value
            if size == k:
                worst = heap[0]
    return worst
