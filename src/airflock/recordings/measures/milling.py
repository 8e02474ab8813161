"""Milling of those present: rotation about the group's own centre (Couzin et al. 2002, Eq. 5)."""

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.measures.states import check_numbers, headings, track_arrays


def milling(recording: xr.Dataset, slowest: float = 0.0) -> pd.Series:
    """Compute the mean cross product of direction from the centre and heading, by time, 0 to 1; nan if alone.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    slowest   : speed (m/s) at or below which one has no heading; it still counts for the centre
    In a periodic world the centre is that of the places as they stand, as it is for the order parameters.
    Couzin et al., J. theor. Biol. 218, 1 (2002), Eq. 5.

    Raises RecordingError for what is no recording of one keypoint, and ParameterError for a
    `slowest` that is no number.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> angle = 0.1 * np.arange(20)[:, None] + np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    >>> ring = airflock.load_tracks(np.stack([np.cos(angle), np.sin(angle)], axis=-1), unit="m", fps=10.0)
    >>> round(float(airflock.measures.milling.milling(ring).iloc[10]), 3)
    1.0
    """
    check_numbers(slowest=slowest)
    found = track_arrays(recording)
    course = np.full(len(found.time), np.nan)
    h = headings(found.velocity, slowest)
    for k, there in enumerate(found.placed):
        moves = there & np.isfinite(h[k]).all(axis=0)
        if moves.sum() < 2:
            continue
        out = found.position[k][:, moves] - found.position[k][:, there].mean(axis=1, keepdims=True)
        out = out / np.maximum(np.linalg.norm(out, axis=0), 1e-12)
        # In the plane the third component is zero, so that one cross product serves plane and
        # space.
        flat = np.zeros((2, 3, int(moves.sum())))
        flat[0, : len(out)], flat[1, : len(out)] = out, h[k][:, moves]
        course[k] = float(np.linalg.norm(np.cross(flat[0].T, flat[1].T).mean(axis=0)))
    series = pd.Series(course, index=pd.Index(found.time, name="time"), name="milling")
    series.attrs["units"] = "1"
    return series
