"""Who leads: the delay at which one's direction is most like another's before (Nagy et al. 2010)."""

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.measures.states import headings, states


def delay_correlation(recording: xr.Dataset, longest: float = 2.0, slowest: float = 0.0) -> xr.DataArray:
    """Mean of heading i at t times heading j at t + delay, (leader, follower, delay), -1 to 1.

    longest : largest delay, s; slowest: headings at this speed (m/s) or less do not count
    nan where two are never there together. Nagy, Ákos, Biro & Vicsek, Nature 464, 890 (2010).
    """
    found = states(recording)
    h = headings(found.velocity, slowest)
    shifts = np.arange(-round(longest / found.period), round(longest / found.period) + 1)
    shifts = shifts[np.abs(shifts) < len(h)]
    n = h.shape[2]
    table = np.full((n, n, len(shifts)), np.nan)
    for k, shift in enumerate(shifts):
        first, later = (h[: len(h) - shift], h[shift:]) if shift >= 0 else (h[-shift:], h[:shift])
        there = np.isfinite(first).all(axis=1).astype(float), np.isfinite(later).all(axis=1).astype(float)
        both = there[0].T @ there[1]
        summed = np.einsum("tci,tcj->ij", np.nan_to_num(first), np.nan_to_num(later))
        table[:, :, k] = np.where(both > 0, summed / np.maximum(both, 1.0), np.nan)
    coordinates = {"leader": found.names, "follower": found.names, "delay": shifts * found.period}
    return xr.DataArray(table, coordinates, ("leader", "follower", "delay"), attrs={"units": "1"})


def leadership(recording: xr.Dataset, longest: float = 2.0, least: float = 0.5, slowest: float = 0.0) -> pd.DataFrame:
    """One row for each ordered pair: leader, follower, delay (s) and correlation (-1 to 1) where that is largest.

    A positive delay says that the leader is first; each pair stands there twice, with both signs.

    longest : largest delay that is tried, s
    least   : correlation below which a pair is left out
    slowest : headings at this speed (m/s) or less do not count
    Nagy, Ákos, Biro & Vicsek, Nature 464, 890 (2010).
    """
    table = delay_correlation(recording, longest, slowest)
    rows = []
    for i, first in enumerate(table["leader"].values):
        for j, second in enumerate(table["follower"].values):
            course = table.values[i, j]
            if i == j or not np.isfinite(course).any():
                continue
            best = int(np.nanargmax(course))
            if course[best] >= least:
                rows.append((first, second, float(table["delay"].values[best]), float(course[best])))
    return pd.DataFrame(rows, columns=["leader", "follower", "delay", "correlation"])
