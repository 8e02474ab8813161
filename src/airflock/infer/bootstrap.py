"""Tracks flown again: what the fitted law would have left behind, to correct the fit by and to tell how sure it is.

Places are seen with noise, and the slope of a law against a noisy percept is too flat; a threshold is blurred. So the
law is flown from the same beginnings with the noise that was found, is seen with the same gaps and the same noise of
the tracks, and is fitted again. Where that fit misses the law that flew, the fit to the tracks is put right by as much
(indirect inference, Gouriéroux, Monfort & Renault 1993). The scatter of such fits gives the intervals, which are no
narrower than the curvature of the likelihood says: a fit that is repeated from beside its end does not walk a ridge.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.infer.fit import FINE, Fit, climb, closed_end, open_ends, settle, spread
from airflock.infer.likelihood import Model
from airflock.infer.tracks import ABSENT, ENTERS, Tracks, restated
from airflock.infer.walk import Walk

Array = NDArray[np.float64]
ROUNDS = (3, 10)  # flights of each round, and of the last, which gives the intervals
MOST = 6  # rounds
LONGEST = 0.1  # of a range: move of a number that is put right, in one round
MATCHED = 0.005  # sum of squares by which statistics of flights may differ from those of the tracks in the last round
STEPS = 6  # of a climb
FREE = 1e-9  # m²: least variance
# Relative standard deviations of what flights leave out, of numbers and of noise, such as where steps of the motion
# fall between frames. Measured on tracks of known laws (tests/nightly/infer.py).
BEYOND = (0.0075, 0.05)
DOUBT = 0.5  # share of a correction that is not trusted
ONE = 1.96  # standard errors that hold one number in 95 %
APART = 0.05  # of a range: largest standard deviation by which the laws of the last flights are apart
SURE = 0.95  # of all numbers together
PUSHED, BLURRED = -1, -2  # noise that is no number of the law or its body
LASTING = 1.0  # s; correlation time of errors of what is perceived
BLUR = 0.05  # of the distance to the nearest neighbour: first guess of these errors


@dataclass(frozen=True)
class Noise:
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

    def moved(self, steps: Array) -> "Noise":
        """The noise with logarithms changed."""
        law, speed, seen = (
            value * float(np.exp(step)) for value, step in zip((self.law, self.speed, self.seen), steps, strict=True)
        )
        return replace(self, law=law, speed=speed, seen=seen)


def flown(walk: Walk, place: tuple, kept: Array, noise: Noise, spans: Sequence[int], seed: int) -> Tracks:  # type: ignore[type-arg]
    """Tracks of the law flown again from the beginning of each span.

    place : numbers by column, gains, usual speed (`Model.split`); kept : where individuals were (`Walk.errors`)
    """
    numbers, gains, usual = place
    tracks, axes = walk.tracks, walk.axes
    generator = np.random.default_rng(seed)
    seen = np.full_like(tracks.seen, np.nan)
    own_speed = walk.law is not None and walk.law.heading
    columns = {**numbers, **({noise.column: noise.law} if noise.column >= 0 else {})}
    lasts = float(np.exp(-tracks.period / LASTING))
    for s in spans:
        begin, end = tracks.spans[s]
        blur = generator.normal(0.0, noise.law, (axes, tracks.individuals)) if noise.column == BLURRED else None
        walk.begin(columns, world=(seed * 1009 + s + 1) % 2**31)
        for k in range(begin, end):
            state = tracks.state[k]
            if k > begin:
                was = walk.now().copy()
                if noise.column == PUSHED:
                    walk.rows[axes : 2 * axes, : len(state)] += generator.normal(0.0, noise.law, (axes, len(state)))
                if blur is None:
                    walk.fly(usual)
                else:  # everybody decides by displaced positions, and moves from the true one
                    blur = lasts * blur + np.sqrt(1.0 - lasts**2) * generator.normal(0.0, noise.law, blur.shape)
                    walk.now()[:axes] += blur
                    walk.fly(usual)
                    walk.now()[:axes] -= blur
                if own_speed:
                    speed = np.linalg.norm(was[axes:], axis=0)
                    new = usual + gains.keep * (speed - usual) + generator.normal(0.0, noise.speed, len(state))
                    factor = np.maximum(new, 0.05 * usual) / usual
                    now = walk.now()
                    now[:axes] = was[:axes] + factor * tracks.nearest(now[:axes] - was[:axes])
                    now[axes:] *= factor
            enters = (state == ENTERS) | (state == ABSENT)
            walk.now()[:, enters] = kept[k][:, enters]
            if k == begin:
                walk.settle(walk.now().copy())
            there = state > 1
            noisy = walk.now()[:axes] + generator.normal(0.0, noise.seen, (axes, len(state)))
            seen[k][:, there] = noisy[:, there]
    return restated(tracks, seen)


def statistics(model: Model, u: Array, spans: Sequence[int]) -> Array:
    """What noise shows in: logarithms of the variances along and across, and correlations from frame to frame."""
    found = []
    for walk, own in model.parts(spans):
        by_column, gains, usual = model.split(u)
        e = walk.errors(by_column, gains, usual, own)
        rows = np.concatenate([np.arange(*walk.tracks.spans[s]) for s in own])
        found.append(e[rows])
    parts = []
    for c in range(2):
        x = np.concatenate([e[:, c].ravel() for e in found])
        pairs = np.concatenate([(e[1:, c] * e[:-1, c]).ravel() for e in found])
        parts.append((np.log((x[x != 0.0] ** 2).mean()), pairs[pairs != 0.0].mean() / (x[x != 0.0] ** 2).mean()))
    return np.array([parts[0][0], parts[1][0], 2.0 * parts[0][1], 2.0 * parts[1][1]])


@dataclass
class Again:
    """What flights of the fitted law say about the fit.

    place : of all numbers, put right; low, high : ends of 95 % intervals, as places
    noise : of the flight and of the tracks; noise_low, noise_high : of the number of noise
    """

    place: Array
    low: Array
    high: Array
    noise: Noise
    noise_low: float
    noise_high: float


class Flights:
    """Flights of a fitted model, from the beginnings of some spans of its tracks."""

    def __init__(self, model: Model, place: Array, spans: Sequence[int]):
        self.model, self.spans = model, list(spans)
        self.wanted = statistics(model, place, self.spans)
        self.kept = []
        for walk in model.walks:
            kept = np.zeros((len(walk.seen), 2 * walk.axes, walk.tracks.individuals))
            walk.errors(*model.split(place), None, kept)
            self.kept.append(kept)

    def tracks(self, place: Array, noise: Noise, seed: int) -> list[Tracks]:
        """Tracks of one flight of all spans."""
        found = []
        by_walk = dict(self.model.parts(self.spans))
        for t, walk in enumerate(self.model.walks):
            own = by_walk.get(walk, [])
            found.append(flown(walk, self.model.split(place), self.kept[t], noise, own, 7919 * seed + t))
        return found

    def model_of(self, tracks: list[Tracks]) -> Model:
        """The same model on other tracks."""
        twin = Model(self.model.law, tracks, self.model.scale)
        return twin.fixed(sorted(self.model.held))

    def noise(self, place: Array, first: Noise, fitted: Array) -> tuple[Noise, Array, float]:
        """Noise with which the flights' statistics are those of the tracks; how logarithms of noise move them; misfit.

        fitted : place at which statistics are taken, that of the fit to the tracks
        """
        from scipy.optimize import least_squares

        active = [0, 2] if not self.model.own_speed else [0, 1, 2]

        def off(z: Array, base: Noise = first) -> Array:
            steps = np.zeros(3)
            steps[active] = z
            twin = self.model_of(self.tracks(place, base.moved(steps), 1))
            return np.nan_to_num(statistics(twin, fitted, self.spans) - self.wanted, nan=10.0)

        tried = [float(np.sum(off(np.eye(len(active))[0] * step) ** 2)) for step in LADDER]
        start = np.eye(len(active))[0] * LADDER[int(np.argmin(tried))]
        found = least_squares(off, start, diff_step=0.1, x_scale=1.0, max_nfev=5)
        steps = np.zeros(3)
        steps[active] = np.clip(found.x, -8.0, 8.0)
        moves = np.zeros((len(self.wanted), 3))
        moves[:, active] = found.jac
        return first.moved(steps), moves, 2.0 * float(found.cost)


LADDER = (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0)  # of the logarithm of noise


def again(model: Model, fit: Fit, spans: Sequence[int], say: Callable[[], None] = lambda: None) -> Again:
    """Put a fit right by flights of its own law, and tell how sure it is.

    spans : on which it was fitted
    """
    fitted, free = fit.place, fit.free
    flights = Flights(model, fitted, spans)
    kinds = _first_noise(model, fitted, spans)
    curved, (below, above) = spread(model, fit, spans), open_ends(model, fit, spans)
    for k in np.flatnonzero(below != above):  # a plateau has no curvature, its edge is an end
        curved[k] = closed_end(model, fit, spans, int(k), 0.0 if above[k] else 1.0) / ONE
    place, number, misses = fitted.copy(), 1, np.zeros((1, len(fitted)))
    noises: list[Array] = []
    named = [k for k in free if k < model.named]
    generator = np.random.default_rng(len(flights.spans))
    for turns in range(MOST):
        matched = [flights.noise(place, each, fitted) for each in kinds]
        kinds = [noise for noise, _, _ in matched]
        # noise and numbers go together, as that of a heading and the limit of its turns: each is put right in turn
        last = turns == MOST - 1 or (turns > 0 and min(off for _, _, off in matched) < MATCHED)
        # how far fits miss depends on the law: the last flights are of laws as far apart as the first fits were
        apart = np.minimum(np.maximum(curved, misses.std(axis=0)), APART) if len(misses) > 1 else np.zeros(len(fitted))
        found, noises = [], []
        for turn in range(ROUNDS[last]):
            number += 1
            noise, moves, _ = matched[turn % len(matched)]
            law = place.copy()
            law[named] = np.clip(law[named] + apart[named] * generator.normal(size=len(named)), 0.0, 1.0)
            twin = flights.model_of(flights.tracks(law, noise, number))
            refit = settle(twin, climb(twin, fitted, free, list(spans), STEPS, slopes=(FINE,)), list(spans)).place
            found.append(refit - law)
            noises.append(np.linalg.pinv(moves, rcond=1e-3) @ (statistics(twin, refit, flights.spans) - flights.wanted))
            say()
        misses = np.array(found)
        moved = fitted[named] - np.median(misses[:, named], axis=0)
        place[named] = np.clip(moved, place[named] - LONGEST, place[named] + LONGEST).clip(0.0, 1.0)
        if last:
            break
    from scipy.stats import norm as normal
    from scipy.stats import t as student

    count, level = len(misses), 0.5 + 0.5 * SURE ** (1.0 / max(len(named), 1))
    wide = float(student.ppf(level, count - 1)) * np.sqrt(1.0 + 1.0 / count)
    # half of what was put right is doubt about the noise, which is simpler in flights than in animals
    scatter = np.maximum(wide * misses.std(axis=0, ddof=1), float(normal.ppf(level)) * curved)
    ends = np.hypot(scatter, DOUBT * (place - fitted))
    slopes = [n.slope(float(x)) / max(n.value(float(x)), 1e-9) for n, x in zip(model.numbers, place, strict=True)]
    ends = np.hypot(ends, ONE * BEYOND[0] / np.maximum(slopes, 1e-9))
    low, high = place - ends, place + ends
    low[below], high[above] = 0.0, 1.0
    noise = flights.noise(place, kinds[0], fitted)[0]
    shares = np.array([steps[0] for steps in noises])
    shift = float(np.log(noise.law / kinds[0].law)) + float(np.median(shares))
    half = float(np.hypot(np.hypot(wide * shares.std(ddof=1), ONE * BEYOND[1]), DOUBT * shift))
    return Again(place, low, high, noise, noise.law * float(np.exp(-half)), noise.law * float(np.exp(half)))


def _first_noise(model: Model, place: Array, spans: Sequence[int]) -> list[Noise]:
    """Noise to begin with, of each kind that there may be.

    What the gains say of the noise of the tracks, and a guess of that of the flight.
    """
    along, across = model.score(place, spans).variances()
    _, gains, usual = model.split(place)
    seen = float(np.sqrt(max((1.0 - gains.across[0]) * across, FREE)))
    period = model.tracks[0].period
    push = float(np.sqrt(max(across, FREE))) * gains.across[1] / period
    column, law = PUSHED, push
    assert model.law is not None
    if model.law.noises:
        number = model.law.noises[0]
        column, law = number.column, max(push / max(usual, 1e-6), 1e-3) if number.unit == "rad" else push
    elif model.law.body_noise >= 0:
        column, law = model.law.body_noise, max(push**2 / (2.0 * period), 1e-6)
    found = Noise(column, law, float(np.sqrt(max(along, FREE))) * gains.along[1] / period, seen)
    if column != PUSHED:
        return [found]
    return [found, replace(found, column=BLURRED, law=BLUR * model.scale.near)]
