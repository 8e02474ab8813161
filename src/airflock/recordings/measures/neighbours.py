"""Distances between individuals: to the nearest, and of all pairs."""

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings import dataset
from airflock.recordings.measures.states import check_numbers, track_arrays
from airflock.support import ParameterError


def nearest_distances(recording: xr.Dataset) -> xr.DataArray:
    """Compute the distance to the nearest neighbour, (time, individual), m; nan for an individual absent or alone.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    Geometry, of no publication.

    Raises RecordingError for what is no recording of one keypoint.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> places = np.array([[0.0, 0.0], [3.0, 4.0]]) + np.zeros((5, 1, 1))
    >>> still = airflock.load_tracks(places, unit="m", fps=1.0)
    >>> airflock.measures.neighbours.nearest_distances(still).values[0].tolist()
    [5.0, 5.0]
    """
    found = track_arrays(recording)
    table = np.full(found.placed.shape, np.nan)
    for k, there in enumerate(found.placed):
        if there.sum() > 1:
            x = found.position[k][:, there]
            apart = np.linalg.norm(found.offsets(x), axis=0)
            np.fill_diagonal(apart, np.inf)
            table[k, there] = apart.min(axis=1)
    coordinates = {"time": ("time", found.time, {"units": "s"}), "individual": found.names}
    return xr.DataArray(table, coordinates, ("time", "individual"), attrs={"units": "m"})


def pair_distances(recording: xr.Dataset, width: float, farthest: float) -> pd.Series:
    """Compute the share of pairs by distance, per m, over all frames: its sum times the width of a bin is at most 1.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    width     : of a bin, m; where it does not divide `farthest`, the nearest width that does: `attrs["width"]`
    farthest  : end of the last bin, m; a pair exactly so far apart counts
    A histogram, of no publication.

    Raises RecordingError for what is no recording of one keypoint, and ParameterError for a `width`
    that does not lie between 0 and `farthest`.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> places = np.array([[0.0, 0.0], [3.0, 4.0]]) + np.zeros((5, 1, 1))
    >>> still = airflock.load_tracks(places, unit="m", fps=1.0)
    >>> shares = airflock.measures.neighbours.pair_distances(still, width=2.0, farthest=10.0)
    >>> float(shares.idxmax()), float(shares.sum() * 2.0)
    (5.0, 1.0)
    """
    check_numbers(width=width, farthest=farthest)
    if not 0.0 < width < farthest:
        raise ParameterError(f"width = {width:g} m must lie between 0 and farthest = {farthest:g} m")
    found = track_arrays(recording)
    edges = np.linspace(0.0, farthest, round(farthest / width) + 1)
    width = farthest / (len(edges) - 1)
    counts, pairs = np.zeros(len(edges) - 1), 0
    # Frame by frame: positions of all frames at once would need pairs times frames.
    for place, there in zip(found.position, found.placed, strict=True):
        x = place[:, there]
        i, j = np.triu_indices(x.shape[1], 1)
        counts += np.histogram(np.linalg.norm(dataset.nearest_image(x[:, j] - x[:, i], found.box), axis=0), edges)[0]
        pairs += len(i)
    index = pd.Index(0.5 * (edges[1:] + edges[:-1]), name="distance")
    density = pd.Series(counts / (max(pairs, 1) * width), index=index, name="density")
    density.attrs |= {"width": width, "units": "1/m"}
    return density
