"""The dataset of a recording: its layout, the check of it, its frames, derivatives and nearest images.

A recording is one xarray Dataset, simulated or flown. Dimensions (time, space, keypoint,
individual) and the attributes fps, time_unit, source_software and ds_type follow the convention of
`movement`; velocity and command are Airflock's own additions. Local east-north-up, SI units.
"""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.core import COMMANDS
from airflock.recordings import accessor  # noqa: F401  # every recording passes here, so all of them have it
from airflock.support import RecordingError
from airflock.world import arena, half_sizes

DIMENSIONS = ("time", "space", "keypoint", "individual")
SHORTEST = 1e-6  # s between frames: the shortest motion step there is
FRAME_ATTRIBUTE, EAST_NORTH_UP = (
    "airflock_frame",
    "east-north-up",
)  # of tracks whose axes are known to be those of the ground
VARIABLE_UNITS = {"position": "m", "velocity": "m/s"}


def make_dataset(
    frames: NDArray[Any],
    dimensions: int,
    times: float | NDArray[Any],
    attributes: dict[str, Any],
    command: str,
    groups: Sequence[str] = (),
) -> xr.Dataset:
    """Make a dataset of frames (time, component, agent), whose components are position, velocity and command.

    times   : time of each frame, or the constant time between two, s
    command : what the model commands: velocity (m/s), acceleration (m/s²) or heading
    groups  : name of each agent's group, "" in none, as the coordinate `group`; none where there
              are no groups
    """
    count, _, agents = frames.shape
    if isinstance(times, np.ndarray):
        period = float(times[1] - times[0]) if count > 1 else 1.0
    else:
        period, times = times, np.arange(count) * times
    names = ("position", "velocity", "command")
    units = {**VARIABLE_UNITS, "command": COMMANDS.get(command, "1")}
    variables: dict[str, Any] = {
        name: (DIMENSIONS, frames[:, c * dimensions : (c + 1) * dimensions, None, :], {"units": units[name]})
        for c, name in enumerate(names)
    }
    # Absent agents have nan in the frames; `movement` expects a confidence besides, which is 0 for
    # them.
    there = np.isfinite(frames[:, :dimensions]).all(axis=1).astype(np.float32)  # 0 of those who are absent
    individuals = [f"agent_{i}" for i in range(agents)]
    found = poses(variables, there, times, period, individuals, {"source_software": "airflock", **attributes})
    return found.assign_coords(group=("individual", np.array(groups, str))) if groups else found


def poses(
    variables: dict[str, Any], confidence: NDArray[Any], times: NDArray[Any], period: float, individuals: Sequence[str],
    attributes: Mapping[str, Any],
) -> xr.Dataset:  # fmt: skip
    """Make a dataset of `movement` of variables with DIMENSIONS, and of a confidence (time, individual).

    times : (time,) s, `period` (s) apart
    """
    coordinates = {
        "time": ("time", times, {"units": "s"}), "space": list("xyz"[: variables["position"][1].shape[1]]),
        "keypoint": ["centre"], "individual": individuals,
    }  # fmt: skip
    variables = {**variables, "confidence": (("time", "keypoint", "individual"), confidence[:, None, :])}
    fixed = {"ds_type": "poses", "fps": 1.0 / period, "time_unit": "seconds"}
    return xr.Dataset(variables, coordinates, {**fixed, **attributes})


def check_dataset(value: Any, where: str = "recording") -> None:
    """Raise a RecordingError for what is no dataset at all: a table, an array, the name of a file."""
    if isinstance(value, (str, os.PathLike)):
        raise RecordingError(f"{where}: {os.fspath(value)} is a name; open it with airflock.load_recording")
    if isinstance(value, xr.DataArray):
        raise RecordingError(f"{where}: is the DataArray {value.name}, one variable; give the whole Dataset")
    if not isinstance(value, xr.Dataset):
        kind = type(value).__name__
        raise RecordingError(f"{where}: {kind} is no xarray Dataset; airflock.load_tracks makes one of tracks")


def check_recording(recording: xr.Dataset, where: str = "recording") -> None:
    """Raise a RecordingError that lists everything a dataset lacks to be a recording."""
    check_dataset(recording, where)
    errors = []
    if "position" not in recording:
        errors.append("no variable position")
    else:
        missing = [name for name in DIMENSIONS if name not in recording["position"].dims]
        if missing:
            errors.append(f"position lacks the dimension{'s' if len(missing) > 1 else ''} {', '.join(missing)}")
    # Without all dimensions the other checks would fail by themselves, and hide the first error.
    if not errors:
        sizes = recording["position"].sizes
        if sizes["time"] < 1 or sizes["individual"] < 1:
            errors.append(f"position is empty ({sizes['time']} times, {sizes['individual']} individuals)")
        if sizes["space"] not in (2, 3):
            errors.append(f"space has {sizes['space']} components, not 2 or 3")
        times = recording["time"].values if "time" in recording.coords else np.zeros(0, "U")
        if times.ndim != 1 or times.dtype.kind not in "fiu" or not (np.diff(times.astype(float)) > 0).all():
            errors.append("time is not an increasing coordinate, s")
        for name in ("position", "velocity"):
            if name in recording and recording[name].dtype.kind not in "fiu":
                errors.append(f"{name} is of kind {recording[name].dtype}, not numbers")
            if name in recording and {d: recording[name].sizes.get(d) for d in DIMENSIONS} != {
                d: sizes[d] for d in DIMENSIONS
            }:
                errors.append(f"{name} has not the dimensions {', '.join(DIMENSIONS)} of position")
    if errors:
        raise RecordingError("\n".join(f"{where}: {error}" for error in errors))


