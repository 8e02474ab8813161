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

from airflock.infer.fit import Fit, climb, settle, spread
from airflock.infer.likelihood import Model
from airflock.infer.tracks import ABSENT, ENTERS, Tracks, restated
from airflock.infer.walk import Walk

Array = NDArray[np.float64]
ROUNDS = (3, 10)  # flights of each round; the last gives the intervals
STEPS = 6  # of a climb
FREE = 1e-9  # m²: least variance
# Relative standard deviations of what flights leave out, of numbers and of noise, such as where steps of the motion
# fall between frames. Measured on tracks of known laws (tests/nightly/infer.py).
BEYOND = (0.0075, 0.05)
DOUBT = 0.5  # share of a correction that is not trusted


@dataclass(frozen=True)
class Noise:
    """Noise of a flight and of its tracks.

    law   : number of the law or its body that is noise (column), and its value; column -1: velocities are pushed
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
    for s in spans:
        begin, end = tracks.spans[s]
        walk.begin(columns, world=(seed * 1009 + s + 1) % 2**31)
        for k in range(begin, end):
            state = tracks.state[k]
            if k > begin:
                was = walk.now().copy()
                if noise.column < 0:
                    walk.rows[axes : 2 * axes, : len(state)] += generator.normal(0.0, noise.law, (axes, len(state)))
                walk.fly(usual)
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

    def noise(self, place: Array, first: Noise, fitted: Array) -> tuple[Noise, Array]:
        """Noise with which the flights' statistics are those of the tracks; and how logarithms of noise move them.

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
        return first.moved(steps), moves


LADDER = (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0)  # of the logarithm of noise


def again(model: Model, fit: Fit, spans: Sequence[int], say: Callable[[], None] = lambda: None) -> Again:
    """Put a fit right by flights of its own law, and tell how sure it is.

    spans : on which it was fitted
    """
    fitted, free = fit.place, fit.free
    flights = Flights(model, fitted, spans)
    noise = _first_noise(model, fitted, spans)
    curved = spread(model, fit, spans)
    place, number, refits = fitted.copy(), 1, np.zeros((0, len(fitted)))
    noises: list[Array] = []
    named = [k for k in free if k < model.named]
    for count in ROUNDS:
        noise, moves = flights.noise(place, noise, fitted)
        back = np.linalg.pinv(moves, rcond=1e-3)
        found, noises = [], []
        for _ in range(count):
            number += 1
            twin = flights.model_of(flights.tracks(place, noise, number))
            refit = settle(twin, climb(twin, fitted, free, list(spans), STEPS, rough=True), list(spans)).place
            found.append(refit)
            noises.append(back @ (statistics(twin, refit, flights.spans) - flights.wanted))
            say()
        refits = np.array(found)
        place[named] = np.clip(place[named] + fitted[named] - np.median(refits[:, named], axis=0), 0.0, 1.0)
    from scipy.stats import t as student

    count = len(refits)
    wide = float(student.ppf(0.975, count - 1)) * np.sqrt(1.0 + 1.0 / count)
    # half of what was put right is doubt about the noise, which is simpler in flights than in animals
    scatter = np.maximum(wide * refits.std(axis=0, ddof=1), 1.96 * curved)
    ends = np.hypot(scatter, DOUBT * (place - fitted))
    slopes = [n.slope(float(x)) / max(n.value(float(x)), 1e-9) for n, x in zip(model.numbers, place, strict=True)]
    ends = np.hypot(ends, 1.96 * BEYOND[0] / np.maximum(slopes, 1e-9))
    law = np.array([steps[0] for steps in noises])
    half = 1.96 * float(np.hypot(wide / 1.96 * law.std(ddof=1), BEYOND[1]))
    middle = -float(np.median(law))
    return Again(
        place, place - ends, place + ends, noise.moved(np.array([middle, 0.0, 0.0])),
        noise.law * float(np.exp(middle - half)), noise.law * float(np.exp(middle + half)),
    )  # fmt: skip


def _first_noise(model: Model, place: Array, spans: Sequence[int]) -> Noise:
    """Noise to begin with: what the gains say of the noise of the tracks, and a guess of that of the flight."""
    along, across = model.score(place, spans).variances()
    _, gains, usual = model.split(place)
    seen = float(np.sqrt(max((1.0 - gains.across[0]) * across, FREE)))
    period = model.tracks[0].period
    push = float(np.sqrt(max(across, FREE))) * gains.across[1] / period
    column, law = -1, push
    assert model.law is not None
    if model.law.noises:
        number = model.law.noises[0]
        column, law = number.column, max(push / max(usual, 1e-6), 1e-3) if number.unit == "rad" else push
    elif model.law.body_noise >= 0:
        column, law = model.law.body_noise, max(push**2 / (2.0 * period), 1e-6)
    return Noise(column, law, float(np.sqrt(max(along, FREE))) * gains.along[1] / period, seen)
