"""The posterior check: flocks of the fitted law, flown freely from where the tracks begin, against the tracks."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.flights import FitNoise, NoisyFlight
from airflock.estimate.inference.likelihood import FitModel
from airflock.estimate.inference.tracks import ABSENT

Array = NDArray[np.float64]
LONGEST = 60.0  # s that are flown
MARGIN = 0.01  # share of a value that nobody calls a difference
MEANINGS = {
    "polarisation": "1", "milling": "1", "speed": "m/s", "nearest": "m", "radius": "m",
}  # fmt: skip


@dataclass(frozen=True)
class PredictiveCheck:
    """By measure: the tracks' mean and the 2.5 and 97.5 % ends of the flights, 1 % of the mean wider."""

    found: dict[str, tuple[float, float, float]]

    def outside(self) -> list[str]:
        """Measures that the flights do not reach."""
        return [name for name, (own, low, high) in self.found.items() if not low <= own <= high]


def flock_measures(motion: Array, is_present: NDArray[np.bool_], nearest: Callable[[Array], Array]) -> dict[str, float]:
    """Means over time of polarisation, milling, speed (m/s), nearest distance and radius of the group (m).

    motion : (frame, component, individual); there : (frame, individual); nearest : offsets to the nearest image
    """
    rows = []
    for frame, present in zip(motion, is_present, strict=True):
        if present.sum() < 2:
            continue
        axes = len(frame) // 2
        x, v = frame[:axes, present], frame[axes:, present]
        speed = np.linalg.norm(v, axis=0)
        h = v / np.maximum(speed, 1e-12)
        out = nearest(x - x[:, :1])
        out = out - out.mean(axis=1, keepdims=True)
        radius = np.linalg.norm(out, axis=0)
        arm = out / np.maximum(radius, 1e-12)
        turning = np.cross(arm.T, h.T) if axes == 3 else arm[0] * h[1] - arm[1] * h[0]
        offsets = nearest((x[:, :, None] - x[:, None, :]).reshape(axes, -1)).reshape(axes, x.shape[1], -1)
        apart = np.linalg.norm(offsets, axis=0)
        np.fill_diagonal(apart, np.inf)
        rows.append(
            (
                np.linalg.norm(h.mean(axis=1)), np.linalg.norm(np.atleast_1d(turning.mean(axis=0))), speed.mean(),
                apart.min(axis=0).mean(), radius.mean(),
            )
        )  # fmt: skip
    return dict(zip(MEANINGS, np.mean(rows, axis=0).tolist(), strict=True)) if rows else {}


def run_predictive_check(
    model: FitModel, point: Array, noise: FitNoise, flights: int, on_progress: Callable[[], None]
) -> PredictiveCheck:
    """Fly the law freely from the first frame at which the first tracks hold most individuals, and compare."""
    walk = model.filters[0]
    tracks, axes = walk.tracks, walk.axes
    kept = np.zeros((len(walk.seen), 2 * axes, tracks.individual_count))
    numbers, gains, usual = model.split(point)
    walk.errors(numbers, gains, usual, None, kept)
    there = tracks.state > ABSENT
    begin = int(np.argmax(there.sum(axis=1) >= 0.9 * there.sum(axis=1).max()))
    frames = min(len(kept) - begin, round(LONGEST / tracks.period))
    stride = max(1, round(0.5 / tracks.period))
    own = flock_measures(kept[begin : begin + frames : stride], there[begin : begin + frames : stride], tracks.nearest)
    rows = []
    for number in range(flights):
        flight = NoisyFlight(walk, (numbers, gains, usual), noise, 1_000_000 + number)
        flight.begin(1_000_000 + number)
        walk.fill_past_states(kept[begin])
        speed: Array | None = np.linalg.norm(kept[begin, axes:], axis=0)
        flown = np.zeros((-(-frames // stride), 2 * axes, tracks.individual_count))
        for k in range(frames):
            if k % stride == 0:
                flown[k // stride] = walk.now()
            speed = flight.step(speed)
        rows.append(flock_measures(flown, np.broadcast_to(there[begin], (len(flown), flown.shape[2])), tracks.nearest))
        on_progress()
    found = {}
    for name, value in own.items():
        drawn = np.array([row[name] for row in rows])
        margin = MARGIN * abs(value)
        found[name] = (value, float(np.quantile(drawn, 0.025)) - margin, float(np.quantile(drawn, 0.975)) + margin)
    return PredictiveCheck(found)
