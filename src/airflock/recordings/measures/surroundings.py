"""Density of neighbours in the frame of each individual, front-back and left-right, and its anisotropy."""

import numpy as np
import xarray as xr

from airflock.recordings import dataset
from airflock.recordings.measures.states import check_numbers, headings, track_arrays
from airflock.support import ParameterError


def density_map(recording: xr.Dataset, reach: float, cells: int = 21, slowest: float = 0.0) -> xr.DataArray:
    """Map neighbours per m² around an individual that moves along `front`, (left, front); mean over all and all frames.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    reach     : half the side of the map, m; cells: along each side
    slowest   : speed (m/s) at or below which one has no front
    In space the map is horizontal: distances in height are left out.
    Maps of neighbours as in Katz et al., PNAS 108, 18720 (2011).

    Raises RecordingError for what is no recording of one keypoint, and ParameterError for `reach`
    or `cells` that make no map.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]])
    >>> moved = corners + np.arange(5)[:, None, None] * np.array([1.0, 0.0])
    >>> group = airflock.load_tracks(moved, unit="m", fps=1.0)
    >>> around = airflock.measures.surroundings.density_map(group, reach=5.0, cells=5)
    >>> float(around.sum()) * 4.0  # cells of 4 m²: each of the four has three others near it
    3.0
    """
    check_numbers(reach=reach, cells=cells, slowest=slowest)
    if not reach > 0.0 or cells < 1 or cells % 1:
        raise ParameterError(f"reach = {reach:g} m and cells = {cells}, a whole number, must be above 0")
    cells = int(cells)
    found = track_arrays(recording)
    h = headings(found.velocity[:, :2], slowest)
    box = None if found.box is None else found.box[:2]
    edges = np.linspace(-reach, reach, cells + 1)
    total, focal = np.zeros((cells, cells)), 0
    for place, ahead, there in zip(found.position[:, :2], h, found.placed, strict=True):
        x = place[:, there]
        for i in np.flatnonzero(there & np.isfinite(ahead).all(axis=0)):
            offset = dataset.nearest_image(x - place[:, i : i + 1], box)
            others = np.ones(offset.shape[1], bool)
            others[np.searchsorted(np.flatnonzero(there), i)] = False
            cx, cy = ahead[:, i]
            front, left = (
                cx * offset[0, others] + cy * offset[1, others],
                cx * offset[1, others] - cy * offset[0, others],
            )
            total += np.histogram2d(left, front, (edges, edges))[0]
            focal += 1
    middle = 0.5 * (edges[1:] + edges[:-1])
    area = (edges[1] - edges[0]) ** 2
    attributes = {"units": "1/m^2", "focal": focal}
    coordinates = {axis: (axis, middle, {"units": "m"}) for axis in ("left", "front")}
    return xr.DataArray(total / (max(focal, 1) * area), coordinates, ("left", "front"), attrs=attributes)


def anisotropy(recording: xr.Dataset, reach: float, slowest: float = 0.0) -> float:
    """Compute the mean of cos 2 angle to the nearest neighbour within reach (m): 1 ahead or behind, -1 at the sides, 0
    anywhere.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    reach     : distance beyond which nobody counts as a neighbour, m
    slowest   : speed (m/s) at or below which one has no front
    In space distances and angles are horizontal, as in `density_map`; nan where nobody has a neighbour within reach.
    Our definition, in the plane, of what Ballerini et al., PNAS 105, 1232 (2008), ask of directions in space.

    Raises RecordingError for what is no recording of one keypoint, and ParameterError for a `reach`
    that is not above 0.

    Examples
    --------
    >>> import airflock
    >>> import numpy as np
    >>> corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]])
    >>> moved = corners + np.arange(5)[:, None, None] * np.array([1.0, 0.0])
    >>> group = airflock.load_tracks(moved, unit="m", fps=1.0)
    >>> airflock.measures.surroundings.anisotropy(group, reach=3.0)  # the nearest one is beside
    -1.0
    """
    check_numbers(reach=reach, slowest=slowest)
    found = track_arrays(recording)
    h = headings(found.velocity[:, :2], slowest)
    box = None if found.box is None else found.box[:2]
    total, count = 0.0, 0
    for place, ahead, there in zip(found.position[:, :2], h, found.placed, strict=True):
        rows = np.flatnonzero(there)
        x = place[:, rows]
        offset = dataset.nearest_image(x[:, None, :] - x[:, :, None], box)
        apart = np.linalg.norm(offset, axis=0)
        np.fill_diagonal(apart, np.inf)
        for k, i in enumerate(rows):
            if len(rows) < 2 or not np.isfinite(ahead[:, i]).all():
                continue
            j = int(apart[k].argmin())
            if apart[k, j] <= reach and apart[k, j] > 0.0:
                along = float(ahead[:, i] @ offset[:, k, j]) / apart[k, j]
                total, count = total + 2.0 * along * along - 1.0, count + 1
    return float(total / count) if count else float("nan")
