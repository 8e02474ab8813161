"""Fit one law to tracks, and hold out spans or whole recordings to see what it predicts."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.innovation_filter import FitModel
from airflock.estimate.inference.law_candidates import FitParameter, LawCandidate
from airflock.estimate.inference.likelihood_fit import (
    Fit,
    climb_to_maximum,
    draw_points,
    jacobian,
    loss_at,
)
from airflock.estimate.inference.observed_tracks import SpanTracks, TrackScale
from airflock.estimate.inference.posterior_sample import search_widely

Array = NDArray[np.float64]
FOLDS = 4  # parts of the tracks, every other one of which is held out
ENOUGH = 24_000  # individual steps, and
FRAMES = (400, 2400)  # least and largest number of frames, on which is fitted
CHI2_HALF_95 = 1.92  # loss that a number is worth: what 95 % of numbers that are not needed bring at most (Wilks 1938)
DEPENDENT = 0.2  # share of a slope that other numbers do not explain; below it a number is not identifiable
EFFECT_POINTS = 6  # best places at which the effect of a number is looked for
ALONG = (0.1, 0.35, 0.65, 0.9)  # of a range: where the effect of a number is looked for
FINE = 0.005  # of a range: step by which numbers are tested for depending on each other
# One prediction that lost somebody cost 869 units and hid the gain of nine spans of ten; at ten
# standard deviations a normal density is 1e-22, which nobody believes of a tracker.
WILD = (1e-3, 20.0)  # share of held-out differences that are wild, and how many times their standard deviation is
WITHIN = 1.959964  # standard deviations that hold 95 %


@dataclass
class HeldOutScore:
    """Score of the predictions of spans that were not fitted.

    surprise : (span,) negative log-likelihood; inside: share of differences within the 95 % that
               are predicted
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
    start = model.first()
    start[model.named :] = gains
    begin = draw_points(model, start, model.few(), seed)
    kept = identifiable_indices(model, list(begin[:EFFECT_POINTS]), model.few())
    on_progress()
    rest = [*kept, *range(model.named, len(start))]
    model = model.with_parameters([law.numbers[k] for k in kept])
    found = search_widely(model, begin[:, rest], free_indices(model), model.few(), seed, on_progress)
    fitted = climb_to_maximum(model, found.place, free_indices(model), sample_spans(model))
    on_progress()
    return model, fitted


def identifiable_indices(model: FitModel, places: Sequence[Array], spans: Sequence[int]) -> list[int]:
    """Return indices of the named numbers that tracks can identify, in order; the others stay at their defaults.

    A number is not identifiable if it changes nothing anywhere along its range, such as the limit
    of a law that has none; or if the earlier numbers explain its slope at all places taken
    together, such as a mass beside all weights. A radius within which nobody is at these places has
    no slope, but an effect along its range: kept.
    """
    alive = [k for k in range(model.named) if k == model.speed_index or _acts(model, places, k, spans)]
    flat = np.concatenate([_slopes(model, u, alive, spans) for u in places])
    kept: list[int] = []
    basis = np.zeros((len(flat), 0))
    # Gram-Schmidt in the order of declaration, since authors declare important numbers first: a
    # column that earlier ones explain is a number that they replace.
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


def _acts(model: FitModel, places: Sequence[Array] | Array, index: int, spans: Sequence[int]) -> bool:
    """Return True if a number changes the loss anywhere along its range."""
    for u in places:
        here = model.score(u, spans).loss()
        for x in ALONG:
            moved = u.copy()
            moved[index] = x
            if abs(model.score(moved, spans).loss() - here) > 1.0:
                return True
    return False


def _slopes(model: FitModel, u: Array, numbers: Sequence[int], spans: Sequence[int]) -> Array:
    """Return the slopes of all differences in units of their standard deviations, (difference, number)."""
    e = model.differences(u, spans)[0]
    weights = 1.0 / np.sqrt(np.maximum((e**2).mean(axis=0), 1e-30))
    found: Array = (jacobian(model, u, numbers, spans, FINE, e) * weights[None, :, None]).reshape(-1, len(numbers))
    return found


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
    ends = [climb_to_maximum(whole, u, free_indices(whole), sample_spans(whole)) for u in places]
    return whole, min(ends, key=lambda end: end.loss)


def drop_redundant(model: FitModel, fit: Fit, on_progress: Callable[[], None]) -> tuple[FitModel, Fit]:
    """Drop numbers without which the tracks are explained as well, the last declared first, since it matters least.

    The rest is fitted again from where it is, and from where another number of the same unit takes
    the part of the one that is dropped, such as one radius that of another.
    """
    spans, lowest = sample_spans(model), fit.loss
    for k in reversed(range(model.named)):
        one, rest = model.numbers[k], [f for f in range(len(fit.place)) if f != k]
        if k == model.speed_index or not (one.key.startswith("model.") or one.default == 0.0):
            continue  # of the body only what its default switches off
        without = model.with_parameters([n for n in model.numbers[: model.named] if n != one])
        starts = [fit.place.copy() for _ in range(model.named)]
        for f, u in enumerate(starts):
            if f != k and model.numbers[f].unit == one.unit:
                u[f] = model.numbers[f].place(one.value(fit.place[k]))
        unique = list({tuple(u[rest]): u[rest] for u in starts}.values())
        start = min(unique, key=lambda u: loss_at(without, u, free_indices(without), spans))
        less = climb_to_maximum(without, start, free_indices(without), spans)
        on_progress()
        if less.loss < lowest + CHI2_HALF_95:
            model, fit, lowest = without, less, min(lowest, less.loss)
    return model, fit


def free_indices(model: FitModel) -> list[int]:
    """Return numbers that are fitted: all, except the share of own speed that is kept if laws command the speed."""
    return list(range(len(model.numbers) - (0 if model.own_speed else 1)))


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

    A number that was sought on all tracks has seen what it is to predict, also where it is fitted
    again without: of nine recordings of walks at random two were explained by thresholds that had
    been chosen so.
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
