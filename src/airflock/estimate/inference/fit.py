"""Fit: climb to the numbers of a law under which the next frame is least surprising.

The likelihood is that of the walk (`likelihood`, `walk`). Gauss-Newton steps climb it from a place; `search` says from
which. Slopes are taken by wide steps first, which look over what is rough, then by steps that change the likelihood by
about as much as its standard errors do: wider ones cut the corners of a bent ridge. A weak prior (a standard deviation
of half the range, on the scale that is sought) keeps flat directions in place.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.likelihood import FitModel, SpanScore

Array = NDArray[np.float64]
PROBE = 0.02  # of a range: step by which slopes are taken at first; wider than what the tracks' noise blurs
SHOWN = 1.5  # standard errors, were all others known: steps by which slopes are taken then, and
MIN_FINE_STEP = 3e-4  # of a range: their least
MAX_CLIMB_STEPS = 8  # Gauss-Newton steps
LONGEST = 0.2  # of a range: largest move of a number in one step
GAINED = 0.05  # loss; a step that gains less is the last
SHORTER = 6  # times that a step which gains nothing is tried again, shorter
STRIDES = (0.03, 0.01, 0.003)  # of a range: moves of one number at a time
CHI2_HALF_95 = 1.92  # loss that a number is worth: what 95 % of numbers that are not needed bring at most (Wilks 1938)
HALVED = 10  # times that the way to an end is halved
ON_THE_WAY = (1.0, 0.5, 0.2)  # to the end of a range: where is looked whether anything is explained worse
WIDE_SLOPES, FINE_SLOPES, CENTRAL_SLOPES = (
    0,
    1,
    2,
)  # how slopes are taken: wide or fine steps to one side, fine ones to both
WIDE_CENTRAL_SLOPES = 3  # as WIDE, an eighth as far, to both sides: for what numbers make up for each other
SLOPE_SEQUENCE = (WIDE_SLOPES, FINE_SLOPES, CENTRAL_SLOPES)


@dataclass
class Fit:
    """Where a model fits best.

    place : of all numbers; free : indices of those that were fitted; score : on the spans of the fit
    loss  : negative log-likelihood with the prior
    others : places of other ends that a search has met
    """

    place: Array
    free: list[int]
    score: SpanScore
    loss: float
    others: tuple[Array, ...] = ()


def log_prior(u: Array, free: Sequence[int]) -> float:
    """Weak prior: a normal one of SD 1/2 about the middle of each range."""
    return float((2.0 * (u[list(free)] - 0.5) ** 2).sum())


def loss_at(model: FitModel, u: Array, free: Sequence[int], spans: Sequence[int] | None) -> float:
    """Negative log-likelihood with the prior of the free numbers."""
    return model.score(u, spans).loss() + log_prior(u, free)


def fit_with_parameter(model: FitModel, fit: Fit, index: int, coordinate: float, spans: Sequence[int] | None) -> Fit:
    """A fit with one more number, which stands at a place; model : with the number, fit : without it."""
    u = np.insert(fit.place, index, coordinate)
    free = sorted([index, *(f + (f >= index) for f in fit.free)])
    score = model.score(u, spans)
    return Fit(u, free, score, score.loss() + log_prior(u, free))


def jacobian(
    model: FitModel,
    u: Array,
    free: Sequence[int],
    spans: Sequence[int] | None,
    steps: Array | float = PROBE,
    here: Array | None = None,
) -> Array:
    """Slopes of the differences (step, component, free number); to one side only where those at `u` are given.

    steps : of all, or of each free number
    """
    columns = []
    for k, step in zip(free, np.broadcast_to(steps, len(free)).tolist(), strict=True):
        low, high = u.copy(), u.copy()
        if here is not None:
            high[k] += step if u[k] < 0.5 else -step
            columns.append((model.differences(high, spans)[0] - here) / (high[k] - u[k]))
            continue
        low[k], high[k] = max(u[k] - step, 0.0), min(u[k] + step, 1.0)
        columns.append((model.differences(high, spans)[0] - model.differences(low, spans)[0]) / (high[k] - low[k]))
    return np.stack(columns, axis=-1)


def climb_to_maximum(
    model: FitModel,
    start: Array,
    free: Sequence[int],
    spans: Sequence[int] | None = None,
    steps: int = MAX_CLIMB_STEPS,
    slopes: Sequence[int] = SLOPE_SEQUENCE,
) -> Fit:
    """Gauss-Newton with damping (Levenberg-Marquardt) from a place, over the free numbers.

    slopes : how they are taken; each way until it leads no further
    """
    free, ways = list(free), iter(slopes)
    way, probes = next(ways), np.full(len(free), PROBE)
    e, owner = model.differences(start, spans)
    score = model.score_differences(e, owner)
    fit, damping = Fit(start.copy(), free, score, score.loss() + log_prior(start, free)), 1e-3
    for _ in range(steps):
        hessian, gradient = _normal(
            model, fit, spans, e, PROBE if way == WIDE_SLOPES else probes, way != CENTRAL_SLOPES
        )
        probes = _probes(hessian)
        gained = 0.0
        for _ in range(SHORTER):
            scaled = hessian + damping * np.diag(np.diag(hessian)) + 4.0 * np.eye(len(free))
            move = -np.linalg.solve(scaled, gradient + 4.0 * (fit.place[free] - 0.5))
            new = fit.place.copy()
            new[free] = np.clip(new[free] + np.clip(move, -LONGEST, LONGEST), 0.0, 1.0)
            e_new, _ = model.differences(new, spans)
            score = model.score_differences(e_new, owner)
            trial = Fit(new, free, score, score.loss() + log_prior(new, free))
            if trial.loss < fit.loss:
                gained, e = fit.loss - trial.loss, e_new
                fit, damping = trial, 0.3 * damping
                break
            damping = max(10.0 * damping, 1e-3)
        if gained < GAINED:
            finer, damping = next(ways, None), 1e-3
            if finer is None:
                break
            way = finer
    return fit


def settle_fit(model: FitModel, fit: Fit, spans: Sequence[int] | None) -> Fit:
    """A fit moved along one number at a time, by strides that grow shorter, and climbed again.

    A radius changes who is a neighbour at once or not at all: the likelihood has steps there, which slopes do not see.
    """
    place, lowest = fit.place.copy(), fit.loss
    for stride in STRIDES:
        for k in [k for k in fit.free if k < model.named]:
            for move in (stride, -stride):
                while True:
                    u = place.copy()
                    u[k] = min(max(u[k] + move, 0.0), 1.0)
                    loss = loss_at(model, u, fit.free, spans) if u[k] != place[k] else lowest
                    if loss >= lowest:
                        break
                    place, lowest = u, loss
    return climb_to_maximum(model, place, fit.free, spans, slopes=(FINE_SLOPES,))


def standard_errors(model: FitModel, fit: Fit, spans: Sequence[int]) -> Array:
    """Standard errors of all numbers, as shares of their ranges, by the curvature at a fit; 0 of those not fitted.

    The larger of two: by wide slopes, which cut the corners of a bent ridge, and by fine ones, in which single pairs
    show that a radius takes in or leaves out. The prior is part of it: a number that the tracks do not tell has about
    half its range.
    """
    errors = np.zeros(len(fit.place))
    each = [np.diag(np.linalg.inv(curvature(model, fit, spans, way))) for way in (WIDE_SLOPES, CENTRAL_SLOPES)]
    errors[fit.free] = np.sqrt(np.maximum(*each))
    return errors


def open_ends(model: FitModel, fit: Fit, spans: Sequence[int]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Numbers for which the tracks set no lower, and no upper limit: on the whole way there nothing is explained worse.

    Such as a largest force that nobody ever uses.
    """
    unlimited = np.zeros((2, len(fit.place)), bool)
    for k in [k for k in fit.free if k < model.named]:
        for side, end in enumerate((0.0, 1.0)):
            ways = fit.place[k] + np.array(ON_THE_WAY) * (end - fit.place[k])
            unlimited[side, k] = not any(_worse(model, fit, spans, k, x) for x in ways)
    return unlimited[0], unlimited[1]


