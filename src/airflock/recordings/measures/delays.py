"""Leadership: the delay at which one heading resembles an earlier one of another individual (Nagy et al. 2010)."""

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.measures.states import check_numbers, headings, track_arrays
from airflock.support import ParameterError

# Of equal delays the shortest counts. Two that fly straight had "led" by the longest delay, through
# rounding.
ROUNDING = 1e-6  # correlations nearer than this are the same: headings of recordings have single precision


def delay_correlation(recording: xr.Dataset, longest: float = 2.0, slowest: float = 0.0) -> xr.DataArray:
    """Compute the mean of heading i at t times heading j at t + delay, (leader, follower, delay), -1 to 1.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    longest   : largest delay, s; slowest: headings at this speed (m/s) or less do not count
    nan where two are never there together. Nagy, Ákos, Biro & Vicsek, Nature 464, 890 (2010).

    Raises RecordingError for what is no recording of one keypoint, and ParameterError for a
    `longest` below 0.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> angle = 0.3 * np.arange(60) * 0.1
    >>> turns = np.stack([np.cumsum(np.cos(angle)), np.cumsum(np.sin(angle))], axis=1)
    >>> pair = airflock.load_tracks(np.stack([turns[5:], turns[:-5]], axis=1), unit="m", fps=10.0)
    >>> table = airflock.measures.delays.delay_correlation(pair, longest=1.0)
    >>> round(float(table.isel(leader=0, follower=1).sel(delay=0.5, method="nearest")), 3)
    1.0
    """
    check_numbers(longest=longest, slowest=slowest)
    if not 0.0 <= longest < float("inf"):
        raise ParameterError(f"longest = {longest:g} s must be 0 or more")
    found = track_arrays(recording)
    h = headings(found.velocity, slowest)
    shifts = np.arange(-round(longest / found.period), round(longest / found.period) + 1)
    shifts = shifts[np.abs(shifts) < len(h)]
    n = h.shape[2]
    table = np.full((n, n, len(shifts)), np.nan)
    # One shift at a time, all pairs by a matrix product: all shifts at once would need their number
    # times the memory.
    for k, shift in enumerate(shifts):
        first, later = (h[: len(h) - shift], h[shift:]) if shift >= 0 else (h[-shift:], h[:shift])
        there = np.isfinite(first).all(axis=1).astype(float), np.isfinite(later).all(axis=1).astype(float)
        both = there[0].T @ there[1]
        summed = np.einsum("tci,tcj->ij", np.nan_to_num(first), np.nan_to_num(later))
        table[:, :, k] = np.where(both > 0, summed / np.maximum(both, 1.0), np.nan)
    late = ("delay", shifts * found.period, {"units": "s"})
    coordinates = {"leader": found.names, "follower": found.names, "delay": late}
    return xr.DataArray(table, coordinates, ("leader", "follower", "delay"), attrs={"units": "1"})


def leadership(recording: xr.Dataset, longest: float = 2.0, least: float = 0.5, slowest: float = 0.0) -> pd.DataFrame:
    """Find who leads, a row for each ordered pair: leader, follower, and the delay (s) of the largest correlation (-1
    to 1).

    A positive delay says that the leader is first; each pair stands there twice, with both signs.
    Where several delays are as good, such as of two that fly straight, it is the shortest of them.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    longest   : largest delay that is tried, s
    least     : correlation below which a pair is left out, -1 to 1
    slowest   : headings at this speed (m/s) or less do not count
    Nagy, Ákos, Biro & Vicsek, Nature 464, 890 (2010).

    Raises RecordingError and ParameterError as `delay_correlation` does.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> angle = 0.3 * np.arange(60) * 0.1
    >>> turns = np.stack([np.cumsum(np.cos(angle)), np.cumsum(np.sin(angle))], axis=1)
    >>> pair = airflock.load_tracks(np.stack([turns[5:], turns[:-5]], axis=1), unit="m", fps=10.0)
    >>> first = airflock.measures.delays.leadership(pair, longest=1.0).query("delay > 0").iloc[0]
    >>> round(float(first["delay"]), 3)  # the second one does half a second later what the first one does
    0.5
    """
    check_numbers(longest=longest, least=least, slowest=slowest)
    table = delay_correlation(recording, longest, slowest)
    shifts, n = table["delay"].values, table.sizes["leader"]
    best: dict[tuple[int, int], tuple[float, float]] = {}
    for i in range(n):
        for j in range(i + 1, n):
            course = table.values[i, j]
            if not np.isfinite(course).any():
                continue
            # Correlations within rounding are equal; among these the shortest delay is the simplest
            # explanation.
            top = np.flatnonzero(course >= np.nanmax(course) - ROUNDING)
            k = int(top[np.abs(shifts[top]).argmin()])
            if course[k] >= least:
                best[i, j] = float(shifts[k]), float(course[k])
                best[j, i] = 0.0 - float(shifts[k]), float(course[k])
    names = table["leader"].values
    rows = [(names[i], names[j], *best[i, j]) for i, j in sorted(best)]
    pairs = pd.DataFrame(rows, columns=["leader", "follower", "delay", "correlation"])
    pairs.attrs["units"] = {"delay": "s", "correlation": "1"}
    return pairs
