"""Form of the group at every instant: area of its hull, length along and across its motion."""

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.measures.states import track_arrays


def group_shape(recording: xr.Dataset) -> pd.DataFrame:
    """Measure the group by time: number present, hull (m², in space m³), length and width (m), elongation (length /
    width).

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s

    In a periodic world the places count as they stand.
    length, width : root mean square extension along and across the mean horizontal velocity, times sqrt(12), which is
    the side of an even rectangle. nan where too few are there. Our definitions.

    Raises RecordingError for what is no recording of one keypoint.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]])
    >>> moved = corners + np.arange(5)[:, None, None] * np.array([1.0, 0.0])
    >>> group = airflock.load_tracks(moved, unit="m", fps=1.0)
    >>> float(airflock.measures.shape.group_shape(group)["hull"].iloc[0])
    8.0
    """
    from scipy.spatial import ConvexHull, QhullError

    found = track_arrays(recording)
    axes = found.position.shape[1]
    rows = []
    for place, speed, there, moves in zip(found.position, found.velocity, found.placed, found.present, strict=True):
        x, count = place[:, there], int(there.sum())
        hull = length = width = np.nan
        # A hull needs one point more than there are axes; fewer have none, and points on a line
        # have a hull of 0.
        if count > axes:
            try:
                hull = float(ConvexHull(x.T).volume)  # in the plane `volume` is the area
            except QhullError:
                hull = 0.0  # all on one line, or on one plane in space
        if count > 1 and moves.any():
            mean = speed[:2, moves].mean(axis=1)
            size = np.linalg.norm(mean)
            if size > 1e-12:
                ahead = mean / size
                offset = x[:2] - x[:2].mean(axis=1, keepdims=True)
                length = float(np.sqrt(12.0 * ((ahead @ offset) ** 2).mean()))
                width = float(np.sqrt(12.0 * ((ahead[0] * offset[1] - ahead[1] * offset[0]) ** 2).mean()))
        rows.append((count, hull, length, width, length / width if width > 1e-9 else np.nan))
    units = {"present": "1", "hull": "m^2" if axes == 2 else "m^3", "length": "m", "width": "m", "elongation": "1"}
    table = pd.DataFrame(rows, index=pd.Index(found.time, name="time"), columns=[*units])
    table.attrs["units"] = units
    return table
