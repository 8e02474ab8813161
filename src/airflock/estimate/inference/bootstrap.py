"""Tracks flown again: what the fitted law would have left behind, to correct the fit and to say how sure it is.

Places are seen with noise, and the slope of a law against a noisy percept is too flat; a threshold is blurred. So the
law is flown from the same beginnings with the noise that was found, is seen with the same gaps and the same noise of
the tracks, and is fitted again. Where that fit misses the law that flew, the fit to the tracks is put right by as much
(indirect inference, Gouriéroux, Monfort & Renault 1993). The scatter of such fits gives the intervals, which are no
narrower than the curvature of the likelihood says, nor than the ridges on which numbers make up for each other.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.candidates import LawCandidate
from airflock.estimate.inference.fit import (
    CENTRAL_SLOPES,
    FINE_SLOPES,
    Fit,
    climb_to_maximum,
    distance_to_worse,
    loss_at,
    open_ends,
    settle_fit,
    standard_errors,
)
from airflock.estimate.inference.flights import FitNoise, FittedFlights, first_noise
from airflock.estimate.inference.given_up import ridges_of_dropped
from airflock.estimate.inference.likelihood import FitModel
from airflock.estimate.inference.noise import IntervalEnds, estimate_law_noise
from airflock.estimate.inference.ridges import Ridges, profile_ridges

Array = NDArray[np.float64]
ROUNDS = (3, 10)  # flights of each round, and of the last, which gives the intervals
MOST = 6  # rounds
LONGEST = 0.1  # of a range: move of a number that is put right, in one round
MATCHED = 0.005  # sum of squares by which statistics of flights may differ from those of the tracks in the last round
STEPS = 6  # of a climb
# Relative standard deviations of what flights leave out, of numbers and of noise, such as where steps of the motion
# fall between frames. Measured on tracks of known laws (tests/nightly/infer.py).
BEYOND = (0.0075, 0.05)
DOUBT = 0.5  # share of a correction that is not trusted
ONE = 1.96  # standard errors that hold one number in 95 %
APART = 0.05  # of a range: largest standard deviation by which the laws of the last flights are apart
UNLIKELY = 20.0  # loss above the fit, beyond which another end is left
SURE = 0.95  # of a number alone, and of all numbers together
WIDER = (1.0, 3.0)  # least and largest variance of refitted numbers, in units of what the curvature says


@dataclass
class CorrectedFit:
    """A fit corrected by flights of its own law, and how sure it is.

    place  : of all numbers, corrected
    alone  : ends of 95 % intervals of each number by itself, as places; low and high
    joint  : ends of intervals that hold all numbers together in 95 %
    noise  : of the flight and of the tracks
    noises : ends of the number of noise, alone and together; None where the tracks set no limit
    """

    place: Array
    alone: tuple[Array, Array]
    joint_ends: tuple[Array, Array]
    noise: FitNoise
    noise_ends: tuple[IntervalEnds, IntervalEnds]


def interval_levels(numbers: int) -> tuple[float, float]:
    """Shares below the upper end of an interval: of one number, and of so many that hold together (Šidák 1967)."""
    return 0.5 + 0.5 * SURE, 0.5 + 0.5 * SURE ** (1.0 / max(numbers, 1))


def correct_fit(
    law: LawCandidate, model: FitModel, fit: Fit, spans: Sequence[int], on_progress: Callable[[], None] = lambda: None
) -> CorrectedFit:
    """Correct a fit by flights of its own law, and find its intervals.

    law : with all its numbers, also those that the model does without; spans : on which it was fitted
    """
    from scipy.stats import norm as normal, t as student

    model, fit = _softened(model, fit, spans)
    kinds = first_noise(model, fit.place, spans)
    named = [k for k in fit.free if k < model.named]
    shares = interval_levels(len(named) + (kinds[0].column >= 0))
    deepest = 0.5 * WIDER[1] * float(normal.ppf(shares[1])) ** 2
    fit, ways = profile_ridges(model, fit, spans, deepest, on_progress)
    ways = Ridges((*ways.paths, *ridges_of_dropped(law, model, fit, spans, deepest, on_progress)))
    fitted = fit.place
    flights = FittedFlights(model, fitted, spans)
    curved, (below, above) = standard_errors(model, fit, spans), open_ends(model, fit, spans)
    for k in np.flatnonzero(below != above):  # a plateau has no curvature, its edge is an end
        curved[k] = distance_to_worse(model, fit, spans, int(k), 0.0 if above[k] else 1.0) / ONE
    place, kinds, misses = _put_right(flights, fit, kinds, curved, on_progress)
    deviations = misses.std(axis=0, ddof=1)
    wider = float(np.clip(np.median((deviations[named] / curved[named]) ** 2), *WIDER))
    slopes = [n.slope(float(x)) / max(n.value(float(x)), 1e-9) for n, x in zip(model.numbers, place, strict=True)]
    count, found = len(misses), []
    for share in shares:
        z = float(normal.ppf(share))
        wide = float(student.ppf(share, count - 1)) * np.sqrt(1.0 + 1.0 / count)
        scatter = np.maximum(wide * deviations, z * curved)
        # half of what was put right is doubt about the noise, which is simpler in flights than in animals
        doubt = np.hypot(DOUBT * (place - fitted), z * BEYOND[0] / np.maximum(slopes, 1e-9))
        down, up = ways.ends(fitted, 0.5 * wider * z**2)
        low = place - np.hypot(np.maximum(scatter, fitted - down), doubt)
        high = place + np.hypot(np.maximum(scatter, up - fitted), doubt)
        low[below | (down <= 0.0)], high[above | (up >= 1.0)] = 0.0, 1.0
        found.append((low, high))
    noise = kinds[0]
    ends: list[IntervalEnds] = [(None, None), (None, None)]
    if noise.column >= 0:
        noise, ends = _noise(flights, place, 0.5 * (found[0][1] - found[0][0]) / ONE, noise, fitted, shares)
        on_progress()
    return CorrectedFit(place, found[0], found[1], noise, (ends[0], ends[1]))


def _softened(model: FitModel, fit: Fit, spans: Sequence[int]) -> tuple[FitModel, Fit]:
    """The model in which large differences count less, and its fit, from that of all differences or another end."""
    model = model.robust()
    here = model.score(fit.place, spans).loss()
    near = [u for u in fit.others if model.score(u, spans).loss() < here + UNLIKELY]
    ends = [
        climb_to_maximum(model, u, fit.free, spans, slopes=(FINE_SLOPES, CENTRAL_SLOPES)) for u in (fit.place, *near)
    ]
    best = min(ends, key=lambda end: end.loss)
    return model, replace(best, others=(*fit.others, *(end.place for end in ends if end is not best)))


def _put_right(
    flights: FittedFlights, fit: Fit, kinds: list[FitNoise], curved: Array, say: Callable[[], None]
) -> tuple[Array, list[FitNoise], Array]:
    """The place put right, the noise of each kind that goes with it, and the misses of the last flights."""
    model, spans, fitted = flights.model, flights.spans, fit.place
    named = [k for k in fit.free if k < model.named]
    place, number, misses = fitted.copy(), 1, np.zeros((1, len(fitted)))
    generator = np.random.default_rng(len(spans))
    for turns in range(MOST):
        matched = [flights.noise(place, each, fitted) for each in kinds]
        kinds = [noise for noise, _ in matched]
        # noise and numbers go together, as that of a heading and the limit of its turns: each is put right in turn
        last = turns == MOST - 1 or (turns > 0 and min(off for _, off in matched) < MATCHED)
        # how far fits miss depends on the law: the last flights are of laws as far apart as the first fits were
        apart = np.minimum(np.maximum(curved, misses.std(axis=0)), APART) if len(misses) > 1 else np.zeros(len(fitted))
        found = []
        for turn in range(ROUNDS[last]):
            number += 1
            law = place.copy()
            law[named] = np.clip(law[named] + apart[named] * generator.normal(size=len(named)), 0.0, 1.0)
            twin = flights.model_on(flights.tracks(law, kinds[turn % len(kinds)], number))
            # from the law itself, or from where fits of such laws have ended, whichever is likelier
            starts = (law, np.clip(fitted + law - place, 0.0, 1.0))
            start = min(starts, key=lambda u, twin=twin: loss_at(twin, u, fit.free, spans))  # type: ignore[misc]
            found.append(
                settle_fit(
                    twin, climb_to_maximum(twin, start, fit.free, spans, STEPS, slopes=(FINE_SLOPES,)), spans
                ).place
                - law
            )
            say()
        misses = np.array(found)
        moved = fitted[named] - np.median(misses[:, named], axis=0)
        place[named] = np.clip(moved, place[named] - LONGEST, place[named] + LONGEST).clip(0.0, 1.0)
        if last:
            break
    return place, [flights.noise(place, each, fitted)[0] for each in kinds], misses


def _noise(
    flights: FittedFlights, place: Array, scatter: Array, noise: FitNoise, fitted: Array, shares: tuple[float, float]
) -> tuple[FitNoise, list[IntervalEnds]]:
    """The number of noise, and its ends alone and together, with what flights leave out."""
    from scipy.stats import norm as normal

    noise, ends = estimate_law_noise(flights, place, scatter, noise, fitted, shares, len(flights.spans))
    found: list[IntervalEnds] = []
    for share, (low, high) in zip(shares, ends, strict=True):
        more = float(normal.ppf(share)) * BEYOND[1]
        found.append((_farther(noise.law, low, more), _farther(noise.law, high, more)))
    return noise, found


def _farther(value: float, end: float | None, more: float) -> float | None:
    """An end whose logarithm lies further off, by what flights leave out."""
    if end is None:
        return None
    away = float(np.log(end / value))
    return value * float(np.exp(np.copysign(np.hypot(away, more), away)))
