"""Fit the body and the sensor of a drone to its logs, by the likelihood of the models' own equations."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import t as student

from airflock.estimate.identification.vehicle_logs import FlightLogs
from airflock.parts.bodies import held


def second_derivative(loss: Callable[[Any], float], z: NDArray[np.float64], i: int, j: int, step: float) -> float:
    """Differentiate a loss by its numbers i and j at z (number,)."""
    one, other = step * np.eye(len(z))[[i, j]]
    differences = loss(z + one + other) - loss(z + one - other) - loss(z - one + other) + loss(z - one - other)
    return differences / (4.0 * step * step)


def hessian(loss: Callable[[Any], float], z: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Return all second derivatives of a loss at z, (row, column)."""
    n = len(z)
    return np.array([[second_derivative(loss, z, i, j, step) for j in range(n)] for i in range(n)])


# The body: tau, a_max, outer noise and the noise of the log, by the likelihood of a Kalman filter
# through the saturated lag. State: the velocity of one drone, with one variance for its axes.
# Between rows the command is constant; the mean follows `parts.bodies.held`, the variance that of
# an Ornstein-Uhlenbeck process below saturation and of a random walk above. Intervals come from the
# curvature of the likelihood and the scatter of its slope between stretches of flight (Huber's
# sandwich), so that they hold where the noise is not quite what the filter assumes.
# A dead time before it shifts the commands by rows, also by parts of one.
BODY_NAMES = ("tau", "a_max", "noise", "white")
LATE_ROWS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0)  # delays that are tried first, rows
LATEST = 2.0  # s; our choice: beyond it is no dead time of a vehicle, but a law of its own
NO_DELAY = 2.0  # rows; a delay that is surely shorter, and may be none, is none
ROWS = 25.0  # rows in one unit of the delay that is sought, so that its steps compare with those of logarithms
STARTS = ((0.7, 4.0, 0.1, 0.05), (0.25, 8.0, 0.3, 0.02))
LIMITED = (0.5, 0.7, 0.85, 0.95, 0.99)  # shares of rows below the limit, from which a limit is sought, and
SHORTER = (1.0, 0.92, 0.84, 0.7)  # shares of the first tau, which without a limit is too long
MOST_FRESH = 0.5  # share of rows that begin with a new command, up to which these are left out
BLOCK = 20.0  # s of one drone whose slopes are taken together
FREE = 1e4  # m/s^2: no limit
WITHIN, NEWTON = 1.92, 3  # half of the 95 % point of chi-squared with 1 degree of freedom; steps of each fit on the way
GAIN, SATURATED = 200.0, 100  # least 2 Δ log-likelihood and rows at the limit for an a_max
# The second estimator shares no noise with the first; where set-points run ahead of the vehicle
# they disagree. A jerk that is limited, as that of ArduCopter, parts them by 0.16: no reason to refuse.
JUMP = 0.5  # standard deviations of the commands: a smaller change from row to row is no step
DIFFER, DISAGREE = 0.15, 0.3  # of two estimates of tau: from which on the interval has both, and none is right
# Relative standard deviation of what the filter leaves out: commands come from the true velocity,
# so they know more of it than the filter does, also one row after they are given (`_counted_rows`).
# Measured on random fleets with 0.1 m/s of noise in the log (benchmarks/identify.py).
BEYOND = np.array([0.01, 0.01, 0.005, 0.005])


@dataclass
class BodyFit:
    """Fit of the body: values and 95 % intervals by name, those of `BODY_NAMES` and the delay of commands, s.

    refused : name → reason, for numbers that cannot be separated
    gain    : 2 Δ log-likelihood of a limited against an unlimited acceleration
    seen    : least limit that goes with the log, m/s²: of 95 % by its likelihood, and at most the
              largest demand
    """

    value: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    refused: dict[str, str]
    saturated_rows: int
    rows: int
    gain: float
    second_tau: float
    seen: float
    gust_correlation: float
    notes: list[str]


