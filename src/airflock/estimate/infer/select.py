"""Fit one law to tracks, and hold out spans or whole recordings to see what it predicts."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.infer.candidates import Candidate
from airflock.estimate.infer.fit import CLIMBS, WIDE, WORSE, Fit, climb, loss_at, settle
from airflock.estimate.infer.given_up import taken_back
from airflock.estimate.infer.hills import hills
from airflock.estimate.infer.identifiability import canonical, identifiable, simplify
from airflock.estimate.infer.likelihood import Model
from airflock.estimate.infer.search import drawn, profile, race, scan
from airflock.estimate.infer.tracks import Scale, Tracks

Array = NDArray[np.float64]
FOLDS = 4  # parts of the tracks that are held out in turn
ENOUGH = 24_000  # individual steps, and
FRAMES = (400, 2400)  # least and largest number of frames, on which is fitted
LONG = 20  # steps of a climb to the end
ELSEWHERE = (0.1, 0.3, 0.5, 0.7, 0.9)  # places of a number that was given up, beside its default, from which is climbed
REGAIN = 8  # steps of such a climb
AGAIN = 3  # steps of a climb without the part that is held out
WILD = (1e-3, 20.0)  # share of held-out differences that are wild, and how many times their standard deviation is
WITHIN = 1.959964  # standard deviations that hold 95 %


@dataclass
class Held:
    """What a fit predicts of spans that it has not seen.

    surprise : (span,) negative log-likelihood; inside: share of differences within the 95 % that are predicted
    """

    surprise: Array
    inside: float


def sample(model: Model) -> list[int]:
    """Spans on which is fitted: all, or evenly some of them where tracks are long."""
    individuals = max(tracks.individuals for tracks in model.tracks)
    return model.few(int(np.clip(ENOUGH / individuals, *FRAMES)))


def straight(tracks: Sequence[Tracks], scale: Scale) -> tuple[Model, Fit]:
    """What is predicted by going straight on at one's own speed, which returns to the usual one."""
    model = Model(None, tracks, scale)
    return model, climb(model, model.first(), range(len(model.numbers)), sample(model), 30)


def fit(
    law: Candidate, tracks: Sequence[Tracks], scale: Scale, gains: Array, seed: int, say: Callable[[], None]
) -> tuple[Model, Fit]:
    """The law's numbers at their likeliest; those that cannot be told apart stay at their defaults.

    gains : of going straight on, to begin with
    """
    model = Model(law, tracks, scale)
    begin = drawn(model, _begin(model, gains), model.few(), seed)
    kept = identifiable(model, _begin(model, gains), begin, model.few())
    say()
    model = model.with_numbers([law.numbers[k] for k in kept])
    fitted = race(model, _begin(model, gains), begin[:, kept], free(model), model.few(), say)
    fitted = polish(model, fitted.place)
    say()
    return model, fitted


def regained(law: Candidate, model: Model, fitted: Fit, say: Callable[[], None]) -> tuple[Model, Fit]:
    """The fit with those numbers that were given up before the search, but explain something beside the fit.

    Before the search, `identifiable` asks at places that explain little; at the fit the answer may differ.

    law : with all its numbers
    """
    few = model.few()
    best = climb(model, fitted.place, fitted.free, few, slopes=(WIDE,))
    for number in model.missing(law):
        fuller, k = model.with_number(law, number)
        places = [np.insert(best.place, k, x) for x in (number.place(number.default), *ELSEWHERE)]
        places.sort(key=lambda u, fuller=fuller: loss_at(fuller, u, free(fuller), few))  # type: ignore[misc]
        tried = [climb(fuller, u, free(fuller), few, REGAIN, slopes=(WIDE,)) for u in places[:2]]
        say()
        with_it = min(tried, key=lambda each: each.loss)
        if with_it.loss < best.loss - WORSE:
            model, best = fuller, with_it
    if len(model.numbers) == len(fitted.place):
        return model, fitted
    return model, polish(model, best.place, LONG)


def simpler(law: Candidate, model: Model, fitted: Fit, say: Callable[[], None]) -> tuple[Model, Fit]:
    """The fit after a search along each number, with all numbers that explain something and no others.

    law : with all its numbers
    """
    model, fitted = first_names(law, *without_spare(*regained(law, model, fitted, say), say), say)
    other = profile(model, climb(model, fitted.place, fitted.free, model.few(), slopes=(WIDE,)), model.few(), say)
    other = settle(model, climb(model, other.place, other.free, sample(model), LONG), sample(model))
    fitted = hills(model, min(fitted, other, key=lambda each: each.loss), model.few(), sample(model), say)
    model, fitted = first_names(law, *without_spare(model, fitted, say), say)
    return taken_back(law, model, fitted, sample(model), say)


