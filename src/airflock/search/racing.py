"""Racing inside a generation: a candidate that can no longer reach the better half is not flown further.

Candidates fly the same seeds, one after another. A candidate is dropped when even its optimistic mean, in which all
flights that are left are as good as the best one of the generation so far, lies below the mean of the candidate in the
middle. CMA-ES moves by the better half, so only that has to be told apart. Birattari et al. 2002 race with tests of
ranks; ours needs no level, as a bound of what is left takes its place.
"""

from collections.abc import Sequence

SeedValues = Sequence[float | None]


def remaining_candidates(
    values: Sequence[SeedValues], remaining: Sequence[int], seeds_left: int, maximise: bool
) -> list[int]:
    """Which candidates of `alive` fly on.

    values : (candidate, seed so far) of all candidates of the generation; None: failed, which ends a candidate
    left   : seeds that are still to come
    """
    sign = 1.0 if maximise else -1.0
    told = [[sign * value for value in row if value is not None] for row in values]
    failed = [len(row) < len(given) for row, given in zip(told, values, strict=True)]
    means = [-float("inf") if lost or not row else sum(row) / len(row) for row, lost in zip(told, failed, strict=True)]
    best = max((value for row in told for value in row), default=0.0)
    needed = sorted(means, reverse=True)[(len(means) + 1) // 2 - 1]
    return [
        i
        for i in remaining
        if not failed[i] and (sum(told[i]) + seeds_left * best) / (len(told[i]) + seeds_left) >= needed
    ]
