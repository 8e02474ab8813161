"""Checks of a fitted body: the lag by another way, commands that act late, gusts that all drones feel."""

import numpy as np

from airflock.estimate.identification.logs import FlightLogs

MIN_ROWS = 200  # fewest rows for an estimate


def instrumental_tau(logs: FlightLogs, tau: float, a_max: float) -> float:
    """Give tau (s) by another way: increments against the gap, with the gap to an earlier velocity as instrument.

    White noise of the row is not in the earlier velocity, so it does not bias the ratio of covariances. Rows at the
    limit are left out. Where commands run ahead of the vehicle (feed-forward) the two ways disagree.
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
    """Mean correlation of drones' unexplained accelerations: gusts that all feel, rather than noise of each one."""
    if logs.drones < 2:
        return 0.0
    h = np.diff(logs.time)
    gap = logs.command[:-1] - logs.velocity[:-1]
    size = np.maximum(np.linalg.norm(gap, axis=1), 1e-12)
    pull = np.minimum(size / value["tau"], value["a_max"])
    off = np.diff(logs.velocity, axis=0) / np.maximum(h, 1e-9)[:, None] - gap * (pull / size)[:, None]
    sound = ~logs.is_new[1:] & (h > 0.0)
    slot = np.floor(logs.time[1:] - logs.time.min()).astype(np.int64)  # means over 1 s
    table = np.full((logs.drones, int(slot.max()) + 1), np.nan)
    total, count = np.zeros_like(table), np.zeros_like(table)
    np.add.at(total, (logs.who[1:][sound], slot[sound]), off[sound, 0])
    np.add.at(count, (logs.who[1:][sound], slot[sound]), 1.0)
    table = np.where(count > 0, total / np.maximum(count, 1.0), np.nan)
    shared = np.isfinite(table).all(axis=0)
    if shared.sum() < 30:
        return 0.0
    alike = np.corrcoef(table[:, shared])
    return float((alike.sum() - logs.drones) / (logs.drones * (logs.drones - 1)))


def command_delay(logs: FlightLogs, value: dict[str, float]) -> float:
    """Delay of commands that explains the increments best, s, to a row: a body has none, so it is only told."""
    best, kept = np.inf, 0.0
    run = np.cumsum(logs.is_new)
    for late in range(0, 11):
        k = np.arange(late, len(logs.time) - 1)
        k = k[run[k - late] == run[k + 1]]
        gap = logs.command[k - late] - logs.velocity[k]
        size = np.maximum(np.linalg.norm(gap, axis=1), 1e-12)
        pull = np.minimum(size / value["tau"], value["a_max"])
        h = (logs.time[k + 1] - logs.time[k])[:, None]
        off = float(((logs.velocity[k + 1] - logs.velocity[k] - gap * (pull / size)[:, None] * h) ** 2).mean())
        if off < 0.98 * best:
            best, kept = off, late * logs.step
    return kept
