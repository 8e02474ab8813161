"""Likelihood: how surprising the next frames of tracks are under a law with its numbers and the gains of a walk.

Differences along and across the heading are normal, their two variances are those that make them likeliest.
"""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.candidates import FitParameter, LawCandidate
from airflock.estimate.inference.tracks import COUNTED, SpanTracks, TrackScale
from airflock.estimate.inference.walk import FilterGains, InnovationFilter

Array = NDArray[np.float64]
SOFT = 1.345  # of a standard deviation: where nothing is wild, estimates are 0.95 as efficient (Huber 1964)
LOST, TINY = 1e6, 1e-15  # m; somebody who flew off, and less than any difference
LOOKS = 100  # at most, for a standard deviation; about six do
# with which normal differences keep their variance: 1 over the mean of twice Huber's function
_DENSITY, _WITHIN = math.exp(-0.5 * SOFT**2) / math.sqrt(2.0 * math.pi), math.erf(SOFT / math.sqrt(2.0))
SAME = (_WITHIN + 2.0 * SOFT * _DENSITY - SOFT**2 * (1.0 - _WITHIN)) ** -0.5
AS_NORMAL = _WITHIN  # mean of min(z², SOFT |z|) of normal numbers
FIRST_GAINS = (0.6, 0.3, 0.6, 0.3, 0.9)
SMALL = 360  # frames on which is searched
KP = FitParameter("gain", -1, "1", 0.01, 0.999, False, 0.6)
KV = FitParameter("gain", -1, "1", 3e-4, 1.3, True, 0.3)
KEEP = FitParameter("keep", -1, "1", 0.0, 1.0, False, 0.9)


def huber_differences(e: Array) -> Array:
    """Differences whose squares grow as their size alone where they are large (Huber 1964).

    A law has edges: somebody just within a radius flies on otherwise than somebody just outside. Who is near an edge,
    and is seen with noise, is now and then predicted on its wrong side, also by the numbers that flew. The square of
    one such step would outweigh all that thousands of others say of a number. Normal differences keep their variance.

    e : (step, component); differences up to `SOFT` of their `robust_deviation` stay as they are but for a factor, the
        same for
        all of a component
    """
    if not len(e):
        return e
    e = np.clip(np.nan_to_num(e, nan=LOST), -LOST, LOST)
    size = np.array([robust_deviation(component) for component in e.T])
    far = np.abs(e) / size
    rest = np.sqrt(np.maximum(2.0 * SOFT * far - SOFT * SOFT, 0.0))
    found: Array = np.copysign(SAME * size * np.where(far < SOFT, far, rest), e)
    return found


def robust_deviation(e: Array) -> float:
    """Standard deviation of differences, by all of them, of which the large ones count less (Huber 1964, proposal 2).

    It is that at which the mean of min(z², SOFT |z|) is what it is of normal numbers z. A median would do as well, but
    hangs on one difference alone, and with it each slope.
    """
    sizes = np.sort(np.abs(e)) + TINY
    square, linear = np.cumsum(sizes * sizes), np.cumsum(sizes)
    last, found = -1, float(np.sqrt(square[-1] / len(sizes)))
    for _ in range(LOOKS):
        near = int(np.searchsorted(sizes, SOFT * found))
        if near == last:
            break
        last = near
        within = float(square[near - 1]) if near else 0.0
        beyond = SOFT * float(linear[-1] - (linear[near - 1] if near else 0.0))
        found = (beyond + math.sqrt(beyond * beyond + 4.0 * AS_NORMAL * len(sizes) * within)) / (
            2.0 * AS_NORMAL * len(sizes)
        )
    return found


@dataclass
class SpanScore:
    """Sums over counted steps: number, and squares along and across, m²; one row per span."""

    count: Array
    along: Array
    across: Array
    axes: int

    def loss(self) -> float:
        """Negative log-likelihood at the likeliest variances."""
        n = float(self.count.sum())
        a, b = float(self.along.sum()) / n, float(self.across.sum()) / (n * (self.axes - 1))
        if not (math.isfinite(a) and math.isfinite(b) and a > 0.0 and b > 0.0):
            return 1e15
        return 0.5 * n * (math.log(a) + (self.axes - 1) * math.log(b) + self.axes * (1.0 + math.log(2.0 * math.pi)))

    def variances(self) -> tuple[float, float]:
        """Variances along and across, m²."""
        n = float(self.count.sum())
        return float(self.along.sum()) / n, float(self.across.sum()) / (n * (self.axes - 1))


