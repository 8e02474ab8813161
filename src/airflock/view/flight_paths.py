"""Paths in a window of time, outlines of the world, and the projection of both onto a picture."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings import attributes, check_recording, motion_arrays, scenario_of_recording
from airflock.scenarios import Scenario
from airflock.support import RecordingError
from airflock.view.scene import wall_lines
from airflock.world import arena, half_sizes

Array = NDArray[Any]


class FlightPaths(NamedTuple):
    """Trajectories in a window of time; missing positions are nan.

    times    : (time,) s
    position : (time, axis, agent) m, two or three axes
    velocity : the same, m/s
    """

    times: Array
    position: Array
    velocity: Array

    @property
    def speed(self) -> Array:
        """Speed (time, agent), m/s."""
        return np.asarray(np.sqrt((self.velocity**2).sum(1)))

    @property
    def agents(self) -> int:
        """Number of agents."""
        return int(self.position.shape[2])


def paths_in_window(
    recording: xr.Dataset, start: float | None = None, stop: float | None = None, *, last: float | None = None
) -> FlightPaths:
    """Return the trajectories from start to stop, s; without a start, the `last` seconds, or all of them.

    Raises a RecordingError when the window holds no frame.
    """
    check_recording(recording)
    times = recording["time"].values.astype(float)
    begin, end = time_window(times, start, stop, last)
    chosen = (times >= begin - 1e-9) & (times <= end + 1e-9)
    if not chosen.any():
        raise RecordingError(
            f"recording: has no frame from {begin:g} to {end:g} s; it reaches from {times[0]:g} to {times[-1]:g} s"
        )
    shown, position, velocity = motion_arrays(recording.isel(time=np.flatnonzero(chosen)), kind=float)
    return FlightPaths(shown, position, np.zeros_like(position) if velocity is None else velocity)


def time_window(
    times: Array, start: float | None, stop: float | None, last: float | None = None
) -> tuple[float, float]:
    """Return the first and the last instant shown, s."""
    end = float(times[-1]) if stop is None else float(stop)
    if start is not None:
        begin = float(start)
    else:
        begin = float(times[0]) if last is None else max(float(times[0]), min(end, float(times[-1])) - last)
    if begin > end:
        raise RecordingError(f"recording: the window from {begin:g} to {end:g} s ends before it starts")
    return begin, end


def scenario_or_none(recording: xr.Dataset) -> Scenario | None:
    """Return the scenario that a recording was flown with; None for tracks."""
    check_recording(recording)
    return scenario_of_recording(recording) if recording.attrs.get("airflock_scenario") else None


def world_or_open(recording: xr.Dataset) -> arena.Parameters:
    """Return the world of a recording; an open one for tracks."""
    scenario = scenario_or_none(recording)
    return scenario.world if scenario else arena.Parameters(arena="none")


def short_name(source: xr.Dataset | Scenario) -> str:
    """Return the short name of a scenario or recording: of its preset or file, or of the file of its tracks."""
    name = source.name if isinstance(source, Scenario) else attributes.recording_name(source)
    return Path(name).stem if name.endswith((".toml", ".nc")) else name


def title_details(recording: xr.Dataset, paths: FlightPaths | None = None) -> str:
    """Return the details of a title: number of agents, seed, and the window of time that is shown."""
    agents = recording.sizes["individual"]
    parts = [f"{agents} agent{'s' if agents > 1 else ''}"]
    if "airflock_seed" in recording.attrs:
        parts.append(f"seed {recording.attrs['airflock_seed']}")
    if paths is not None:
        parts.append(f"{paths.times[0]:.4g} to {paths.times[-1]:.4g} s")
    return " · ".join(parts)


def crosses_periodic_face(segments: Array, world: arena.Parameters) -> Array:
    """Return a mask of the segments (segment, end, axis), m, that lead through a periodic face."""
    if world.edges != "periodic":
        return np.zeros(len(segments), bool)
    # A step of more than half the world is a jump to the opposite face.
    halves = np.array(half_sizes(world)[: segments.shape[2]])
    return np.asarray((np.abs(segments[:, 1] - segments[:, 0]) > halves).any(axis=1))


class Projection(NamedTuple):
    """Parallel projection onto the picture: `right` and `up` are unit vectors (axis,)."""

    right: Array
    up: Array

    def __call__(self, points: Array, axis: int = 1) -> tuple[Array, Array]:
        """Return picture coordinates of points, m; `axis` is the axis that holds their components. A plane lies at
        height 0.
        """
        moved = np.moveaxis(points, axis, -1)
        known = min(moved.shape[-1], len(self.right))
        moved = moved[..., :known]
        return moved @ self.right[:known], moved @ self.up[:known]


def projection(axes: int, azimuth_deg: float = -60.0, elevation_deg: float = 25.0) -> Projection:
    """Return the view from above in the plane; in space, the view from a direction."""
    if axes == 2:
        return Projection(np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    # Oblique parallel projection: lengths compare anywhere in the picture, which perspective would
    # spoil.
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    up = np.array([-math.cos(a) * math.sin(e), -math.sin(a) * math.sin(e), math.cos(e)])
    return Projection(right, up)


def picture_extent(
    paths: FlightPaths, world: arena.Parameters, view: Projection, margin: float = 0.04, around: Sequence[Array] = ()
) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of a picture that holds the arena, all paths and the lines `around`, m."""
    xs, ys = view(paths.position)
    points = [(xs.ravel(), ys.ravel())] + [
        view(line) for line in (*(wall.corners for wall in wall_lines(world)), *around)
    ]
    x, y = np.concatenate([p[0] for p in points]), np.concatenate([p[1] for p in points])
    if not np.isfinite(x).any():
        raise RecordingError("recording: every position in this window is missing")
    left, right, bottom, top = (float(v) for v in (np.nanmin(x), np.nanmax(x), np.nanmin(y), np.nanmax(y)))
    edge = margin * max(right - left, top - bottom, 1.0)
    return left - edge, right + edge, bottom - edge, top + edge


def speed_range(paths: FlightPaths) -> tuple[float, float]:
    """Return the ends of a colour bar, m/s: all but a few percent of the speeds lie between, rounded outwards."""
    speed = paths.speed[np.isfinite(paths.speed)]
    if not speed.size:
        return 0.0, 1.0
    # A single fast agent would leave all others in one colour.
    slow, fast = (max(float(v), 1e-3) for v in np.quantile(speed, (0.01, 0.999)))
    step = 10.0 ** math.floor(math.log10(fast)) / 2.0
    return step * math.floor(slow / step), step * math.ceil(fast / step)
