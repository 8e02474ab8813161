"""Search and sample the numbers of a law: the likeliest ones, and how far each goes while all others follow."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.innovation_filter import FitModel
from airflock.estimate.inference.likelihood_fit import Fit, climb_to_maximum, curvature, loss_at

Array = NDArray[np.float64]
# Numbers of a law compensate for each other along ridges that bend, end in plateaus, and have steps
# where a radius takes a pair in. Differential evolution (ter Braak & Vrugt 2008) needs no slope: it
# moves by differences of earlier draws, which lie along the ridge, however narrow that is.
CHAINS = 4
LENGTH, SEARCH, LEAST = 400, 300, 8  # draws per number, of the posterior and of a search, and for how many at least
BEGIN = 10  # places per number to begin with
HEAT = 1000.0  # by which differences of the loss are divided at the beginning of a search
REMEMBERED = 4  # moves of all chains, after which their places are added to those that moves are made of
JUMP, ALONE = 0.1, 0.15  # shares of moves: by a whole difference, to other hills; of one number to anywhere
RECENT = 40  # places of which every second move is made: their differences follow a ridge that bends
SHARES = (0.25, 0.5, 1.0)  # of the numbers, that are moved at once
HIGHER = 0.5  # log-likelihood by which a draw must beat the fit to be climbed from
OPEN = 0.1  # of half of an interval: nearer than this to the end of a range nothing limits a number


def search_widely(
    model: FitModel, begin: Array, free: Sequence[int], spans: Sequence[int], seed: int, on_progress: Callable[[], None]
) -> Fit:
    """Search from places over the whole range, best first; return the best climb from where draws have cooled."""
    d = len(free)
    best, draws = evolve(model, begin[: BEGIN * d], free, spans, SEARCH * max(d, LEAST), seed, on_progress, HEAT)
    ends = [climb_to_maximum(model, u, free, spans) for u in (best[1], *draws[-CHAINS:])]
    return min(ends, key=lambda end: end.loss)


def search_onward(
    model: FitModel, fit: Fit, spans: Sequence[int], on_progress: Callable[[], None]
) -> tuple[Fit, Array]:
    """Search from a fit, also for other hills that are as likely; return the best one, and places on these hills."""
    fit = climb_to_maximum(model, fit.place, fit.free, spans)
    count = SEARCH * max(len(fit.free), LEAST)
    best, draws = evolve(model, _around(model, fit, spans), fit.free, spans, count, 0, on_progress, HEAT)
    if best[0] < fit.loss - HIGHER:
        fit = climb_to_maximum(model, best[1], fit.free, spans)
    return fit, draws[np.linspace(2 * count // 3, len(draws) - 1, BEGIN * len(fit.free) // 2).astype(int)]


def sample_posterior(
    model: FitModel, fit: Fit, places: Array, spans: Sequence[int], on_progress: Callable[[], None]
) -> tuple[Fit, Array]:
    """Return the likeliest fit, and draws of all numbers (draw, number) by their likelihood and the prior.

    places : others that may be as likely, of which moves are made, too
    """
    count = LENGTH * max(len(fit.free), LEAST)
    begin = np.concatenate([_around(model, fit, spans), places])
    best, draws = evolve(model, begin, fit.free, spans, count, 0, on_progress)
    if best[0] < fit.loss - HIGHER:
        fit = climb_to_maximum(model, best[1], fit.free, spans)
    return fit, draws[len(draws) // 3 :]


def _around(model: FitModel, fit: Fit, spans: Sequence[int]) -> Array:
    """Draw places around a fit, itself first, by the curvature there."""
    d = len(fit.free)
    found = np.tile(fit.place, (BEGIN * d // 2, 1))
    hessian = curvature(model, fit, spans, model.differences(fit.place, spans)[0])[0] + 4.0 * np.eye(d)
    generator = np.random.default_rng(len(spans))
    found[1:, fit.free] += generator.multivariate_normal(np.zeros(d), np.linalg.inv(hessian), len(found) - 1)
    return np.clip(found, 0.0, 1.0)


def evolve(
    model: FitModel, begin: Array, free: Sequence[int], spans: Sequence[int], count: int, seed: int,
    on_progress: Callable[[], None], heat: float = 1.0,
) -> tuple[tuple[float, Array], Array]:  # fmt: skip
    """Draw places from some to begin with, best first; return the loss and place of the best, and so many draws.

    heat : by which differences of the loss are divided at first, 1 at the end
    """
    g, d, turns, known = np.random.default_rng(seed), len(free), count // CHAINS, len(begin)
    who = np.array(free)
    past = np.concatenate([begin, np.zeros((CHAINS * (turns // REMEMBERED + 1), begin.shape[1]))])
    chains = [u.copy() for u in begin[:CHAINS]]
    losses = [loss_at(model, u, free, spans) for u in chains]
    best = min(zip(losses, chains, strict=True), key=lambda each: each[0])
    draws = []
    for turn in range(turns):
        cooled = heat ** max(1.0 - 1.5 * turn / turns, 0.0)
        for k, u in enumerate(chains):
            new = u.copy()
            if g.random() < ALONE:
                new[who[g.integers(d)]] = g.random()
            else:
                moved = who[g.random(d) < SHARES[g.integers(len(SHARES))]]
                far = 1.0 if g.random() < JUMP else 2.38 / math.sqrt(2.0 * max(len(moved), 1))
                first = max(known - RECENT, 0) if g.random() < 0.5 else 0
                one, other = past[g.integers(first, known, size=2)]
                new[moved] += far * g.uniform(0.9, 1.1) * (one - other)[moved] + 1e-5 * g.normal(size=len(moved))
            if (new < 0.0).any() or (new > 1.0).any():
                continue
            loss = loss_at(model, new, free, spans)
            if g.random() < math.exp(min((losses[k] - loss) / cooled, 0.0)):
                chains[k], losses[k] = new, loss
                best = min(best, (loss, new), key=lambda each: each[0])
        draws += chains
        if turn % REMEMBERED == 0:
            past[known : known + CHAINS] = chains
            known += CHAINS
            on_progress()
    return best, np.array(draws)


def posterior_ends(draws: Array, level: float) -> tuple[Array, Array]:
    """Return ends of all numbers below and above which lies a share of (1 - level) each; 0 and 1: no limit.

    A plateau goes on to the end of the range, which is near then, beside the width of the draws.
    """
    low, middle, high = np.quantile(draws, (1.0 - level, 0.5, level), axis=0)
    low = np.where(low < OPEN * (middle - low), 0.0, low)
    return low, np.where(1.0 - high < OPEN * (high - middle), 1.0, high)