# Not least squares of increments: 0.1 m/s of noise is in the gap and in the increment, and tau is
# 18 to 59 % too short.
@cache
def _body_kernel() -> Any:
    """Compile the negative log-likelihood per block."""
    from numba import njit

    decay_rate, wander, gap_left = njit(held.decay_rate), njit(held.wander), njit(held.gap_left)

    @njit
    def kernel(time, m, c, new, counted, block, out, tau, a_max, noise, white, dt):  # type: ignore[no-untyped-def]
        out[:] = 0.0
        axes = m.shape[1]
        v, e = np.zeros(3), np.zeros(3)
        variance, r2 = 0.0, white * white
        rate, still = decay_rate(tau, dt), noise * wander(tau, dt)
        # One pass over all rows: predict to the next row, compare with the logged velocity,
        # correct; `new` begins again.
        for k in range(len(time)):
            if new[k]:
                for i in range(axes):
                    # Nothing is known before the first row of a stretch, so its measurement is the
                    # state.
                    v[i] = m[k, i]
                variance = r2
                continue
            h = time[k] - time[k - 1]
            size = 1e-12
            for i in range(axes):
                e[i] = c[k - 1, i] - v[i]
                size += e[i] * e[i]
            size = np.sqrt(size)
            left, limited = gap_left(size, h, tau, rate, a_max)
            keep = np.exp(-2.0 * rate * (h - limited))
            # across the gap a limited motion keeps errors as they are; along it both ends move
            # alike
            variance = keep * variance + 2.0 * noise * limited * keep + still * (1.0 - keep)
            total, loss = variance + r2, 0.0
            gain = variance / total
            for i in range(axes):
                predicted = c[k - 1, i] - e[i] * left / size
                off = m[k, i] - predicted
                loss += off * off
                v[i] = predicted + gain * off
            variance *= 1.0 - gain
            # Rows that do not count still move the filter, so the next row begins at the right
            # state.
            if counted[k]:
                out[block[k]] += 0.5 * axes * np.log(total) + 0.5 * loss / total
        return out.sum()

    return kernel


def fit_body(logs: FlightLogs, dt: float = 0.0, walk: float = 0.0) -> BodyFit:
    """Fit the body of `parts.bodies.motion` to logs with commands.

    dt   : motion step of the scenario that the numbers are for, s; 0 for continuous time
    walk : what the sensor's own error adds to the noise of logged velocities, m²/s³: damping times
           noise of `parts.sensors.langevin`; it is taken off the outer noise
    """
    flying = logs.flying()
    if len(flying.time) < MIN_ROWS:
        reason = (
            f"{len(flying.time)} rows with a velocity and a command are fewer than {MIN_ROWS}; "
            "map what the log calls the commanded velocity: --map cx:=COLUMN --map cy:=COLUMN"
        )
        return _nothing(reason)
    loss, blocks = _body_loss(flying, dt)
    z = _lowest(loss, np.linalg.norm(flying.command - flying.velocity, axis=1))
    later, later_spread, freedom = _fit_delay(flying, dt, z)
    late, error = ROWS * later[4], 1.96 * ROWS * later_spread[4]
    low_delay, high_delay = flying.step * max(late - error, 0.0), flying.step * max(late + error, 0.5)
    if late > _longest_delay(flying) - 0.5:  # it may be any longer one
        high_delay = math.inf
    # No delay is the rule in simulation: then the fit is one without it, and as sharp as that.
    late = 0.0 if late - error < 0.5 and late + error < NO_DELAY else max(late, 0.0)
    if late:
        flying = _delayed(flying, late)
        loss, blocks = _body_loss(flying, dt)
        z, spread = _refined(loss, later[:4]), later_spread[:4]
    else:
        spread, freedom = _body_errors(loss, z, blocks)
    gap = np.linalg.norm(flying.command - flying.velocity, axis=1)
    lowest = loss(z)
    value = dict(zip(BODY_NAMES, np.exp(z), strict=True))
    wide = float(student.ppf(0.975, max(freedom, 1)))
    interval = {
        n: (float(np.exp(c - wide * s)), float(np.exp(c + wide * s)))
        for n, c, s in zip(BODY_NAMES, z, spread, strict=True)
    }
    value["delay"], interval["delay"] = flying.step * late, (low_delay, high_delay)
    # The walk of the sensor's own error looks like outer noise in logged velocities, and its rate
    # is known.
    low, high = interval["noise"]
    value["noise"], interval["noise"] = value["noise"] - walk, (max(low - walk, 0.0), max(high - walk, 0.0))
    saturated = int((gap > value["a_max"] * value["tau"]).sum())
    # A limit that no row reaches cannot be fitted; then the largest demand of the log bounds it
    # from below.
    demand = float(np.quantile(gap, 0.999) / value["tau"])
    seen = _least_limit(loss, z, lowest, min(demand, value["a_max"]))
    free = _settled(lambda y: loss([y[0], np.log(FREE), y[1], y[2]]), z[[0, 2, 3]])
    found = BodyFit(
        value, interval, {}, saturated, len(flying.time), 2.0 * (free - lowest),
        instrumental_tau(flying, value["tau"], value["a_max"]), seen,
        gust_correlation(flying, value), [],
    )  # fmt: skip
    _judge(found, flying)
    return found


