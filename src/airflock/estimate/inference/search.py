"""Search: from which places to climb, so that the climb ends on the highest hill.

Laws have thresholds: where no neighbour is within a radius, the radius has no slope, and a climb from there ends at
once. So places are drawn evenly over the whole range (Sobol), and are raced: all climb a few steps, the better half
goes on. The simpler law comes first: a number whose default switches a part of the law off (a field of view of 360°)
stays there until the rest is found. At the end each number is moved along its whole range while the others follow
(a profile of the likelihood), which leaves hills that are a valley apart.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.fit import WIDE_SLOPES, Fit, climb_to_maximum, conditional_point, curvature, loss_at
from airflock.estimate.inference.likelihood import FitModel

Array = NDArray[np.float64]
DRAWN = 9  # two to the power of this: places that are looked at
RACE = ((16, 4), (8, 4), (4, 8))  # how many climb, and by how many steps
SCAN = 10  # places along the range of one number
PROFILE, FOLLOW = 6, 2  # the same while the others follow, by so many steps
SWEEPS = 3  # of all numbers
BETTER = 1.0  # loss that a move has to gain


def default_is_off(model: FitModel) -> list[int]:
    """Named numbers whose default is a usual one, with which a part of the law is switched off."""
    assert model.law is not None
    known = model.law.scenario.model.usual
    return [
        k
        for k, number in enumerate(model.numbers[: model.named])
        if number.key.startswith("model.") and known.get(number.key.partition(".")[2]) == number.default
    ]


def draw_points(model: FitModel, start: Array, spans: Sequence[int], seed: int) -> Array:
    """Places of the named numbers (place, number): `start` and others spread over the whole range, best first.

    Usual numbers stay usual.
    """
    from scipy.stats import qmc

    named = list(range(model.named))
    found = np.vstack([start[named], qmc.Sobol(len(named), seed=seed).random_base2(DRAWN)])
    found[:, default_is_off(model)] = start[default_is_off(model)]
    places = np.tile(start, (len(found), 1))
    places[:, named] = found
    return np.array(found[np.argsort([loss_at(model, u, named, spans) for u in places])])


def race_from_points(
    model: FitModel,
    start: Array,
    start_points: Array,
    free: Sequence[int],
    spans: Sequence[int],
    on_progress: Callable[[], None],
) -> Fit:
    """The best climb from the start and from the first of some places; usual numbers are free in its last steps.

    start : a place whose named numbers are defaults; begin : places of the named numbers, best first
    """
    simple = [k for k in free if k not in default_is_off(model)]
    places = [start, *(np.concatenate([x, start[model.named :]]) for x in start_points[: RACE[0][0] - 1])]
    fits: list[Fit] = []
    for count, steps in RACE:
        fits = [climb_to_maximum(model, u, simple, spans, steps, slopes=(WIDE_SLOPES,)) for u in places[:count]]
        fits.sort(key=lambda each: each.loss)
        places = [each.place for each in fits]
        on_progress()
    return climb_to_maximum(model, fits[0].place, free, spans, slopes=(WIDE_SLOPES,))


def scan_ranges(model: FitModel, point: Array, free: Sequence[int], spans: Sequence[int] | None) -> tuple[Array, bool]:
    """A better place found along the range of one named number at a time, and whether there is one.

    Where a threshold lies beyond all that happens, a slope shows nothing; a look along the range does.
    """
    lowest, best, moved = loss_at(model, point, free, spans), point, False
    for k in [k for k in free if k < model.named]:
        for x in (np.arange(SCAN) + 0.5) / SCAN:
            u = best.copy()
            u[k] = x
            found = loss_at(model, u, free, spans)
            if found < lowest - BETTER:
                lowest, best, moved = found, u, True
    return best, moved


def profile_ranges(model: FitModel, fit: Fit, spans: Sequence[int], on_progress: Callable[[], None]) -> Fit:
    """The best place found along the range of one named number at a time while all the others follow."""
    best, curved = fit, curvature(model, fit, spans)
    for _ in range(SWEEPS):
        before = best.loss
        for k in [k for k in fit.free if k < model.named]:
            others = [f for f in fit.free if f != k]
            for x in (np.arange(PROFILE) + 0.5) / PROFILE:
                if abs(x - best.place[k]) < 0.5 / PROFILE:
                    continue
                found = _lower(model, (conditional_point(best, curved, k, x), _moved(best.place, k, x)), others, spans)
                if found.loss < best.loss - BETTER:
                    best = climb_to_maximum(model, found.place, fit.free, spans, 2 * FOLLOW, slopes=(WIDE_SLOPES,))
                    curved = curvature(model, best, spans)
            on_progress()
        if best.loss > before - BETTER:
            break
    return best


def _moved(place: Array, number: int, x: float) -> Array:
    u = place.copy()
    u[number] = x
    return u


def _lower(model: FitModel, places: Sequence[Array], free: Sequence[int], spans: Sequence[int]) -> Fit:
    """A short climb from that of some places which begins lower."""
    return climb_to_maximum(
        model, min(places, key=lambda u: loss_at(model, u, free, spans)), free, spans, FOLLOW, slopes=(WIDE_SLOPES,)
    )
