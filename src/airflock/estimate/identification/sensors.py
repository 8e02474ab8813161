"""Error of satellite navigation from drones that stand: likelihood of the model's own error process.

`parts.sensors.langevin.error` in steps of the sensor's period is a linear system of two states, position error q and
velocity error u. The place where a drone stands is unknown and is a third state; logged velocities may have white
noise.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from airflock.estimate.identification.derivatives import hessian
from airflock.estimate.identification.logs import FlightLogs

NAMES = ("noise", "damping", "scale", "white")
LEAST = 30.0  # s of standing
ANYWHERE = 1e4  # m²; variance of where a drone stands: must not depend on what is sought, or it is sought too small
START = (0.1, 3.0)  # damping, 1/s, and scale, m s^(1/2), to begin with
RESTARTS = 2  # a simplex that has shrunk on a slope is spread again


@dataclass
class SensorFit:
    """Values and 95 % intervals by name, m²/s², 1/s, m, m/s; reasons for what is refused."""

    value: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    refused: dict[str, str]
    seconds: float


@cache
def _kernel() -> Any:
    from numba import njit

    @njit
    def kernel(q, u, new, h, noise, damping, scale, white, grain):  # type: ignore[no-untyped-def]
        """Negative log-likelihood of all series; state: position error, velocity error, place (0, 1, 2)."""
        spring = np.sqrt(2.0 * damping * noise) / scale
        # langevin: u' = u - spring h q - damping h u + push, q' = q + h u'; the place stays
        a10, a11 = -spring * h, 1.0 - damping * h
        a00, a01 = 1.0 + h * a10, h * a11
        push = 2.0 * damping * h * noise
        # stationary variances (sensors.langevin): of u the noise, of q scale sqrt(noise / (2 damping))
        still = scale * np.sqrt(noise / (2.0 * damping))
        rq, ru, total = grain * grain, white * white + 1e-12, 0.0
        x0, x1, x2 = 0.0, 0.0, 0.0
        p00, p01, p02, p11, p12, p22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(len(q)):
            if new[k]:
                x0, x1, x2 = 0.0, 0.0, q[k]
                p00, p01, p02, p11, p12, p22 = still, 0.0, 0.0, noise, 0.0, ANYWHERE
            else:
                x0, x1 = a00 * x0 + a01 * x1, a10 * x0 + a11 * x1
                b00, b01 = a00 * p00 + a01 * p01, a00 * p01 + a01 * p11
                b10, b11 = a10 * p00 + a11 * p01, a10 * p01 + a11 * p11
                p02, p12 = a00 * p02 + a01 * p12, a10 * p02 + a11 * p12
                p00 = b00 * a00 + b01 * a01 + h * h * push
                p01 = b00 * a10 + b01 * a11 + h * push
                p11 = b10 * a10 + b11 * a11 + push
            off = q[k] - x0 - x2  # the logged position: place and error
            c0, c1, c2 = p00 + p02, p01 + p12, p02 + p22
            variance = c0 + c2 + rq
            total += 0.5 * np.log(variance) + 0.5 * off * off / variance
            x0, x1, x2 = x0 + c0 * off / variance, x1 + c1 * off / variance, x2 + c2 * off / variance
            p00, p01, p02 = p00 - c0 * c0 / variance, p01 - c0 * c1 / variance, p02 - c0 * c2 / variance
            p11, p12, p22 = p11 - c1 * c1 / variance, p12 - c1 * c2 / variance, p22 - c2 * c2 / variance
            off, variance = u[k] - x1, p11 + ru  # the logged velocity
            total += 0.5 * np.log(variance) + 0.5 * off * off / variance
            c0, c1, c2 = p01, p11, p12
            x0, x1, x2 = x0 + c0 * off / variance, x1 + c1 * off / variance, x2 + c2 * off / variance
            p00, p01, p02 = p00 - c0 * c0 / variance, p01 - c0 * c1 / variance, p02 - c0 * c2 / variance
            p11, p12, p22 = p11 - c1 * c1 / variance, p12 - c1 * c2 / variance, p22 - c2 * c2 / variance
        return total

    return kernel


def fit_sensors(logs: FlightLogs, period: float) -> SensorFit:
    """Fit the error of `parts.sensors.langevin` to the rows on the ground; `period` (s) is that of the sensor."""
    ground = logs.grounded_rows()
    nan = float("nan")
    nothing = dict.fromkeys(NAMES, nan)
    seconds = float(len(ground.time) * logs.step) if len(ground.time) > 2 else 0.0
    empty = SensorFit(nothing, dict.fromkeys(NAMES, (nan, nan)), {}, seconds)
    if not period > 0.0:
        empty.refused = dict.fromkeys(NAMES, "sensors.period is 0")
        return empty
    series = _series(ground, period)
    shared = sum(len(part[0]) for part in series) * period / 2.0
    if not series or shared < LEAST:
        empty.refused = dict.fromkeys(
            NAMES, f"{shared:.0f} s on the ground are fewer than {LEAST:.0f} s: stand still for two minutes, logging"
        )
        return empty
    q, u = (np.concatenate([part[c] for part in series]) for c in (0, 1))
    new = np.concatenate([np.arange(len(part[0])) == 0 for part in series])
    steps = np.abs(np.diff(q))
    grain = 0.3 * float(np.min(steps[steps > 1e-9], initial=1.0))
    kernel = _kernel()

    def loss(z: Any) -> float:
        if max(z) > 8.0 or min(z) < -16.0 or np.exp(z[1]) * period > 0.9:
            return 1e15
        return float(kernel(q, u, new, period, *np.exp(z), max(min(grain, 0.05), 1e-4)))

    half = max(0.5 * float(u.var()), 1e-5)  # of the velocity's variance: wandering, the rest white
    z = np.log((half, *START, math.sqrt(half)))
    for _ in range(1 + RESTARTS):
        z = minimize(loss, z, method="Nelder-Mead", options={"maxiter": 800, "xatol": 1e-3, "fatol": 1e-2}).x
    spread = _spread(loss, z)
    value = dict(zip(NAMES, (float(v) for v in np.exp(z)), strict=True))
    interval = {
        n: (float(np.exp(c - 1.96 * s)), float(np.exp(c + 1.96 * s))) for n, c, s in zip(NAMES, z, spread, strict=True)
    }
    refused = {
        name: f"only known to a factor of {np.exp(1.96 * s):.1f} from {shared:.0f} s of standing: stand longer"
        for name, s in zip(NAMES[:3], spread, strict=False)
        if s > 0.5 or not np.isfinite(s)
    }
    return SensorFit(value, interval, refused, shared)


def _series(ground: FlightLogs, period: float) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Stretches of one drone and axis, one row per period: positions and velocities."""
    found = []
    edges = [*np.flatnonzero(ground.is_new), len(ground.time)]
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        own = ground.time[begin:end] - ground.time[begin]
        wanted = np.arange(0.0, own[-1] + 1e-9, period) if len(own) > 1 else np.empty(0)
        rows = begin + np.clip(np.searchsorted(own, wanted - 1e-3 * period), 0, max(len(own) - 1, 0))
        if len(rows) >= 25:
            found += [(ground.position[rows, axis], ground.velocity[rows, axis]) for axis in (0, 1)]
    return found


def _spread(loss: Any, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard errors of log parameters, by the curvature of the likelihood."""
    return np.asarray(np.sqrt(np.clip(np.diag(np.linalg.pinv(hessian(loss, z, 0.03))), 0.0, None)))
