"""Fit: the numbers of a law under which the next frame is least surprising.

The likelihood is that of the walk (`likelihood`, `walk`). A search by CMA-ES over the whole range finds the hill,
Gauss-Newton steps climb it. A weak prior (a standard deviation of half the range, on the scale that is sought) keeps
flat directions in place.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airflock.infer.likelihood import Model, Score

Array = NDArray[np.float64]
PROBE = 0.02  # of a range: step by which slopes are taken; wider than what the tracks' noise blurs
DEPENDENT = 0.1  # share of a slope that the others do not explain, below which a number cannot be told
DRAWN = 200  # places at random, of which the best begin a search
STARTS = 5  # from the best of which it is climbed at once
ROUNDS, POPULATION = 100, 16  # of CMA-ES
LOOKS = 6  # best places at which is asked what a number does
FINE = 0.005  # of a range: step by which is asked whether numbers depend on each other
SCAN = 10  # places along the range of one number
HOP = 0.12  # of a range
CLIMBS = 8  # Gauss-Newton steps
APART, WORSE = 0.1, 1.5  # of a range, from the default; loss that a number is worth


@dataclass
class Fit:
    """Where a model fits best.

    place : of all numbers; free : indices of those that were fitted; score : on the spans of the fit
    loss  : negative log-likelihood with the prior
    """

    place: Array
    free: list[int]
    score: Score
    loss: float


def prior(u: Array, free: Sequence[int]) -> float:
    """Weak prior: a normal one of SD 1/2 about the middle of each range."""
    return float((2.0 * (u[list(free)] - 0.5) ** 2).sum())


def drawn(model: Model, start: Array, spans: Sequence[int], seed: int) -> Array:
    """Places of the named numbers (place, number): `start` and others spread over the whole range, best first."""
    from scipy.stats import qmc

    named = list(range(model.named))
    found = np.vstack([start[named], qmc.LatinHypercube(len(named), seed=seed).random(DRAWN)])
    return np.array(found[np.argsort([_at(model, start, named, spans, x) for x in found])])


def _at(model: Model, start: Array, free: Sequence[int], spans: Sequence[int] | None, x: Array) -> float:
    u = start.copy()
    u[list(free)] = x
    return model.score(u, spans).loss() + prior(u, free)


def search(
    model: Model,
    start: Array,
    begin: Array,
    spans: Sequence[int],
    seed: int,
    say: Callable[[], None],
    searches: int,
) -> Array:
    """The best place found over the whole range of the named numbers, on a few spans: by climbs and by CMA-ES.

    start : a place whose named numbers are defaults, from which is climbed, too
    begin : places of the named numbers to begin from, best first
    searches : of CMA-ES
    """
    import warnings

    import cma

    named = list(range(model.named))
    best, lowest = start.copy(), math.inf
    for x in (start[named], *begin[:STARTS]):
        u = start.copy()
        u[named] = x
        found = climb(model, u, named, spans, rough=True)
        say()
        if found.loss < lowest:
            lowest, best = found.loss, found.place
    for attempt in range(searches):
        options = {
            "bounds": [0.0, 1.0], "seed": seed + attempt + 1, "verbose": -9, "maxiter": ROUNDS, "tolfun": 0.1,
            "popsize": POPULATION,
        }  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            strategy = cma.CMAEvolutionStrategy(np.clip(begin[attempt], 0.02, 0.98), 0.2, options)
        while not strategy.stop():
            asked = strategy.ask()
            strategy.tell(asked, [_at(model, start, named, spans, np.asarray(x)) for x in asked])
        say()
        if strategy.result.fbest < lowest:
            lowest, best = strategy.result.fbest, start.copy()
            best[named] = strategy.result.xbest
    return best


def scan(model: Model, place: Array, free: Sequence[int], spans: Sequence[int] | None) -> tuple[Array, bool]:
    """A better place found along the range of one named number at a time, and whether there is one.

    Where a threshold lies beyond all that happens, a slope shows nothing; a look along the range does.
    """
    lowest, best, moved = model.score(place, spans).loss() + prior(place, free), place, False
    for k in [k for k in free if k < model.named]:
        for x in (np.arange(SCAN) + 0.5) / SCAN:
            u = best.copy()
            u[k] = x
            found = model.score(u, spans).loss() + prior(u, free)
            if found < lowest - 1.0:
                lowest, best, moved = found, u, True
    return best, moved


def hop(model: Model, fit: Fit, spans: Sequence[int], count: int, seed: int, say: Callable[[], None]) -> Fit:
    """The best of some climbs that begin beside a fit: half of its named numbers, drawn anew each time, are moved."""
    generator = np.random.default_rng(seed)
    best = fit
    named = [k for k in fit.free if k < model.named]
    for _ in range(count):
        u = best.place.copy()
        moved = [k for k in named if generator.random() < 0.5]
        u[moved] = np.clip(u[moved] + generator.normal(0.0, HOP, len(moved)), 0.02, 0.98)
        found = climb(model, u, fit.free, spans, 5, rough=True)
        say()
        if found.loss < best.loss:
            best = found
    return best


def jacobian(
    model: Model,
    u: Array,
    free: Sequence[int],
    spans: Sequence[int] | None,
    step: float = PROBE,
    here: Array | None = None,
) -> Array:
    """Slopes of the differences (step, component, free number); to one side only where those at `u` are given."""
    columns = []
    for k in free:
        low, high = u.copy(), u.copy()
        if here is not None:
            high[k] += step if u[k] < 0.5 else -step
            columns.append((model.differences(high, spans)[0] - here) / (high[k] - u[k]))
            continue
        low[k], high[k] = max(u[k] - step, 0.0), min(u[k] + step, 1.0)
        columns.append((model.differences(high, spans)[0] - model.differences(low, spans)[0]) / (high[k] - low[k]))
    return np.stack(columns, axis=-1)


def climb(
    model: Model,
    start: Array,
    free: Sequence[int],
    spans: Sequence[int] | None = None,
    steps: int = CLIMBS,
    rough: bool = False,
) -> Fit:
    """Gauss-Newton with damping (Levenberg-Marquardt) from a place, over the free numbers.

    rough : slopes to one side only, at half the cost
    """
    free = list(free)
    u, damping = start.copy(), 1e-3
    e, owner = model.differences(u, spans)
    score = model.tally(e, owner)
    loss = score.loss() + prior(u, free)
    for _ in range(steps):
        hessian, gradient = _normal(model, u, free, spans, e, score, rough)
        gained = 0.0
        for _ in range(6):
            scaled = hessian + damping * np.diag(np.diag(hessian)) + 4.0 * np.eye(len(free))
            move = -np.linalg.solve(scaled, gradient + 4.0 * (u[free] - 0.5))
            new = u.copy()
            new[free] = np.clip(u[free] + np.clip(move, -0.2, 0.2), 0.0, 1.0)
            e_new, _ = model.differences(new, spans)
            score_new = model.tally(e_new, owner)
            loss_new = score_new.loss() + prior(new, free)
            if loss_new < loss:
                gained = loss - loss_new
                u, e, score, loss, damping = new, e_new, score_new, loss_new, 0.3 * damping
                break
            damping = max(10.0 * damping, 1e-3)
        if gained < 0.05:
            break
    return Fit(u, free, score, loss)


def _normal(
    model: Model, u: Array, free: list[int], spans: Sequence[int] | None, e: Array, score: Score, rough: bool
) -> tuple[Array, Array]:
    """Curvature and slope of the loss."""
    weights = 1.0 / np.array([score.variances()[0], *[score.variances()[1]] * (model.axes - 1)])
    j = jacobian(model, u, free, spans, here=e if rough else None)
    hessian = np.einsum("scf,c,scg->fg", j, weights, j, optimize=True)
    gradient = np.einsum("sc,c,scf->f", e, weights, j, optimize=True)
    return hessian, gradient


def telling(model: Model, start: Array, begin: Array, spans: Sequence[int]) -> list[int]:
    """Named numbers that differences tell apart, by their slopes at the best of many places taken together.

    In their order: a number whose slope the earlier ones explain everywhere, such as a mass beside all weights, or that
    has no effect at all, stays at its default.
    """
    named = list(range(model.named))
    parts = []
    for x in begin[:LOOKS]:
        u = start.copy()
        u[named] = x
        weights = 1.0 / np.sqrt(np.maximum((model.differences(u, spans)[0] ** 2).mean(axis=0), 1e-30))
        found = jacobian(model, u, named, spans, FINE) * weights[None, :, None]
        parts.append(found.reshape(-1, model.named))
    flat = np.concatenate(parts)
    kept: list[int] = []
    basis = np.zeros((len(flat), 0))
    for number in named:
        column = flat[:, number]
        size = float(np.linalg.norm(column))
        rest = column - basis @ (basis.T @ column)
        left = float(np.linalg.norm(rest))
        if left > max(DEPENDENT * size, 1.0) or number == model.usual:
            kept.append(number)
            basis = np.column_stack([basis, rest / max(left, 1e-12)])
    return kept


def simplify(model: Model, fit: Fit, say: Callable[[], None]) -> list[int]:
    """Named numbers without which the tracks are explained as well: the others make up for them.

    Each that stands away from its default is put there in turn, the last declared first, and the rest is fitted anew.
    """
    few = model.few()
    place, free = fit.place.copy(), list(fit.free)
    lowest = climb(model, place, free, few, rough=True).loss
    gone: list[int] = []
    for k in reversed(range(model.named)):
        number = model.numbers[k]
        if k == model.usual or not number.key.startswith("model."):
            continue
        if abs(number.place(number.default) - place[k]) < APART:
            continue
        rest = [f for f in free if f != k]
        without = model.fixed([*gone, k])
        u, _ = scan(without, place, rest, few)
        found = climb(without, u, rest, few, rough=True)
        say()
        if found.loss < lowest + WORSE:
            gone, free, place, lowest = [*gone, k], rest, found.place, min(lowest, found.loss)
    return gone
