"""Given up: what numbers whose defaults explain the tracks as well mean for the intervals of the others."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from airflock.estimate.infer.candidates import Candidate
from airflock.estimate.infer.fit import BOTH, FINE, Fit, beside, by_powers, climb, curvature, followed
from airflock.estimate.infer.identifiability import acts
from airflock.estimate.infer.likelihood import Model
from airflock.estimate.infer.ridges import View, Way

AWAY = 0.2  # of a range: move of a number of which is asked whether the others make up for it exactly
DROP = 12.0  # fall of the log-likelihood at which a walk ends that looks for a higher place
EXACT = 0.05  # change of the log-likelihood by such a move, below which they do


def taken_back(
    law: Candidate, model: Model, fit: Fit, spans: Sequence[int], say: Callable[[], None]
) -> tuple[Model, Fit]:
    """The model with those numbers again that explain something far from their defaults, the others elsewhere.

    A number is given up where no climb from the fit says anything for it. A walk may lead higher all the same.

    law : with all its numbers
    """
    for number in model.missing(law):
        fuller, i = model.with_number(law, number)
        view = _view(fuller, fit, i, number.place(number.default), spans, DROP)
        if view is None:
            continue
        for side in (-1.0, 1.0):
            better = view.walk(view.fit.free.index(i), side, True)[1]
            say()
            if better is not None:
                higher = climb(fuller, better, view.fit.free, spans, slopes=(FINE, BOTH))
                return taken_back(law, fuller, higher, spans, say)
    return model, fit


def ways_beside(
    law: Candidate, model: Model, fit: Fit, spans: Sequence[int], drop: float, say: Callable[[], None]
) -> tuple[Way, ...]:
    """Ways of a fit's numbers on which one that was given up leaves its default, and all others follow.

    law : with all its numbers; drop : fall of the log-likelihood at which a way ends
    """
    found: list[Way] = []
    for number in model.missing(law):
        fuller, i = model.with_number(law, number)
        ways = ways_of(fuller, fit, i, number.place(number.default), spans, drop)
        found += [tuple((np.delete(place, i), fell) for place, fell in way) for way in ways]
        say()
    return tuple(found)


def ways_of(model: Model, fit: Fit, number: int, place: float, spans: Sequence[int], drop: float) -> list[Way]:
    """Ways on which a number leaves a place; none where that would say nothing about the others.

    They say nothing of a number that changes nothing; nor of one that the others make up for exactly, such as the unit
    of all weights: no tracks could identify it, and its default is the unit of the others.

    model : with the number; fit : without it
    """
    view = _view(model, fit, number, place, spans, drop)
    return [] if view is None else [view.walk(view.fit.free.index(number), side, False)[0] for side in (-1.0, 1.0)]


def _view(model: Model, fit: Fit, number: int, place: float, spans: Sequence[int], drop: float) -> View | None:
    """The view from a fit along a number that it does without; None where that would say nothing about the others."""
    full = beside(model, fit, number, place, spans)
    far = full.score.loss() > fit.score.loss() + drop  # its default lies beyond what is sought
    if far or not acts(model, [full.place], number, spans) or exact(model, full, number, spans):
        return None
    return View(model, replace(full, score=fit.score), spans, drop)  # falls are counted from the fit


def exact(model: Model, fit: Fit, number: int, spans: Sequence[int]) -> bool:
    """Whether the others make up for a number exactly, by powers of it or along a line."""
    x = float(fit.place[number])
    moved = followed(fit, curvature(model, fit, spans, BOTH), number, x + (AWAY if x < 0.5 else -AWAY))
    here = model.score(fit.place, spans).loss()
    return any(
        abs(model.score(u, spans).loss() - here) < EXACT
        for u in (np.clip(moved, 0.0, 1.0), by_powers(model, fit, moved, number, spans))
    )
