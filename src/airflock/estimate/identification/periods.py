"""Decision period and largest commanded speed, from the commands alone."""

import numpy as np

from airflock.estimate.identification.logs import FlightLogs

FEW = 30  # fewest changes of a command for an estimate of the period
PLATEAU = 0.01  # share of rows within half a per cent of the largest command that make a limit


def decision_period(logs: FlightLogs) -> tuple[float, tuple[float, float], str]:
    """Give sensors.period from the times at which commands change, its interval, and a reason to refuse it, s."""
    flying = logs.flying()
    nan = float("nan")
    if len(flying.time) < 2:
        return nan, (nan, nan), "no commands"
    changed = np.abs(np.diff(flying.command, axis=0)).max(axis=1) > 1e-9
    sound = ~flying.is_new[1:]
    share = float(changed[sound].mean()) if sound.any() else 0.0
    at = np.flatnonzero(changed & sound) + 1
    run = np.cumsum(flying.is_new)
    between = np.diff(flying.time[at])[np.diff(run[at]) == 0]
    if len(between) < FEW:
        return nan, (nan, nan), f"commands change {len(at)} times: fewer than {FEW}"
    if share > 0.9:
        return (
            nan,
            (nan, nan),
            f"commands change in every row: the log ({flying.step:.3g} s) is no faster than decisions",
        )
    usual = float(np.median(between))
    between = between[(between > 0.5 * usual) & (between < 4.5 * usual)]
    times = np.maximum(np.round(between / usual), 1.0)
    period = float((between * times).sum() / (times * times).sum())
    error = float(np.std(between - times * period) / np.sqrt(len(between)))
    return period, (period - 1.96 * error, period + 1.96 * error), ""


def largest_command(logs: FlightLogs, v_flock: float | None = None) -> tuple[float, str]:
    """Give model.v_max as a plateau of commanded speeds, m/s, and a reason to refuse it.

    v_flock : preferred speed of the law, m/s, at which commands have a plateau as well
    """
    speed = np.linalg.norm(logs.flying().command, axis=1)
    if not len(speed):
        return float("nan"), "no commands"
    most = float(speed.max())
    share = float((speed > 0.995 * most).mean())
    if share < PLATEAU:
        return (
            most,
            f"at least {most:.3g} m/s: only {share:.2%} of the commands are within half a per cent of the largest",
        )
    if v_flock is not None and abs(most / v_flock - 1.0) < 0.03:
        return most, f"at least {most:.3g} m/s: the plateau is that of the preferred speed, the limit was never met"
    return most, ""