def recording_frames(recording: xr.Dataset, where: str = "recording") -> tuple[NDArray[Any], float, NDArray[np.bool_]]:
    """Return frames (time, component, agent) of position and velocity, the time between frames (s), and presence.

    An agent of which a number is missing (nan) at an instant is not there then: (time, agent).
    Velocity is differentiated from position, within stretches in which the agent is there, where it
    is not recorded.
    """
    check_recording(recording, where)
    times, position, velocity = motion_arrays(recording)
    steps = np.diff(times)
    period = float(np.median(steps)) if steps.size else 1.0
    if not SHORTEST <= period < np.inf:
        raise RecordingError(f"{where}: frames are {period:g} s apart, less than {SHORTEST:g} s or more than any time")
    # A law and its metrics assume a constant step; deviations of up to 1 % are taken as rounding of
    # times.
    if steps.size and np.abs(steps - period).max() > 0.01 * period + 1e-9:
        raise RecordingError(
            f"{where}: frames are {steps.min():g} to {steps.max():g} s apart; resample to a constant rate"
        )
    if velocity is None:
        raise RecordingError(f"{where}: one frame without velocity has no speed to score")
    frames = np.concatenate([position, velocity], axis=1)
    # nan means absent, infinity is an error: it would turn every mean into infinity.
    endless = np.argwhere(np.isinf(frames))
    if len(endless):
        time, component, agent = endless[0]
        what, name = "position" if component < position.shape[1] else "velocity", recording["individual"].values[agent]
        raise RecordingError(f"{where}: the {what} of {name} at t = {times[time]:g} s is infinite")
    present = ~np.isnan(frames).any(axis=1)
    if not present.any():
        raise RecordingError(
            f"{where}: no individual is present at any instant: a position or velocity is always missing"
        )
    return frames, period, present


Array = NDArray[Any]


def motion_arrays(recording: xr.Dataset, kind: Any = None) -> tuple[Array, Array, Array | None]:
    """Return times (frame,), s, and position and velocity (frame, axis, individual), m and m/s, of the first keypoint.

    Velocity is differentiated from position where it is not recorded; None of a single frame.
    kind : type of the numbers; by default that of the recording
    """
    own = recording.isel(keypoint=0)
    times = own["time"].values.astype(float)
    position, *recorded = (
        np.asarray(own[name].transpose("time", "space", "individual").values, kind)
        for name in ("position", "velocity")
        if name in own
    )
    if recorded:
        return times, position, recorded[0]
    return times, position, differentiated_velocity(position, times) if len(times) > 1 else None


# numpy.gradient weighs three equal positions with weights that do not cancel: a group at rest then
# had a heading.
def central_difference(position: Array, times: Array) -> Array:
    """Compute velocity (time, ...), m/s, of positions in m at times in s: central differences, one-sided at both ends.

    Exactly 0 where a position stays the same over the frames that it is taken from:
    `numpy.gradient` leaves a rounding error there, which is a velocity of 1e-15 m/s with a heading.
    """
    found: Array = np.asarray(np.gradient(position, times, axis=0))
    same = position[1:] == position[:-1]
    still = np.concatenate([same[:1], same[1:] & same[:-1], same[-1:]])
    return np.where(still, found.dtype.type(0.0), found)


def differentiated_velocity(position: Array, times: Array) -> Array:
    """Compute velocity (time, axis, individual), m/s, within the stretches in which each individual is present; else
    nan.
    """
    there = np.asarray(~np.isnan(position).any(axis=1))
    if there.all():
        return central_difference(position, times)
    velocity = np.full_like(position, np.nan)
    for agent in range(position.shape[2]):
        borders = np.flatnonzero(np.diff(there[:, agent], prepend=False, append=False))
        for first, last in zip(borders[::2].tolist(), borders[1::2].tolist(), strict=True):
            if last - first > 1:
                stretch = slice(first, last)
                velocity[stretch, :, agent] = central_difference(position[stretch, :, agent], times[stretch])
    return velocity


def box_sides(world: arena.Parameters, dimensions: int) -> Array | None:
    """Return the sides of a periodic world, (axis,) m; None of any other world."""
    return 2.0 * np.array(half_sizes(world)[:dimensions]) if world.edges == "periodic" else None


# In a periodic world the shortest way between two places may lead across the border.
def nearest_image(offset: Array, box: Array | None, axis: int = 0) -> Array:
    """Return offsets (m) to the nearest images; `axis` is that of the coordinates, `box` is from `box_sides`."""
    if box is None:
        return offset
    side = box.reshape([-1 if a == axis else 1 for a in range(offset.ndim)])
    found: Array = offset - side * np.round(offset / side)
    return found
