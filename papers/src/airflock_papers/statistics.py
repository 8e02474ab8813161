"""Statistics of a few dozen flights: intervals, ranks, ratios of over-dispersed counts."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

RESAMPLES = 4000


class Estimate(NamedTuple):
    """A value with its SD over runs and its 95 % interval, as the fields of a claim."""

    ours: float
    sd: float | None
    low: float | None
    high: float | None
    runs: int


def one(value: float, runs: int = 1) -> Estimate:
    """A value without a spread: an extreme, a count, a result of many flights at once."""
    return Estimate(float(value), None, None, None, runs)


def mean(values: ArrayLike) -> Estimate:
    """Mean with Student's 95 % interval."""
    x = _clean(values)
    m, sd = float(x.mean()), float(x.std(ddof=1))
    half = float(stats.t.ppf(0.975, x.size - 1)) * sd / x.size**0.5
    return Estimate(m, sd, m - half, m + half, x.size)


def median(values: ArrayLike) -> Estimate:
    """Median with a bootstrap interval."""
    x = _clean(values)
    low, high = _interval(_resampled(x, np.median))
    return Estimate(float(np.median(x)), float(x.std(ddof=1)), low, high, x.size)


def difference(a: ArrayLike, b: ArrayLike) -> Estimate:
    """Mean of a minus mean of b with Welch's interval."""
    x, y = _clean(a), _clean(b)
    vx, vy = float(x.var(ddof=1)) / x.size, float(y.var(ddof=1)) / y.size
    gap = float(x.mean() - y.mean())
    if vx + vy == 0.0:
        return Estimate(gap, None, gap, gap, x.size + y.size)
    freedom = (vx + vy) ** 2 / (vx**2 / (x.size - 1) + vy**2 / (y.size - 1))  # Welch and Satterthwaite
    half = float(stats.t.ppf(0.975, freedom)) * (vx + vy) ** 0.5
    return Estimate(gap, None, gap - half, gap + half, x.size + y.size)


def ratio(a: ArrayLike, b: ArrayLike) -> Estimate:
    """Mean of a over mean of b with a bootstrap interval: for counts whose variance exceeds their mean.

    Nothing over nothing is not a number, and says nothing: where a resample has no count on either side, the quotient
    may be anything from 0 to infinity, so that the interval reaches there.
    """
    x, y = _clean(a), _clean(b)
    below = _resampled(y, np.mean)
    tops = _resampled(x, np.mean, seed=1)
    quotients = np.divide(tops, below, out=np.full_like(tops, np.inf), where=below > 0.0)
    low = _interval(np.where((tops == 0.0) & (below == 0.0), 0.0, quotients))[0]
    high = _interval(quotients)[1]
    nothing = np.nan if x.mean() == 0.0 else np.inf
    return Estimate(float(x.mean() / y.mean()) if y.mean() > 0.0 else nothing, None, low, high, x.size)


def rank_test(a: ArrayLike, b: ArrayLike) -> float:
    """Two-sided p of the Mann-Whitney test that a and b come from one distribution."""
    return float(stats.mannwhitneyu(_clean(a), _clean(b), alternative="two-sided").pvalue)


def welch(a: Estimate, published: float, published_sd: float, published_runs: int) -> float:
    """Two-sided p of Welch's test against a published mean and SD."""
    if not a.sd and not published_sd:
        return 1.0 if a.ours == published else 0.0
    return float(
        stats.ttest_ind_from_stats(
            a.ours, a.sd, a.runs, published, published_sd, published_runs, equal_var=False
        ).pvalue
    )


def _clean(values: ArrayLike) -> NDArray[np.float64]:
    x: NDArray[np.float64] = np.asarray(values, dtype=np.float64)
    return x[np.isfinite(x)]


def _resampled(x: NDArray[np.float64], of: Callable[..., Any], seed: int = 0) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return np.asarray(of(rng.choice(x, (RESAMPLES, x.size)), axis=1), dtype=float)


def _interval(x: NDArray[np.float64]) -> tuple[float, float]:
    # nearest ranks, so that an infinite quotient never meets a finite one in an interpolation
    low, high = np.quantile(x, [0.025, 0.975], method="nearest")
    return float(low), float(high)
