"""Hills of the likelihood of a reception curve: the highest along the far distance, and how wide it is.

Four numbers (`radios.links`): near, far (m) and the shares received there. They are sought unbounded, as `unpacked`
reads them.
"""

from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize

LINKS = ("near", "far", "received_near", "received_far")
ALIKE = 3.0  # of log-likelihood: half of a chi-square at 95 % and what the descent leaves open
FARS = 20  # lengths of far that are tried, and from where the others are fitted:
SHARES, RATIOS = (0.2, 0.5), (0.0, -1.5)  # of near in far; of the far share in the near one, by its logit
RESTARTS = 6  # of a descent
HARDLY = 1.92  # of log-likelihood: half of a chi-square at 95 %
EASE = 0.05  # pull along a profile by a half interval, beside the square of what the loss is off the limit
PULLS = 3  # each with the half interval that the one before found


def lowest(loss: Any, farthest: float) -> list[Any]:
    """Best of the hills of the likelihood along far: a longer far hides behind a smaller share there.

    At each of many lengths of far the other three are fitted; from each length that is better than both beside it all
    four are. Returns the best, and others that are nearly as likely.
    """
    fars = np.geomspace(0.08, 0.9, FARS) * farthest
    profile = [min((_beside(loss, far, *start) for start in product(SHARES, RATIOS)), key=_fun) for far in fars]
    height = np.array([np.inf, *(_fun(found) for found in profile), np.inf])
    tops = np.flatnonzero((height[1:-1] <= height[:-2]) & (height[1:-1] <= height[2:]))
    found = sorted((_settled(loss, placed(fars[k], profile[k].x)) for k in tops), key=_fun)
    return [np.asarray(each.x) for each in found if _fun(each) < _fun(found[0]) + ALIKE]


def _fun(found: Any) -> float:
    return float(found.fun)


def placed(far: float, y: Any) -> Any:
    """Unbounded numbers of a far (m) and of the other three: logit of near over far, then as `unpacked` reads them."""
    near = far / (1.0 + np.exp(-np.clip(y[0], -8.0, 8.0)))
    return np.array([np.log(near), np.log(far - near), y[1], y[2]])


def _beside(loss: Any, far: float, share: float, ratio: float) -> Any:
    """The other three numbers at a given far."""
    start = [np.log(share / (1.0 - share)), 2.5, ratio]
    return minimize(
        lambda y: loss(placed(far, y)), start, method="Nelder-Mead", options={"maxiter": 120, "fatol": 0.05}
    )


def _settled(loss: Any, z: Any) -> Any:
    """A descent in all four; a simplex that has shrunk on a slope is spread again."""
    options = {"maxiter": 400, "xatol": 1e-3, "fatol": 1e-2}
    found = minimize(loss, z, method="Nelder-Mead", options=options)
    for _ in range(RESTARTS):
        before = _fun(found)
        found = minimize(loss, found.x, method="Nelder-Mead", options=options)
        if _fun(found) > before - 0.1:
            break
    return found


def unpacked(z: Any) -> tuple[float, float, float, float]:
    """Give near, far (m), received_near, received_far from unbounded numbers."""
    near = float(np.exp(z[0]))
    high = 1.0 / (1.0 + np.exp(-z[2]))
    return near, near + float(np.exp(z[1])), float(high), float(high / (1.0 + np.exp(-z[3])))


def intervals(loss: Any, z: Any) -> dict[str, tuple[float, float]]:
    """95 % intervals: least and largest of each number where the likelihood is hardly lower (its profile).

    Curvature says too little where a share is nearly 1, or where far and the share there make up for each other.
    """
    limit, spread, values = float(loss(z)) + HARDLY, _spread(loss, z), unpacked(z)
    found = {}
    for k, name in enumerate(LINKS):
        ends = [_farthest(loss, z, limit, k, side, float(spread[k])) for side in (-1.0, 1.0)]
        found[name] = min(ends[0], values[k]), max(ends[1], values[k])
    return found


def _farthest(loss: Any, z: Any, limit: float, k: int, side: float, wide: float) -> float:
    """Value of number k, as far as it goes to one side, where the loss reaches the limit; wide: a guess of how far."""
    x, value = np.asarray(z, float), unpacked(z)[k]
    for _ in range(PULLS):
        pull = EASE * side / max(wide, 1e-4 * value)
        x = np.asarray(
            minimize(
                lambda y, pull=pull: min(float(loss(y)) - limit, 1e6) ** 2 - pull * unpacked(y)[k], x,
                method="Nelder-Mead", options={"maxiter": 200, "fatol": 1e-4},
            ).x
        )  # fmt: skip
        if loss(x) > limit:  # too far: back on the line to where it reaches the limit
            back = x
            x = z + brentq(lambda t, back=back: float(loss(z + t * (back - z))) - limit, 0.0, 1.0) * (x - z)
        wide = abs(unpacked(x)[k] - value)
    return unpacked(x)[k]


def _spread(loss: Any, z: Any) -> Any:
    """Half of 95 % intervals by the curvature and the derivative of the numbers by what is fitted."""
    step, size = 0.02, len(z)
    unit, curve = np.eye(size) * step, np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            curve[i, j] = (
                loss(z + unit[i] + unit[j]) - loss(z + unit[i] - unit[j])
                - loss(z - unit[i] + unit[j]) + loss(z - unit[i] - unit[j])
            ) / (4.0 * step * step)  # fmt: skip
    by = np.array([(np.array(unpacked(z + u)) - np.array(unpacked(z - u))) / (2 * step) for u in unit]).T
    return 1.96 * np.sqrt(np.clip(np.diag(by @ np.linalg.pinv(curve) @ by.T), 0.0, None))
