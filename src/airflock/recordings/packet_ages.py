"""Age of the knowledge that agents have of each other, by distance (Vásárhelyi et al. 2018, Fig. 8)."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings import dataset
from airflock.recordings.dataset import recording_frames
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.support import RecordingError

BINS = 24
LEVELS = {"q05": 0.05, "q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95}
COLUMNS = ("receiver", "sender", "t", "stamp", "distance", "got")
HOW = (
    "plot the scenario itself, fly it with airflock.simulate(..., keep=('heard',)), or record a fleet with "
    "airflock fleet --save"
)


def packet_age(heard: xr.Dataset | pd.DataFrame, bins: int = BINS) -> pd.DataFrame:
    """Compute the age of the knowledge about another agent by the distance to it, over all pairs and instants.

    heard : a recording with `age` (time, receiver, sender), s; or a table of packets, one row for each decision and
            pair: receiver, sender, t (s), stamp (s), distance (m), got (0 or 1)
    bins  : of distance, of equal width

    Returns
    -------
    A row for each bin: distance of its middle (m), count, share heard so far, and of the ages (s) the median and the
    quantiles q05, q25, q75 and q95.

    Raises RecordingError where nothing is known of packets.
    """
    distance, age = _of_table(heard) if isinstance(heard, pd.DataFrame) else _of_recording(heard)
    if not len(distance):
        raise RecordingError("reception: there is no pair of agents at any instant")
    edges = np.linspace(0.0, max(float(distance.max()), 1e-6), bins + 1)
    place = np.clip(np.searchsorted(edges, distance, side="right") - 1, 0, bins - 1)
    rows = []
    # Quantiles per bin: ages have long tails under loss, for which means would be misleading.
    for number in range(bins):
        ages = age[place == number]
        known = ages[np.isfinite(ages)]
        quantiles = np.quantile(known, list(LEVELS.values())) if len(known) else [np.nan] * len(LEVELS)
        share = len(known) / len(ages) if len(ages) else np.nan
        rows.append([0.5 * (edges[number] + edges[number + 1]), len(ages), share, *quantiles])
    return pd.DataFrame(rows, columns=["distance", "count", "heard", *LEVELS])


def _of_recording(recording: xr.Dataset) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return distance (m) and age (s) of every pair at every instant at which both are present."""
    if "age" not in recording:
        raise RecordingError(f"recording: does not hold the age of received data; {HOW}")
    frames, _, present = recording_frames(recording)
    axes, agents = frames.shape[1] // 2, frames.shape[2]
    age = recording["age"].transpose("time", "receiver", "sender").values.astype(float)
    if age.shape != (len(frames), agents, agents):
        raise RecordingError(f"recording: age has the sizes {age.shape}, not {(len(frames), agents, agents)}")
    world = scenario_of_recording(recording).world if recording.attrs.get("airflock_scenario") else None
    box = dataset.box_sides(world, axes) if world is not None else None
    off = ~np.eye(agents, dtype=bool)
    distances, ages = [], []
    for place, old, there in zip(frames[:, :axes], age, present, strict=True):
        gap = dataset.nearest_image(place[:, None, :] - place[:, :, None], box)
        both = off & there[:, None] & there[None, :]
        distances.append(np.sqrt((gap**2).sum(axis=0))[both])
        ages.append(old[both])
    return np.concatenate(distances), np.concatenate(ages)


def _of_table(heard: pd.DataFrame) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return distance (m) and age (s) of every row: time since the stamp of the last packet that arrived from this
    sender.
    """
    lacking = [name for name in COLUMNS if name not in heard]
    if lacking:
        raise RecordingError(f"heard: no column {', '.join(lacking)}; give {', '.join(COLUMNS)}")
    rows = heard.sort_values("t", kind="stable")
    # Between two packets the last one is what the receiver knows, so its stamp is carried forward.
    stamp = rows["stamp"].where(rows["got"] > 0).groupby([rows["receiver"], rows["sender"]]).ffill()
    return rows["distance"].to_numpy(float), (rows["t"] - stamp).to_numpy(float)