def _nothing(reason: str) -> BodyFit:
    nan = float("nan")
    names = (*BODY_NAMES, "delay")
    refused = dict.fromkeys(names, reason)
    return BodyFit(dict.fromkeys(names, nan), dict.fromkeys(names, (nan, nan)), refused, 0, 0, 0.0, nan, 0.0, 0.0, [])


def _body_loss(logs: FlightLogs, dt: float, lead: int = 0) -> tuple[Callable[..., float], int]:
    """Return the negative log-likelihood of the log parameters, and its number of blocks; a fifth number is the delay.

    lead : rows at the start of each stretch that do not count, since the commands before them are
           unknown
    """
    span = _blocks(logs)
    out = np.zeros(int(span.max()) + 1)
    rows, velocity = np.arange(len(logs.time)), np.ascontiguousarray(logs.velocity)
    counted = _counted_rows(logs) & (rows - _stretches(logs)[0] >= lead)
    kernel, longest = _body_kernel(), _longest_delay(logs)

    def loss(z: Any, blocks: Any = None) -> float:
        tau, a_max, noise, white = np.exp(z[:4])
        late = ROWS * z[4] if len(z) > 4 else 0.0
        if not dt < 0.9 * tau or max(z[:4]) > 12.0 or min(z[:4]) < -14.0 or abs(late) > longest:
            return 1e15
        # Delays below 0 are looked at, too, or an interval that begins at 0 would look sharp.
        acting = logs.command if late == 0.0 else _late_commands(logs, late)
        arrays = (logs.time, velocity, np.ascontiguousarray(acting), logs.is_new, counted, span)
        return float(kernel(*arrays, out if blocks is None else blocks, tau, a_max, noise, white, dt))

    return loss, len(out)


