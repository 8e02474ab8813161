"""P values of many tests, corrected so that chance alone rejects no row of a long table."""

import math
from collections.abc import Sequence


def holm_correction(p_values: Sequence[float]) -> list[float]:
    """Correct p values by Holm's step-down method (1979), in their order; nan stays nan and counts as no test."""
    order = sorted((p, k) for k, p in enumerate(p_values) if math.isfinite(p))
    corrected, most = [math.nan] * len(p_values), 0.0
    # The running maximum keeps corrected values in the order of the raw ones.
    for rank, (p, k) in enumerate(order):
        most = max(most, min(1.0, (len(order) - rank) * p))
        corrected[k] = most
    return corrected