def first_names(law: Candidate, model: Model, fitted: Fit, say: Callable[[], None]) -> tuple[Model, Fit]:
    """The fit in terms of the numbers that are declared first, where either of two explains the tracks."""
    renamed, place = canonical(law, model, fitted, say)
    return (model, fitted) if renamed is model else (renamed, _nearest(renamed, place, place))


def without_spare(model: Model, fitted: Fit, say: Callable[[], None]) -> tuple[Model, Fit]:
    """The model without numbers that the others make up for, where the sample is explained as well by what is left."""
    gone, place, carried = simplify(model, fitted, say)
    if not gone:
        return model, fitted
    rest = [k for k in range(len(model.numbers)) if k not in gone]
    assert model.law is not None
    without = model.with_numbers([n for k, n in enumerate(model.law.numbers) if k not in gone])
    less = _nearest(without, place[rest], carried[rest])
    if less.loss >= fitted.loss + 2.0 * len(gone):
        return model, fitted
    return without, replace(less, others=tuple(place[rest] for place in fitted.others))


def _nearest(model: Model, *places: Array) -> Fit:
    """The best of climbs from a place by way of a few spans, and from another on the sample at once."""
    ends = polish(model, places[0], LONG), climb(model, places[1], free(model), sample(model), LONG)
    return min((settle(model, end, sample(model)) for end in ends), key=lambda end: end.loss)


def free(model: Model) -> list[int]:
    """Numbers that are fitted: all, but the share of the own speed that is kept only where speeds are one's own."""
    return list(range(len(model.numbers) - (0 if model.own_speed else 1)))


def polish(model: Model, place: Array, steps: int = CLIMBS) -> Fit:
    """Climb on a few spans and on the sample, looking along each number's range in between."""
    few = model.few()
    rough = climb(model, place, free(model), few, slopes=(WIDE,))
    for _ in range(3):
        place, better = scan(model, rough.place, free(model), few)
        if not better:
            break
        rough = climb(model, place, free(model), few, slopes=(WIDE,))
    return climb(model, rough.place, free(model), sample(model), steps)


def _begin(model: Model, gains: Array) -> Array:
    place = model.first()
    place[model.named :] = gains
    return place


def folds(model: Model) -> list[list[int]]:
    """Spans that are held out together: those of a recording where there are several, else neighbouring ones."""
    if len(model.tracks) > 1:
        groups = np.array_split(np.arange(len(model.tracks)), min(FOLDS, len(model.tracks)))
        return [[k for k, (t, _) in enumerate(model.spans) if t in group] for group in groups]
    return [part.tolist() for part in np.array_split(np.arange(len(model.spans)), FOLDS)]


def surprises(z: Array) -> Array:
    """Negative logarithm of the density of differences in standard deviations: normal, but one in a thousand is wild.

    An individual that a prediction lost for a moment, or a tracker, would otherwise outweigh all other steps: at ten
    standard deviations a normal density is 10^-22.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.minimum(np.nan_to_num(z * z, nan=1e12), 1e12)
    sound = math.log1p(-WILD[0]) - 0.5 * square
    wild = math.log(WILD[0] / WILD[1]) - 0.5 * square / WILD[1] ** 2
    found: Array = 0.5 * math.log(2.0 * math.pi) - np.logaddexp(sound, wild)
    return found


def hold_out(model: Model, fitted: Fit, say: Callable[[], None]) -> Held:
    """Fit without each part in turn, and predict that part."""
    spans = sample(model)
    surprise, inside, count = np.zeros(len(model.spans)), 0.0, 0
    for part in folds(model):
        rest = [k for k in spans if k not in set(part)] or [k for k in range(len(model.spans)) if k not in set(part)]
        own = climb(model, fitted.place, fitted.free, rest, AGAIN, slopes=(WIDE,))
        along, across = own.score.variances()
        e, owner = model.innovations(own.place, part)
        z = e / np.sqrt([along, *[across] * (model.axes - 1)])
        constant = 0.5 * (np.log(along) + (model.axes - 1) * np.log(across))
        surprise[part] = np.bincount(owner, surprises(z).sum(axis=1) + constant, len(model.spans))[part]
        inside += float((np.abs(z) < WITHIN).sum())
        count += e.size
        say()
    return Held(surprise, inside / count)
