"""Burst and coast: short accelerations and long glides of fish (Calovi et al. 2018)."""

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings.measures.states import check_numbers, track_arrays
from airflock.support import ParameterError


def bursts(recording: xr.Dataset, least: float) -> pd.DataFrame:
    """Find bursts and their coasts, a row each: individual, begin (s), burst (s), coast (s), speed before and at its
    top (m/s).

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    least     : rise of speed, m/s, below which it is noise of the tracker
    A burst is a rise of speed from a minimum to the next maximum by `least` or more, with falls of less than that in
    between; its coast lasts until the next burst begins, or the individual is gone. After Calovi et al., PLoS Comput.
    Biol. 14, e1005933 (2018).

    Raises RecordingError for what is no recording of one keypoint, and ParameterError for a `least`
    that is not above 0.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> speed = np.array([1.0, 1.0, 4.0, 3.0, 2.0, 1.0, 1.0])
    >>> x = np.cumsum(speed)[:, None, None] * np.array([[[1.0, 0.0]]])
    >>> fish = airflock.load_tracks(x, unit="m", fps=1.0)
    >>> airflock.measures.bursts.bursts(fish, least=1.0)["speed_top"].tolist()
    [3.5]
    """
    check_numbers(least=least)
    if not least > 0.0:
        raise ParameterError(f"least = {least:g} m/s must be above 0")
    found = track_arrays(recording)
    speed = np.linalg.norm(found.velocity, axis=1)
    rows = []
    for i, name in enumerate(found.names):
        there = found.present[:, i]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], there.astype(int), [0]])))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            for low, top, last in _rises(speed[begin:end, i], least):
                at = found.time[begin + np.array([low, top, last])]
                s = speed[begin + np.array([low, top]), i]
                rows.append((name, at[0], at[1] - at[0], at[2] - at[1], s[0], s[1]))
    units = {"begin": "s", "burst": "s", "coast": "s", "speed_before": "m/s", "speed_top": "m/s"}
    table = pd.DataFrame(rows, columns=["individual", *units])
    table.attrs["units"] = units
    return table


def _rises(speed: NDArray[np.float64], least: float) -> list[tuple[int, int, int]]:
    """Return frames of minimum, maximum and the end of the coast, of each rise by `least`."""
    turns: list[tuple[int, int]] = []
    low = top = 0
    rising = False
    # A small state machine with hysteresis: a rise or fall counts once it exceeds `least`, so noise
    # makes no burst.
    for k in range(1, len(speed)):
        if rising:
            if speed[k] > speed[top]:
                top = k
            elif speed[top] - speed[k] >= least:
                turns.append((low, top))
                low, rising = k, False
        elif speed[k] <= speed[low]:
            low = k
        elif speed[k] - speed[low] >= least:
            top, rising = k, True
    if rising:
        turns.append((low, top))
    ends = [*[begin for begin, _ in turns[1:]], len(speed) - 1][: len(turns)]
    return [(begin, peak, end) for (begin, peak), end in zip(turns, ends, strict=True)]
