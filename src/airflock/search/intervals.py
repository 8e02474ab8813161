"""Intervals of means over flights."""

from collections.abc import Sequence

import numpy as np
from scipy import stats


def mean_interval(values: Sequence[float]) -> tuple[float, float, float, float]:
    """Mean, SD, and Student's 95 % interval of the mean."""
    x = np.array(values, float)
    mean, sd = float(x.mean()), float(x.std(ddof=1)) if len(x) > 1 else 0.0
    half = float(stats.t.ppf(0.975, len(x) - 1)) * sd / len(x) ** 0.5 if len(x) > 1 else 0.0
    return mean, sd, mean - half, mean + half
