"""Flights of a fitted law from the beginnings of its tracks, seen with the same gaps and noise, and their noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.likelihood import FitModel
from airflock.estimate.inference.tracks import ABSENT, ENTERS, SpanTracks, with_positions
from airflock.estimate.inference.walk import FilterGains, InnovationFilter

Array = NDArray[np.float64]
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
        """The noise with logarithms changed."""
        law, speed, seen = (
            value * float(np.exp(step)) for value, step in zip((self.law, self.speed, self.seen), steps, strict=True)
        )
        return replace(self, law=law, speed=speed, seen=seen)


class NoisyFlight:
    """A flight of a fitted law with its noise, period by period of the tracks.

    place : numbers by column, gains, usual speed (`Model.split`)
    """

    def __init__(
        self, walk: InnovationFilter, fitted: tuple[dict[int, float], FilterGains, float], noise: FitNoise, seed: int
    ):
        numbers, self.gains, self.mean_speed = fitted
        self.walk, self.noise, self.generator = walk, noise, np.random.default_rng(seed)
        self.columns = {**numbers, **({noise.column: noise.law} if noise.column >= 0 else {})}
        self.shape = walk.axes, walk.tracks.individual_count
        self.own_speed = walk.law is not None and walk.law.commands_heading
        self.error: Array | None = None  # of everybody's position as it is perceived, m

    def begin(self, world: int) -> None:
        """Forget the flight before. world : which random numbers the law draws."""
        if self.noise.column == BLURRED:
            self.error = self.generator.normal(0.0, self.noise.law, self.shape)
        self.walk.begin(self.columns, world=world)

    def step(self, speed: Array | None = None) -> Array | None:
        """Fly for one period. Returns own speeds (individual,) after it, m/s, where they are the individuals' own.

        speed : own speeds before it, by default those of the velocities
        """
        walk, axes = self.walk, self.walk.axes
        was = walk.now().copy()
        if self.noise.column == PUSHED:
            walk.now()[axes:] += self.generator.normal(0.0, self.noise.law, self.shape)
        if self.error is None:
            walk.fly(self.mean_speed)
        else:  # everybody decides by displaced positions, and moves from the true one
            lasts = float(np.exp(-walk.tracks.period / LASTING))
            draws = self.generator.normal(0.0, self.noise.law, self.shape)
            self.error = lasts * self.error + np.sqrt(1.0 - lasts**2) * draws
            walk.now()[:axes] += self.error
            walk.fly(self.mean_speed)
            walk.now()[:axes] -= self.error
        if not self.own_speed:
            return None
        speed = np.linalg.norm(was[axes:], axis=0) if speed is None else speed
        speed = next_speed(speed, self.gains.keep, self.mean_speed, self.noise.speed, self.generator)
        stretch_last_step(walk, was, speed / self.mean_speed)
        return speed


def fly_tracks(
    walk: InnovationFilter,
    fitted: tuple[dict[int, float], FilterGains, float],
    filtered_states: Array,
    noise: FitNoise,
    spans: Sequence[int],
    seed: int,
) -> SpanTracks:
    """Tracks of the law flown again from the beginning of each span.

    place : numbers by column, gains, usual speed (`Model.split`); kept : where individuals were (`Walk.errors`)
    """
    tracks, axes = walk.tracks, walk.axes
    flight = NoisyFlight(walk, fitted, noise, seed)
    seen = np.full_like(tracks.seen, np.nan)
    for s in spans:
        begin, end = tracks.spans[s]
        flight.begin((seed * 1009 + s + 1) % 2**31)
        for k in range(begin, end):
            state = tracks.state[k]
            if k > begin:
                flight.step()
            enters = (state == ENTERS) | (state == ABSENT)
            walk.now()[:, enters] = filtered_states[k][:, enters]
            if k == begin:
                walk.fill_past_states(walk.now().copy())
            there = state > 1
            noisy = walk.now()[:axes] + flight.generator.normal(0.0, noise.seen, flight.shape)
            seen[k][:, there] = noisy[:, there]
    return with_positions(tracks, seen)


def next_speed(
    speed: Array, persistence: float, mean_speed: float, noise: float, generator: np.random.Generator
) -> Array:
    """Own speeds (individual,) a period later, m/s: they return to the usual one, and wander.

    persistence : share of a difference from the usual speed that is left; noise : standard deviation of a period's
                  change
    """
    found: Array = mean_speed + persistence * (speed - mean_speed) + generator.normal(0.0, noise, len(speed))
    return np.maximum(found, 0.05 * mean_speed)


def stretch_last_step(walk: InnovationFilter, previous: Array, factor: Array) -> None:
    """Make the last step of each individual so many times as long, and its velocity as large.

    was : (component, individual), positions and velocities before the step
    """
    now, axes = walk.now(), walk.axes
    now[:axes] = previous[:axes] + factor * walk.tracks.nearest(now[:axes] - previous[:axes])
    now[axes:] *= factor


def noise_statistics(model: FitModel, u: Array, spans: Sequence[int]) -> Array:
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
        """Tracks of one flight of all spans."""
        found = []
        by_walk = dict(self.model.parts(self.spans))
        for t, walk in enumerate(self.model.filters):
            own = by_walk.get(walk, [])
            found.append(fly_tracks(walk, self.model.split(point), self.kept[t], noise, own, 7919 * seed + t))
        return found

    def model_on(self, tracks: list[SpanTracks]) -> FitModel:
        """The same model on other tracks."""
        twin = FitModel(self.model.law, tracks, self.model.scale)
        twin = twin.with_fixed(sorted(self.model.held))
        return twin.robust() if self.model.soft else twin

    def noise(self, point: Array, first_noise: FitNoise, fitted: Array) -> tuple[FitNoise, float]:
        """Noise with which the flights' statistics are those of the tracks, and the misfit.

        fitted : place at which statistics are taken, that of the fit to the tracks
        """
        from scipy.optimize import least_squares

        active = [0, 2] if not self.model.own_speed else [0, 1, 2]

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
    """Noise to begin with, of each kind that there may be.

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
