"""Told: which numbers of a law the tracks can tell at all, and which the others make up for."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airflock.infer.candidates import Candidate
from airflock.infer.fit import EVEN, WIDE, WORSE, Fit, by_powers, climb, curvature, followed, jacobian, loss_at
from airflock.infer.likelihood import Model
from airflock.infer.search import scan

Array = NDArray[np.float64]
DEPENDENT = 0.2  # share of a slope that the others do not explain, below which a number cannot be told
LOOKS = 6  # best places at which is asked what a number does
ALONG = (0.1, 0.35, 0.65, 0.9)  # of a range: where is asked whether a number does anything
FINE = 0.005  # of a range: step by which is asked whether numbers depend on each other
APART = 0.1  # of a range, from the default
UNLIKELY = 20.0  # loss above the fit, beyond which no climb begins where another number has taken a part


def telling(model: Model, start: Array, begin: Array, spans: Sequence[int]) -> list[int]:
    """Named numbers that differences tell apart, in their order; the others stay at their defaults.

    A number is not told that changes nothing anywhere along its range, such as the limit of a law that has none, or
    whose slope the earlier ones explain at the best of many places taken together, such as a mass beside all weights.
    A radius within which nobody is at these places has no slope, but does something along its range: it is kept.
    """
    places = []
    for x in begin[:LOOKS]:
        u = start.copy()
        u[: model.named] = x
        places.append(u)
    alive = [k for k in range(model.named) if k == model.usual or _acts(model, places, k, spans)]
    flat = np.concatenate([_slopes(model, u, alive, spans) for u in places])
    kept: list[int] = []
    basis = np.zeros((len(flat), 0))
    for column, number in zip(flat.T, alive, strict=True):
        size = float(np.linalg.norm(column))
        rest = column - basis @ (basis.T @ column)
        left = float(np.linalg.norm(rest))
        if size > 1.0 and left < DEPENDENT * size and number != model.usual:
            continue
        kept.append(number)
        if size > 1.0:
            basis = np.column_stack([basis, rest / max(left, 1e-12)])
    return kept


def _acts(model: Model, places: Sequence[Array], number: int, spans: Sequence[int]) -> bool:
    """Whether a number changes the loss anywhere along its range."""
    for u in places:
        here = model.score(u, spans).loss()
        for x in ALONG:
            moved = u.copy()
            moved[number] = x
            if abs(model.score(moved, spans).loss() - here) > 1.0:
                return True
    return False


def _slopes(model: Model, u: Array, numbers: Sequence[int], spans: Sequence[int]) -> Array:
    """Slopes of all differences in units of their standard deviations, (difference, number)."""
    weights = 1.0 / np.sqrt(np.maximum((model.differences(u, spans)[0] ** 2).mean(axis=0), 1e-30))
    found: Array = (jacobian(model, u, numbers, spans, FINE) * weights[None, :, None]).reshape(-1, len(numbers))
    return found


def exchanged(law: Candidate, model: Model, fit: Fit, say: Callable[[], None]) -> tuple[Model, Array]:
    """The model told by the numbers that are declared first, and its place; the same model where nothing gives way.

    A number that was given up before the search may come back under the name of a later one: the weight of one force as
    the unit of all forces, a radius as another within which its neighbours act, too. Of two numbers of which either
    explains the tracks beside the others, the one that is declared first is told; the later one takes its default.

    law : with all its numbers
    """
    few = model.few()
    best = climb(model, fit.place, fit.free, few, slopes=(WIDE,))
    for earlier in law.numbers:
        assert model.law is not None
        kept = model.law.numbers
        if earlier in kept:
            continue
        several = tuple(number for number in law.numbers if number in kept or number == earlier)
        fuller, i = Model(replace(law, numbers=several), model.tracks, model.scale), several.index(earlier)
        u = np.insert(best.place, i, earlier.place(earlier.default))
        beside = Fit(u, sorted([i, *(f + (f >= i) for f in best.free)]), best.score, best.loss)
        curved = curvature(fuller, beside, few, EVEN)
        for k in reversed(range(i + 1, fuller.named)):
            if not _spare(fuller, beside, k):
                continue
            without, rest = fuller.fixed([k]), [f for f in beside.free if f != k]
            start = min(_taken_over(without, beside, curved, i, k, few), key=lambda u: loss_at(without, u, rest, few))
            if loss_at(without, start, rest, few) > best.loss + UNLIKELY:
                continue
            found = climb(without, scan(without, start, rest, few)[0], rest, few, slopes=(WIDE,))
            if found.loss < best.loss + WORSE:
                numbers = tuple(number for f, number in enumerate(several) if f != k)
                model = Model(replace(law, numbers=numbers), model.tracks, model.scale)
                best = Fit(np.delete(found.place, k), [f - (f > k) for f in rest], found.score, found.loss)
                break
        say()
    return model, best.place


def _taken_over(
    model: Model, fit: Fit, curved: Array, earlier: int, later: int, spans: Sequence[int]
) -> Iterator[Array]:
    """Places at which an earlier number, and the others, may have taken the part of a later one, now at its default."""
    one, other = model.numbers[earlier], model.numbers[later]
    moved = followed(fit, curved, later, other.place(other.default))
    yield moved
    yield by_powers(model, fit, moved, later, spans)
    if one.unit == other.unit:
        u = fit.place.copy()
        u[earlier] = one.place(other.value(u[later]))
        yield u


def _spare(model: Model, fit: Fit, number: int) -> bool:
    """Whether a number may be given up: one away from its default, or whose default lies beyond what is sought.

    Numbers of the body are where their default is none at all.
    """
    one = model.numbers[number]
    if number == model.usual or not (one.key.startswith("model.") or one.default == 0.0):
        return False
    return not one.low <= one.default <= one.high or abs(one.place(one.default) - fit.place[number]) >= APART


def simplify(model: Model, fit: Fit, say: Callable[[], None]) -> tuple[list[int], Array]:
    """Named numbers without which the tracks are explained as well, and the place of the rest without them.

    Each that stands away from its default, or whose default lies beyond what was sought, is put there in turn, the last
    declared first, and the rest is fitted anew: from where the others make up for it, and from where another number of
    its unit takes its part.
    """
    few = model.few()
    best = climb(model, fit.place, fit.free, few, slopes=(WIDE,))
    lowest, gone = best.loss, list[int]()
    for k in reversed(range(model.named)):
        if not _spare(model, best, k):
            continue
        number = model.numbers[k]
        default = number.place(number.default)
        without, rest = model.fixed([*gone, k]), [f for f in best.free if f != k]
        moved = followed(best, curvature(model.fixed(gone), best, few, EVEN), k, default)
        starts = [moved, by_powers(without, best, moved, k, few)]
        for other in (f for f in rest if f < model.named and model.numbers[f].unit == number.unit):
            starts.append(best.place.copy())
            starts[-1][other] = model.numbers[other].place(number.value(best.place[k]))
        start = min(starts, key=lambda u: loss_at(without, u, rest, few))
        found = climb(without, scan(without, start, rest, few)[0], rest, few, slopes=(WIDE,))
        say()
        if found.loss < lowest + WORSE:
            gone, best, lowest = [*gone, k], found, min(lowest, found.loss)
    return gone, best.place