def _stretches(logs: FlightLogs) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first and the last row of the unbroken stretch that each row belongs to."""
    starts = np.flatnonzero(logs.is_new)
    number = np.cumsum(logs.is_new) - 1
    return starts[number], np.append(starts[1:], len(logs.time))[number] - 1


def _longest_delay(logs: FlightLogs) -> float:
    """Return the longest delay that is sought, rows: at least half of the rows know their command then."""
    return min(LATEST / logs.step, float(np.median(np.arange(len(logs.time)) - _stretches(logs)[0])))


def _late_commands(logs: FlightLogs, late: float) -> NDArray[np.float64]:
    """Return the commands (row, axis) that act from each row to the next if all act `late` rows later."""
    whole = math.floor(late)
    at, (first, last) = np.arange(len(logs.time)) - whole, _stretches(logs)
    # Within a step the command of one row gives way to that of the next: their mean acts.
    newer, older = (logs.command[np.clip(at - row, first, last)] for row in (0, 1))
    return (1.0 - (late - whole)) * newer + (late - whole) * older


def _delayed(logs: FlightLogs, late: float) -> FlightLogs:
    """Return logs whose commands act `late` rows later, without the rows whose command came before their stretch."""
    known = np.arange(len(logs.time)) - _stretches(logs)[0] >= math.ceil(late)
    return replace(logs, command=_late_commands(logs, late)).select_rows(known)


def _fit_delay(logs: FlightLogs, dt: float, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], Any, int]:
    """Return the log parameters with a fifth, the delay, their standard errors, and degrees of freedom.

    z : parameters without a delay, from which the others are sought
    """
    loss, _ = _body_loss(logs, dt)
    best, tried = (math.inf, z, 0.0), z
    for late in (row for row in LATE_ROWS if row <= _longest_delay(logs)):
        near = minimize(lambda y, at=late / ROWS: loss([*y, at]), tried, method="Nelder-Mead", options={"maxiter": 80})
        tried = near.x
        best = min(best, (float(near.fun), tried, late), key=lambda one: one[0])
    loss, blocks = _body_loss(logs, dt, lead=math.ceil(best[2]) + 2)
    start = np.append(best[1], best[2] / ROWS)
    return (y := _refined(loss, start)), *_body_errors(loss, y, blocks)


# Mean error of tau 0.81 -> 0.18 %, of the limit -1.46 -> -0.91 %; the filter itself still runs
# through these rows.
def _counted_rows(logs: FlightLogs) -> NDArray[np.bool_]:
    """Return True for rows whose increment counts: not for one that begins as a command arrives.

    That command was computed from the very velocity that the filter does not know, so that the gap
    to it is wrong by what the filter is wrong by. Where most rows have a command of their own, all
    count.
    """
    fresh = np.zeros(len(logs.time), bool)
    fresh[2:] = (logs.command[1:-1] != logs.command[:-2]).any(axis=1) & ~logs.is_new[1:-1]
    return ~fresh if fresh.mean() < MOST_FRESH else np.ones(len(fresh), bool)


def _blocks(logs: FlightLogs) -> NDArray[np.int64]:
    """Return the number of a stretch of BLOCK s of one drone, for every row."""
    part = np.floor((logs.time - logs.time.min()) / BLOCK).astype(np.int64)
    return np.unique(logs.who * (part.max() + 1) + part, return_inverse=True)[1].astype(np.int64)


# A limit that nobody reaches has no slope, and a longer lag hides it: four of 200 fleets were up to
# 10 % off.
def _lowest(loss: Callable[[Any], float], gap: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the log parameters of the highest mode of the likelihood.

    Where no row is at the limit, the limit has no slope: a descent that went there with too long a
    tau stays. So other limits are looked at, with shorter lags beside them.
    """
    first = [_descent(loss, np.log(s)) for s in STARTS]
    best = min(first, key=lambda found: float(found.fun))
    tau, _, noise, white = np.exp(best.x)
    limits = np.quantile(gap, LIMITED) / tau
    others = [np.log((k * tau, max(limit, 1e-3) / k, noise, white)) for limit in limits for k in SHORTER]
    best = min(best, _descent(loss, min(others, key=loss)), key=lambda found: float(found.fun))
    return _refined(loss, best.x)


def _least_limit(loss: Callable[[Any], float], z: NDArray[np.float64], lowest: float, top: float) -> float:
    """Return the least limit of acceleration whose likelihood, the others fitted, is within 95 % of the highest; at
    most `top`.
    """
    others, unit = [0, 2, 3], 0.01 * np.eye(len(z))[[0, 2, 3]]

    def fitted(limit: float) -> float:
        y = np.array([z[0], np.log(limit), z[2], z[3]])
        best = loss(y)
        # Newton steps along each of the others: the profile needs their best values only roughly.
        for _ in range(NEWTON):
            up, down = np.array([loss(y + u) for u in unit]), np.array([loss(y - u) for u in unit])
            y[others] -= np.clip(0.01 * 0.5 * (up - down) / np.maximum(up + down - 2.0 * loss(y), 1e-3), -0.1, 0.1)
            best = min(best, loss(y))
        return best

    low, high = top / 8.0, top
    # Bisection of logarithms: eight halvings of a factor of 8 leave 1 %.
    for _ in range(8):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if fitted(middle) < lowest + WITHIN else (middle, high)
    return high


def _refined(loss: Callable[[Any], float], start: Any) -> NDArray[np.float64]:
    options = {"maxiter": 600, "xatol": 2e-4, "fatol": 2e-2}
    return np.asarray(minimize(loss, start, method="Nelder-Mead", options=options).x, float)


def _descent(loss: Callable[[Any], float], start: Any) -> Any:
    return minimize(loss, start, method="Nelder-Mead", options={"maxiter": 120})


def _settled(loss: Callable[[Any], float], start: Any) -> float:
    return float(minimize(loss, start, method="Nelder-Mead", options={"maxiter": 150}).fun)


