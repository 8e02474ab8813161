"""Fit: the numbers of a law under which the next frame is least surprising.

The likelihood is that of the walk (`walk`): differences along and across the heading are normal, their two variances
are those that make them likeliest. A search by CMA-ES over the whole range finds the hill, Gauss-Newton steps climb it.
A weak prior (a standard deviation of half the range, on the scale that is sought) keeps flat directions in place.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airflock.infer.candidates import Candidate, Number
from airflock.infer.tracks import COUNTED, Scale, Tracks
from airflock.infer.walk import Gains, Walk

Array = NDArray[np.float64]
FIRST_GAINS = (0.6, 0.3, 0.6, 0.3, 0.9)
PROBE = 0.02  # of a range: step by which slopes are taken; wider than what the tracks' noise blurs
DEPENDENT = 0.1  # share of a slope that the others do not explain, below which a number cannot be told
DRAWN = 200  # places at random, of which the best begin a search
STARTS = 5  # from the best of which it is climbed at once
SEARCHES, ROUNDS, POPULATION = 1, 90, 14  # of CMA-ES
LOOKS = 6  # best places at which is asked what a number does
FINE = 0.005  # of a range: step by which is asked whether numbers depend on each other
SCAN = 10  # places along the range of one number
HOP = 0.12  # of a range
CLIMBS = 8  # Gauss-Newton steps
SMALL = 360  # frames on which is searched
APART, WORSE = 0.1, 1.5  # of a range, from the default; loss that a number is worth
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

    def surprise(self, along: float, across: float) -> Array:
        """Negative log-likelihood of each span at given variances."""
        k = self.axes - 1
        constant = math.log(along) + k * math.log(across) + self.axes * math.log(2.0 * math.pi)
        found: Array = 0.5 * (self.count * constant + self.along / along + self.across / across)
        return found


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
        twin = object.__new__(Model)
        twin.__dict__.update(self.__dict__)
        twin.held = frozenset({*self.held, *numbers})
        return twin

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


@dataclass
class Fit:
    """Where a model fits best.

    place : of all numbers; free : indices of those that were fitted; score : on the spans of the fit
    loss  : negative log-likelihood with the prior
    """

    place: Array
    free: list[int]
    score: Score
    loss: float


def prior(u: Array, free: Sequence[int]) -> float:
    """Weak prior: a normal one of SD 1/2 about the middle of each range."""
    return float((2.0 * (u[list(free)] - 0.5) ** 2).sum())


def drawn(model: Model, start: Array, spans: Sequence[int], seed: int) -> Array:
    """Places of the named numbers (place, number): `start` and others spread over the whole range, best first."""
    from scipy.stats import qmc

    named = list(range(model.named))
    found = np.vstack([start[named], qmc.LatinHypercube(len(named), seed=seed).random(DRAWN)])
    return np.array(found[np.argsort([_at(model, start, named, spans, x) for x in found])])


def _at(model: Model, start: Array, free: Sequence[int], spans: Sequence[int] | None, x: Array) -> float:
    u = start.copy()
    u[list(free)] = x
    return model.score(u, spans).loss() + prior(u, free)


def search(model: Model, start: Array, begin: Array, spans: Sequence[int], seed: int, say: Callable[[], None]) -> Array:
    """The best place found over the whole range of the named numbers, on a few spans: by climbs and by CMA-ES.

    start : a place whose named numbers are defaults, from which is climbed, too
    begin : places of the named numbers to begin from, best first
    """
    import warnings

    import cma

    named = list(range(model.named))
    best, lowest = start.copy(), math.inf
    for x in (start[named], *begin[:STARTS]):
        u = start.copy()
        u[named] = x
        found = climb(model, u, named, spans, rough=True)
        say()
        if found.loss < lowest:
            lowest, best = found.loss, found.place
    for attempt in range(SEARCHES):
        options = {
            "bounds": [0.0, 1.0], "seed": seed + attempt + 1, "verbose": -9, "maxiter": ROUNDS, "tolfun": 0.1,
            "popsize": POPULATION,
        }  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            strategy = cma.CMAEvolutionStrategy(np.clip(begin[attempt], 0.02, 0.98), 0.2, options)
        while not strategy.stop():
            asked = strategy.ask()
            strategy.tell(asked, [_at(model, start, named, spans, np.asarray(x)) for x in asked])
        say()
        if strategy.result.fbest < lowest:
            lowest, best = strategy.result.fbest, start.copy()
            best[named] = strategy.result.xbest
    return best


def scan(model: Model, place: Array, free: Sequence[int], spans: Sequence[int] | None) -> tuple[Array, bool]:
    """A better place found along the range of one named number at a time, and whether there is one.

    Where a threshold lies beyond all that happens, a slope shows nothing; a look along the range does.
    """
    lowest, best, moved = model.score(place, spans).loss() + prior(place, free), place, False
    for k in [k for k in free if k < model.named]:
        for x in (np.arange(SCAN) + 0.5) / SCAN:
            u = best.copy()
            u[k] = x
            found = model.score(u, spans).loss() + prior(u, free)
            if found < lowest - 1.0:
                lowest, best, moved = found, u, True
    return best, moved


def hop(model: Model, fit: Fit, spans: Sequence[int], count: int, seed: int, say: Callable[[], None]) -> Fit:
    """The best of some climbs that begin beside a fit: half of its named numbers, drawn anew each time, are moved."""
    generator = np.random.default_rng(seed)
    best = fit
    named = [k for k in fit.free if k < model.named]
    for _ in range(count):
        u = best.place.copy()
        moved = [k for k in named if generator.random() < 0.5]
        u[moved] = np.clip(u[moved] + generator.normal(0.0, HOP, len(moved)), 0.02, 0.98)
        found = climb(model, u, fit.free, spans, 5, rough=True)
        say()
        if found.loss < best.loss:
            best = found
    return best


def jacobian(
    model: Model,
    u: Array,
    free: Sequence[int],
    spans: Sequence[int] | None,
    step: float = PROBE,
    here: Array | None = None,
) -> Array:
    """Slopes of the differences (step, component, free number); to one side only where those at `u` are given."""
    columns = []
    for k in free:
        low, high = u.copy(), u.copy()
        if here is not None:
            high[k] += step if u[k] < 0.5 else -step
            columns.append((model.differences(high, spans)[0] - here) / (high[k] - u[k]))
            continue
        low[k], high[k] = max(u[k] - step, 0.0), min(u[k] + step, 1.0)
        columns.append((model.differences(high, spans)[0] - model.differences(low, spans)[0]) / (high[k] - low[k]))
    return np.stack(columns, axis=-1)


def climb(
    model: Model,
    start: Array,
    free: Sequence[int],
    spans: Sequence[int] | None = None,
    steps: int = CLIMBS,
    rough: bool = False,
) -> Fit:
    """Gauss-Newton with damping (Levenberg-Marquardt) from a place, over the free numbers.

    rough : slopes to one side only, at half the cost
    """
    free = list(free)
    u, damping = start.copy(), 1e-3
    e, owner = model.differences(u, spans)
    score = model.tally(e, owner)
    loss = score.loss() + prior(u, free)
    for _ in range(steps):
        hessian, gradient = _normal(model, u, free, spans, e, score, rough)
        gained = 0.0
        for _ in range(6):
            scaled = hessian + damping * np.diag(np.diag(hessian)) + 4.0 * np.eye(len(free))
            move = -np.linalg.solve(scaled, gradient + 4.0 * (u[free] - 0.5))
            new = u.copy()
            new[free] = np.clip(u[free] + np.clip(move, -0.2, 0.2), 0.0, 1.0)
            e_new, _ = model.differences(new, spans)
            score_new = model.tally(e_new, owner)
            loss_new = score_new.loss() + prior(new, free)
            if loss_new < loss:
                gained = loss - loss_new
                u, e, score, loss, damping = new, e_new, score_new, loss_new, 0.3 * damping
                break
            damping = max(10.0 * damping, 1e-3)
        if gained < 0.05:
            break
    return Fit(u, free, score, loss)


def _normal(
    model: Model, u: Array, free: list[int], spans: Sequence[int] | None, e: Array, score: Score, rough: bool
) -> tuple[Array, Array]:
    """Curvature and slope of the loss."""
    weights = 1.0 / np.array([score.variances()[0], *[score.variances()[1]] * (model.axes - 1)])
    j = jacobian(model, u, free, spans, here=e if rough else None)
    hessian = np.einsum("scf,c,scg->fg", j, weights, j, optimize=True)
    gradient = np.einsum("sc,c,scf->f", e, weights, j, optimize=True)
    return hessian, gradient


def telling(model: Model, start: Array, begin: Array, spans: Sequence[int]) -> list[int]:
    """Named numbers that differences tell apart, by their slopes at the best of many places taken together.

    In their order: a number whose slope the earlier ones explain everywhere, such as a mass beside all weights, or that
    has no effect at all, stays at its default.
    """
    named = list(range(model.named))
    parts = []
    for x in begin[:LOOKS]:
        u = start.copy()
        u[named] = x
        weights = 1.0 / np.sqrt(np.maximum((model.differences(u, spans)[0] ** 2).mean(axis=0), 1e-30))
        found = jacobian(model, u, named, spans, FINE) * weights[None, :, None]
        parts.append(found.reshape(-1, model.named))
    flat = np.concatenate(parts)
    kept: list[int] = []
    basis = np.zeros((len(flat), 0))
    for number in named:
        column = flat[:, number]
        size = float(np.linalg.norm(column))
        rest = column - basis @ (basis.T @ column)
        left = float(np.linalg.norm(rest))
        if left > max(DEPENDENT * size, 1.0) or number == model.usual:
            kept.append(number)
            basis = np.column_stack([basis, rest / max(left, 1e-12)])
    return kept


def simplify(model: Model, fit: Fit, say: Callable[[], None]) -> list[int]:
    """Named numbers without which the tracks are explained as well: the others make up for them.

    Each that stands away from its default is put there in turn, the last declared first, and the rest is fitted anew.
    """
    few = model.few()
    place, free = fit.place.copy(), list(fit.free)
    lowest = climb(model, place, free, few, rough=True).loss
    gone: list[int] = []
    for k in reversed(range(model.named)):
        number = model.numbers[k]
        if k == model.usual or not number.key.startswith("model."):
            continue
        if abs(number.place(number.default) - place[k]) < APART:
            continue
        rest = [f for f in free if f != k]
        without = model.fixed([*gone, k])
        u, _ = scan(without, place, rest, few)
        found = climb(without, u, rest, few, rough=True)
        say()
        if found.loss < lowest + WORSE:
            gone, free, place, lowest = [*gone, k], rest, found.place, min(lowest, found.loss)
    return gone