def distance_to_worse(model: FitModel, fit: Fit, spans: Sequence[int], index: int, end: float) -> float:
    """Distance of a place, towards an end of its range, beyond which the tracks are explained worse; others stay."""
    near, far = 0.0, abs(end - float(fit.place[index]))
    for _ in range(HALVED):
        middle = 0.5 * (near + far)
        worse = _worse(model, fit, spans, index, fit.place[index] + math.copysign(middle, end - fit.place[index]))
        near, far = (near, middle) if worse else (middle, far)
    return far


def _worse(model: FitModel, fit: Fit, spans: Sequence[int], number: int, x: float) -> bool:
    return model.score(_moved(fit.place, number, x), spans).loss() > fit.score.loss() + CHI2_HALF_95


def _moved(place: Array, number: int, x: float) -> Array:
    u = place.copy()
    u[number] = x
    return u


def curvature(model: FitModel, fit: Fit, spans: Sequence[int] | None, slopes: int = WIDE_SLOPES) -> Array:
    """Second derivatives of the loss by the free numbers, with the prior."""
    e, _ = model.differences(fit.place, spans)
    if slopes == WIDE_CENTRAL_SLOPES:
        curvature = _normal(model, fit, spans, e, PROBE / 8.0, False)[0]
    else:
        curvature = _normal(model, fit, spans, e, PROBE, True)[0]
        if slopes != WIDE_SLOPES:
            curvature = _normal(model, fit, spans, e, _probes(curvature), slopes != CENTRAL_SLOPES)[0]
    return curvature + 4.0 * np.eye(len(fit.free))