def _body_errors(loss: Any, z: NDArray[np.float64], blocks: int) -> tuple[NDArray[np.float64], int]:
    """Return standard errors of log parameters, and degrees of freedom, by a sandwich of curvature and slopes of
    blocks.
    """
    d, n = 0.01, len(z)
    unit = np.eye(n) * d
    curve = np.zeros((n, n))
    for i in range(n):
        for j in range(i, n):
            curve[i, j] = curve[j, i] = second_derivative(loss, z, i, j, d)
    slopes = np.zeros((n, blocks))
    for i in range(n):
        up, down = np.zeros(blocks), np.zeros(blocks)
        loss(z + unit[i], up)
        loss(z - unit[i], down)
        slopes[i] = (up - down) / (2.0 * d)
    # Slopes of all blocks sum to zero at the maximum; what remains of the mean is rounding of the
    # descent.
    slopes -= slopes.mean(axis=1, keepdims=True)
    inverse = np.linalg.pinv(curve)
    robust = inverse @ (slopes @ slopes.T) @ inverse * blocks / max(blocks - 1, 1)
    sampled = np.maximum(np.diag(robust), np.clip(np.diag(inverse), 0.0, None))
    sampled[:4] += BEYOND**2
    return np.minimum(np.sqrt(sampled), 3.0), blocks - 1


def _judge(found: BodyFit, logs: FlightLogs) -> None:
    """Refuse what the log cannot tell, with the reason."""
    tau, step = found.value["tau"], logs.step
    alone = np.isnan(found.second_tau)  # the second estimator says nothing
    relative = np.inf if alone else abs(np.log(max(found.second_tau, 1e-9) / tau))
    width = np.log(found.intervals["tau"][1] / found.intervals["tau"][0]) / 3.92
    low, high = found.intervals["delay"]
    if math.isinf(high):
        found.refused["delay"] = f"at least {low:.2g} s, longer than the log goes on without a gap: log every row"
    elif high - low > 0.5 * tau or (low == 0.0 and high >= NO_DELAY * step):
        found.refused["delay"] = f"{low:.2g} to {high:.2g} s: the commands change too little; fly velocity steps"
    if math.isinf(high):
        found.refused["tau"] = "depends on delay, which is not identifiable here"
    elif tau < 2.0 * step and largest_jump(logs) < JUMP:
        found.refused["tau"] = (
            "the set-points have no steps, and the vehicle runs with them or ahead of them (feed-forward), so its lag "
            "does not show: fly velocity steps without feed-forward"
        )
    elif tau < 2.0 * step:
        found.refused["tau"] = f"below about two steps of the log ({2.0 * step:.3g} s): log faster"
    elif relative > max(DISAGREE, 3.0 * width):
        other = "nothing" if alone else f"{found.second_tau:.2g} s"
        found.refused["tau"] = (
            f"two estimators disagree ({tau:.2g} s and {other}): set-points that the vehicle runs ahead of, "
            "or smoothed velocities; fly velocity steps, log the raw estimate"
        )
    elif relative > DIFFER:
        low, high = found.intervals["tau"]
        found.intervals["tau"] = min(low, found.second_tau), max(high, found.second_tau)
    elif width > 0.5:
        found.refused["tau"] = "the flight hardly excites it: fly velocity steps"
    if "tau" in found.refused:
        for name in ("delay", "a_max", "noise"):
            found.refused.setdefault(name, "depends on tau, which is not identifiable here")
        return
    if found.gain < GAIN or found.saturated_rows < SATURATED:
        found.refused["a_max"] = (
            f"at least {found.seen:.2g} m/s^2: {found.saturated_rows} rows at the limit (needs {SATURATED}), gain of "
            f"likelihood {found.gain:.0f} (needs {GAIN:.0f}); fly larger steps of velocity"
        )
    if not found.value["noise"] > 0.0:
        found.refused["noise"] = "no larger than the walk of the sensor's own error"
    if found.gust_correlation > 0.2:
        found.notes.append(
            f"unexplained accelerations of the drones correlate ({found.gust_correlation:.2f}): gusts that all feel"
        )


MIN_ROWS = 200  # fewest rows for an estimate


def largest_jump(logs: FlightLogs) -> float:
    """Return the largest changes of a command from row to row (99.9 %), in standard deviations of all commands."""
    jumps = np.linalg.norm(np.diff(logs.command, axis=0)[~logs.is_new[1:]], axis=1)
    spread = float(np.sqrt(logs.command.var(axis=0).sum()))
    return float(np.quantile(jumps, 0.999)) / spread if len(jumps) and spread > 0.0 else 0.0


