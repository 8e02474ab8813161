"""Fit one law to tracks, and hold out spans or whole recordings to see what it predicts."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.identifiability import (
    canonical_model,
    droppable_parameters,
    identifiable_indices,
    restore_parameters,
)
from airflock.estimate.inference.innovation_filter import FitModel
from airflock.estimate.inference.law_candidates import FitParameter, LawCandidate
from airflock.estimate.inference.likelihood_fit import (
    CHI2_HALF_95,
    FINE_SLOPES,
    MAX_CLIMB_STEPS,
    WIDE_SLOPES,
    Fit,
    climb_to_maximum,
    draw_points,
    loss_at,
    profile_ranges,
    race_from_points,
    scan_ranges,
    search_modes,
    settle_fit,
)
from airflock.estimate.inference.observed_tracks import SpanTracks, TrackScale

Array = NDArray[np.float64]
FOLDS = 4  # parts of the tracks, every other one of which is held out
ENOUGH = 24_000  # individual steps, and
FRAMES = (400, 2400)  # least and largest number of frames, on which is fitted
LONG = 20  # steps of a climb to the end
ELSEWHERE = (0.1, 0.3, 0.5, 0.7, 0.9)  # places of a number that was given up, beside its default, from which is climbed
REGAIN = 8  # steps of such a climb
# One prediction that lost somebody cost 869 units and hid the gain of nine spans of ten; at ten
# standard deviations a normal density is 1e-22, which nobody believes of a tracker.
WILD = (1e-3, 20.0)  # share of held-out differences that are wild, and how many times their standard deviation is
WITHIN = 1.959964  # standard deviations that hold 95 %


@dataclass
class HeldOutScore:
    """Score of the predictions of spans that were not fitted.

    surprise : (span,) negative log-likelihood; inside: share of differences within the 95 % that are predicted
    """

    negative_log_likelihoods: Array
    inside: float


def sample_spans(model: FitModel) -> list[int]:
    """Return the spans that are fitted: all, or evenly some of them where tracks are long."""
    individuals = max(tracks.individual_count for tracks in model.tracks)
    return model.few(int(np.clip(ENOUGH / individuals, *FRAMES)))


def straight_model(
    tracks: Sequence[SpanTracks], scale: TrackScale, pool: Sequence[int] | None = None
) -> tuple[FitModel, Fit]:
    """Return the model of going straight on at the own speed, which relaxes to the usual one; pool : spans it sees."""
    model = FitModel(None, tracks, scale)
    model = model if pool is None else model.on(pool)
    return model, climb_to_maximum(model, model.first(), range(len(model.numbers)), sample_spans(model), 30)


def fit_law(
    law: LawCandidate, tracks: Sequence[SpanTracks], scale: TrackScale, gains: Array, seed: int, pool: Sequence[int],
    on_progress: Callable[[], None],
) -> tuple[FitModel, Fit]:  # fmt: skip
    """Fit the numbers of a law to the spans of a pool; those that cannot be distinguished stay at their defaults.

    gains : of going straight on, to begin with
    """
    model = FitModel(law, tracks, scale).on(pool)
    begin = draw_points(model, _begin(model, gains), model.few(), seed)
    kept = identifiable_indices(model, _begin(model, gains), begin, model.few())
    on_progress()
    model = model.with_parameters([law.numbers[k] for k in kept])
    fitted = race_from_points(
        model, _begin(model, gains), begin[:, kept], free_indices(model), model.few(), on_progress
    )
    fitted = polish_fit(model, fitted.place)
    on_progress()
    return model, fitted


def merge_fits(law: LawCandidate, fits: Sequence[tuple[FitModel, Fit]]) -> tuple[FitModel, Fit]:
    """Fit a law to all spans, from the fits to parts of them, with every number that one of these has.

    law : with all its numbers
    """
    held: set[FitParameter] = {n for model, _ in fits for n in model.numbers[: model.named]}
    whole = fits[0][0].on(range(len(fits[0][0].spans)))
    whole = whole.with_parameters([n for n in law.numbers if n in held])
    places = []
    for model, fit in fits:
        place = whole.first()
        place[whole.named :] = fit.place[model.named :]
        for n, x in zip(model.numbers[: model.named], fit.place, strict=False):
            place[whole.numbers.index(n)] = x
        places.append(place)
    ends = [
        climb_to_maximum(whole, u, free_indices(whole), sample_spans(whole), slopes=(WIDE_SLOPES, FINE_SLOPES))
        for u in places
    ]
    return whole, min(ends, key=lambda end: end.loss)


def restore_useful(
    law: LawCandidate, model: FitModel, fitted: Fit, on_progress: Callable[[], None]
) -> tuple[FitModel, Fit]:
    """Restore the numbers that were dropped before the search, but explain something at the fit.

    Before the search, `identifiable` asks at places that explain little; at the fit the answer may
    differ.

    law : with all its numbers
    """
    few = model.few()
    best = climb_to_maximum(model, fitted.place, fitted.free, few, slopes=(WIDE_SLOPES,))
    for number in model.dropped_parameters(law):
        fuller, k = model.with_parameter(law, number)
        places = [np.insert(best.place, k, x) for x in (number.place(number.default), *ELSEWHERE)]
        places.sort(key=lambda u, fuller=fuller: loss_at(fuller, u, free_indices(fuller), few))  # type: ignore[misc]
        tried = [
            climb_to_maximum(fuller, u, free_indices(fuller), few, REGAIN, slopes=(WIDE_SLOPES,)) for u in places[:2]
        ]
        on_progress()
        with_it = min(tried, key=lambda each: each.loss)
        if with_it.loss < best.loss - CHI2_HALF_95:
            model, best = fuller, with_it
    if len(model.numbers) == len(fitted.place):
        return model, fitted
    return model, polish_fit(model, best.place, LONG)


def fit_minimal(
    law: LawCandidate, model: FitModel, fitted: Fit, on_progress: Callable[[], None]
) -> tuple[FitModel, Fit]:
    """Search along each number, then fit with all numbers that explain something and no others.

    law : with all its numbers
    """
    model, fitted = fit_canonical(
        law, *drop_redundant(*restore_useful(law, model, fitted, on_progress), on_progress), on_progress
    )
    other = profile_ranges(
        model,
        climb_to_maximum(model, fitted.place, fitted.free, model.few(), slopes=(WIDE_SLOPES,)),
        model.few(),
        on_progress,
    )
    other = settle_fit(
        model, climb_to_maximum(model, other.place, other.free, sample_spans(model), LONG), sample_spans(model)
    )
    fitted = search_modes(
        model, min(fitted, other, key=lambda each: each.loss), model.few(), sample_spans(model), on_progress
    )
    model, fitted = fit_canonical(law, *drop_redundant(model, fitted, on_progress), on_progress)
    return restore_parameters(law, model, fitted, sample_spans(model), on_progress)


def fit_canonical(
    law: LawCandidate, model: FitModel, fitted: Fit, on_progress: Callable[[], None]
) -> tuple[FitModel, Fit]:
    """Fit in terms of the numbers that are declared first, where either of two explains the tracks."""
    renamed, place = canonical_model(law, model, fitted, on_progress)
    return (model, fitted) if renamed is model else (renamed, _nearest(renamed, place, place))


def drop_redundant(model: FitModel, fitted: Fit, on_progress: Callable[[], None]) -> tuple[FitModel, Fit]:
    """Drop numbers that the others compensate for, where the rest explains the sample as well."""
    gone, place, carried = droppable_parameters(model, fitted, on_progress)
    if not gone:
        return model, fitted
    rest = [k for k in range(len(model.numbers)) if k not in gone]
    assert model.law is not None
    without = model.with_parameters([n for k, n in enumerate(model.law.numbers) if k not in gone])
    less = _nearest(without, place[rest], carried[rest])
    if less.loss >= fitted.loss + 2.0 * len(gone):
        return model, fitted
    return without, replace(less, others=tuple(place[rest] for place in fitted.others))


def _nearest(model: FitModel, *places: Array) -> Fit:
    """Return the best of climbs from a point via a few spans, and from another point on the sample at once."""
    ends = (
        polish_fit(model, places[0], LONG),
        climb_to_maximum(model, places[1], free_indices(model), sample_spans(model), LONG),
    )
    return min((settle_fit(model, end, sample_spans(model)) for end in ends), key=lambda end: end.loss)


def free_indices(model: FitModel) -> list[int]:
    """Return numbers that are fitted: all, except the share of own speed that is kept if laws command the speed."""
    return list(range(len(model.numbers) - (0 if model.own_speed else 1)))


def polish_fit(model: FitModel, point: Array, steps: int = MAX_CLIMB_STEPS) -> Fit:
    """Climb on a few spans and on the sample, with a scan of each number's range in between."""
    few = model.few()
    rough = climb_to_maximum(model, point, free_indices(model), few, slopes=(WIDE_SLOPES,))
    for _ in range(3):
        point, better = scan_ranges(model, rough.place, free_indices(model), few)
        if not better:
            break
        rough = climb_to_maximum(model, point, free_indices(model), few, slopes=(WIDE_SLOPES,))
    return climb_to_maximum(model, rough.place, free_indices(model), sample_spans(model), steps)