def _probes(hessian: Array) -> Array:
    """Steps by which slopes are taken finely: so far that the likelihood changes by a little more than 1."""
    return np.asarray(np.clip(SHOWN / np.sqrt(np.diag(hessian) + 4.0), MIN_FINE_STEP, PROBE))


def conditional_point(fit: Fit, curved: Array, index: int, coordinate: float) -> Array:
    """A fit's place with one number elsewhere, and the others where they make up for it as the curvature says."""
    u, k = fit.place.copy(), fit.free.index(index)
    others = [f for f in range(len(fit.free)) if f != k]
    moves = -np.linalg.solve(curved[np.ix_(others, others)], curved[others, k]) * (coordinate - u[index])
    u[[fit.free[f] for f in others]] += moves
    u[index] = coordinate
    return np.clip(u, 0.0, 1.0)


def power_law_point(model: FitModel, fit: Fit, moved: Array, index: int, spans: Sequence[int] | None) -> Array:
    """Return the point of `conditional_point`, with whole exponents: laws are products of whole powers.

    Of numbers that are sought by their logarithm; the others stay where they are. Where thresholds make the curvature
    rough, exponents may be read off wrongly: from those that are read and from none, each is raised and lowered by one
    while that explains more.
    """
    wide = [math.log(n.high / n.low) if n.log else 0.0 for n in model.numbers]
    step = (moved[index] - fit.place[index]) * wide[index]
    read = {
        f: round((moved[f] - fit.place[f]) * wide[f] / step)
        for f in fit.free
        if f < model.named and f != index and wide[f] and step
    }

    def place(powers: Mapping[int, int]) -> Array:
        u = fit.place.copy()
        u[index] = moved[index]
        for f, power in powers.items():
            u[f] += power * step / wide[f]
        return np.clip(u, 0.0, 1.0)

    def lower(powers: dict[int, int]) -> tuple[float, Array]:
        lowest, better = loss_at(model, place(powers), fit.free, spans), True
        while better:
            better = False
            for f, more in ((f, more) for f in powers for more in (1, -1)):
                changed = {**powers, f: powers[f] + more}
                loss = loss_at(model, place(changed), fit.free, spans)
                if loss < lowest - GAINED:
                    powers, lowest, better = changed, loss, True
        return lowest, place(powers)

    return min(lower(read), lower(dict.fromkeys(read, 0)), key=lambda found: found[0])[1]


def _normal(
    model: FitModel, fit: Fit, spans: Sequence[int] | None, e: Array, steps: Array | float, one: bool
) -> tuple[Array, Array]:
    """Curvature and slope of the loss, without the prior. one : slopes are taken to one side only."""
    along, across = fit.score.variances()
    weights = 1.0 / np.array([along, *[across] * (model.axes - 1)])
    j = jacobian(model, fit.place, fit.free, spans, steps, e if one else None)
    hessian = np.einsum("scf,c,scg->fg", j, weights, j, optimize=True)
    gradient = np.einsum("sc,c,scf->f", e, weights, j, optimize=True)
    return hessian, gradient