def instrumental_tau(logs: FlightLogs, tau: float, a_max: float) -> float:
    """Give tau (s) by another way: increments against the gap, with the gap to an earlier velocity as instrument.

    White noise of the row is not in the earlier velocity, so it does not bias the ratio of
    covariances. Rows at the limit are left out. Where commands run ahead of the vehicle
    (feed-forward) the two ways disagree.
    """
    lag = 3
    gap = logs.command - logs.velocity
    run = np.cumsum(logs.is_new)
    k = np.arange(lag, len(logs.time) - 1)
    sound = run[k - lag] == run[k + 1]
    earlier = logs.command[lag:-1] - logs.velocity[: -lag - 1]  # to the velocity of `lag` rows before
    calm = sound & (np.linalg.norm(earlier, axis=1) < 0.7 * a_max * tau)
    k, earlier = k[calm], earlier[calm]
    if len(k) < MIN_ROWS:
        return float("nan")
    h = logs.time[k + 1] - logs.time[k]
    moved = logs.velocity[k + 1] - logs.velocity[k]
    instrument = earlier - earlier.mean(axis=0)
    share = float((moved * instrument).sum() / (gap[k] * instrument).sum())
    if not 0.0 < share < 1.0:
        return float("nan")
    return float(-np.median(h) / np.log1p(-share))


def gust_correlation(logs: FlightLogs, value: dict[str, float]) -> float:
    """Return the mean correlation of drones' unexplained accelerations: gusts are common to all, noise is not."""
    if logs.drones < 2:
        return 0.0
    h = np.diff(logs.time)
    gap = logs.command[:-1] - logs.velocity[:-1]
    size = np.maximum(np.linalg.norm(gap, axis=1), 1e-12)
    pull = np.minimum(size / value["tau"], value["a_max"])
    off = np.diff(logs.velocity, axis=0) / np.maximum(h, 1e-9)[:, None] - gap * (pull / size)[:, None]
    sound = ~logs.is_new[1:] & (h > 0.0)
    # Means over 1 s suppress the noise of single rows, which would hide a common gust.
    slot = np.floor(logs.time[1:] - logs.time.min()).astype(np.int64)  # means over 1 s
    table = np.full((logs.drones, int(slot.max()) + 1), np.nan)
    total, count = np.zeros_like(table), np.zeros_like(table)
    np.add.at(total, (logs.who[1:][sound], slot[sound]), off[sound, 0])
    np.add.at(count, (logs.who[1:][sound], slot[sound]), 1.0)
    table = np.where(count > 0, total / np.maximum(count, 1.0), np.nan)
    shared = np.isfinite(table).all(axis=0)
    if shared.sum() < 30:
        return 0.0
    correlation = np.corrcoef(table[:, shared])
    return float((correlation.sum() - logs.drones) / (logs.drones * (logs.drones - 1)))


# The sensor: errors of satellite navigation of drones that stand. `parts.sensors.langevin.error` in
# steps of the sensor's period is a linear system of two states, position error q and velocity error
# u. The unknown place of a drone is a third state; logged velocities may have white noise.
SENSOR_NAMES = ("noise", "damping", "scale", "white")
LEAST = 30.0  # s of standing
# As a variance that grew with the noise it made small noise look likelier: intervals contained the
# truth in 169 of 200 fleets, now in 185.
ANYWHERE = 1e4  # m²; variance of where a drone stands: must not depend on what is sought, or it is sought too small
START = (0.1, 3.0)  # damping, 1/s, and scale, m s^(1/2), to begin with
RESTARTS = 2  # a simplex that has shrunk on a slope is spread again


@dataclass
class SensorFit:
    """Fit of the sensor: values and 95 % intervals by name, m²/s², 1/s, m, m/s; reasons for refused numbers."""

    value: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    refused: dict[str, str]
    seconds: float


