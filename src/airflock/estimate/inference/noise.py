"""How much noise a law has of its own: flights with more and with less of it, against the tracks.

Small noise hardly shows beside that of the tracks, and one flight differs from the next by more than a little of it
does. So the law is flown with noise over a wide range, and what noise shows in is told by curves through all these
flights. How flights scatter about the curves says how sure the number is (a synthetic likelihood: Wood 2010).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.flights import FitNoise, FittedFlights, noise_statistics

Array = NDArray[np.float64]
FLOWN = 40  # flights of each look
RANGE = 1.6  # of the logarithm of noise, to each side, at the first look
NARROW = 0.15  # at the second, at least
BESIDE = 1.25  # of the interval: range of the second look
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
    """The likeliest noise, and the ends of an interval for each level; None where the tracks set no limit.

    place, scatter : numbers of the law, as places, and their standard errors; fitted: where statistics are taken
    levels         : shares of Student's distribution below an upper end, such as 0.975
    """
    generator = np.random.default_rng(seed)
    centre, half, widest = 0.0, RANGE, int(np.argmax(levels))
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
    steps, intervals = _look(flights, point, scatter, noise, fitted, levels, centre, half, generator)
    ends: list[IntervalEnds] = []
    for (low, high), (before, after) in zip(intervals, first, strict=True):
        below = centre - half if low is None and before is not None else low
        above = centre + half if high is None and after is not None else high
        ends.append(
            (None if below is None else noise.law * float(np.exp(below)),
             None if above is None else noise.law * float(np.exp(above)))
        )  # fmt: skip
    return noise.shifted(steps), ends


def _look(
    flights: FittedFlights, place: Array, scatter: Array, noise: FitNoise, fitted: Array, levels: Sequence[float],
    centre: float, half: float, generator: np.random.Generator,
) -> tuple[Array, list[IntervalEnds]]:  # fmt: skip
    """Logarithms by which noises are the likeliest, and ends of that of the law, by flights over a range."""
    from scipy.stats import t as student

    named = flights.model.named
    speeds = flights.model.own_speed
    design, rows = [], []
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
