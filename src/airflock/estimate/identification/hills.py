"""Hills of the likelihood of a reception curve: the highest along the far distance, and how wide it is.

Four numbers (`parts.radios.links`): near, far (m) and the shares received there. They are sought unbounded, as
`unpack` reads them.
"""

import math
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import minimize

from airflock.estimate.identification.derivatives import hessian

CURVE_PARAMETERS = ("near", "far", "received_near", "received_far")
ALIKE = 3.0  # of log-likelihood: half of a chi-square at 95 % and what the descent leaves open
FARS = 20  # lengths of far that are tried, and from where the others are fitted:
SHARES, RATIOS = (0.2, 0.5), (0.0, -1.5)  # of near in far; of the far share in the near one, by its logit
BETWEEN = 20.0  # of log-likelihood above the best of these lengths, up to which all four are fitted from there
SAME = 0.01  # relative distance of two lengths of far up to which they are one hill
RESTARTS = 6  # of a descent
HARDLY = 1.92  # of log-likelihood: half of a chi-square at 95 %
LOOKS = 20  # at values of a number, for one end of its interval
CLOSE = 0.02  # share of half an interval to which its end is found
FLAT = 0.005  # distance of a share from 0 and 1 at which a search begins at least
NEAREST, FARTHEST = (0.1, 0.2, 1e-5, 1e-5), (1e4, 1e4, 1.0 - 1e-5, 1.0 - 1e-5)  # edges of what is looked at


def best_mode(loss: Any, farthest: float) -> list[Any]:
    """Best of the hills of the likelihood along far: a longer far hides behind a smaller share there.

    At each of many lengths of far the other three are fitted; all four are from each length that is better than both
    beside it, or likely enough for a hill to stand between it and the next. Returns the best, and others that are
    nearly as likely.
    """
    fars = np.geomspace(0.08, 0.9, FARS) * farthest
    profile = [min((_beside(loss, far, *start) for start in product(SHARES, RATIOS)), key=_fun) for far in fars]
    height = np.array([np.inf, *(_fun(found) for found in profile), np.inf])
    tops = (height[1:-1] <= height[:-2]) & (height[1:-1] <= height[2:])
    tops |= height[1:-1] < height.min() + BETWEEN
    ends = sorted((_settled(loss, pack_at_far(fars[k], profile[k].x)) for k in np.flatnonzero(tops)), key=_fun)
    found: list[Any] = []
    for each in (np.asarray(end.x) for end in ends if _fun(end) < _fun(ends[0]) + ALIKE):
        if all(abs(unpack(each)[1] / unpack(other)[1] - 1.0) > SAME for other in found):
            found.append(each)
    return found


def _fun(found: Any) -> float:
    return float(found.fun)


def pack_at_far(far: float, y: Any) -> Any:
    """Unbounded numbers of a far (m) and of the other three: logit of near over far, then as `unpack` reads them."""
    near = far / (1.0 + np.exp(-np.clip(y[0], -8.0, 8.0)))
    return np.array([np.log(near), np.log(far - near), y[1], y[2]])


