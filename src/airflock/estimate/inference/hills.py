"""Hills: numbers that act together, such as those of a wall, looked for anew over their whole ranges.

Such numbers have several hills, and long narrow ridges that bend between them: no single number leads along one, and a
climb ends wherever on the ridge it has arrived. So many climbs are made: some with the numbers of the group alone at
first, others, in a race, with all at once, since beside a wrong rest of the fit the group alone climbs back to where it
came from. Where their ends lie apart, the way from one to the better one is gone on beyond it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.fit import (
    CENTRAL_SLOPES,
    FINE_SLOPES,
    SLOPE_SEQUENCE,
    WIDE_SLOPES,
    Fit,
    climb_to_maximum,
    curvature,
    jacobian,
    loss_at,
)
from airflock.estimate.inference.likelihood import FitModel

Array = NDArray[np.float64]
TOGETHER = 4  # numbers that are drawn anew together, at most
ALIKE = 0.8  # overlap of where two numbers act, from which they are
GROUPS = 3  # of them, the least certain first
SHARED = 0.5  # of a group: where more of it stands in an earlier one, other groups come first
REDRAWN = 8  # two to the power of this: places of a group that are looked at
ALONE, ALL, WHOLE = (16, 10), (6, 16), (4, 12)  # how many climb, by how many steps: the group, all, and on all frames
RACE = ((24, 4), (8, 8))  # the same of a race with all numbers
KEPT = 4  # of its ends
SAME = 0.1  # of a range: places whose numbers of a group are all nearer than this are of one hill
UNLIKELY = 20.0  # loss above the best on few frames, beyond which a hill is left
BEYOND = (0.5, -0.5)  # of the way from another end to the best one: how far is looked past it, and between the two
ONWARD = 2  # times that ends are gone beyond
BETTER = 0.5  # loss that a move has to gain


def search_modes(
    model: FitModel, fit: Fit, few_spans: Sequence[int], spans: Sequence[int], on_progress: Callable[[], None]
) -> Fit:
    """The fit, or a better one elsewhere for numbers that act together; with the other ends that were met.

    few, spans : on which is looked, and on which is fitted
    """
    met: list[Fit] = []
    for group in parameter_groups(model, fit, few_spans):
        apart = redraw_group(model, fit, group, few_spans)
        on_progress()
        rough = sorted(
            (climb_to_maximum(model, u, fit.free, few_spans, ALL[1], slopes=SLOPE_SEQUENCE) for u in apart),
            key=lambda e: e.loss,
        )
        on_progress()
        worst = loss_at(model, fit.place, fit.free, few_spans) + UNLIKELY
        likely = distinct_points([end.place for end in rough if end.loss < worst], group)[: WHOLE[0]]
        found = [
            climb_to_maximum(model, u, fit.free, spans, WHOLE[1], slopes=(FINE_SLOPES, CENTRAL_SLOPES)) for u in likely
        ]
        on_progress()
        found = climb_beyond(model, [fit, *found], group, few_spans, spans, on_progress)
        fit, met = found[0], [*met, *found[1:]]
    return replace(fit, others=tuple(end.place for end in met))


def redraw_group(model: FitModel, fit: Fit, group: Sequence[int], few_spans: Sequence[int]) -> list[Array]:
    """Places from which all are to climb, after a group was drawn anew: ends of a race, and of the group by itself."""
    from scipy.stats import qmc

    drawn = np.tile(fit.place, (2**REDRAWN, 1))
    drawn[:, group] = qmc.Sobol(len(group), seed=0).random_base2(REDRAWN)
    places = sorted(drawn, key=lambda u: loss_at(model, u, fit.free, few_spans))
    raced = [end.place for end in race_climbs(model, distinct_points(places, group, [fit.place]), fit.free, few_spans)][
        :KEPT
    ]
    ends = (
        climb_to_maximum(model, u, group, few_spans, ALONE[1], slopes=(WIDE_SLOPES, FINE_SLOPES))
        for u in places[: ALONE[0]]
    )
    alone = [end.place for end in sorted(ends, key=lambda end: end.loss)]
    # each hill once, and not that of the fit: beside the rest of this fit, a higher hill may seem lower
    return [*raced, *distinct_points(alone, group, [fit.place, *raced])][: ALL[0]]


def race_climbs(model: FitModel, points: Sequence[Array], free: Sequence[int], spans: Sequence[int]) -> list[Fit]:
    """Ends of climbs over all numbers, best first: of the first of some places, the better ones of which go on."""
    found: list[Fit] = []
    for count, steps in RACE:
        found = [climb_to_maximum(model, u, free, spans, steps, slopes=(WIDE_SLOPES,)) for u in points[:count]]
        found.sort(key=lambda end: end.loss)
        points = [end.place for end in found]
    return found


def climb_beyond(
    model: FitModel,
    ends: Sequence[Fit],
    group: Sequence[int],
    few_spans: Sequence[int],
    spans: Sequence[int],
    on_progress: Callable[[], None],
) -> list[Fit]:
    """Ends of climbs, best first, with those that are met beyond the best one, seen from the next ones.

    Two ends on one ridge tell which way it goes, however narrow it is.
    """
    found = sorted(ends, key=lambda end: end.loss)
    for _ in range(ONWARD):
        best = found[0]
        rest = [end for end in found[1:] if np.abs(end.place - best.place)[list(group)].max() > SAME]
        starts = [np.clip(best.place + far * (best.place - end.place), 0.0, 1.0) for end in rest[:2] for far in BEYOND]
        near = [
            climb_to_maximum(model, u, group, few_spans, ALONE[1], slopes=(FINE_SLOPES, CENTRAL_SLOPES)).place
            for u in starts
        ]
        near = sorted(near, key=lambda u: loss_at(model, u, best.free, few_spans))[:2]
        found += [
            climb_to_maximum(model, u, best.free, spans, WHOLE[1], slopes=(FINE_SLOPES, CENTRAL_SLOPES)) for u in near
        ]
        found.sort(key=lambda end: end.loss)
        on_progress()
        if found[0].loss > best.loss - BETTER:
            break
    return found


def distinct_points(points: Sequence[Array], group: Sequence[int], known_points: Sequence[Array] = ()) -> list[Array]:
    """Places that differ from known ones, and from all before them, in some number of a group."""
    found = list(known_points)
    for u in points:
        if all(np.abs(u - other)[list(group)].max() > SAME for other in found):
            found.append(u)
    return found[len(known_points) :]


def parameter_groups(model: FitModel, fit: Fit, spans: Sequence[int]) -> list[list[int]]:
    """Groups of named numbers that act on the same steps, around those that are least certain."""
    named = [k for k in fit.free if k < model.named]
    slopes = np.abs(jacobian(model, fit.place, named, spans, here=model.differences(fit.place, spans)[0]))
    flat = np.sqrt(slopes.reshape(-1, len(named)))  # a few steps at edges would outweigh all others
    sizes = np.maximum(np.linalg.norm(flat, axis=0), 1e-30)
    overlap = (flat.T @ flat) / np.outer(sizes, sizes)
    errors = np.diag(np.linalg.inv(curvature(model, fit, spans)))[[fit.free.index(k) for k in named]]
    found: list[list[int]] = []
    for k in np.argsort(-errors).tolist():
        near = [f for f in np.argsort(-overlap[k]).tolist() if f != k and overlap[k, f] > ALIKE][: TOGETHER - 1]
        group = sorted(named[f] for f in (k, *near))
        if near and not any(named[k] in other for other in found):
            found.append(group)
    return sort_groups(found)[:GROUPS]


def sort_groups(groups: Sequence[list[int]]) -> list[list[int]]:
    """Groups in their order, but those that mostly stand in earlier ones last.

    Else the numbers of friction, the least certain, would come three times in other company, and those of a wall never.
    """
    first: list[list[int]] = []
    for group in groups:
        if all(len({*group} & {*other}) <= SHARED * len(group) for other in first):
            first.append(group)
    return first + [group for group in groups if group not in first]
