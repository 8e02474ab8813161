"""Fit the numbers of a law: climb to the maximum of the likelihood of the next frame.

The likelihood is that of `innovation_filter`. Gauss-Newton steps climb it from many points. Slopes
are taken by wide steps first, which smooth a rough surface, then by steps of about one standard
error: wider ones cut the corners of a bent ridge. A weak prior (a standard deviation of half the
range, on the scale of the search) keeps flat directions in place.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

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
    """Point at which a model fits best.

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
    """Return the negative logarithm of a weak normal prior of SD 1/2 about the middle of each range."""
    return float((2.0 * (u[list(free)] - 0.5) ** 2).sum())


def loss_at(model: FitModel, u: Array, free: Sequence[int], spans: Sequence[int] | None) -> float:
    """Return the negative log-likelihood with the prior of the free numbers."""
    return model.score(u, spans).loss() + log_prior(u, free)


def fit_with_parameter(model: FitModel, fit: Fit, index: int, coordinate: float, spans: Sequence[int] | None) -> Fit:
    """Return a fit with one more number at a coordinate; model : with the number, fit : without it."""
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
    """Return slopes of the differences (step, component, free number); one-sided if those at `u` are given.

    steps : of all, or of each free number
    """
    columns = []
    for k, step in zip(free, np.broadcast_to(steps, len(free)).tolist(), strict=True):
        low, high = u.copy(), u.copy()
        # One-sided slopes cost half; towards the middle of the range, so that the step stays inside
        # it.
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


def standard_errors(model: FitModel, fit: Fit, spans: Sequence[int]) -> Array:
    """Return standard errors of all numbers, as shares of their ranges, by the curvature at a fit; 0 of fixed ones.

    The larger of two: by wide slopes, which cut the corners of a bent ridge, and by fine ones, in
    which single pairs show that a radius takes in or leaves out. The prior is part of it: a number
    that the tracks do not tell has about half its range.
    """
    errors = np.zeros(len(fit.place))
    each = [np.diag(np.linalg.inv(curvature(model, fit, spans, way))) for way in (WIDE_SLOPES, CENTRAL_SLOPES)]
    # Neither curvature alone is safe: wide slopes see no single pair, fine slopes see little else.
    errors[fit.free] = np.sqrt(np.maximum(*each))
    return errors


