"""Likelihood: how surprising the next frames of tracks are under a law with its numbers and the gains of a walk.

Differences along and across the heading are normal, their two variances are those that make them likeliest.
"""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.infer.candidates import Candidate, Number
from airflock.infer.tracks import COUNTED, Scale, Tracks
from airflock.infer.walk import Gains, Walk

Array = NDArray[np.float64]
FIRST_GAINS = (0.6, 0.3, 0.6, 0.3, 0.9)
SMALL = 360  # frames on which is searched
KP = Number("gain", -1, "1", 0.01, 0.999, False, 0.6)
KV = Number("gain", -1, "1", 3e-4, 1.3, True, 0.3)
KEEP = Number("keep", -1, "1", 0.0, 1.0, False, 0.9)


@dataclass
class Score:
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


class Model:
    """A law (or none) with the numbers that are fitted, on the tracks.

    numbers : of the law and its body, then four gains and, for a law of headings, what share of its speed one keeps
    Places are points of a unit cube, one coordinate per number.
    """

    def __init__(self, law: Candidate | None, tracks: Sequence[Tracks], scale: Scale):
        self.law, self.tracks, self.scale = law, tuple(tracks), scale
        self.walks = [Walk(law, each) for each in tracks]
        self.axes = tracks[0].axes
        self.own_speed = law is None or law.heading
        named = (
            list(law.numbers)
            if law
            else [Number("speed", -1, "m/s", 0.02 * scale.speed, 2.0 * scale.fastest, True, 0.0)]
        )
        self.numbers: list[Number] = [*named, KP, KV, KP, KV, KEEP]
        self.named = len(named)
        speeds = [i for i, n in enumerate(named) if n.key in ("speed", "body.speed")]
        self.usual = speeds[0] if self.own_speed else None
        self.spans = [(t, s) for t, each in enumerate(self.tracks) for s in range(len(each.spans))]
        self.held: frozenset[int] = frozenset()

    def fixed(self, numbers: Sequence[int]) -> "Model":
        """The same model in which some numbers stay at their defaults, whatever the place says."""
        twin = copy(self)
        twin.held = frozenset({*self.held, *numbers})
        return twin

    def told_by(self, numbers: Sequence[Number]) -> "Model":
        """The same law on the same tracks, told by other numbers of it."""
        assert self.law is not None
        return Model(replace(self.law, numbers=tuple(numbers)), self.tracks, self.scale)

    def with_number(self, law: Candidate, number: Number) -> tuple["Model", int]:
        """The model with one more number, and its index there; law : with all its numbers, in their order."""
        assert self.law is not None
        several = [other for other in law.numbers if other in self.law.numbers or other == number]
        return self.told_by(several), several.index(number)

    def first(self) -> Array:
        """A place to begin with: defaults, usual gains, and of speeds what was seen."""
        values = [n.default for n in self.numbers[: self.named]] + list(FIRST_GAINS)
        if self.usual is not None:
            values[self.usual] = self.scale.speed
        return np.array([n.place(v) for n, v in zip(self.numbers, values, strict=True)])

    def split(self, u: Array) -> tuple[dict[int, float], Gains, float]:
        """Values by column, gains, and the usual speed (m/s) at a place."""
        values = [n.value(float(min(max(x, 0.0), 1.0))) for n, x in zip(self.numbers, u, strict=True)]
        kpa, kva, kpb, kvb, keep = values[self.named :]
        named = enumerate(zip(self.numbers[: self.named], values, strict=False))
        by_column = {n.column: v for k, (n, v) in named if n.column >= 0 and k not in self.held}
        usual = values[self.usual] if self.usual is not None else 0.0
        return by_column, Gains((kpa, kva), (kpb, kvb), keep), usual

    def differences(self, u: Array, spans: Sequence[int] | None = None) -> tuple[Array, NDArray[np.int64]]:
        """Differences of counted steps (step, along and across), m, and the span of each."""
        by_column, gains, usual = self.split(u)
        parts, owners = [], []
        first = dict(zip(self.spans, range(len(self.spans)), strict=True))
        for walk, own in self.parts(spans):
            t = self.walks.index(walk)
            found = walk.errors(by_column, gains, usual, own)
            for s in own:
                begin, end = walk.tracks.spans[s]
                counted = walk.tracks.state[begin:end] == COUNTED
                part = found[begin:end].transpose(0, 2, 1)[counted]
                parts.append(part)
                owners.append(np.full(len(part), first[t, s]))
        return np.concatenate(parts), np.concatenate(owners)

    def parts(self, spans: Sequence[int] | None = None) -> list[tuple[Walk, list[int]]]:
        """Walks, and which spans of each are meant."""
        chosen = [self.spans[k] for k in (range(len(self.spans)) if spans is None else spans)]
        found = [(walk, [s for t, s in chosen if t == number]) for number, walk in enumerate(self.walks)]
        return [(walk, own) for walk, own in found if own]

    def score(self, u: Array, spans: Sequence[int] | None = None) -> Score:
        """Sums of squares by span."""
        return self.tally(*self.differences(u, spans))

    def tally(self, e: Array, owner: NDArray[np.int64]) -> Score:
        """Sums of squares by span of differences."""
        m = len(self.spans)
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.nan_to_num(e * e, nan=1e12, posinf=1e12)
        along = np.bincount(owner, squares[:, 0], m).astype(float)
        across = np.bincount(owner, squares[:, 1:].sum(axis=1), m).astype(float)
        return Score(np.bincount(owner, minlength=m).astype(float), along, across, self.axes)

    def few(self, frames: int = SMALL) -> list[int]:
        """Spans, evenly over all tracks, that hold about so many frames."""
        lengths = [self.tracks[t].spans[s][1] - self.tracks[t].spans[s][0] for t, s in self.spans]
        count = int(np.clip(round(frames / np.mean(lengths)), 3, len(self.spans)))
        if count > 0.7 * len(self.spans):
            return list(range(len(self.spans)))
        return sorted({int(k) for k in np.linspace(0, len(self.spans) - 1, count + 2)[1:-1].round()})