def _begin(model: FitModel, gains: Array) -> Array:
    place = model.first()
    place[model.named :] = gains
    return place


def make_halves(model: FitModel) -> tuple[list[int], list[int]]:
    """Divide the spans into two halves, each of which is predicted by what was fitted to the other.

    Whole recordings if there are several; else neighbouring spans, every other part of the tracks.
    """
    of = [t for t, _ in model.spans] if len(model.tracks) > 1 else range(len(model.spans))
    groups = np.array_split(np.unique(of), min(FOLDS, len(np.unique(of))))
    number = {int(member): part % 2 for part, group in enumerate(groups) for member in group}
    halves = [k for k, member in enumerate(of) if not number[member]], [k for k, m in enumerate(of) if number[m]]
    return halves


def outlier_log_density(z: Array) -> Array:
    """Return the negative log-density of differences in standard deviations: normal, one in a thousand is wild.

    An individual that a prediction lost for a moment, or a tracker, would otherwise outweigh all
    other steps: at ten standard deviations a normal density is 10^-22.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.minimum(np.nan_to_num(z * z, nan=1e12), 1e12)
    sound = math.log1p(-WILD[0]) - 0.5 * square
    wild = math.log(WILD[0] / WILD[1]) - 0.5 * square / WILD[1] ** 2
    found: Array = 0.5 * math.log(2.0 * math.pi) - np.logaddexp(sound, wild)
    return found


def predict_held_out(fits: Sequence[tuple[FitModel, Fit]], halves: Sequence[Sequence[int]]) -> HeldOutScore:
    """Predict each half by what was fitted to the other alone: its numbers, its thresholds and its variances.

    A number that was sought on all tracks has seen what it is to predict, also where it is fitted again without: of
    nine recordings of walks at random two were explained by thresholds that had been chosen so.
    """
    surprise = np.zeros(len(fits[0][0].spans))
    inside, count = 0.0, 0
    for (model, fit), part in zip(fits, reversed(halves), strict=True):
        along, across = fit.score.variances()
        e, owner = model.innovations(fit.place, part)
        z = e / np.sqrt([along, *[across] * (model.axes - 1)])
        constant = 0.5 * (np.log(along) + (model.axes - 1) * np.log(across))
        surprise[part] = np.bincount(owner, outlier_log_density(z).sum(axis=1) + constant, len(surprise))[part]
        inside += float((np.abs(z) < WITHIN).sum())
        count += e.size
    return HeldOutScore(surprise, inside / count)