def _beside(loss: Any, far: float, share: float, ratio: float) -> Any:
    """The other three numbers at a given far."""
    start = [np.log(share / (1.0 - share)), 2.5, ratio]
    return minimize(
        lambda y: loss(pack_at_far(far, y)), start, method="Nelder-Mead", options={"maxiter": 120, "fatol": 0.05}
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


def unpack(z: Any) -> tuple[float, float, float, float]:
    """Give near, far (m), received_near, received_far from unbounded numbers."""
    near = float(np.exp(z[0]))
    high = 1.0 / (1.0 + np.exp(-z[2]))
    return near, near + float(np.exp(z[1])), float(high), float(high / (1.0 + np.exp(-z[3])))


def pack(near: float, far: float, received_near: float, received_far: float) -> Any:
    """Unbounded numbers that `unpack` reads as these; shares of 0 and 1 are moved to the edge of what is sought."""
    high = _logit(received_near)
    return np.array([np.log(near), np.log(max(far - near, 1e-5)), high, _logit(received_far * (1.0 + np.exp(-high)))])


def profile_intervals(loss: Any, z: Any) -> dict[str, tuple[float, float]]:
    """95 % intervals: least and largest of each number where the likelihood is hardly lower (its profile).

    At each value of a number the other three are fitted anew. Curvature says too little where a share is nearly 1, or
    where far and the share there make up for each other along a ridge.
    """
    lowest_loss, spread, values = float(loss(z)), _spread(loss, z), unpack(z)
    ends = np.array([values, values])
    for k in range(len(CURVE_PARAMETERS)):
        for row, side in enumerate((-1.0, 1.0)):
            end, likely = _end(loss, values, lowest_loss, k, side, float(spread[k]))
            for place in likely:  # numbers that are likely enough together are so for each of them
                ends = np.array([np.minimum(ends[0], place), np.maximum(ends[1], place)])
            ends[row, k] = max(side * ends[row, k], side * end) * side
    return {name: (float(low), float(high)) for name, low, high in zip(CURVE_PARAMETERS, *ends, strict=True)}


def _end(
    loss: Any, values: tuple[float, ...], lowest_loss: float, k: int, side: float, wide: float
) -> tuple[float, list[Any]]:
    """Value of number k on one side where its profile reaches the limit, and likely numbers that were met on the way.

    values : the likeliest four numbers; wide : a guess of how far the end is
    """
    likely: list[Any] = []
    edge = (FARTHEST if side > 0.0 else NEAREST)[k]
    near, there = values[k], np.asarray(values)  # within the limit so far, and all numbers there
    step, low, high = float(np.clip(wide, 0.01 * near, 0.3 * near)), -(HARDLY**0.5), math.inf
    beyond = near
    for _ in range(LOOKS):
        if math.isinf(high):  # farther, until the likelihood is too low
            beyond = near + side * step
            beyond = min(beyond, edge) if side > 0.0 else max(beyond, edge)
            tried, step = beyond, 2.0 * step
        else:  # the root of the loss grows as a straight line: where that meets the limit
            tried = near + (beyond - near) * float(np.clip(low / (low - high), 0.1, 0.9))
        off, place = _others(loss, k, tried, there)
        above = max(off - lowest_loss, 0.0) ** 0.5 - HARDLY**0.5
        if above > 0.0:
            beyond, high = tried, above
        else:
            near, low, there = tried, above, place
            likely.append(place)
        if near == edge or (abs(beyond - near) < CLOSE * abs(beyond - values[k]) and not math.isinf(high)):
            break
    return (near if math.isinf(high) else near + (beyond - near) * low / (low - high)), likely


def _others(loss: Any, k: int, value: float, there: Any) -> tuple[float, Any]:
    """Least loss where number k has a value, and all four numbers there; the search begins with numbers elsewhere."""

    def all_four(y: Any) -> Any:
        one, two, three = np.clip(y, -11.9, 11.9)
        if k == 1:
            near, far, high = value * _share(one), value, _share(two)
        else:
            near = value if k == 0 else float(np.exp(one))
            far = near + float(np.exp(one if k == 0 else two))
            high = value if k == 2 else _share(two)
        if k == 3:
            return near, far, value + (1.0 - value) * _share(three), value
        return near, far, high, high * _share(three)

    near, far, high, low = there
    gap, top, ratio = (  # not on the plateau at a share of 1, where nothing has a slope
        float(np.log(max(far - near, 0.01))), _logit(high, FLAT), _logit(low / high, FLAT)
    )  # fmt: skip
    start = {
        0: (gap, top, ratio),
        1: (_logit(near / far, FLAT), top, ratio),
        2: (float(np.log(near)), gap, ratio),
        3: (float(np.log(near)), gap, _logit((high - value) / (1.0 - value), FLAT)),
    }[k]
    simplex = np.vstack([start, *(np.asarray(start) + 0.1 * side for side in np.eye(3))])
    found = minimize(
        lambda y: loss(pack(*all_four(y))), start, method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxiter": 250, "fatol": 0.01, "xatol": 0.01},
    )  # fmt: skip
    return _fun(found), np.asarray(all_four(found.x))


def _share(y: float) -> float:
    return float(1.0 / (1.0 + np.exp(-y)))


def _logit(share: float, edge: float = 1e-5) -> float:
    inside = min(max(share, edge), 1.0 - edge)
    return float(np.log(inside / (1.0 - inside)))


def _spread(loss: Any, z: Any) -> Any:
    """Half of 95 % intervals by the curvature and the derivative of the numbers by what is fitted."""
    step = 0.02
    unit = np.eye(len(z)) * step
    by = np.array([(np.array(unpack(z + u)) - np.array(unpack(z - u))) / (2 * step) for u in unit]).T
    return 1.96 * np.sqrt(np.clip(np.diag(by @ np.linalg.pinv(hessian(loss, z, step)) @ by.T), 0.0, None))
