"""Identifiability: which numbers of a law tracks can identify, and for which of them other numbers make up."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.candidates import LawCandidate
from airflock.estimate.inference.fit import (
    CHI2_HALF_95,
    WIDE_CENTRAL_SLOPES,
    WIDE_SLOPES,
    Fit,
    climb_to_maximum,
    conditional_point,
    curvature,
    fit_with_parameter,
    jacobian,
    loss_at,
    power_law_point,
)
from airflock.estimate.inference.likelihood import FitModel
from airflock.estimate.inference.search import scan_ranges

Array = NDArray[np.float64]
DEPENDENT = 0.2  # share of a slope that other numbers do not explain; below it a number is not identifiable
LOOKS = 6  # best places at which the effect of a number is looked for
ALONG = (0.1, 0.35, 0.65, 0.9)  # of a range: where the effect of a number is looked for
FINE = 0.005  # of a range: step by which numbers are tested for depending on each other
APART = 0.1  # of a range, from the default
ELSEWHERE = 0.2  # of a range: move of a number, to see whether the others make up for it wholly
UNLIKELY = 20.0  # loss above the fit, beyond which no climb begins where another number has taken a part


def identifiable_indices(model: FitModel, start: Array, start_points: Array, spans: Sequence[int]) -> list[int]:
    """Indices of the named numbers that tracks can identify, in their order; the others stay at their defaults.

    A number is not identifiable if it changes nothing anywhere along its range, such as the limit of a law that has
    none; or if the earlier numbers explain its slope at the best of many places taken together, such as a mass beside
    all weights. A radius within which nobody is at these places has no slope, but an effect along its range: kept.
    """
    places = []
    for x in start_points[:LOOKS]:
        u = start.copy()
        u[: model.named] = x
        places.append(u)
    alive = [k for k in range(model.named) if k == model.speed_index or has_effect(model, places, k, spans)]
    flat = np.concatenate([_slopes(model, u, alive, spans) for u in places])
    kept: list[int] = []
    basis = np.zeros((len(flat), 0))
    for column, number in zip(flat.T, alive, strict=True):
        size = float(np.linalg.norm(column))
        rest = column - basis @ (basis.T @ column)
        left = float(np.linalg.norm(rest))
        if size > 1.0 and left < DEPENDENT * size and number != model.speed_index:
            continue
        kept.append(number)
        if size > 1.0:
            basis = np.column_stack([basis, rest / max(left, 1e-12)])
    return kept


def has_effect(model: FitModel, points: Sequence[Array], index: int, spans: Sequence[int]) -> bool:
    """Whether a number changes the loss anywhere along its range."""
    for u in points:
        here = model.score(u, spans).loss()
        for x in ALONG:
            moved = u.copy()
            moved[index] = x
            if abs(model.score(moved, spans).loss() - here) > 1.0:
                return True
    return False


def _slopes(model: FitModel, u: Array, numbers: Sequence[int], spans: Sequence[int]) -> Array:
    """Slopes of all differences in units of their standard deviations, (difference, number)."""
    weights = 1.0 / np.sqrt(np.maximum((model.differences(u, spans)[0] ** 2).mean(axis=0), 1e-30))
    found: Array = (jacobian(model, u, numbers, spans, FINE) * weights[None, :, None]).reshape(-1, len(numbers))
    return found


def canonical_model(
    law: LawCandidate, model: FitModel, fit: Fit, on_progress: Callable[[], None]
) -> tuple[FitModel, Array]:
    """The model in terms of the numbers that are declared first, and its place; the same model where nothing changes.

    A number that was given up before the search may come back under the name of a later one: the weight of one force as
    the unit of all forces, a radius as another within which its neighbours act, too. Where either of two numbers
    explains the tracks, the one that is declared first is kept; the later one takes its default.

    law : with all its numbers; the fit is on all spans, and its place is carried over as it is
    """
    few = model.few()
    place, lowest = fit.place, climb_to_maximum(model, fit.place, fit.free, few, slopes=(WIDE_SLOPES,)).loss
    for earlier in law.numbers:
        assert model.law is not None
        if earlier in model.law.numbers:
            continue
        fuller, i = model.with_parameter(law, earlier)
        full = fit_with_parameter(fuller, replace(fit, place=place), i, earlier.place(earlier.default), few)
        curved = curvature(fuller, full, few, WIDE_CENTRAL_SLOPES)
        for k in reversed(range(i + 1, fuller.named)):
            if not (_may_go(fuller, k) and _away(fuller, full, k)):
                continue
            without, rest = fuller.with_fixed([k]), [f for f in full.free if f != k]
            start = _given_up(without, full, curved, k, few)
            if loss_at(without, start, rest, few) > full.loss + UNLIKELY or abs(start[i] - full.place[i]) < APART:
                continue
            found = climb_to_maximum(
                without, scan_ranges(without, start, rest, few)[0], rest, few, slopes=(WIDE_SLOPES,)
            )
            if found.loss < lowest + CHI2_HALF_95:
                model = fuller.with_parameters(
                    [number for f, number in enumerate(fuller.numbers[: fuller.named]) if f != k]
                )
                place = np.delete(start, k)
                fit = replace(fit, free=[f - (f > k) for f in rest])
                break
        on_progress()
    return model, place


def _may_go(model: FitModel, number: int) -> bool:
    """Whether a number may be given up: any of the law; one of the body only if its default is 0."""
    one = model.numbers[number]
    return number != model.speed_index and (one.key.startswith("model.") or one.default == 0.0)


def _away(model: FitModel, fit: Fit, number: int) -> bool:
    """Whether a number stands away from its default, or its default lies outside the range that is searched."""
    one = model.numbers[number]
    return not one.low <= one.default <= one.high or abs(one.place(one.default) - fit.place[number]) >= APART


def _anywhere(model: FitModel, fit: Fit, curved: Array, number: int, spans: Sequence[int]) -> bool:
    """Whether the tracks are explained as well with a number elsewhere, the others moved by whole powers of it."""
    x = float(fit.place[number])
    moved = conditional_point(fit, curved, number, x + (ELSEWHERE if x < 0.5 else -ELSEWHERE))
    return loss_at(model, power_law_point(model, fit, moved, number, spans), fit.free, spans) < fit.loss + CHI2_HALF_95


def droppable_parameters(model: FitModel, fit: Fit, on_progress: Callable[[], None]) -> tuple[list[int], Array, Array]:
    """Named numbers without which the tracks are explained as well, and two places of the rest without them.

    Each number that stands away from its default, or whose default lies outside the range that was searched, is put
    there in turn, the last declared first, and the rest is fitted again: from where the others make up for it, and from
    where another number of its unit takes its part. So is a number near its default that may as well stand elsewhere,
    such as a mass beside forces.

    The first place is where a few frames are explained best; the second is the fit's own place, carried over.
    """
    few = model.few()
    best = climb_to_maximum(model, fit.place, fit.free, few, slopes=(WIDE_SLOPES,))
    carried, lowest, gone = fit.place, best.loss, list[int]()
    for k in reversed(range(model.named)):
        if not _may_go(model, k):
            continue
        present = model.with_fixed(gone)
        curved = curvature(present, best, few, WIDE_CENTRAL_SLOPES)
        if not _away(model, best, k) and not _anywhere(present, best, curved, k, few):
            continue
        without, rest = model.with_fixed([*gone, k]), [f for f in best.free if f != k]
        start = _given_up(without, best, curved, k, few)
        found = climb_to_maximum(without, scan_ranges(without, start, rest, few)[0], rest, few, slopes=(WIDE_SLOPES,))
        on_progress()
        if found.loss < lowest + CHI2_HALF_95:
            carried = _given_up(without, replace(best, place=carried), curved, k, few)
            gone, best, lowest = [*gone, k], found, min(lowest, found.loss)
    return gone, best.place, carried


def _given_up(model: FitModel, fit: Fit, curved: Array, number: int, spans: Sequence[int]) -> Array:
    """The likeliest place with a number at its default: the others make up for it, or one of its unit takes its part.

    model : one in which this number is fixed
    """
    one, rest = model.numbers[number], [f for f in fit.free if f != number]
    moved = conditional_point(fit, curved, number, one.place(one.default))
    starts = [moved, power_law_point(model, fit, moved, number, spans)]
    for other in (f for f in rest if f < model.named and model.numbers[f].unit == one.unit):
        starts.append(fit.place.copy())
        starts[-1][other] = model.numbers[other].place(one.value(fit.place[number]))
    return min(starts, key=lambda u: loss_at(model, u, rest, spans))
