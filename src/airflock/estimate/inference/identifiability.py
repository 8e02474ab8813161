"""Identifiability: numbers of a law that tracks can identify, ridges of the likelihood, and dropped numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.innovation_filter import FitModel
from airflock.estimate.inference.law_candidates import LawCandidate
from airflock.estimate.inference.likelihood_fit import (
    CENTRAL_SLOPES,
    CHI2_HALF_95,
    FINE_SLOPES,
    MIN_FINE_STEP,
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
    scan_ranges,
    with_coordinate,
)

Array = NDArray[np.float64]
# Numbers that tracks can identify. Of two numbers of which either explains the tracks, the first
# declared is reported: authors declare important ones first.
DEPENDENT = 0.2  # share of a slope that other numbers do not explain; below it a number is not identifiable
EFFECT_POINTS = 6  # best places at which the effect of a number is looked for
ALONG = (0.1, 0.35, 0.65, 0.9)  # of a range: where the effect of a number is looked for
FINE = 0.005  # of a range: step by which numbers are tested for depending on each other
APART = 0.1  # of a range, from the default
ELSEWHERE = 0.2  # of a range: move of a number, to see whether the others make up for it wholly
UNLIKELY = 20.0  # loss above the fit, beyond which no climb begins where another number has taken a part


def identifiable_indices(model: FitModel, start: Array, start_points: Array, spans: Sequence[int]) -> list[int]:
    """Return indices of the named numbers that tracks can identify, in order; the others stay at their defaults.

    A number is not identifiable if it changes nothing anywhere along its range, such as the limit
    of a law that has none; or if the earlier numbers explain its slope at the best of many places
    taken together, such as a mass beside all weights. A radius within which nobody is at these
    places has no slope, but an effect along its range: kept.
    """
    places = []
    # Slopes at several good points: one point may lie where a part of the law is switched off.
    for x in start_points[:EFFECT_POINTS]:
        u = start.copy()
        u[: model.named] = x
        places.append(u)
    alive = [k for k in range(model.named) if k == model.speed_index or has_effect(model, places, k, spans)]
    flat = np.concatenate([_slopes(model, u, alive, spans) for u in places])
    kept: list[int] = []
    basis = np.zeros((len(flat), 0))
    # Gram-Schmidt in the order of declaration: a column that earlier ones explain is a number that
    # they replace.
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
    """Return True if a number changes the loss anywhere along its range."""
    # A threshold beyond all that happens has no slope but an effect, so values along the range are
    # tried.
    for u in points:
        here = model.score(u, spans).loss()
        for x in ALONG:
            moved = u.copy()
            moved[index] = x
            if abs(model.score(moved, spans).loss() - here) > 1.0:
                return True
    return False


def _slopes(model: FitModel, u: Array, numbers: Sequence[int], spans: Sequence[int]) -> Array:
    """Return the slopes of all differences in units of their standard deviations, (difference, number)."""
    weights = 1.0 / np.sqrt(np.maximum((model.differences(u, spans)[0] ** 2).mean(axis=0), 1e-30))
    found: Array = (jacobian(model, u, numbers, spans, FINE) * weights[None, :, None]).reshape(-1, len(numbers))
    return found


def canonical_model(
    law: LawCandidate, model: FitModel, fit: Fit, on_progress: Callable[[], None]
) -> tuple[FitModel, Array]:
    """Express a model in the numbers that are declared first; return it and its point, unchanged if nothing is gained.

    A number that was given up before the search may come back under the name of a later one: the
    weight of one force as the unit of all forces, a radius as another within which its neighbours
    act, too. Where either of two numbers explains the tracks, the one that is declared first is
    kept; the later one takes its default.

    law : with all its numbers; the fit is on all spans, and its place is carried over as it is
    """
    few = model.few()
    place, lowest = fit.place, climb_to_maximum(model, fit.place, fit.free, few, slopes=(WIDE_SLOPES,)).loss
    # Bring back each dropped number that is declared earlier, and try to drop a later one in its
    # place.
    for earlier in law.numbers:
        assert model.law is not None
        if earlier in model.law.numbers:
            continue
        fuller, i = model.with_parameter(law, earlier)
        full = fit_with_parameter(fuller, replace(fit, place=place), i, earlier.place(earlier.default), few)
        curved = curvature(fuller, full, few, WIDE_CENTRAL_SLOPES)
        # The last declared goes first, since it matters least to the authors.
        for k in reversed(range(i + 1, fuller.named)):
            if not (_may_go(fuller, k) and _away(fuller, full, k)):
                continue
            without, rest = fuller.with_fixed([k]), [f for f in full.free if f != k]
            start = _given_up(without, full, curved, k, few)
            # Where the start is hopeless, or the earlier number has not moved, a climb would only
            # cost time.
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
    """Return True if a number may be dropped: any of the law; one of the body only if its default is 0."""
    one = model.numbers[number]
    return number != model.speed_index and (one.key.startswith("model.") or one.default == 0.0)


def _away(model: FitModel, fit: Fit, number: int) -> bool:
    """Return True if a number is away from its default, or its default lies outside the searched range."""
    one = model.numbers[number]
    return not one.low <= one.default <= one.high or abs(one.place(one.default) - fit.place[number]) >= APART


def _anywhere(model: FitModel, fit: Fit, curved: Array, number: int, spans: Sequence[int]) -> bool:
    """Return True if the tracks are explained as well elsewhere, the others moved by whole powers of a number."""
    x = float(fit.place[number])
    moved = conditional_point(fit, curved, number, x + (ELSEWHERE if x < 0.5 else -ELSEWHERE))
    return loss_at(model, power_law_point(model, fit, moved, number, spans), fit.free, spans) < fit.loss + CHI2_HALF_95


def droppable_parameters(model: FitModel, fit: Fit, on_progress: Callable[[], None]) -> tuple[list[int], Array, Array]:
    """Return the named numbers without which the tracks are explained as well, and two points of the rest without each.

    Each number that stands away from its default, or whose default lies outside the range that was
    searched, is put there in turn, the last declared first, and the rest is fitted again: from
    where the others make up for it, and from where another number of its unit takes its part. So is
    a number near its default that may as well stand elsewhere, such as a mass beside forces.

    The first place is where a few frames are explained best; the second is the fit's own place,
    carried over.
    """
    few = model.few()
    best = climb_to_maximum(model, fit.place, fit.free, few, slopes=(WIDE_SLOPES,))
    carried, lowest, gone = fit.place, best.loss, list[int]()
    # Backward elimination: every drop is final, and the next number is judged without the dropped
    # ones.
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
    """Return the likeliest point with a number at its default: the others, or one of its unit, compensate for it.

    model : one in which this number is fixed
    """
    one, rest = model.numbers[number], [f for f in fit.free if f != number]
    moved = conditional_point(fit, curved, number, one.place(one.default))
    starts = [moved, power_law_point(model, fit, moved, number, spans)]
    for other in (f for f in rest if f < model.named and model.numbers[f].unit == one.unit):
        starts.append(fit.place.copy())
        starts[-1][other] = model.numbers[other].place(one.value(fit.place[number]))
    return min(starts, key=lambda u: loss_at(model, u, rest, spans))


RidgePath = tuple[tuple[Array, float], ...]  # places, and by how much the log-likelihood has fallen there
# Ridges: how far numbers that compensate for each other go together before the tracks are explained
# worse. The numbers of a braking curve lie on a ridge that bends. The curvature at the fit knows
# its first steps only, and a fit repeated from beside its end does not follow it. So the ridge is
# followed: one number is moved step by step, all others follow, and the points on the way bound
# each of them. Where numbers compensate in more than one way the ridge is a surface, and the way of
# one number misses where another could go; so the least certain numbers are followed one by one,
# and so are those that act similarly. A number such as a largest force acts nowhere beyond some
# value: a plateau, to which no way leads; so each end of each range is tried by itself, with all
# others following there.
WORST, WALKED = 4, 8  # least certain numbers, and numbers that are walked, at most
TIED = 0.9  # correlation of the slopes of two numbers, from which both are walked, however certain they seem
# The number that acts most like the moved one follows first. With all at once the way lost a ridge
# on which the likelihood does not fall (gain 1.6 to 19 1/s of a wall).
NESTED = 3  # numbers that act most like the moved one, which follow before all do
WINDOW, LINE_STEPS = (
    0.05,
    14,
)  # of a range: on which one of them looks for its place alone, at least; and how often it looks
SIMILAR = 0.5  # correlation of the slopes of two numbers, from which they are similar
SHORTEST = 0.03  # of a range: ends nearer than this by the curvature are not looked for
FIRST = 0.4  # of the way to the end by the curvature: first step
STRIDE = (0.01, 0.15)  # of a range: least step, but for a first one that is shorter, and longest
FASTER = 1.6  # each step is so much longer than the one before, while the likelihood hardly falls
PLACES = 16  # that are looked at, on each side of a ridge
FOLLOWS = 4  # steps of the climb by which the others follow
SHORTER = 3.0  # a step is so much shorter where the likelihood has fallen too far: the others could not follow
# log-likelihood by which a place must be better than the fit, to begin again from there: climbs
# that begin beside each other end several units apart, and from the top of a spike every way falls
HIGHER = 6.0
AGAIN = 2  # times
UNLIKELY_END = 20.0  # fall at the end of a range, the others where they are, beyond which nothing follows


@dataclass(frozen=True)
class Ridges:
    """Points along ridges, each way from the fit, and the drop of the log-likelihood there."""

    paths: tuple[RidgePath, ...]

    def ends(self, point: Array, drop: float) -> tuple[Array, Array]:
        """Return the least and largest points of all numbers where the log-likelihood has fallen by at most `drop`."""
        low, high = point.copy(), point.copy()
        for way in self.paths:
            # Between two points the drop is taken as a parabola, so its root is linear in the
            # distance.
            for (inner, less), (outer, more) in zip(way[:-1], way[1:], strict=True):
                if less > drop:
                    break
                share = 1.0
                if more > drop:  # a parabola between the two
                    share = (drop**0.5 - less**0.5) / (more**0.5 - less**0.5)
                reached = inner + share * (outer - inner)
                low, high = np.minimum(low, reached), np.maximum(high, reached)
        return low, high


def profile_ridges(
    model: FitModel, fit: Fit, spans: Sequence[int], drop: float, on_progress: Callable[[], None] = lambda: None
) -> tuple[Fit, Ridges]:
    """Follow ridges from a fit, or from a better one on the way, down to a drop of the likelihood.

    Other ends that the search has met, and places on the way to a better fit, are added where they
    are as likely: each by itself, for a valley may lie between.
    """
    ways: list[RidgePath] = []
    met = list(fit.others)
    # A way may lead to a better fit than the one it began at; then everything begins again there,
    # at most AGAIN times.
    for turn in range(AGAIN + 1):
        ways, better = _ways(model, fit, spans, drop, turn < AGAIN)
        on_progress()
        if better is None:
            break
        met += [fit.place, *(place for way in ways for place, _ in way)]
        fit = climb_to_maximum(model, better, fit.free, spans, slopes=(FINE_SLOPES, CENTRAL_SLOPES))
    falls = [max(model.score(u, spans).loss() - fit.score.loss(), 0.0) for u in met]
    alone = [((u, fall), (u, fall)) for u, fall in zip(met, falls, strict=True) if fall <= drop]
    return fit, Ridges((*ways, *alone))


def _ways(
    model: FitModel, fit: Fit, spans: Sequence[int], drop: float, leave: bool
) -> tuple[list[RidgePath], Array | None]:
    """Return the ways along all ridges; and a better point, where a ridge may be left for it."""
    view = CurvatureView(model, fit, spans, drop)
    named = [k for k, f in enumerate(fit.free) if f < model.named]
    # Following a ridge costs tens of climbs, so only uncertain or tied numbers are followed.
    worst = [k for k in sorted(named, key=lambda k: -view.reach[k]) if view.reach[k] >= SHORTEST][:WORST]
    tied = [
        k
        for k in sorted(named, key=lambda k: -view.similarity[k, named].max())
        if view.similarity[k, named].max() > TIED
    ]
    ways: list[RidgePath] = []
    # The ends of all ranges: a plateau shows there, and nowhere on a ridge.
    for k, end in ((fit.free[k], end) for k in named for end in (0.0, 1.0)):
        found, fell = fit_at_end(model, fit, spans, k, end)
        if leave and fell < -HIGHER:
            return ways, found
        if fell <= drop:
            ways.append(((found, max(fell, 0.0)), (found, max(fell, 0.0))))
    for k in list(dict.fromkeys([*worst, *tied]))[:WALKED]:
        for side in (-1.0, 1.0):
            way, better = view.walk(k, side, leave)
            if better is not None:
                return ways, better
            ways.append(way)
    return ways, None


class CurvatureView:
    """Prediction by the curvature at a fit of the ways along its numbers, by their places among the free.

    reach : how far each goes by the curvature until the likelihood has fallen by `drop`
    similarity : of the slopes of any two numbers
    """

    def __init__(self, model: FitModel, fit: Fit, spans: Sequence[int], drop: float):
        curved = [curvature(model, fit, spans, way) for way in (WIDE_SLOPES, CENTRAL_SLOPES)]
        covariances = [np.linalg.inv(each) for each in curved]
        self.model, self.fit, self.spans, self.drop = model, fit, spans, drop
        self.covariance, self.similarity = covariances[1], _similarity(curved[1])
        self.reach: Array = np.sqrt(2.0 * drop * np.maximum(*(np.diag(each) for each in covariances)))

    def walk(self, k: int, side: float, leave: bool) -> tuple[RidgePath, Array | None]:
        """Follow the ridge of a number down (-1) or up (1); return the way, and a better point if it may be left for
        one.
        """
        fit, covariance = self.fit, self.covariance
        slope = np.zeros(len(fit.place))
        slope[fit.free] = covariance[k] / covariance[k, k]
        near = [g for g in np.argsort(-self.similarity[k]).tolist() if self.similarity[k, g] > SIMILAR]
        follow = [fit.free[g] for g in near if fit.free[g] < self.model.named]
        first = FIRST * float(self.reach[k])
        return _walk(self.model, fit, self.spans, fit.free[k], follow, side * slope, first, self.drop, leave)


def fit_at_end(model: FitModel, fit: Fit, spans: Sequence[int], index: int, end: float) -> tuple[Array, float]:
    """Fit with one number at an end of its range, the others following; return the point and the drop of the
    log-likelihood.
    """
    u = with_coordinate(fit.place, index, end)
    fell = model.score(u, spans).loss() - fit.score.loss()
    if fell > UNLIKELY_END:
        return u, fell
    rest = [f for f in fit.free if f != index]
    followed = climb_to_maximum(model, u, rest, spans, FOLLOWS, slopes=(FINE_SLOPES, CENTRAL_SLOPES))
    return followed.place, followed.score.loss() - fit.score.loss()


def _slid(model: FitModel, u: Array, number: int, spans: Sequence[int], far: float) -> tuple[Array, float]:
    """Move one number to where the tracks are explained best, at most as far again as it has come; return point and
    loss.

    Where single individuals are lost, the likelihood has edges, at which slopes lead nowhere.
    """
    from scipy.optimize import minimize_scalar

    def loss(x: float) -> float:
        return model.score(with_coordinate(u, number, x), spans).loss()

    ends = np.clip([u[number] - far - WINDOW, u[number] + far + WINDOW], 0.0, 1.0)
    found = minimize_scalar(
        loss, bounds=ends, method="bounded", options={"maxiter": LINE_STEPS, "xatol": MIN_FINE_STEP}
    )
    here = loss(float(u[number]))
    return (with_coordinate(u, number, float(found.x)), float(found.fun)) if found.fun < here else (u, here)


def _similarity(curved: Array) -> Array:
    """Return the similarity of any two numbers: correlations of their slopes, 0 of each with itself."""
    sizes = np.sqrt(np.diag(curved))
    found: Array = np.abs(curved) / np.outer(sizes, sizes)
    np.fill_diagonal(found, 0.0)
    return found


def _walk(
    model: FitModel,
    fit: Fit,
    spans: Sequence[int],
    number: int,
    near: Sequence[int],
    slope: Array,
    step: float,
    drop: float,
    leave: bool,
) -> tuple[RidgePath, Array | None]:
    """Follow one way along a ridge; return it, and the best point on the way if it may be left for a better one.

    Where the way leads higher it is gone on: what leads along a ridge is a walk, not a climb.

    near  : numbers that act as the moved one does, which follow first
    slope : moves of all numbers at first, that of the moved one is 1 or -1; step : first move
    """
    rest = [f for f in fit.free if f != number]
    way = [(fit.place, 0.0)]
    best: tuple[Array | None, float] = (None, -HIGHER)
    step = float(np.clip(step, MIN_FINE_STEP, STRIDE[1]))
    least = min(step, STRIDE[0])
    # Predictor and corrector: a step along the slope of the way so far, then the others climb back
    # to the ridge.
    for _ in range(PLACES):
        last = way[-1][0]
        start = np.clip(last + step * slope, 0.0, 1.0)
        if near:
            # all along the way so far, or none but the moved one and one that makes up for it
            beside = with_coordinate(last, number, float(start[number]))
            candidates = [(start, near[0]), *((beside, f) for f in near[:NESTED])]
            alone = [_slid(model, u, f, spans, abs(float(start[f] - last[f]))) for u, f in candidates]
            start = min(alone, key=lambda each: each[1])[0]
            start = climb_to_maximum(
                model, start, near[:NESTED], spans, FOLLOWS, slopes=(FINE_SLOPES, CENTRAL_SLOPES)
            ).place
        found = climb_to_maximum(model, start, rest, spans, FOLLOWS, slopes=(FINE_SLOPES,))
        down = found.score.loss() - fit.score.loss()
        if leave and down < best[1]:
            best = found.place, down
        fell = max(down, 0.0)
        moved = abs(found.place[number] - last[number])
        if moved == 0.0:
            break
        # The likelihood has fallen too far at once: the others could not follow, so repeat with a
        # shorter step.
        if fell - way[-1][1] > 0.5 * drop and step > least:
            step = max(step / SHORTER, least)
            continue
        way.append((found.place, fell))
        if fell >= drop or not 0.0 < found.place[number] < 1.0:
            break
        slope = (found.place - last) / moved
        # On flat ridges steps grow, so that a plateau over the whole range takes few climbs.
        if fell - way[-2][1] < 0.1 * drop:
            step = min(FASTER * step, STRIDE[1])
    return tuple(way), best[0]


# Dropped numbers: if their defaults explain the tracks as well, the intervals of the others must
# still allow for them.
AWAY = 0.2  # of a range: move of a number, to test whether the others compensate for it exactly
DROP = 12.0  # fall of the log-likelihood at which a walk ends that looks for a higher place
EXACT = 0.05  # change of the log-likelihood by such a move, below which they do


def restore_parameters(
    law: LawCandidate, model: FitModel, fit: Fit, spans: Sequence[int], on_progress: Callable[[], None]
) -> tuple[FitModel, Fit]:
    """Restore dropped numbers that explain something far from their defaults, with the others elsewhere.

    A number is given up where no climb from the fit says anything for it. A walk may lead higher
    all the same.

    law : with all its numbers
    """
    # A default that explains the tracks as well may lie on a ridge: the true point was 34 units
    # higher and no climb found it.
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
                # One restored number may make another one useful: begin again with the fuller
                # model.
                return restore_parameters(law, fuller, higher, spans, on_progress)
    return model, fit


def ridges_of_dropped(
    law: LawCandidate, model: FitModel, fit: Fit, spans: Sequence[int], drop: float, on_progress: Callable[[], None]
) -> tuple[RidgePath, ...]:
    """Follow ways of a fit's numbers on which a dropped number leaves its default, and all others follow.

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
    """Follow ways on which a number leaves a point; none where that would not concern the others.

    They say nothing of a number that changes nothing; nor of one that the others make up for
    exactly, such as the unit of all weights: no tracks could identify it, and its default is the
    unit of the others.

    model : with the number; fit : without it
    """
    view = _view(model, fit, index, coordinate, spans, drop)
    return [] if view is None else [view.walk(view.fit.free.index(index), side, False)[0] for side in (-1.0, 1.0)]


def _view(
    model: FitModel, fit: Fit, number: int, place: float, spans: Sequence[int], drop: float
) -> CurvatureView | None:
    """Return the view from a fit along a number that it does without; None where that would not concern the others."""
    full = fit_with_parameter(model, fit, number, place, spans)
    far = full.score.loss() > fit.score.loss() + drop  # its default lies beyond what is sought
    if far or not has_effect(model, [full.place], number, spans) or is_compensated(model, full, number, spans):
        return None
    return CurvatureView(model, replace(full, score=fit.score), spans, drop)  # falls are counted from the fit


def is_compensated(model: FitModel, fit: Fit, index: int, spans: Sequence[int]) -> bool:
    """Return True if the others compensate for a number exactly, by powers of it or along a line."""
    x = float(fit.place[index])
    moved = conditional_point(
        fit, curvature(model, fit, spans, CENTRAL_SLOPES), index, x + (AWAY if x < 0.5 else -AWAY)
    )
    here = model.score(fit.place, spans).loss()
    return any(
        abs(model.score(u, spans).loss() - here) < EXACT
        for u in (np.clip(moved, 0.0, 1.0), power_law_point(model, fit, moved, index, spans))
    )
