"""Fit the numbers of a law: climb to the maximum of the likelihood of the next frame.

The likelihood is that of `innovation_filter`. Gauss-Newton steps climb it from many points. Slopes
are taken by wide steps first, which smooth a rough surface, then by steps of about one standard
error: wider ones cut the corners of a bent ridge. A weak prior (a standard deviation of half the
range, on the scale of the search) keeps flat directions in place.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.innovation_filter import FitModel, SpanScore

Array = NDArray[np.float64]
# Wide steps cut the corners of ridges ten times narrower; fine steps from their end gained 8 and 15
# units more.
PROBE = 0.02  # of a range: step by which slopes are taken at first; wider than what the tracks' noise blurs
SHOWN = 1.5  # standard errors, were all others known: steps by which slopes are taken then, and
MIN_FINE_STEP = 3e-4  # of a range: their least
MAX_CLIMB_STEPS = 8  # Gauss-Newton steps
LONGEST = 0.2  # of a range: largest move of a number in one step
GAINED = 0.05  # loss; a step that gains less is the last
SHORTER = 6  # times that a step which gains nothing is tried again, shorter
# A radius takes a pair in or leaves it out: the likelihood has steps that no slope sees, so single
# numbers are moved by strides, too.
STRIDES = (0.03, 0.01, 0.003)  # of a range: moves of one number at a time
WIDE_SLOPES, FINE_SLOPES = 0, 1  # how slopes are taken


@dataclass
class Fit:
    """Point at which a model fits best.

    place : of all numbers; free : indices of those that were fitted; score : on the spans of the
            fit
    loss  : negative log-likelihood with the prior
    """

    place: Array
    free: list[int]
    score: SpanScore
    loss: float


def log_prior(u: Array, free: Sequence[int]) -> float:
    """Return the negative logarithm of a weak normal prior of SD 1/2 about the middle of each range."""
    return float((2.0 * (u[list(free)] - 0.5) ** 2).sum())


def loss_at(model: FitModel, u: Array, free: Sequence[int], spans: Sequence[int] | None) -> float:
    """Return the negative log-likelihood with the prior of the free numbers."""
    return model.score(u, spans).loss() + log_prior(u, free)


def jacobian(
    model: FitModel, u: Array, free: Sequence[int], spans: Sequence[int] | None, steps: Array | float, here: Array
) -> Array:
    """Return slopes of the differences (step, component, free number) from those at `u`.

    steps : of all, or of each free number
    """
    columns = []
    for k, step in zip(free, np.broadcast_to(steps, len(free)).tolist(), strict=True):
        # To one side, which costs half; towards the middle of the range, so that the step stays inside it.
        moved = u.copy()
        moved[k] += step if u[k] < 0.5 else -step
        columns.append((model.differences(moved, spans)[0] - here) / (moved[k] - u[k]))
    return np.stack(columns, axis=-1)


def climb_to_maximum(
    model: FitModel,
    start: Array,
    free: Sequence[int],
    spans: Sequence[int] | None = None,
    steps: int = MAX_CLIMB_STEPS,
    slopes: Sequence[int] = (WIDE_SLOPES, FINE_SLOPES),
) -> Fit:
    """Climb from a point over the free numbers, by Gauss-Newton with damping (Levenberg-Marquardt).

    slopes : how they are taken; each way until it leads no further
    """
    free, ways = list(free), iter(slopes)
    way, probes = next(ways), np.full(len(free), PROBE)
    e, owner = model.differences(start, spans)
    score = model.score_differences(e, owner)
    fit, damping = Fit(start.copy(), free, score, score.loss() + log_prior(start, free)), 1e-3
    # Marquardt: each gained step trusts the curvature more, each failed one less. The prior adds 4
    # to the diagonal.
    for _ in range(steps):
        hessian, gradient = curvature(model, fit, spans, e, PROBE if way == WIDE_SLOPES else probes)
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
        # This way of taking slopes leads no further: go on with finer ones, or stop.
        if gained < GAINED:
            finer, damping = next(ways, None), 1e-3
            if finer is None:
                break
            way = finer
    return fit


def settle_fit(model: FitModel, fit: Fit, spans: Sequence[int] | None) -> Fit:
    """Move a fit along one number at a time, by strides that grow shorter, and climb again.

    A radius changes who is a neighbour at once or not at all: the likelihood has steps there, which
    slopes do not see.
    """
    place, lowest = fit.place.copy(), fit.loss
    for stride in STRIDES:
        # The gains of the filter come after the named numbers; they make nobody a neighbour, so
        # they need no strides.
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


# A step of one standard error compromises between the rounding of fine steps and the bends of
# coarse ones.
def _probes(hessian: Array) -> Array:
    """Return fine steps for slopes: those that change the log-likelihood by a little more than 1."""
    return np.asarray(np.clip(SHOWN / np.sqrt(np.diag(hessian) + 4.0), MIN_FINE_STEP, PROBE))


def curvature(
    model: FitModel, fit: Fit, spans: Sequence[int] | None, e: Array, steps: Array | float = PROBE
) -> tuple[Array, Array]:
    """Return curvature and slope of the loss by the free numbers, without the prior. e : differences at the fit."""
    along, across = fit.score.variances()
    weights = 1.0 / np.array([along, *[across] * (model.axes - 1)])
    j = jacobian(model, fit.place, fit.free, spans, steps, e)
    # Gauss-Newton: second derivatives of the predictions are neglected, since differences are small
    # at the fit.
    hessian = np.einsum("scf,c,scg->fg", j, weights, j, optimize=True)
    gradient = np.einsum("sc,c,scf->f", e, weights, j, optimize=True)
    return hessian, gradient


# Search: places from which to climb. Laws have thresholds: if no neighbour is within a radius, the
# radius has no slope, and a climb from there ends at once. So places are drawn evenly over the
# whole range (Sobol). In every other one the law is simple: a number whose default switches a part
# of it off (a field of view of 360 degrees) stays there.
DRAWN = 8  # two to the power of this: places that are looked at


def draw_points(model: FitModel, start: Array, spans: Sequence[int], seed: int) -> Array:
    """Return places (place, number): `start`, and others over the whole range of the named numbers, best first."""
    from scipy.stats import qmc

    assert model.law is not None
    known = model.law.scenario.model.usual
    named = model.numbers[: model.named]
    off = [
        k for k, n in enumerate(named)
        if n.key.startswith("model.") and known.get(n.key.partition(".")[2]) == n.default
    ]  # fmt: skip
    places = np.tile(start, (1 + 2**DRAWN, 1))
    places[1:, : model.named] = qmc.Sobol(model.named, seed=seed).random_base2(DRAWN)
    places[1::2, off] = start[off]
    free = range(model.named)
    return np.array(places[np.argsort([loss_at(model, u, free, spans) for u in places])])