@cache
def _sensor_kernel() -> Any:
    from numba import njit

    @njit
    def kernel(q, u, new, h, noise, damping, scale, white, grain):  # type: ignore[no-untyped-def]
        """Negative log-likelihood of all series; state: position error, velocity error, place (0, 1, 2)."""
        spring = np.sqrt(2.0 * damping * noise) / scale
        # langevin: u' = u - spring h q - damping h u + push, q' = q + h u'; the place stays
        a10, a11 = -spring * h, 1.0 - damping * h
        a00, a01 = 1.0 + h * a10, h * a11
        push = 2.0 * damping * h * noise
        # stationary variances (sensors.langevin): of u the noise, of q scale sqrt(noise / (2
        # damping))
        still = scale * np.sqrt(noise / (2.0 * damping))
        rq, ru, total = grain * grain, white * white + 1e-12, 0.0
        x0, x1, x2 = 0.0, 0.0, 0.0
        p00, p01, p02, p11, p12, p22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        # A Kalman filter written out for three states: symmetric covariances need six numbers, and
        # no matrix is allocated.
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
            # Two scalar updates, of position then of velocity, equal one update by both, since
            # their noises are independent.
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
    nothing = dict.fromkeys(SENSOR_NAMES, nan)
    seconds = float(len(ground.time) * logs.step) if len(ground.time) > 2 else 0.0
    empty = SensorFit(nothing, dict.fromkeys(SENSOR_NAMES, (nan, nan)), {}, seconds)
    if not period > 0.0:
        empty.refused = dict.fromkeys(SENSOR_NAMES, "sensors.period is 0")
        return empty
    series = _series(ground, period)
    shared = sum(len(part[0]) for part in series) * period / 2.0
    if not series or shared < LEAST:
        empty.refused = dict.fromkeys(
            SENSOR_NAMES,
            f"{shared:.0f} s on the ground are fewer than {LEAST:.0f} s: stand still for two minutes, logging",
        )
        return empty
    q, u = (np.concatenate([part[c] for part in series]) for c in (0, 1))
    new = np.concatenate([np.arange(len(part[0])) == 0 for part in series])
    steps = np.abs(np.diff(q))
    # Logged positions are rounded: 0.3 of a step is about the standard deviation of rounding, 1 /
    # sqrt(12).
    grain = 0.3 * float(np.min(steps[steps > 1e-9], initial=1.0))
    kernel = _sensor_kernel()

    def loss(z: Any) -> float:
        if max(z) > 8.0 or min(z) < -16.0 or np.exp(z[1]) * period > 0.9:
            return 1e15
        return float(kernel(q, u, new, period, *np.exp(z), max(min(grain, 0.05), 1e-4)))

    half = max(0.5 * float(u.var()), 1e-5)  # of the velocity's variance: wandering, the rest white
    z = np.log((half, *START, math.sqrt(half)))
    for _ in range(1 + RESTARTS):
        z = minimize(loss, z, method="Nelder-Mead", options={"maxiter": 800, "xatol": 1e-3, "fatol": 1e-2}).x
    spread = _sensor_errors(loss, z)
    value = dict(zip(SENSOR_NAMES, (float(v) for v in np.exp(z)), strict=True))
    interval = {
        n: (float(np.exp(c - 1.96 * s)), float(np.exp(c + 1.96 * s)))
        for n, c, s in zip(SENSOR_NAMES, z, spread, strict=True)
    }
    refused = {
        name: f"only known to a factor of {np.exp(1.96 * s):.1f} from {shared:.0f} s of standing: stand longer"
        for name, s in zip(SENSOR_NAMES[:3], spread, strict=False)
        if s > 0.5 or not np.isfinite(s)
    }
    return SensorFit(value, interval, refused, shared)


def _series(ground: FlightLogs, period: float) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return stretches of one drone and axis, one row per period: positions and velocities."""
    found = []
    edges = [*np.flatnonzero(ground.is_new), len(ground.time)]
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        own = ground.time[begin:end] - ground.time[begin]
        wanted = np.arange(0.0, own[-1] + 1e-9, period) if len(own) > 1 else np.empty(0)
        rows = begin + np.clip(np.searchsorted(own, wanted - 1e-3 * period), 0, max(len(own) - 1, 0))
        if len(rows) >= 25:
            found += [(ground.position[rows, axis], ground.velocity[rows, axis]) for axis in (0, 1)]
    return found


def _sensor_errors(loss: Any, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return standard errors of log parameters, by the curvature of the likelihood."""
    return np.asarray(np.sqrt(np.clip(np.diag(np.linalg.pinv(hessian(loss, z, 0.03))), 0.0, None)))