def open_ends(model: FitModel, fit: Fit, spans: Sequence[int]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the numbers without a lower, and without an upper limit: nothing on the way to that end fits worse.

    Such as a largest force that nobody ever uses.
    """
    unlimited = np.zeros((2, len(fit.place)), bool)
    for k in [k for k in fit.free if k < model.named]:
        for side, end in enumerate((0.0, 1.0)):
            ways = fit.place[k] + np.array(ON_THE_WAY) * (end - fit.place[k])
            unlimited[side, k] = not any(_worse(model, fit, spans, k, x) for x in ways)
    return unlimited[0], unlimited[1]


def distance_to_worse(model: FitModel, fit: Fit, spans: Sequence[int], index: int, end: float) -> float:
    """Return the distance of a point towards an end of its range beyond which the tracks fit worse; others stay."""
    near, far = 0.0, abs(end - float(fit.place[index]))
    # Bisection: the likelihood is only assumed to fall once between the fit and the end.
    for _ in range(HALVED):
        middle = 0.5 * (near + far)
        worse = _worse(model, fit, spans, index, fit.place[index] + math.copysign(middle, end - fit.place[index]))
        near, far = (near, middle) if worse else (middle, far)
    return far


def _worse(model: FitModel, fit: Fit, spans: Sequence[int], number: int, x: float) -> bool:
    return model.score(with_coordinate(fit.place, number, x), spans).loss() > fit.score.loss() + CHI2_HALF_95


def with_coordinate(place: Array, number: int, x: float) -> Array:
    """Return a copy of a point with one of its numbers set to x."""
    u = place.copy()
    u[number] = x
    return u


def curvature(model: FitModel, fit: Fit, spans: Sequence[int] | None, slopes: int = WIDE_SLOPES) -> Array:
    """Return second derivatives of the loss by the free numbers, with the prior."""
    e, _ = model.differences(fit.place, spans)
    if slopes == WIDE_CENTRAL_SLOPES:
        curvature = _normal(model, fit, spans, e, PROBE / 8.0, False)[0]
    else:
        curvature = _normal(model, fit, spans, e, PROBE, True)[0]
        if slopes != WIDE_SLOPES:
            curvature = _normal(model, fit, spans, e, _probes(curvature), slopes != CENTRAL_SLOPES)[0]
    return curvature + 4.0 * np.eye(len(fit.free))


# A step of one standard error compromises between the rounding of fine steps and the bends of
# coarse ones.
def _probes(hessian: Array) -> Array:
    """Return fine steps for slopes: those that change the log-likelihood by a little more than 1."""
    return np.asarray(np.clip(SHOWN / np.sqrt(np.diag(hessian) + 4.0), MIN_FINE_STEP, PROBE))


def conditional_point(fit: Fit, curved: Array, index: int, coordinate: float) -> Array:
    """Move one number of a fit, and the others so that they compensate for it by the curvature."""
    u, k = fit.place.copy(), fit.free.index(index)
    others = [f for f in range(len(fit.free)) if f != k]
    moves = -np.linalg.solve(curved[np.ix_(others, others)], curved[others, k]) * (coordinate - u[index])
    u[[fit.free[f] for f in others]] += moves
    u[index] = coordinate
    return np.clip(u, 0.0, 1.0)


def power_law_point(model: FitModel, fit: Fit, moved: Array, index: int, spans: Sequence[int] | None) -> Array:
    """Return the point of `conditional_point`, with whole exponents: laws are products of whole powers.

    Of numbers that are sought by their logarithm; the others stay where they are. Where thresholds
    make the curvature rough, exponents may be read off wrongly: from those that are read and from
    none, each is raised and lowered by one while that explains more.
    """
    wide = [math.log(n.high / n.low) if n.log else 0.0 for n in model.numbers]
    step = (moved[index] - fit.place[index]) * wide[index]
    # Exponents are slopes of the logarithms along the move, rounded to whole numbers.
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
    """Return curvature and slope of the loss, without the prior. one : take slopes to one side only."""
    along, across = fit.score.variances()
    weights = 1.0 / np.array([along, *[across] * (model.axes - 1)])
    j = jacobian(model, fit.place, fit.free, spans, steps, e if one else None)
    # Gauss-Newton: second derivatives of the predictions are neglected, since differences are small
    # at the fit.
    hessian = np.einsum("scf,c,scg->fg", j, weights, j, optimize=True)
    gradient = np.einsum("sc,c,scf->f", e, weights, j, optimize=True)
    return hessian, gradient


# Search: points from which to climb. Laws have thresholds: if no neighbour is within a radius, the
# radius has no slope, and a climb from there ends at once. So points are drawn evenly over the
# whole range (Sobol) and raced: all climb a few steps, the better half goes on. The simpler law
# comes first: a number whose default switches a part of the law off (a field of view of 360
# degrees) stays there until the rest is fitted. Last, each number is moved along its whole range
# while the others follow (a profile of the likelihood), which leaves modes that lie a valley apart.
# CMA-ES with 1,600 evaluations was lost among switches that close a part of the law; Sobol points
# with a race were not.
DRAWN = 8  # two to the power of this: places that are looked at
RACE = ((10, 3), (5, 4), (2, 8))  # how many climb, and by how many steps
SCAN = 10  # places along the range of one number
PROFILE, FOLLOW = 6, 2  # the same while the others follow, by so many steps
SWEEPS = 3  # of all numbers
BETTER = 1.0  # loss that a move has to gain


def default_is_off(model: FitModel) -> list[int]:
    """Return the named numbers whose default switches a part of the law off."""
    assert model.law is not None
    known = model.law.scenario.model.usual
    return [
        k
        for k, number in enumerate(model.numbers[: model.named])
        if number.key.startswith("model.") and known.get(number.key.partition(".")[2]) == number.default
    ]


def draw_points(model: FitModel, start: Array, spans: Sequence[int], seed: int) -> Array:
    """Return points of the named numbers (point, number): `start` and others over the whole range, best first.

    Usual numbers stay usual.
    """
    from scipy.stats import qmc

    named = list(range(model.named))
    found = np.vstack([start[named], qmc.Sobol(len(named), seed=seed).random_base2(DRAWN)])
    # Drawn values would switch a part on that the simpler law does without; these numbers wait
    # until the rest is fitted.
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
    """Return the best climb from the start and from the first of some points; usual numbers are free in its last steps.

    start : a place whose named numbers are defaults; begin : places of the named numbers, best first
    """
    simple = [k for k in free if k not in default_is_off(model)]
    places = [start, *(np.concatenate([x, start[model.named :]]) for x in start_points[: RACE[0][0] - 1])]
    fits: list[Fit] = []
    # Successive halving: most points are clearly worse after a few steps, so the effort goes to the
    # rest.
    for count, steps in RACE:
        fits = [climb_to_maximum(model, u, simple, spans, steps, slopes=(WIDE_SLOPES,)) for u in places[:count]]
        fits.sort(key=lambda each: each.loss)
        places = [each.place for each in fits]
        on_progress()
    return climb_to_maximum(model, fits[0].place, free, spans, slopes=(WIDE_SLOPES,))


def scan_ranges(model: FitModel, point: Array, free: Sequence[int], spans: Sequence[int] | None) -> tuple[Array, bool]:
    """Scan the range of one named number at a time; return the best point, and True if it is better.

    Where a threshold lies beyond all that happens, a slope shows nothing; a look along the range
    does.
    """
    lowest, best, moved = loss_at(model, point, free, spans), point, False
    for k in [k for k in free if k < model.named]:
        n = model.numbers[k]
        whole = [n.place(value) for value in range(int(n.low), int(n.high))] if n.whole else []
        for x in whole or (np.arange(SCAN) + 0.5) / SCAN:
            u = best.copy()
            u[k] = x
            found = loss_at(model, u, free, spans)
            if found < lowest - BETTER:
                lowest, best, moved = found, u, True
    return best, moved


def profile_ranges(model: FitModel, fit: Fit, spans: Sequence[int], on_progress: Callable[[], None]) -> Fit:
    """Scan the range of one named number at a time while all the others follow; return the best fit."""
    best, curved = fit, curvature(model, fit, spans)
    for _ in range(SWEEPS):
        before = best.loss
        # Each number visits the middle of every cell of its range; the curvature says where the
        # others go meanwhile.
        for k in [k for k in fit.free if k < model.named]:
            others = [f for f in fit.free if f != k]
            for x in (np.arange(PROFILE) + 0.5) / PROFILE:
                if abs(x - best.place[k]) < 0.5 / PROFILE:
                    continue
                # The curvature is only local: where it points to a worse place, the climb begins
                # with the others unmoved.
                found = _lower(
                    model, (conditional_point(best, curved, k, x), with_coordinate(best.place, k, x)), others, spans
                )
                # The move gained: free all numbers from there, and take the curvature of the new
                # place.
                if found.loss < best.loss - BETTER:
                    best = climb_to_maximum(model, found.place, fit.free, spans, 2 * FOLLOW, slopes=(WIDE_SLOPES,))
                    curved = curvature(model, best, spans)
            on_progress()
        if best.loss > before - BETTER:
            break
    return best


def _lower(model: FitModel, places: Sequence[Array], free: Sequence[int], spans: Sequence[int]) -> Fit:
    """Climb a few steps from that of some points which begins lower."""
    return climb_to_maximum(
        model, min(places, key=lambda u: loss_at(model, u, free, spans)), free, spans, FOLLOW, slopes=(WIDE_SLOPES,)
    )


# Modes: numbers that act together, such as those of a wall, are searched again over their whole
# ranges. They have several modes, and long narrow ridges that bend between them: no single number
# leads along one, and a climb ends wherever on the ridge it arrives. So many climbs are made: some
# with the numbers of the group alone first, others in a race with all numbers, since beside a wrong
# rest the group alone climbs back to its old place. Where ends lie apart, the way from one to the
# better one is continued beyond it.
TOGETHER = 4  # most numbers that are drawn together
# Bhattacharyya's overlap, of roots: in squares a few steps at an edge outweigh all others, and a
# wall's range and gain (overlap 0.84 to 0.96) were never drawn together.
SIMILAR = 0.8  # overlap of where two numbers act, from which they are
GROUPS = 3  # of them, the least certain first
SHARED = 0.5  # of a group: where more of it stands in an earlier one, other groups come first
REDRAWN = 8  # two to the power of this: places of a group that are looked at
ALONE, ALL, WHOLE = (16, 10), (6, 16), (4, 12)  # how many climb, by how many steps: the group, all, and on all frames
# Beside a wrong rest a group climbs back to its old place, because the rest was fitted to it: all
# numbers must race.
MODE_RACE = ((24, 4), (8, 8))  # the same of a race with all numbers
KEPT = 4  # of its ends
SAME = 0.1  # of a range: places whose numbers of a group are all nearer than this are of one hill
UNLIKELY = 20.0  # loss above the best on few frames, beyond which a hill is left
BEYOND = (0.5, -0.5)  # of the way from another end to the best one: how far is looked past it, and between the two
ONWARD = 2  # times that ends are gone beyond
MODE_GAIN = 0.5  # loss that a move has to gain


def search_modes(
    model: FitModel, fit: Fit, few_spans: Sequence[int], spans: Sequence[int], on_progress: Callable[[], None]
) -> Fit:
    """Search other modes of numbers that act together; return the best fit, with the other ends on the way.

    few, spans : on which is looked, and on which is fitted
    """
    met: list[Fit] = []
    # Few frames are enough to find modes, all frames are needed to compare them: the expensive
    # climbs come last.
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
    """Draw a group again from a Sobol sequence; return ends of a race, and of the group by itself."""
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
    # Each hill once, whatever its loss: while the other numbers stay at this fit's, a higher hill
    # may look lower.
    return [*raced, *distinct_points(alone, group, [fit.place, *raced])][: ALL[0]]


def race_climbs(model: FitModel, points: Sequence[Array], free: Sequence[int], spans: Sequence[int]) -> list[Fit]:
    """Race climbs over all numbers from the first of some points, the better ones go on; return ends, best first."""
    found: list[Fit] = []
    for count, steps in MODE_RACE:
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
    """Climb beyond the best end, away from the next ones; return all ends, best first.

    Two ends on one ridge tell which way it goes, however narrow it is.
    """
    found = sorted(ends, key=lambda end: end.loss)
    # Two ends on one narrow, bent ridge show its direction; curvature cannot take a step along it.
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
        if found[0].loss > best.loss - MODE_GAIN:
            break
    return found


def distinct_points(points: Sequence[Array], group: Sequence[int], known_points: Sequence[Array] = ()) -> list[Array]:
    """Return the points that differ from known ones, and from all before them, in some number of a group."""
    found = list(known_points)
    for u in points:
        if all(np.abs(u - other)[list(group)].max() > SAME for other in found):
            found.append(u)
    return found[len(known_points) :]


def parameter_groups(model: FitModel, fit: Fit, spans: Sequence[int]) -> list[list[int]]:
    """Group named numbers that act on the same steps, around the least certain ones."""
    named = [k for k in fit.free if k < model.named]
    slopes = np.abs(jacobian(model, fit.place, named, spans, here=model.differences(fit.place, spans)[0]))
    flat = np.sqrt(slopes.reshape(-1, len(named)))  # a few steps at edges would outweigh all others
    sizes = np.maximum(np.linalg.norm(flat, axis=0), 1e-30)
    overlap = (flat.T @ flat) / np.outer(sizes, sizes)
    errors = np.diag(np.linalg.inv(curvature(model, fit, spans)))[[fit.free.index(k) for k in named]]
    found: list[list[int]] = []
    # The least certain number founds a group of the numbers that act most like it, unless it is in
    # one already.
    for k in np.argsort(-errors).tolist():
        near = [f for f in np.argsort(-overlap[k]).tolist() if f != k and overlap[k, f] > SIMILAR][: TOGETHER - 1]
        group = sorted(named[f] for f in (k, *near))
        if near and not any(named[k] in other for other in found):
            found.append(group)
    return sort_groups(found)[:GROUPS]


def sort_groups(groups: Sequence[list[int]]) -> list[list[int]]:
    """Sort groups: those that mostly repeat earlier ones come last.

    Else the numbers of friction, the least certain, would come three times in other company, and
    those of a wall never.
    """
    first: list[list[int]] = []
    # A group that repeats more than half of an earlier one waits, so that other numbers have their
    # turn.
    for group in groups:
        if all(len({*group} & {*other}) <= SHARED * len(group) for other in first):
            first.append(group)
    return first + [group for group in groups if group not in first]