class FitModel:
    """A law (or none) with the numbers that are fitted, on the tracks.

    numbers : of the law and its body, then four gains and, for a law of headings, what share of its speed one keeps
    Places are points of a unit cube, one coordinate per number.
    """

    def __init__(self, law: LawCandidate | None, tracks: Sequence[SpanTracks], scale: TrackScale):
        self.law, self.tracks, self.scale = law, tuple(tracks), scale
        self.filters = [InnovationFilter(law, each) for each in tracks]
        self.axes = tracks[0].axes
        self.own_speed = law is None or law.commands_heading
        named = (
            list(law.numbers)
            if law
            else [FitParameter("speed", -1, "m/s", 0.02 * scale.speed, 2.0 * scale.max_speed, True, 0.0)]
        )
        self.numbers: list[FitParameter] = [*named, KP, KV, KP, KV, KEEP]
        self.named = len(named)
        speeds = [i for i, n in enumerate(named) if n.key in ("speed", "body.speed")]
        self.speed_index = speeds[0] if self.own_speed else None
        self.spans = [(t, s) for t, each in enumerate(self.tracks) for s in range(len(each.spans))]
        self.held: frozenset[int] = frozenset()
        self.soft = False

    def with_fixed(self, numbers: Sequence[int]) -> "FitModel":
        """The same model in which some numbers stay at their defaults, whatever the place says."""
        twin = copy(self)
        twin.held = frozenset({*self.held, *numbers})
        return twin

    def with_parameters(self, numbers: Sequence[FitParameter]) -> "FitModel":
        """The same law on the same tracks, of which only these numbers are fitted."""
        assert self.law is not None
        found = FitModel(replace(self.law, numbers=tuple(numbers)), self.tracks, self.scale)
        return found.robust() if self.soft else found

    def with_parameter(self, law: LawCandidate, parameter: FitParameter) -> tuple["FitModel", int]:
        """The model with one more number, and its index there; law : with all its numbers, in their order."""
        assert self.law is not None
        several = [other for other in law.numbers if other in self.law.numbers or other == parameter]
        return self.with_parameters(several), several.index(parameter)

    def dropped_parameters(self, law: LawCandidate) -> list[FitParameter]:
        """Numbers of the law that the model does without; law : with all its numbers."""
        assert self.law is not None
        return [number for number in law.numbers if number not in self.law.numbers]

    def first(self) -> Array:
        """A place to begin with: defaults, usual gains, and of speeds what was seen."""
        values = [n.default for n in self.numbers[: self.named]] + list(FIRST_GAINS)
        if self.speed_index is not None:
            values[self.speed_index] = self.scale.speed
        return np.array([n.place(v) for n, v in zip(self.numbers, values, strict=True)])

    def split(self, u: Array) -> tuple[dict[int, float], FilterGains, float]:
        """Values by column, gains, and the usual speed (m/s) at a place."""
        values = [n.value(float(min(max(x, 0.0), 1.0))) for n, x in zip(self.numbers, u, strict=True)]
        kpa, kva, kpb, kvb, keep = values[self.named :]
        named = enumerate(zip(self.numbers[: self.named], values, strict=False))
        by_column = {n.column: v for k, (n, v) in named if n.column >= 0 and k not in self.held}
        usual = values[self.speed_index] if self.speed_index is not None else 0.0
        return by_column, FilterGains((kpa, kva), (kpb, kvb), keep), usual

    def differences(self, u: Array, spans: Sequence[int] | None = None) -> tuple[Array, NDArray[np.int64]]:
        """What is fitted: innovations, of which large ones may count less (`robust`), and the span of each."""
        e, owner = self.innovations(u, spans)
        return (huber_differences(e) if self.soft else e), owner

    def robust(self) -> "FitModel":
        """The same model, in which a few large differences count less."""
        twin = copy(self)
        twin.soft = True
        return twin

    def innovations(self, u: Array, spans: Sequence[int] | None = None) -> tuple[Array, NDArray[np.int64]]:
        """Differences of counted steps (step, along and across), m, to where they were predicted; the span of each."""
        by_column, gains, usual = self.split(u)
        parts, owners = [], []
        first = dict(zip(self.spans, range(len(self.spans)), strict=True))
        for walk, own in self.parts(spans):
            t = self.filters.index(walk)
            found = walk.errors(by_column, gains, usual, own)
            for s in own:
                begin, end = walk.tracks.spans[s]
                counted = walk.tracks.state[begin:end] == COUNTED
                part = found[begin:end].transpose(0, 2, 1)[counted]
                parts.append(part)
                owners.append(np.full(len(part), first[t, s]))
        return np.concatenate(parts), np.concatenate(owners)

    def parts(self, spans: Sequence[int] | None = None) -> list[tuple[InnovationFilter, list[int]]]:
        """Walks, and which spans of each are meant."""
        chosen = [self.spans[k] for k in (range(len(self.spans)) if spans is None else spans)]
        found = [(walk, [s for t, s in chosen if t == number]) for number, walk in enumerate(self.filters)]
        return [(walk, own) for walk, own in found if own]

    def score(self, u: Array, spans: Sequence[int] | None = None) -> SpanScore:
        """Sums of squares by span."""
        return self.score_differences(*self.differences(u, spans))

    def score_differences(self, e: Array, owner: NDArray[np.int64]) -> SpanScore:
        """Sums of squares by span of differences."""
        m = len(self.spans)
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.nan_to_num(e * e, nan=1e12, posinf=1e12)
        along = np.bincount(owner, squares[:, 0], m).astype(float)
        across = np.bincount(owner, squares[:, 1:].sum(axis=1), m).astype(float)
        return SpanScore(np.bincount(owner, minlength=m).astype(float), along, across, self.axes)

    def few(self, frames: int = SMALL) -> list[int]:
        """Spans, evenly over all tracks, that hold about so many frames."""
        lengths = [self.tracks[t].spans[s][1] - self.tracks[t].spans[s][0] for t, s in self.spans]
        count = int(np.clip(round(frames / np.mean(lengths)), 3, len(self.spans)))
        if count > 0.7 * len(self.spans):
            return list(range(len(self.spans)))
        return sorted({int(k) for k in np.linspace(0, len(self.spans) - 1, count + 2)[1:-1].round()})
