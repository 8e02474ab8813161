"""Rays of one agent at one instant: which were cast, which met something, and which one it flew along."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from airflock.core import HeardNeighbour, State
from airflock.scenarios import FlightWorld, GoalCourse
from airflock.support import RecordingError
from airflock.view.plots import style
from airflock.view.plots.flight import paths_in_window, scenario_or_none, short_name, title_details
from airflock.view.plots.scene_paths import draw_ground_plans, shapes_near_paths
from airflock.view.stage.rays import CastRay, rays_and_command


def rays_at_frame(recording: xr.Dataset, agent: int, frame: int) -> tuple[list[CastRay], tuple[float, float, float]]:
    """Rays that an agent cast at a frame of its recording, and the command (m/s) that it decided on."""
    scenario = scenario_or_none(recording)
    if scenario is None or scenario.model.sight is None:
        raise RecordingError("recording: its model casts no rays; kidger does")
    states = np.concatenate([recording[name].values[:, :, 0, :] for name in ("position", "velocity")], axis=1)
    dims = scenario.dimensions
    pad = (0.0,) * (3 - dims)

    def flock(k: int) -> list[State]:
        return [State(*map(float, (*s[:dims], *pad, *s[dims:], *pad))) for s in states[k].T]

    place, course = FlightWorld(scenario), GoalCourse(scenario)
    elapsed = float(recording["time"].values[1]) if len(states) > 1 else scenario.flight.dt
    for k in range(frame + 1):
        course.advance(k * elapsed, elapsed, flock(k))
    now = flock(frame)
    place.update_appearing(frame * elapsed, now)
    heard = [HeardNeighbour(j, state, 0.0) for j, state in enumerate(now) if j != agent]
    return rays_and_command(scenario, place, course, now[agent], heard, frame * elapsed, agent)


def rays(recording: xr.Dataset, *, start: float | None = None, agent: int = 0, ax: Axes | None = None) -> Figure:
    """Rays of one agent from above: red where they met something, green the first free one, black what was flown.

    recording : (time, space, keypoint, individual), of a law that casts rays, m and m/s; agent : whose rays
    start     : instant, s; by default the one at which this agent cast most rays in the flight's first 20 s
    ax        : axes to draw into, instead of a new figure

    Raises RecordingError where the law casts no rays, or there is no such agent or instant.

    Examples
    --------
    >>> import airflock
    >>> city = airflock.simulate(airflock.load("kidger/city", {"agents": 4, "duration": 2.0}))
    >>> len(airflock.plots.rays(city, start=1.0).axes)
    1
    """
    count = recording.sizes["individual"]
    if not 0 <= agent < count:
        raise RecordingError(f"recording: has no agent {agent}; its agents are 0 to {count - 1}")
    times = recording["time"].values.astype(float)
    if start is None:
        few = np.unique(np.linspace(0, np.searchsorted(times, 20.0, side="right") - 1, 80).astype(int))
        frame = int(max(few, key=lambda k: len(rays_at_frame(recording, agent, int(k))[0])))
    else:
        frame = int(np.abs(times - start).argmin())
    found, command = rays_at_frame(recording, agent, frame)
    scenario, shown = scenario_or_none(recording), paths_in_window(recording)
    assert scenario is not None
    x, y = (float(c) for c in shown.position[frame, :2, agent])
    reach = 1.3 * max(ray.length for ray in found)
    figure, axes = style.figure_and_axes(ax, 6.0, 5.6)
    draw_ground_plans(axes, shapes_near_paths(scenario, shown))
    lines = [[(x, y), (x + ray.free * ray.x, y + ray.free * ray.y)] for ray in found]
    colours = [style.GREEN if ray.free >= ray.length else style.RED for ray in found]
    axes.add_collection(LineCollection(lines, colors=colours, linewidths=0.8, alpha=0.8, zorder=3))
    pace = max(float(np.linalg.norm(command)), 1e-9)
    tip = (x + reach / 1.3 * command[0] / pace, y + reach / 1.3 * command[1] / pace)
    axes.annotate("", tip, (x, y), arrowprops={"arrowstyle": "->", "color": style.INK, "lw": 1.4}, zorder=5)
    axes.plot(*shown.position[max(0, frame - 60) : frame + 1, :2, agent].T, color=style.BLUE, linewidth=1.2, zorder=4)
    axes.scatter(*shown.position[frame, :2], s=12.0, color=style.GREY, zorder=4)
    axes.scatter([x], [y], s=40.0, color=style.INK, zorder=6)
    axes.set(xlim=(x - reach, x + reach), ylim=(y - reach, y + reach))
    axes.set_aspect("equal")
    style.style_axes(axes, "east (m)", "north (m)", grid=False)
    words = f"agent {agent} at {times[frame]:.4g} s · {len(found)} rays cast"
    style.set_title(axes, short_name(recording), f"{words} · {title_details(recording)}")
    return figure
