"""Correct bias and intervals of a fit by flights of the fitted law (a parametric bootstrap)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.innovation_filter import FilterGains, FitModel, InnovationFilter
from airflock.estimate.inference.likelihood_fit import FINE_SLOPES, Fit, climb_to_maximum, settle_fit
from airflock.estimate.inference.observed_tracks import UNSEEN, SpanTracks, with_positions
from airflock.estimate.inference.posterior_sample import posterior_ends

Array = NDArray[np.float64]
# Flights of a fitted law from the beginnings of its tracks, observed with the same gaps and noise.
FREE = 1e-9  # m²: least variance
PUSHED = -1  # noise that is no number of the law or its body


@dataclass(frozen=True)
class FitNoise:
    """Noise of a flight and of its tracks.

    law   : number of the law or its body that is noise (column), and its value; PUSHED: SD of
            pushes of velocities, m/s
    speed : SD of a period's change of own speed, m/s, where speeds are the individuals' own
    seen  : SD of a seen position, m
    """

    column: int
    law: float
    speed: float
    seen: float

    def shifted(self, steps: Array) -> "FitNoise":
        """Return the noise with its logarithms changed."""
        law, speed, seen = (
            value * float(np.exp(step)) for value, step in zip((self.law, self.speed, self.seen), steps, strict=True)
        )
        return replace(self, law=law, speed=speed, seen=seen)


def fly_freely(
    walk: InnovationFilter,
    fitted: tuple[dict[int, float], FilterGains, float],
    noise: FitNoise,
    state: NDArray[np.int8],
    follow: Array,
    world: int,
    generator: np.random.Generator,
) -> Array:
    """Fly the law with its noise; return positions (m) and velocities (m/s), (frame, component, individual).

    fitted : numbers by column, gains, usual speed (`FitModel.split`)
    state  : (frame, individual); who enters or is absent follows the record
    follow : as what is returned: states of the record, of which the first frame is the start
    world  : number of the random world of the law
    """
    numbers, gains, usual = fitted
    columns = {**numbers, **({noise.column: noise.law} if noise.column >= 0 else {})}
    wander = noise.speed if walk.law is not None and walk.law.commands_heading else -1.0
    pushed = noise.law if noise.column == PUSHED else 0.0
    flown = np.zeros((len(state), 2 * walk.axes, walk.tracks.individual_count))
    draws = generator.normal(size=(len(state), walk.axes + 1, walk.tracks.individual_count))
    walk.loops.fly_span(
        *walk.begin(columns, usual, world), state, follow, draws, pushed, wander, walk.axes, walk.half_sides, usual,
        gains.keep, flown,
    )  # fmt: skip
    return flown


def fly_tracks(
    walk: InnovationFilter,
    fitted: tuple[dict[int, float], FilterGains, float],
    filtered_states: Array,
    noise: FitNoise,
    spans: Sequence[int],
    seed: int,
) -> SpanTracks:
    """Fly the law from the beginning of each span, and return tracks of these flights.

    fitted : numbers by column, gains, usual speed (`FitModel.split`)
    filtered_states : where individuals were (`InnovationFilter.errors`)
    """
    tracks, generator = walk.tracks, np.random.default_rng(seed)
    seen = np.full_like(tracks.seen, np.nan)
    # Each span has a world of its own; 1009 is prime, so that seeds and spans do not meet.
    for s in spans:
        part = slice(*tracks.spans[s])
        world = (seed * 1009 + s + 1) % 2**31
        flown = fly_freely(walk, fitted, noise, tracks.state[part], filtered_states[part], world, generator)
        noisy = flown[:, : walk.axes] + generator.normal(0.0, noise.seen, seen[part].shape)
        seen[part] = np.where((tracks.state[part] > UNSEEN)[:, None], noisy, np.nan)
    return with_positions(tracks, seen)


def noise_statistics(model: FitModel, u: Array, spans: Sequence[int]) -> Array:
    """Return statistics of noise: logarithms of the variances along and across, and correlations between frames."""
    found = []
    for walk, own in model.parts(spans):
        by_column, gains, usual = model.split(u)
        e = walk.errors(by_column, gains, usual, own)
        rows = np.concatenate([np.arange(*walk.tracks.spans[s]) for s in own])
        found.append(e[rows])
    parts = []
    # Variances mix noise of the flight and of the tracks; correlations from frame to frame help to
    # separate them.
    for c in range(2):
        x = np.concatenate([e[:, c].ravel() for e in found])
        pairs = np.concatenate([(e[1:, c] * e[:-1, c]).ravel() for e in found])
        parts.append((np.log((x[x != 0.0] ** 2).mean()), pairs[pairs != 0.0].mean() / (x[x != 0.0] ** 2).mean()))
    return np.array([parts[0][0], parts[1][0], 2.0 * parts[0][1], 2.0 * parts[1][1]])


class FittedFlights:
    """Flights of a fitted model, from the beginnings of some spans of its tracks."""

    def __init__(self, model: FitModel, point: Array, spans: Sequence[int]):
        self.model, self.spans = model, list(spans)
        self.wanted = noise_statistics(model, point, self.spans)
        self.kept = []
        for walk in model.filters:
            kept = np.zeros((len(walk.seen), 2 * walk.axes, walk.tracks.individual_count))
            walk.errors(*model.split(point), None, kept)
            self.kept.append(kept)

    def fly(self, point: Array, noise: FitNoise, seed: int) -> FitModel:
        """Return the model on the tracks of one flight of all spans."""
        found = []
        by_walk = dict(self.model.parts(self.spans))
        for t, walk in enumerate(self.model.filters):
            own = by_walk.get(walk, [])
            found.append(fly_tracks(walk, self.model.split(point), self.kept[t], noise, own, 7919 * seed + t))
        twin = FitModel(self.model.law, found, self.model.scale)
        return twin.robust() if self.model.soft else twin

    def statistics(self, point: Array, noise: FitNoise, fitted: Array, seed: int) -> Array:
        """Return by how much statistics of one flight differ from those of the tracks, both taken at the fit."""
        flown = noise_statistics(self.fly(point, noise, seed), fitted, self.spans)
        return np.nan_to_num(flown - self.wanted, nan=10.0)


def first_noise(model: FitModel, point: Array, spans: Sequence[int]) -> FitNoise:
    """Return the noise to begin with.

    What the gains say of the noise of the tracks, and a guess of that of the flight.
    """
    along, across = model.score(point, spans).variances()
    _, gains, usual = model.split(point)
    seen = float(np.sqrt(max((1.0 - gains.across[0]) * across, FREE)))
    period = model.tracks[0].period
    push = float(np.sqrt(max(across, FREE))) * gains.across[1] / period
    column, law = PUSHED, push
    assert model.law is not None
    if model.law.noise_parameters:
        number = model.law.noise_parameters[0]
        column, law = number.column, max(push / max(usual, 1e-6), 1e-3) if number.unit == "rad" else push
    elif model.law.body_noise_column >= 0:
        column, law = model.law.body_noise_column, max(push**2 / (2.0 * period), 1e-6)
    return FitNoise(column, law, float(np.sqrt(max(along, FREE))) * gains.along[1] / period, seen)


# Noise of the law. Small noise hardly shows beside that of the tracks: one flight differs from the
# next by as much as half of the noise. So the law is flown with noise over a wide range, and curves
# through all these flights relate the statistics to the noise. The scatter about the curves gives
# the uncertainty (a synthetic likelihood: Wood 2010).
FLOWN = 30  # flights of each look
RANGE = (3.0, 0.7, 0.3)  # of the logarithms of noise: the law's, at the first look; own speed's and the tracks'
NARROW = 0.15  # at later looks, at least
BESIDE = 1.25  # of the interval: range of the next look
LOOKS = 4  # each where the one before points to
POWERS = 3  # of the curves
PLACES = 161  # along the range
IntervalEnds = tuple[float | None, float | None]


def estimate_noise(
    flights: FittedFlights, point: Array, scatter: Array, noise: FitNoise, fitted: Array, levels: Sequence[float],
    seed: int,
) -> tuple[FitNoise, list[IntervalEnds]]:  # fmt: skip
    """Estimate the noise of a law and of its tracks; and ends for each level, None where the tracks set no limit.

    scatter : draws of numbers about the point; fitted : where statistics are taken, the fit to the
              tracks
    levels  : shares of Student's distribution below an upper end, such as 0.975, the widest last
    """
    generator = np.random.default_rng(seed)
    centre, half, steps, ends = np.zeros(3), RANGE[0], np.zeros(3), list[IntervalEnds]()
    # Where the tracks set no limit, or beyond the edge of a look, the next one is wider on that side.
    for _ in range(LOOKS):
        steps, ends = _look(flights, point, scatter, noise, fitted, levels, centre, half, generator)
        bottom, top = (
            centre[0] + side * half if end is None else end for side, end in zip((-1.0, 1.0), ends[-1], strict=True)
        )
        half = max(0.5 * BESIDE * (top - bottom), NARROW)
        centre = np.array([0.5 * (bottom + top), *steps[1:]])
    scaled = [tuple(None if end is None else noise.law * math.exp(end) for end in each) for each in ends]
    return noise.shifted(steps), scaled  # type: ignore[return-value]


def _look(
    flights: FittedFlights, point: Array, scatter: Array, noise: FitNoise, fitted: Array, levels: Sequence[float],
    centre: Array, half: float, generator: np.random.Generator,
) -> tuple[Array, list[IntervalEnds]]:  # fmt: skip
    """Fly over a range of noise; return the logarithms of the likeliest noises, and the ends of that of the law."""
    from scipy.stats import t as student

    others = [1, 2] if flights.model.own_speed else [2]
    design, rows = [], []
    # Stratified draws of the noise along the window; numbers of the law are drawn within their
    # errors, which widens the interval as it should.
    for number in range(FLOWN):
        x = np.array([2.0 * (number + generator.random()) / FLOWN - 1.0, *generator.uniform(-1.0, 1.0, 2)])
        x[1] *= flights.model.own_speed
        law = np.clip(point + scatter[generator.integers(len(scatter))], 0.0, 1.0)
        flown = noise.shifted(centre + x * (half, *RANGE[1:]))
        rows.append(flights.statistics(law, flown, fitted, int(generator.integers(2, 2**20))))
        design.append([*(x[0] ** power for power in range(POWERS + 1)), *x[others]])
    matrix, found = np.array(design), np.array(rows)
    # Cubic curves in the logarithm of the noise, and lines in the nuisance noises.
    curves = np.linalg.lstsq(matrix, found, rcond=None)[0]
    left = found - matrix @ curves
    freedom = FLOWN - matrix.shape[1]
    covariance = left.T @ left / freedom * (1.0 + matrix.shape[1] / FLOWN)
    weight = np.linalg.inv(covariance + 1e-12 * np.eye(len(covariance)))
    along = np.linspace(-1.0, 1.0, PLACES)
    off = np.stack([along**power for power in range(POWERS + 1)], axis=1) @ curves[: POWERS + 1]
    lines = curves[POWERS + 1 :]  # noise of the tracks and of speeds follows, within what was flown
    follow = -np.linalg.solve(lines @ weight @ lines.T + np.eye(len(lines)), lines @ weight @ off.T)
    rest = off + follow.T @ lines
    worse = np.einsum("ij,jk,ik->i", rest, weight, rest) + (follow**2).sum(axis=0)
    best = int(np.argmin(worse))
    steps = np.array(centre)
    steps[0] += half * along[best]
    steps[others] += follow[:, best] * np.array(RANGE)[others]
    ends: list[IntervalEnds] = []
    for level in levels:
        held = np.flatnonzero(worse - worse[best] <= student.ppf(level, freedom) ** 2)
        low = None if held[0] == 0 else centre[0] + half * float(along[held[0]])
        high = None if held[-1] == PLACES - 1 else centre[0] + half * float(along[held[-1]])
        ends.append((low, high))
    return steps, ends


ROUNDS = (4, 4, 4, 4, 10)  # flights of each round; the last gives the intervals
LONGEST = 0.1  # of a range: move of a number that is put right, in one round
STEPS = 6  # of a climb
# Relative standard deviations of what flights leave out, of numbers and of noise, such as where
# steps of the motion fall between frames. Measured on tracks of known laws
# (tests/nightly/infer.py). Our choices, made on tracks of known laws: flights only have noise of
# the known kinds.
BEYOND = (0.0075, 0.05)
DOUBT = 0.5  # share of a correction that is not trusted
SURE = 0.95  # of a number alone, and of all numbers together


@dataclass
class CorrectedFit:
    """A fit corrected by flights of its own law, with intervals.

    place  : of all numbers, corrected
    alone  : ends of 95 % intervals of each number by itself, as places; low and high
    joint  : ends of intervals that hold all numbers together in 95 %
    noise  : of the flight and of the tracks
    noises : ends of the number of noise, alone and together; None where the tracks set no limit
    """

    place: Array
    alone: tuple[Array, Array]
    joint_ends: tuple[Array, Array]
    noise: FitNoise
    noise_ends: tuple[IntervalEnds, IntervalEnds]


def interval_levels(numbers: int) -> tuple[float, float]:
    """Return shares below the upper end of an interval: of one number, and of so many jointly (Šidák 1967)."""
    return 0.5 + 0.5 * SURE, 0.5 + 0.5 * SURE ** (1.0 / max(numbers, 1))


def correct_fit(
    model: FitModel, fit: Fit, draws: Array, spans: Sequence[int], on_progress: Callable[[], None] = lambda: None
) -> CorrectedFit:
    """Correct a fit by flights of its own law, and find its intervals.

    draws : numbers that explain the tracks as well (`sample_posterior`); spans : on which was
            fitted
    """
    from scipy.stats import norm as normal, t as student

    flights, fitted = FittedFlights(model, fit.place, spans), fit.place
    named = [k for k in fit.free if k < model.named]
    noise = first_noise(model, fitted, spans)
    levels = interval_levels(len(named) + (noise.column >= 0))
    scatter = draws - draws.mean(axis=0)
    scatter[:, model.named :] = 0.0
    place, misses, generator = fitted.copy(), np.zeros((1, len(fitted))), np.random.default_rng(len(spans))
    # Noise and numbers go together, as that of a heading and the limit of its turns: each is put
    # right in turn. How far fits miss depends on the law, so laws are flown that explain the tracks as well.
    for turn, count in enumerate(ROUNDS):
        noise, _ = estimate_noise(flights, place, scatter, noise, fitted, levels, len(spans))
        found = []
        for number in range(count):
            law = np.clip(place + scatter[generator.integers(len(scatter))], 0.0, 1.0)
            twin = flights.fly(law, noise, 100 * turn + number)
            # From the law itself, or from where fits of such laws have ended, whichever is likelier.
            starts = law, np.clip(fitted + law - place, 0.0, 1.0)
            start = starts[int(np.argmin([twin.score(u, spans).loss() for u in starts]))]
            end = climb_to_maximum(twin, start, fit.free, spans, STEPS, slopes=(FINE_SLOPES,))
            found.append(settle_fit(twin, end, spans).place - law)
            on_progress()
        misses = np.array(found)
        moved = fitted[named] - np.median(misses[:, named], axis=0)
        # A limit of turns that explains noise is put right by many short moves, and others follow it.
        place[named] = np.clip(moved, place[named] - LONGEST, place[named] + LONGEST).clip(0.0, 1.0)
    deviations = misses.std(axis=0, ddof=1)
    slopes = [n.slope(float(x)) / max(n.value(float(x)), 1e-9) for n, x in zip(model.numbers, place, strict=True)]
    down, up = posterior_ends(draws, levels[0])
    ends: list[tuple[Array, Array]] = []
    for level in levels:
        z = float(normal.ppf(level))
        wide = float(student.ppf(level, len(misses) - 1)) * np.sqrt(1.0 + 1.0 / len(misses)) * deviations
        # Half of what was put right is doubt about the noise, which is simpler in flights than in animals.
        doubt = np.hypot(DOUBT * (place - fitted), z * BEYOND[0] / np.maximum(slopes, 1e-9))
        more = z / float(normal.ppf(levels[0]))
        low = place - np.hypot(np.maximum(wide, more * (fitted - down)), doubt)
        high = place + np.hypot(np.maximum(wide, more * (up - fitted)), doubt)
        low[down <= 0.0], high[up >= 1.0] = 0.0, 1.0
        ends.append((low, high))
    noise, noise_ends = estimate_noise(flights, place, scatter, noise, fitted, levels, len(spans))
    on_progress()
    alone, joint = (
        widened_ends(noise.law, each, float(normal.ppf(level)) * BEYOND[1])
        for each, level in zip(noise_ends, levels, strict=True)
    )
    return CorrectedFit(place, ends[0], ends[1], noise, (alone, joint))


def widened_ends(value: float, ends: IntervalEnds, more: float) -> IntervalEnds:
    """Move both ends outwards on a logarithmic scale, by what flights leave out; the value lies between them."""
    low, high = ends
    below = 0.0 if low is None else max(math.log(value / low), 0.0)
    above = 0.0 if high is None else max(math.log(high / value), 0.0)
    return (
        None if low is None else value * math.exp(-math.hypot(below, more)),
        None if high is None else value * math.exp(math.hypot(above, more)),
    )
