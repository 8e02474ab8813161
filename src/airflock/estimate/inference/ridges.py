"""Ridges: how far numbers that make up for each other can go together before the tracks are explained worse.

The numbers of a braking curve lie on a ridge of the likelihood that bends. The curvature at the fit knows its first
steps alone, and a fit that is repeated from beside its end does not walk it. So it is walked: a number is moved step by
step, all others follow, and the places on the way tell how far each of them goes. Where numbers make up for each other
in more than one way, the ridge is a surface, and the walk of one number passes by where another could have gone. So the
least certain numbers are walked each by itself, and so are those that act alike.

A number such as a largest force acts nowhere beyond some value: a plateau, to which no walk leads on. So each end of
each range is looked at by itself, with all others following there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.fit import (
    CENTRAL_SLOPES,
    FINE_SLOPES,
    MIN_FINE_STEP,
    WIDE_SLOPES,
    Fit,
    climb_to_maximum,
    curvature,
)
from airflock.estimate.inference.likelihood import FitModel

Array = NDArray[np.float64]
RidgePath = tuple[tuple[Array, float], ...]  # places, and by how much the log-likelihood has fallen there
WORST, WALKED = 4, 8  # least certain numbers, and numbers that are walked, at most
TIED = 0.9  # correlation of the slopes of two numbers, from which both are walked, however certain they seem
NESTED = 3  # numbers that act most like the moved one, which follow before all do
WINDOW, LOOKS = 0.05, 14  # of a range: on which one of them looks for its place alone, at least; and how often it looks
ALIKE = 0.5  # correlation of the slopes of two numbers, from which they act alike
SHORTEST = 0.03  # of a range: ends nearer than this by the curvature are not looked for
FIRST = 0.4  # of the way to the end that the curvature tells: first step
STRIDE = (0.01, 0.15)  # of a range: least step, but for a first one that is shorter, and longest
FASTER = 1.6  # each step is so much longer than the one before, while the likelihood hardly falls
PLACES = 16  # that are looked at, on each side of a ridge
FOLLOWS = 4  # steps of the climb by which the others follow
SHORTER = 3.0  # a step is so much shorter where the likelihood has fallen too far: the others could not follow
# log-likelihood by which a place must be better than the fit, to begin again from there: climbs that begin beside each
# other end several units apart, and from the top of a spike every way falls
HIGHER = 6.0
AGAIN = 2  # times
UNLIKELY = 20.0  # fall at the end of a range, the others where they are, beyond which they are not asked to follow


@dataclass(frozen=True)
class Ridges:
    """Places along ridges, each way from the fit, and by how much the log-likelihood has fallen there."""

    paths: tuple[RidgePath, ...]

    def ends(self, point: Array, drop: float) -> tuple[Array, Array]:
        """Least and largest places of all numbers where the log-likelihood has fallen by at most `drop`."""
        low, high = point.copy(), point.copy()
        for way in self.paths:
            for (inner, less), (outer, more) in zip(way[:-1], way[1:], strict=True):
                if less > drop:
                    break
                share = 1.0
                if more > drop:  # a parabola between the two
                    share = (drop**0.5 - less**0.5) / (more**0.5 - less**0.5)
                reached = inner + share * (outer - inner)
                low, high = np.minimum(low, reached), np.maximum(high, reached)
        return low, high


def profile_ridges(
    model: FitModel, fit: Fit, spans: Sequence[int], drop: float, on_progress: Callable[[], None] = lambda: None
) -> tuple[Fit, Ridges]:
    """Ridges through a fit, or through a better one that was met on the way, down to a fall of the likelihood.

    Other ends that the search has met, and places on the way to a better fit, are added where they are as likely: each
    by itself, for a valley may lie between.
    """
    ways: list[RidgePath] = []
    met = list(fit.others)
    for turn in range(AGAIN + 1):
        ways, better = _ways(model, fit, spans, drop, turn < AGAIN)
        on_progress()
        if better is None:
            break
        met += [fit.place, *(place for way in ways for place, _ in way)]
        fit = climb_to_maximum(model, better, fit.free, spans, slopes=(FINE_SLOPES, CENTRAL_SLOPES))
    falls = [max(model.score(u, spans).loss() - fit.score.loss(), 0.0) for u in met]
    alone = [((u, fall), (u, fall)) for u, fall in zip(met, falls, strict=True) if fall <= drop]
    return fit, Ridges((*ways, *alone))


def _ways(
    model: FitModel, fit: Fit, spans: Sequence[int], drop: float, leave: bool
) -> tuple[list[RidgePath], Array | None]:
    """Ways along all ridges; and, where it may be left for it, a better place."""
    view = CurvatureView(model, fit, spans, drop)
    named = [k for k, f in enumerate(fit.free) if f < model.named]
    worst = [k for k in sorted(named, key=lambda k: -view.reach[k]) if view.reach[k] >= SHORTEST][:WORST]
    tied = [k for k in sorted(named, key=lambda k: -view.alike[k, named].max()) if view.alike[k, named].max() > TIED]
    ways: list[RidgePath] = []
    for k, end in ((fit.free[k], end) for k in named for end in (0.0, 1.0)):
        found, fell = fit_at_end(model, fit, spans, k, end)
        if leave and fell < -HIGHER:
            return ways, found
        if fell <= drop:
            ways.append(((found, max(fell, 0.0)), (found, max(fell, 0.0))))
    for k in list(dict.fromkeys([*worst, *tied]))[:WALKED]:
        for side in (-1.0, 1.0):
            way, better = view.walk(k, side, leave)
            if better is not None:
                return ways, better
            ways.append(way)
    return ways, None


class CurvatureView:
    """What the curvature about a fit says of the ways along its numbers, by their places among the free.

    reach : how far each goes by the curvature until the likelihood has fallen by `drop`
    alike : how much any two act alike
    """

    def __init__(self, model: FitModel, fit: Fit, spans: Sequence[int], drop: float):
        curved = [curvature(model, fit, spans, way) for way in (WIDE_SLOPES, CENTRAL_SLOPES)]
        covariances = [np.linalg.inv(each) for each in curved]
        self.model, self.fit, self.spans, self.drop = model, fit, spans, drop
        self.covariance, self.alike = covariances[1], _alike(curved[1])
        self.reach: Array = np.sqrt(2.0 * drop * np.maximum(*(np.diag(each) for each in covariances)))

    def walk(self, k: int, side: float, leave: bool) -> tuple[RidgePath, Array | None]:
        """One way along the ridge of a number, down (-1) or up (1); and a better place, where it may be left for it."""
        fit, covariance = self.fit, self.covariance
        slope = np.zeros(len(fit.place))
        slope[fit.free] = covariance[k] / covariance[k, k]
        near = [g for g in np.argsort(-self.alike[k]).tolist() if self.alike[k, g] > ALIKE]
        follow = [fit.free[g] for g in near if fit.free[g] < self.model.named]
        first = FIRST * float(self.reach[k])
        return _walk(self.model, fit, self.spans, fit.free[k], follow, side * slope, first, self.drop, leave)


def fit_at_end(model: FitModel, fit: Fit, spans: Sequence[int], index: int, end: float) -> tuple[Array, float]:
    """The fit with one number at an end of its range, the others following; and the fall of the log-likelihood."""
    u = _moved(fit.place, index, end)
    fell = model.score(u, spans).loss() - fit.score.loss()
    if fell > UNLIKELY:
        return u, fell
    rest = [f for f in fit.free if f != index]
    followed = climb_to_maximum(model, u, rest, spans, FOLLOWS, slopes=(FINE_SLOPES, CENTRAL_SLOPES))
    return followed.place, followed.score.loss() - fit.score.loss()


def _slid(model: FitModel, u: Array, number: int, spans: Sequence[int], far: float) -> tuple[Array, float]:
    """A place with one number where the tracks are explained best, as far again as it has come; and the loss.

    Where single individuals are lost, the likelihood has edges, at which slopes lead nowhere.
    """
    from scipy.optimize import minimize_scalar

    def loss(x: float) -> float:
        return model.score(_moved(u, number, x), spans).loss()

    ends = np.clip([u[number] - far - WINDOW, u[number] + far + WINDOW], 0.0, 1.0)
    found = minimize_scalar(loss, bounds=ends, method="bounded", options={"maxiter": LOOKS, "xatol": MIN_FINE_STEP})
    here = loss(float(u[number]))
    return (_moved(u, number, float(found.x)), float(found.fun)) if found.fun < here else (u, here)


def _moved(place: Array, number: int, x: float) -> Array:
    u = place.copy()
    u[number] = x
    return u


def _alike(curved: Array) -> Array:
    """How much any two numbers act alike: correlations of their slopes, 0 of each with itself."""
    sizes = np.sqrt(np.diag(curved))
    found: Array = np.abs(curved) / np.outer(sizes, sizes)
    np.fill_diagonal(found, 0.0)
    return found


def _walk(
    model: FitModel,
    fit: Fit,
    spans: Sequence[int],
    number: int,
    near: Sequence[int],
    slope: Array,
    step: float,
    drop: float,
    leave: bool,
) -> tuple[RidgePath, Array | None]:
    """One way along a ridge; and, where it may be left for it, the best place that was met, if it is a better one.

    Where the way leads higher it is gone on: what leads along a ridge is a walk, not a climb.

    near  : numbers that act as the moved one does, which follow first
    slope : moves of all numbers at first, that of the moved one is 1 or -1; step : first move
    """
    rest = [f for f in fit.free if f != number]
    way = [(fit.place, 0.0)]
    best: tuple[Array | None, float] = (None, -HIGHER)
    step = float(np.clip(step, MIN_FINE_STEP, STRIDE[1]))
    least = min(step, STRIDE[0])
    for _ in range(PLACES):
        last = way[-1][0]
        start = np.clip(last + step * slope, 0.0, 1.0)
        if near:
            # all along the way so far, or none but the moved one and one that makes up for it
            beside = _moved(last, number, float(start[number]))
            asked = [(start, near[0]), *((beside, f) for f in near[:NESTED])]
            alone = [_slid(model, u, f, spans, abs(float(start[f] - last[f]))) for u, f in asked]
            start = min(alone, key=lambda each: each[1])[0]
            start = climb_to_maximum(
                model, start, near[:NESTED], spans, FOLLOWS, slopes=(FINE_SLOPES, CENTRAL_SLOPES)
            ).place
        found = climb_to_maximum(model, start, rest, spans, FOLLOWS, slopes=(FINE_SLOPES,))
        down = found.score.loss() - fit.score.loss()
        if leave and down < best[1]:
            best = found.place, down
        fell = max(down, 0.0)
        moved = abs(found.place[number] - last[number])
        if moved == 0.0:
            break
        if fell - way[-1][1] > 0.5 * drop and step > least:
            step = max(step / SHORTER, least)
            continue
        way.append((found.place, fell))
        if fell >= drop or not 0.0 < found.place[number] < 1.0:
            break
        slope = (found.place - last) / moved
        if fell - way[-2][1] < 0.1 * drop:
            step = min(FASTER * step, STRIDE[1])
    return tuple(way), best[0]
