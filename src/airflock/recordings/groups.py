"""Order parameters of each group of a recording, and between every two of them."""

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings import images
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.recordings.layout import recording_frames
from airflock.recordings.scores import measure_recording
from airflock.support import RecordingError

PAIR_METRICS = {
    "r_centres": ("m", "mean distance between the centres of two groups; nan in a periodic world"),
    "r_between": ("m", "smallest distance between agents of the two groups"),
    "phi_between": ("", "velocity correlation between agents of the two groups"),
}
PART = 200  # instants at once


def group_scores(
    recording: xr.Dataset, settings: Mapping[str, Any] | None = None, *, trust: bool = False
) -> pd.DataFrame:
    """Order parameters as a table: a row for all agents, one for each group, and one for each two groups.

    A group is measured as if the others were not there. What is between two groups, `PAIR_METRICS`, stands in rows
    named "one to other"; an instant counts where both have somebody there. Of a group that is never there all but
    `present` is nan. Raises RecordingError where the recording's scenario has no groups.
    """
    scenario = scenario_of_recording(recording, settings, trust=trust)
    groups = [group for group in scenario.groups if group.agents]
    if not groups:
        raise RecordingError("recording: its scenario has no [[groups]]")
    rows: dict[str, dict[str, Any]] = {"all": measure_recording(recording, settings, trust=trust)[0]}
    frames, _, present = recording_frames(recording)
    for group in groups:
        members = list(group.agents)
        rows[group.name] = {"present": 0.0}
        if present[:, members].any():
            rows[group.name] = measure_recording(recording.isel(individual=members), settings, trust=trust)[0]
    dims, world = frames.shape[1] // 2, scenario.world
    box = images.box_sides(world, dims)
    for one, other in combinations(groups, 2):
        pair = (list(one.agents), list(other.agents))
        rows[f"{one.name} to {other.name}"] = _between(frames, present, pair, dims, box)
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("group")


def _between(
    frames: NDArray[Any],
    present: NDArray[np.bool_],
    pair: tuple[list[int], list[int]],
    dims: int,
    box: NDArray[Any] | None,
) -> dict[str, float]:
    """What is between two groups of agents; box : sides of a periodic world, m."""
    x, v = frames[:, :dims].astype(float), frames[:, dims : 2 * dims].astype(float)
    heading = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)
    both = np.logical_and(np.any(present[:, pair[0]], axis=1), np.any(present[:, pair[1]], axis=1))
    apart, nearest, cosines = [], np.inf, []
    for first in range(0, len(x), PART):
        part = np.flatnonzero(both[first : first + PART]) + first
        if not len(part):
            continue
        (xa, xb), (ha, hb) = ([array[part][:, :, who] for who in pair] for array in (x, heading))
        gap = images.nearest_image(xb[:, :, None, :] - xa[:, :, :, None], box, axis=1)
        nearest = min(nearest, float(np.nanmin(np.linalg.norm(gap, axis=1))))
        apart += np.linalg.norm(np.nanmean(xb, axis=2) - np.nanmean(xa, axis=2), axis=1).tolist()
        cosines += np.nanmean((hb[:, :, None, :] * ha[:, :, :, None]).sum(axis=1), axis=(1, 2)).tolist()
    if not apart:
        return dict.fromkeys(PAIR_METRICS, np.nan)
    return {
        "r_centres": float(np.mean(apart)) if box is None else np.nan,
        "r_between": nearest,
        "phi_between": float(np.mean(cosines)),
    }
