"""Turning speed: rate of turn of headings, counter-clockwise positive."""

import numpy as np
import xarray as xr

from airflock.recordings.measures.states import check_numbers, headings, track_arrays


def turning_speed(recording: xr.Dataset, slowest: float = 0.0) -> xr.DataArray:
    """Compute the rate of turn of the horizontal heading, (time, individual), rad/s; nan across absences.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    slowest   : speed (m/s) at or below which one has no heading
    A frame holds the turn between the frames on its two sides; at the ends, to the only one there is.
    Geometry, of no publication.

    Raises RecordingError for what is no recording of one keypoint, and ParameterError for a
    `slowest` that is no number.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> angle = 0.1 * np.arange(20)[:, None]
    >>> circle = airflock.load_tracks(np.stack([np.cos(angle), np.sin(angle)], axis=-1), unit="m", fps=10.0)
    >>> round(float(airflock.measures.turning.turning_speed(circle)[10, 0]), 3)
    1.0
    """
    check_numbers(slowest=slowest)
    found = track_arrays(recording)
    h = headings(found.velocity[:, :2], slowest)
    sine = h[:-1, 0] * h[1:, 1] - h[:-1, 1] * h[1:, 0]
    # The angle by arctan2 of sine and cosine is exact for any turn below half a circle between two
    # frames.
    rate = np.arctan2(sine, (h[:-1] * h[1:]).sum(axis=1)) / np.diff(found.time)[:, None]
    if len(h) > 1:
        before, after = np.vstack([rate[:1], rate]), np.vstack([rate, rate[-1:]])
    else:  # one frame has no turn
        before = after = np.full((len(h), h.shape[2]), np.nan)
    coordinates = {"time": ("time", found.time, {"units": "s"}), "individual": found.names}
    return xr.DataArray(0.5 * (before + after), coordinates, ("time", "individual"), attrs={"units": "rad/s"})
