"""Logs of flights as arrays, and the periods of decisions in them."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings import COMMAND_TARGETS, POSITION_TARGETS, VELOCITY_TARGETS, ImportedTrack
from airflock.support import RecordingError

Array = NDArray[np.float64]
# Logs as estimators need them: rows of one drone after another, at their own times, without
# interpolation.
MAX_STEP_RATIO = 1.5  # usual steps between rows: beyond, a command may have come and gone unseen


@dataclass(frozen=True)
class FlightLogs:
    """Rows of all drones, one drone after another.

    time (row,) s; position, velocity, command (row, axis) m and m/s; who (row,) number of the drone
    new  : (row,) no row before this one belongs to it: the first, after a gap, after a reset of the
           estimator
    standing : (row,) on the ground
    """

    time: Array
    position: Array
    velocity: Array
    command: Array
    who: NDArray[np.int64]
    is_new: NDArray[np.bool_]
    names: list[str]
    standing: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, bool))

    @property
    def step(self) -> float:
        """Return the usual time between rows, s."""
        return float(np.median(np.diff(self.time)[~self.is_new[1:]]))

    @property
    def drones(self) -> int:
        """Return the number of drones."""
        return len(self.names)

    def of(self, drone: int) -> NDArray[np.int64]:
        """Return the rows of one drone."""
        return np.flatnonzero(self.who == drone)

    def flying(self) -> "FlightLogs":
        """Return the rows in flight that have a command; a row after a left-out one is new."""
        keep = np.isfinite(self.command).all(axis=1) & np.isfinite(self.velocity).all(axis=1) & ~self.standing
        return self.select_rows(keep)

    def grounded_rows(self) -> "FlightLogs":
        """Return the rows on the ground, in stretches without a gap of more than 1 s: a log may be slower there."""
        found = self.select_rows(self.standing)
        apart = np.concatenate([[True], (np.diff(found.time) > 1.0) | (np.diff(found.who) != 0)])[: len(found.time)]
        return replace(found, is_new=apart)

    def select_rows(self, mask: NDArray[np.bool_]) -> "FlightLogs":
        """Select rows; a row that follows a left-out one is new."""
        left_out = np.concatenate([[False], ~mask[:-1]])
        new = (self.is_new | left_out)[mask]
        return FlightLogs(
            self.time[mask], self.position[mask], self.velocity[mask], self.command[mask], self.who[mask], new,
            self.names, self.standing[mask],
        )  # fmt: skip


def logs_from_tracks(tracks: list[ImportedTrack], standing: tuple[float, float] | None = None) -> FlightLogs:
    """Make logs of imported tracks; raise RecordingError where velocities are missing.

    standing : first and last time (s after each drone's first row) on the ground, unless the log
               contains it
    """
    if not tracks:
        raise RecordingError("no tracks to identify from")
    lacking = [f"{track.source}: {track.name}" for track in tracks if not track.has(VELOCITY_TARGETS)]
    if lacking:
        raise RecordingError(
            f"{lacking[0]} has no velocity, and a differentiated one contains the future; log it, or map vx and vy"
        )
    axes = 3 if all("cz" in t.columns and "vz" in t.columns and "z" in t.columns for t in tracks) else 2
    parts: list[list[Any]] = []
    for number, track in enumerate(tracks):
        time = track.time
        step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
        new = np.concatenate([[True], np.diff(time) > MAX_STEP_RATIO * step])
        # A reset of the estimator moves the velocity without any force: no increment may cross it.
        new[track.breaks] = True
        wish = track.stack(COMMAND_TARGETS, axes) if track.has(COMMAND_TARGETS) else np.full((len(time), axes), np.nan)
        on_ground = ~track.in_air if track.in_air is not None else np.zeros(len(time), bool)
        if standing is not None:
            after = time - time[0]
            on_ground = (after >= standing[0]) & (after <= standing[1])
        states = track.stack(POSITION_TARGETS, axes), track.stack(VELOCITY_TARGETS, axes)
        parts.append([time, *states, wish, np.full(len(time), number), new, on_ground])
    time, place, speed, wish, who, new, ground = (np.concatenate(part) for part in zip(*parts, strict=True))
    return FlightLogs(time, place, speed, wish, who.astype(np.int64), new, [track.name for track in tracks], ground)


def logs_from_recording(recording: xr.Dataset) -> FlightLogs:
    """Make logs of a recording, simulated or imported; leave out rows that are bridged or absent."""
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
    return FlightLogs(time[keep], place, speed, wish, who[keep], left_out[keep], names, np.zeros(int(keep.sum()), bool))


FEW = 30  # fewest changes of a command for an estimate of the period
PLATEAU = 0.01  # share of rows within half a per cent of the largest command that make a limit


def decision_period(logs: FlightLogs) -> tuple[float, tuple[float, float], str]:
    """Give sensors.period from the times at which commands change, its interval, and a reason to refuse it, s."""
    flying = logs.flying()
    nan = float("nan")
    if len(flying.time) < 2:
        return nan, (nan, nan), "no commands"
    changed = np.abs(np.diff(flying.command, axis=0)).max(axis=1) > 1e-9
    sound = ~flying.is_new[1:]
    share = float(changed[sound].mean()) if sound.any() else 0.0
    at = np.flatnonzero(changed & sound) + 1
    run = np.cumsum(flying.is_new)
    between = np.diff(flying.time[at])[np.diff(run[at]) == 0]
    if len(between) < FEW:
        return nan, (nan, nan), f"commands change {len(at)} times: fewer than {FEW}"
    # A limiter of accelerations changes commands at the rate of the log, whenever the law decides.
    if share > 0.9 or float(np.median(between)) < 1.5 * flying.step:
        return (
            nan,
            (nan, nan),
            f"commands change in every row: the log ({flying.step:.3g} s) is no faster than decisions",
        )
    # Commands may stay equal for a decision or two, so intervals are whole multiples of the period;
    # fit a line through them.
    usual = float(np.median(between))
    between = between[(between > 0.5 * usual) & (between < 4.5 * usual)]
    times = np.maximum(np.round(between / usual), 1.0)
    period = float((between * times).sum() / (times * times).sum())
    error = float(np.std(between - times * period) / np.sqrt(len(between)))
    return period, (period - 1.96 * error, period + 1.96 * error), ""


def largest_command(logs: FlightLogs, v_flock: float | None = None, axes: int = 3) -> tuple[float, str]:
    """Give model.v_max as a plateau of commanded speeds, m/s, and a reason to refuse it.

    v_flock : preferred speed of the law, m/s, at which commands have a plateau as well
    axes    : those that the law commands; of a law in the plane something else keeps the height
    """
    speed = np.linalg.norm(logs.flying().command[:, :axes], axis=1)
    if not len(speed):
        return float("nan"), "no commands"
    most = float(speed.max())
    share = float((speed > 0.995 * most).mean())
    # A limit shows as many equal largest commands; a single peak is only a lower bound.
    if share < PLATEAU:
        return (
            most,
            f"at least {most:.3g} m/s: only {share:.2%} of the commands are within half a per cent of the largest",
        )
    if v_flock is not None and abs(most / v_flock - 1.0) < 0.03:
        return most, f"at least {most:.3g} m/s: the plateau is that of the preferred speed, the limit was never met"
    return most, ""
