"""Flight logs as estimators need them: rows of one drone after another, at their own times."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings.imports.track import COMMAND, POSITION, VELOCITY, Track
from airflock.support.errors import RecordingError

Array = NDArray[np.float64]
MISSING = 1.5  # usual steps between rows: beyond, a command may have come and gone unseen


@dataclass(frozen=True)
class Logs:
    """Rows of all drones, one drone after another.

    time (row,) s; position, velocity, command (row, axis) m and m/s; who (row,) number of the drone
    new  : (row,) no row before this one belongs to it: the first, after a gap, after a reset of the estimator
    standing : (row,) on the ground
    """

    time: Array
    position: Array
    velocity: Array
    command: Array
    who: NDArray[np.int64]
    new: NDArray[np.bool_]
    names: list[str]
    standing: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, bool))

    @property
    def step(self) -> float:
        """Usual time between rows, s."""
        return float(np.median(np.diff(self.time)[~self.new[1:]]))

    @property
    def drones(self) -> int:
        """Number of drones."""
        return len(self.names)

    def of(self, who: int) -> NDArray[np.int64]:
        """Rows of one drone."""
        return np.flatnonzero(self.who == who)

    def flying(self) -> "Logs":
        """Rows in flight that have a command; new where something was left out."""
        keep = np.isfinite(self.command).all(axis=1) & np.isfinite(self.velocity).all(axis=1) & ~self.standing
        return self.only(keep)

    def grounded(self) -> "Logs":
        """Rows on the ground, in stretches without a gap of more than 1 s: a log may be slower there."""
        found = self.only(self.standing)
        apart = np.concatenate([[True], (np.diff(found.time) > 1.0) | (np.diff(found.who) != 0)])[: len(found.time)]
        return replace(found, new=apart)

    def only(self, keep: NDArray[np.bool_]) -> "Logs":
        """Some of the rows; a row that follows one left out is new."""
        left_out = np.concatenate([[False], ~keep[:-1]])
        new = (self.new | left_out)[keep]
        return Logs(
            self.time[keep], self.position[keep], self.velocity[keep], self.command[keep], self.who[keep], new,
            self.names, self.standing[keep],
        )  # fmt: skip


def logs_of(tracks: list[Track], standing: tuple[float, float] | None = None) -> Logs:
    """Logs from imported tracks; raises RecordingError where velocities are missing.

    standing : first and last time (s after each drone's first row) on the ground, unless the log tells it itself
    """
    if not tracks:
        raise RecordingError("no tracks to identify from")
    lacking = [f"{track.source}: {track.name}" for track in tracks if not track.has(VELOCITY)]
    if lacking:
        raise RecordingError(
            f"{lacking[0]} has no velocity, and a differentiated one contains the future; log it, or map vx and vy"
        )
    axes = 3 if all("cz" in t.columns and "vz" in t.columns and "z" in t.columns for t in tracks) else 2
    parts: list[list[Any]] = []
    for number, track in enumerate(tracks):
        time = track.time
        step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
        new = np.concatenate([[True], np.diff(time) > MISSING * step])
        new[track.breaks] = True
        wish = track.stack(COMMAND, axes) if track.has(COMMAND) else np.full((len(time), axes), np.nan)
        on_ground = ~track.air if track.air is not None else np.zeros(len(time), bool)
        if standing is not None:
            after = time - time[0]
            on_ground = (after >= standing[0]) & (after <= standing[1])
        states = track.stack(POSITION, axes), track.stack(VELOCITY, axes)
        parts.append([time, *states, wish, np.full(len(time), number), new, on_ground])
    time, place, speed, wish, who, new, ground = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Logs(time, place, speed, wish, who.astype(np.int64), new, [track.name for track in tracks], ground)


def logs_of_recording(recording: xr.Dataset) -> Logs:
    """Logs from a recording, simulated or imported; rows that were bridged or are absent are left out."""
    if "velocity" not in recording or "command" not in recording:
        raise RecordingError("recording: has no velocity or no command, which identify compares")
    order = ("individual", "time", "space", "keypoint")
    states: list[Any] = [
        recording[n].transpose(*order).isel(keypoint=0).values for n in ("position", "velocity", "command")
    ]
    sure = np.ones(states[0].shape[:2], bool)
    if "confidence" in recording:
        sure = recording["confidence"].transpose("individual", "time", "keypoint").isel(keypoint=0).values >= 1.0
    sure &= np.isfinite(np.concatenate(states[:2], axis=2)).all(axis=2)
    time = np.tile(recording["time"].values.astype(float), len(sure))
    who = np.repeat(np.arange(len(sure)), sure.shape[1])
    keep = sure.reshape(-1)
    left_out = np.concatenate([[True], ~keep[:-1]]) | np.concatenate([[True], who[1:] != who[:-1]])
    place, speed, wish = (state.reshape(-1, state.shape[2])[keep].astype(float) for state in states)
    names = [str(name) for name in recording["individual"].values]
    return Logs(time[keep], place, speed, wish, who[keep], left_out[keep], names, np.zeros(int(keep.sum()), bool))
