"""Correlation of velocity fluctuations by distance, and its first zero (Cavagna et al. 2010)."""

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings import dataset
from airflock.recordings.measures.states import check_numbers, track_arrays
from airflock.support import ParameterError

NOTHING = 1e-6  # of the speed: fluctuations below it are the rounding of recordings in single precision


def velocity_correlation(recording: xr.Dataset, width: float, farthest: float | None = None) -> pd.Series:
    """Compute the correlation of velocities about the group's mean, by distance (m); 1 at distance 0.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    width     : of a bin of distances, m: about a tenth of the group
    farthest  : m; by default the largest distance that occurs
    nan where nobody differs from the mean, to the precision of a recording: a group in unison has no fluctuations.
    Cavagna et al., PNAS 107, 11865 (2010), with the mean velocity of those present taken off at each instant.

    Raises RecordingError for what is no recording of one keypoint, and ParameterError for a `width`
    that is not above 0.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> out = np.array([[-3.0, 0.0], [-1.0, 0.0], [1.0, 0.0], [3.0, 0.0]])  # a line that stretches evenly
    >>> places = out * (1.0 + 0.1 * np.arange(5)[:, None, None])
    >>> line = airflock.load_tracks(places, unit="m", fps=10.0)
    >>> airflock.measures.correlation.velocity_correlation(line, width=3.0).index.name
    'distance'
    """
    check_numbers(width=width, **({} if farthest is None else {"farthest": farthest}))
    found = track_arrays(recording)
    if not width > 0.0:
        raise ParameterError(f"width = {width:g} m must be above 0")
    sums: dict[int, list[float]] = {}
    alone, whole, count = 0.0, 0.0, 0
    # The mean velocity is removed at each instant; the sums of all instants are divided once, so
    # crowded instants weigh more.
    for place, speed, there in zip(found.position, found.velocity, found.present, strict=True):
        if there.sum() < 2:
            continue
        x, u = place[:, there], speed[:, there]
        whole += float((u * u).sum())
        u = u - u.mean(axis=1, keepdims=True)
        alone, count = alone + float((u * u).sum()), count + u.shape[1]
        i, j = np.triu_indices(u.shape[1], 1)
        apart = np.linalg.norm(dataset.nearest_image(x[:, j] - x[:, i], found.box), axis=0)
        bins = np.floor(apart / width).astype(int)
        products = (u[:, i] * u[:, j]).sum(axis=0)
        number, total = np.bincount(bins), np.bincount(bins, products)
        for b in np.flatnonzero(number):
            entry = sums.setdefault(int(b), [0.0, 0.0])
            entry[0] += total[b]
            entry[1] += number[b]
    # If nobody differs from the mean by more than rounding, the ratio would be noise divided by
    # noise.
    scale = alone / count if alone > NOTHING**2 * whole else np.nan
    last = max(sums, default=0) if farthest is None else int(farthest / width)
    kept = [b for b in sorted(sums) if b <= last]
    index = pd.Index([(b + 0.5) * width for b in kept], name="distance")
    course = [sums[b][0] / sums[b][1] / scale for b in kept]
    series = pd.Series(course, index=index, name="correlation", dtype=float)
    series.attrs["units"] = "1"
    return series


def correlation_length(recording: xr.Dataset, width: float) -> float:
    """Return the distance at which the correlation of velocities first falls to zero, m; nan if it does not.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    width     : of a bin of distances, m
    Cavagna et al., PNAS 107, 11865 (2010), by straight lines between the bins of `velocity_correlation`.

    Raises RecordingError and ParameterError as `velocity_correlation` does.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> out = np.array([[-3.0, 0.0], [-1.0, 0.0], [1.0, 0.0], [3.0, 0.0]])  # a line that stretches evenly
    >>> places = out * (1.0 + 0.1 * np.arange(5)[:, None, None])
    >>> line = airflock.load_tracks(places, unit="m", fps=10.0)
    >>> 2.0 < airflock.measures.correlation.correlation_length(line, width=0.5) < 6.0
    True
    """
    course = velocity_correlation(recording, width)
    values, at = course.to_numpy(), course.index.to_numpy()
    down = np.flatnonzero(values <= 0.0)
    if not len(down):
        return float("nan")
    k = int(down[0])
    if k == 0:
        return float(at[0])
    return float(at[k - 1] + (at[k] - at[k - 1]) * values[k - 1] / (values[k - 1] - values[k]))
