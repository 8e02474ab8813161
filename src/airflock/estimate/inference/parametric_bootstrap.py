"""Correct bias and intervals of a fit by flights of the fitted law (a parametric bootstrap)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.identifiability import Ridges, profile_ridges, ridges_of_dropped
from airflock.estimate.inference.innovation_filter import FilterGains, FitModel, InnovationFilter
from airflock.estimate.inference.law_candidates import LawCandidate
from airflock.estimate.inference.likelihood_fit import (
    CENTRAL_SLOPES,
    FINE_SLOPES,
    Fit,
    climb_to_maximum,
    distance_to_worse,
    loss_at,
    open_ends,
    settle_fit,
    standard_errors,
)
from airflock.estimate.inference.observed_tracks import (
    UNSEEN,
    SpanTracks,
    with_positions,
)

Array = NDArray[np.float64]
# Flights of a fitted law from the beginnings of its tracks, observed with the same gaps and noise.
FREE = 1e-9  # m²: least variance
PUSHED, BLURRED = -1, -2  # noise that is no number of the law or its body
LASTING = 1.0  # s; correlation time of errors of what is perceived
BLUR = 0.05  # of the distance to the nearest neighbour: first guess of these errors
LADDER = (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0)  # of the logarithm of noise


@dataclass(frozen=True)
class FitNoise:
    """Noise of a flight and of its tracks.

    law   : number of the law or its body that is noise (column), and its value; PUSHED: SD of pushes of velocities,
            m/s; BLURRED: SD of errors of perceived positions, m
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
    pushed, blurred = (noise.law if noise.column == kind else 0.0 for kind in (PUSHED, BLURRED))
    flown = np.zeros((len(state), 2 * walk.axes, walk.tracks.individual_count))
    draws = generator.normal(size=(len(state), 2 * walk.axes + 1, walk.tracks.individual_count))
    walk.loops.fly_span(
        *walk.begin(columns, usual, world), state, follow, draws, np.zeros_like(flown[0]), pushed, blurred,
        math.exp(-walk.tracks.period / LASTING), wander, walk.axes, walk.half_sides, usual, gains.keep, flown,
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

    def tracks(self, point: Array, noise: FitNoise, seed: int) -> list[SpanTracks]:
        """Return the tracks of one flight of all spans."""
        found = []
        by_walk = dict(self.model.parts(self.spans))
        for t, walk in enumerate(self.model.filters):
            own = by_walk.get(walk, [])
            found.append(fly_tracks(walk, self.model.split(point), self.kept[t], noise, own, 7919 * seed + t))
        return found

    def model_on(self, tracks: list[SpanTracks]) -> FitModel:
        """Return the model on other tracks."""
        twin = FitModel(self.model.law, tracks, self.model.scale)
        twin = twin.with_fixed(sorted(self.model.held))
        return twin.robust() if self.model.soft else twin

    def noise(self, point: Array, first_noise: FitNoise, fitted: Array) -> tuple[FitNoise, float]:
        """Return the noise whose flights have the statistics of the tracks, and the misfit.

        fitted : place at which statistics are taken, that of the fit to the tracks
        """
        from scipy.optimize import least_squares

        active = [0, 2] if not self.model.own_speed else [0, 1, 2]

        # The same seed for all noises: differences between flights then come from the noise alone.
        def off(z: Array, base: FitNoise = first_noise) -> Array:
            steps = np.zeros(3)
            steps[active] = z
            twin = self.model_on(self.tracks(point, base.shifted(steps), 1))
            return np.nan_to_num(noise_statistics(twin, fitted, self.spans) - self.wanted, nan=10.0)

        tried = [float(np.sum(off(np.eye(len(active))[0] * step) ** 2)) for step in LADDER]
        start = np.eye(len(active))[0] * LADDER[int(np.argmin(tried))]
        found = least_squares(off, start, diff_step=0.1, x_scale=1.0, max_nfev=5)
        steps = np.zeros(3)
        steps[active] = np.clip(found.x, -8.0, 8.0)
        return first_noise.shifted(steps), 2.0 * float(found.cost)


def first_noise(model: FitModel, point: Array, spans: Sequence[int]) -> list[FitNoise]:
    """Return the noise to begin with, of each possible kind.

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
    found = FitNoise(column, law, float(np.sqrt(max(along, FREE))) * gains.along[1] / period, seen)
    if column != PUSHED:
        return [found]
    return [found, replace(found, column=BLURRED, law=BLUR * model.scale.near)]


# Noise of the law. Small noise hardly shows beside that of the tracks: one flight differs from the
# next by as much as half of the noise. So the law is flown with noise over a wide range, and curves
# through all these flights relate the statistics to the noise. The scatter about the curves gives
# the uncertainty (a synthetic likelihood: Wood 2010).
FLOWN = 40  # flights of each look
RANGE = 1.6  # of the logarithm of noise, to each side, at the first look
NARROW = 0.15  # at the second, at least
BESIDE = 1.25  # of the interval: range of the second look
INNER = 0.95  # of a look to each side: farther out is its edge
OTHERS = (0.7, 0.15)  # of the logarithms of noise of the own speed, and of the tracks: to each side
MOVED = 4  # times that the first look is made, each where the one before points to
POWERS = 3  # of the curves
PLACES = 161  # along the range
IntervalEnds = tuple[float | None, float | None]


def estimate_law_noise(
    flights: FittedFlights,
    point: Array,
    scatter: Array,
    noise: FitNoise,
    fitted: Array,
    levels: Sequence[float],
    seed: int,
) -> tuple[FitNoise, list[IntervalEnds]]:
    """Estimate the noise of a law, and the ends of an interval for each level; None where the tracks set no limit.

    place, scatter : numbers of the law, as places, and their standard errors; fitted: where statistics are taken
    levels         : shares of Student's distribution below an upper end, such as 0.975
    """
    generator = np.random.default_rng(seed)
    centre, half, widest = 0.0, RANGE, int(np.argmax(levels))
    # Shift the window until the ends of the interval lie inside it.
    for _ in range(MOVED):
        steps, first = _look(flights, point, scatter, noise, fitted, levels, centre, half, generator)
        low, high = first[widest]
        if high is None:  # more noise always shows at last
            centre += half
        elif low is None and steps[0] < centre - 0.9 * half:
            centre -= half
        else:
            break
    bottom, top = (centre - half if low is None else low), (centre + half if high is None else high)
    centre, half = 0.5 * (bottom + top), max(0.5 * BESIDE * (top - bottom), NARROW)
    # A likeliest noise at the edge of a look lies beyond it: look again from there.
    for _ in range(MOVED):
        steps, intervals = _look(flights, point, scatter, noise, fitted, levels, centre, half, generator)
        if abs(steps[0] - centre) < INNER * half:
            break
        centre, half = float(steps[0]), 2.0 * half
    ends: list[IntervalEnds] = []
    for (low, high), (before, after) in zip(intervals, first, strict=True):
        below = None if low is None and before is None else min(x for x in (low, before, steps[0]) if x is not None)
        above = None if high is None and after is None else max(x for x in (high, after, steps[0]) if x is not None)
        if low is not None and high is not None:
            below, above = low, high
        ends.append(
            (None if below is None else noise.law * float(np.exp(below)),
             None if above is None else noise.law * float(np.exp(above)))
        )  # fmt: skip
    if abs(steps[0] - centre) >= INNER * half:  # still at an edge: there is no limit on that side
        ends = [(low, None) if steps[0] > centre else (None, high) for low, high in ends]
    return noise.shifted(steps), ends


def _look(
    flights: FittedFlights, place: Array, scatter: Array, noise: FitNoise, fitted: Array, levels: Sequence[float],
    centre: float, half: float, generator: np.random.Generator,
) -> tuple[Array, list[IntervalEnds]]:  # fmt: skip
    """Fly over a range of noise; return the logarithms of the likeliest noises, and the ends of that of the law."""
    from scipy.stats import t as student

    named = flights.model.named
    speeds = flights.model.own_speed
    design, rows = [], []
    # Stratified draws of the noise along the window; numbers of the law are drawn within their
    # errors, which widens the interval as it should.
    for number in range(FLOWN):
        x = 2.0 * (number + generator.random()) / FLOWN - 1.0
        speed, seen = generator.uniform(-1.0, 1.0, 2) * (1.0 if speeds else 0.0, 1.0)
        steps = np.array([centre + half * x, OTHERS[0] * speed, OTHERS[1] * seen])
        law = place.copy()
        law[:named] = np.clip(law[:named] + scatter[:named] * generator.normal(size=named), 0.0, 1.0)
        twin = flights.model_on(flights.tracks(law, noise.shifted(steps), int(generator.integers(2, 2**20))))
        rows.append(np.nan_to_num(noise_statistics(twin, fitted, flights.spans) - flights.wanted, nan=10.0))
        design.append([*(x**power for power in range(POWERS + 1)), seen, *([speed] if speeds else [])])
    matrix, found = np.array(design), np.array(rows)
    # Cubic curves in the logarithm of the noise, and lines in the two nuisance noises.
    curves = np.linalg.lstsq(matrix, found, rcond=None)[0]
    left = found - matrix @ curves
    freedom = FLOWN - matrix.shape[1]
    covariance = left.T @ left / freedom * (1.0 + matrix.shape[1] / FLOWN)
    weight = np.linalg.inv(covariance + 1e-12 * np.eye(len(covariance)))
    along = np.linspace(-1.0, 1.0, PLACES)
    off = np.stack([along**power for power in range(POWERS + 1)], axis=1) @ curves[: POWERS + 1]
    others = curves[POWERS + 1 :]  # noise of the tracks and of speeds follows, within what was flown
    follow = -np.linalg.solve(others @ weight @ others.T + np.eye(len(others)), others @ weight @ off.T)
    rest = off + follow.T @ others
    worse = np.einsum("ij,jk,ik->i", rest, weight, rest) + (follow**2).sum(axis=0)
    best = int(np.argmin(worse))
    steps = np.array([centre + half * along[best], OTHERS[0] * follow[1, best] if speeds else 0.0, 0.0])
    steps[2] = OTHERS[1] * follow[0, best]
    ends: list[IntervalEnds] = []
    for level in levels:
        held = np.flatnonzero(worse - worse[best] <= student.ppf(level, freedom) ** 2)
        low = None if held[0] == 0 else centre + half * float(along[held[0]])
        high = None if held[-1] == PLACES - 1 else centre + half * float(along[held[-1]])
        ends.append((low, high))
    return steps, ends


ROUNDS = (3, 10)  # flights of each round, and of the last, which gives the intervals
MOST = 6  # rounds
LONGEST = 0.1  # of a range: move of a number that is put right, in one round
MATCHED = 0.005  # sum of squares by which statistics of flights may differ from those of the tracks in the last round
STEPS = 6  # of a climb
# Relative standard deviations of what flights leave out, of numbers and of noise, such as where
# steps of the motion fall between frames. Measured on tracks of known laws
# (tests/nightly/infer.py). Our choices, made on tracks of known laws: flights only have noise of
# the known kinds.
BEYOND = (0.0075, 0.05)
DOUBT = 0.5  # share of a correction that is not trusted
ONE = 1.96  # standard errors that hold one number in 95 %
APART = 0.05  # of a range: largest standard deviation by which the laws of the last flights are apart
UNLIKELY = 20.0  # loss above the fit, beyond which another end is left
SURE = 0.95  # of a number alone, and of all numbers together
WIDER = (1.0, 3.0)  # least and largest variance of refitted numbers, in units of what the curvature says


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
    law: LawCandidate, model: FitModel, fit: Fit, spans: Sequence[int], on_progress: Callable[[], None] = lambda: None
) -> CorrectedFit:
    """Correct a fit by flights of its own law, and find its intervals.

    law : with all its numbers, also those that the model does without; spans : on which it was fitted
    """
    from scipy.stats import norm as normal, t as student

    model, fit = _softened(model, fit, spans)
    kinds = first_noise(model, fit.place, spans)
    named = [k for k in fit.free if k < model.named]
    shares = interval_levels(len(named) + (kinds[0].column >= 0))
    deepest = 0.5 * WIDER[1] * float(normal.ppf(shares[1])) ** 2
    fit, ways = profile_ridges(model, fit, spans, deepest, on_progress)
    ways = Ridges((*ways.paths, *ridges_of_dropped(law, model, fit, spans, deepest, on_progress)))
    fitted = fit.place
    flights = FittedFlights(model, fitted, spans)
    curved, (below, above) = standard_errors(model, fit, spans), open_ends(model, fit, spans)
    for k in np.flatnonzero(below != above):  # a plateau has no curvature, its edge is an end
        curved[k] = distance_to_worse(model, fit, spans, int(k), 0.0 if above[k] else 1.0) / ONE
    place, kinds, misses = _put_right(flights, fit, kinds, curved, on_progress)
    deviations = misses.std(axis=0, ddof=1)
    wider = float(np.clip(np.median((deviations[named] / curved[named]) ** 2), *WIDER))
    slopes = [n.slope(float(x)) / max(n.value(float(x)), 1e-9) for n, x in zip(model.numbers, place, strict=True)]
    count, found = len(misses), []
    for share in shares:
        z = float(normal.ppf(share))
        wide = float(student.ppf(share, count - 1)) * np.sqrt(1.0 + 1.0 / count)
        scatter = np.maximum(wide * deviations, z * curved)
        # half of what was put right is doubt about the noise, which is simpler in flights than in
        # animals
        doubt = np.hypot(DOUBT * (place - fitted), z * BEYOND[0] / np.maximum(slopes, 1e-9))
        down, up = ways.ends(fitted, 0.5 * wider * z**2)
        low = place - np.hypot(np.maximum(scatter, fitted - down), doubt)
        high = place + np.hypot(np.maximum(scatter, up - fitted), doubt)
        low[below | (down <= 0.0)], high[above | (up >= 1.0)] = 0.0, 1.0
        found.append((low, high))
    noise = kinds[0]
    ends: list[IntervalEnds] = [(None, None), (None, None)]
    if noise.column >= 0:
        noise, ends = _noise(flights, place, 0.5 * (found[0][1] - found[0][0]) / ONE, noise, fitted, shares)
        on_progress()
    return CorrectedFit(place, found[0], found[1], noise, (ends[0], ends[1]))


def _softened(model: FitModel, fit: Fit, spans: Sequence[int]) -> tuple[FitModel, Fit]:
    """Refit with less weight of large differences, from the fit of all differences or another end; return model and
    fit.
    """
    model = model.robust()
    here = model.score(fit.place, spans).loss()
    near = [u for u in fit.others if model.score(u, spans).loss() < here + UNLIKELY]
    ends = [
        climb_to_maximum(model, u, fit.free, spans, slopes=(FINE_SLOPES, CENTRAL_SLOPES)) for u in (fit.place, *near)
    ]
    best = min(ends, key=lambda end: end.loss)
    return model, replace(best, others=(*fit.others, *(end.place for end in ends if end is not best)))


def _put_right(
    flights: FittedFlights, fit: Fit, kinds: list[FitNoise], curved: Array, say: Callable[[], None]
) -> tuple[Array, list[FitNoise], Array]:
    """Correct the bias; return the point, the noise of each kind that belongs to it, and the misses of the last
    flights.
    """
    model, spans, fitted = flights.model, flights.spans, fit.place
    named = [k for k in fit.free if k < model.named]
    place, number, misses = fitted.copy(), 1, np.zeros((1, len(fitted)))
    generator = np.random.default_rng(len(spans))
    for turns in range(MOST):
        matched = [flights.noise(place, each, fitted) for each in kinds]
        kinds = [noise for noise, _ in matched]
        # noise and numbers go together, as that of a heading and the limit of its turns: each is
        # put right in turn
        last = turns == MOST - 1 or (turns > 0 and min(off for _, off in matched) < MATCHED)
        # how far fits miss depends on the law: the last flights are of laws as far apart as the
        # first fits were
        apart = np.minimum(np.maximum(curved, misses.std(axis=0)), APART) if len(misses) > 1 else np.zeros(len(fitted))
        found = []
        for turn in range(ROUNDS[last]):
            number += 1
            law = place.copy()
            law[named] = np.clip(law[named] + apart[named] * generator.normal(size=len(named)), 0.0, 1.0)
            twin = flights.model_on(flights.tracks(law, kinds[turn % len(kinds)], number))
            # from the law itself, or from where fits of such laws have ended, whichever is likelier
            starts = (law, np.clip(fitted + law - place, 0.0, 1.0))
            start = min(starts, key=lambda u, twin=twin: loss_at(twin, u, fit.free, spans))  # type: ignore[misc]
            found.append(
                settle_fit(
                    twin, climb_to_maximum(twin, start, fit.free, spans, STEPS, slopes=(FINE_SLOPES,)), spans
                ).place
                - law
            )
            say()
        misses = np.array(found)
        moved = fitted[named] - np.median(misses[:, named], axis=0)
        place[named] = np.clip(moved, place[named] - LONGEST, place[named] + LONGEST).clip(0.0, 1.0)
        if last:
            break
    return place, [flights.noise(place, each, fitted)[0] for each in kinds], misses


def _noise(
    flights: FittedFlights, place: Array, scatter: Array, noise: FitNoise, fitted: Array, shares: tuple[float, float]
) -> tuple[FitNoise, list[IntervalEnds]]:
    """Return the noise, and its ends alone and jointly, widened by what flights leave out."""
    from scipy.stats import norm as normal

    noise, ends = estimate_law_noise(flights, place, scatter, noise, fitted, shares, len(flights.spans))
    more = [float(normal.ppf(share)) * BEYOND[1] for share in shares]
    return noise, [widened_ends(noise.law, *each) for each in zip(ends, more, strict=True)]


def widened_ends(value: float, ends: IntervalEnds, more: float) -> IntervalEnds:
    """Move both ends outwards on a logarithmic scale, by what flights leave out; the value lies between them."""
    low, high = ends
    below = 0.0 if low is None else max(math.log(value / low), 0.0)
    above = 0.0 if high is None else max(math.log(high / value), 0.0)
    return (
        None if low is None else value * math.exp(-math.hypot(below, more)),
        None if high is None else value * math.exp(math.hypot(above, more)),
    )
