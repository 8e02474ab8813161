"""Given up: what numbers whose defaults explain the tracks as well mean for the intervals of the others."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from airflock.estimate.inference.candidates import LawCandidate
from airflock.estimate.inference.fit import (
    CENTRAL_SLOPES,
    FINE_SLOPES,
    Fit,
    climb_to_maximum,
    conditional_point,
    curvature,
    fit_with_parameter,
    power_law_point,
)
from airflock.estimate.inference.identifiability import has_effect
from airflock.estimate.inference.likelihood import FitModel
from airflock.estimate.inference.ridges import CurvatureView, RidgePath

AWAY = 0.2  # of a range: move of a number of which is asked whether the others make up for it exactly
DROP = 12.0  # fall of the log-likelihood at which a walk ends that looks for a higher place
EXACT = 0.05  # change of the log-likelihood by such a move, below which they do


def restore_parameters(
    law: LawCandidate, model: FitModel, fit: Fit, spans: Sequence[int], on_progress: Callable[[], None]
) -> tuple[FitModel, Fit]:
    """The model with those numbers again that explain something far from their defaults, the others elsewhere.

    A number is given up where no climb from the fit says anything for it. A walk may lead higher all the same.

    law : with all its numbers
    """
    for number in model.dropped_parameters(law):
        fuller, i = model.with_parameter(law, number)
        view = _view(fuller, fit, i, number.place(number.default), spans, DROP)
        if view is None:
            continue
        for side in (-1.0, 1.0):
            better = view.walk(view.fit.free.index(i), side, True)[1]
            on_progress()
            if better is not None:
                higher = climb_to_maximum(fuller, better, view.fit.free, spans, slopes=(FINE_SLOPES, CENTRAL_SLOPES))
                return restore_parameters(law, fuller, higher, spans, on_progress)
    return model, fit


def ridges_of_dropped(
    law: LawCandidate, model: FitModel, fit: Fit, spans: Sequence[int], drop: float, on_progress: Callable[[], None]
) -> tuple[RidgePath, ...]:
    """Ways of a fit's numbers on which one that was given up leaves its default, and all others follow.

    law : with all its numbers; drop : fall of the log-likelihood at which a way ends
    """
    found: list[RidgePath] = []
    for number in model.dropped_parameters(law):
        fuller, i = model.with_parameter(law, number)
        ways = ridges_from_point(fuller, fit, i, number.place(number.default), spans, drop)
        found += [tuple((np.delete(place, i), fell) for place, fell in way) for way in ways]
        on_progress()
    return tuple(found)


def ridges_from_point(
    model: FitModel, fit: Fit, index: int, coordinate: float, spans: Sequence[int], drop: float
) -> list[RidgePath]:
    """Ways on which a number leaves a place; none where that would say nothing about the others.

    They say nothing of a number that changes nothing; nor of one that the others make up for exactly, such as the unit
    of all weights: no tracks could identify it, and its default is the unit of the others.

    model : with the number; fit : without it
    """
    view = _view(model, fit, index, coordinate, spans, drop)
    return [] if view is None else [view.walk(view.fit.free.index(index), side, False)[0] for side in (-1.0, 1.0)]


def _view(
    model: FitModel, fit: Fit, number: int, place: float, spans: Sequence[int], drop: float
) -> CurvatureView | None:
    """The view from a fit along a number that it does without; None where that would say nothing about the others."""
    full = fit_with_parameter(model, fit, number, place, spans)
    far = full.score.loss() > fit.score.loss() + drop  # its default lies beyond what is sought
    if far or not has_effect(model, [full.place], number, spans) or is_compensated(model, full, number, spans):
        return None
    return CurvatureView(model, replace(full, score=fit.score), spans, drop)  # falls are counted from the fit


def is_compensated(model: FitModel, fit: Fit, index: int, spans: Sequence[int]) -> bool:
    """Whether the others make up for a number exactly, by powers of it or along a line."""
    x = float(fit.place[index])
    moved = conditional_point(
        fit, curvature(model, fit, spans, CENTRAL_SLOPES), index, x + (AWAY if x < 0.5 else -AWAY)
    )
    here = model.score(fit.place, spans).loss()
    return any(
        abs(model.score(u, spans).loss() - here) < EXACT
        for u in (np.clip(moved, 0.0, 1.0), power_law_point(model, fit, moved, index, spans))
    )
