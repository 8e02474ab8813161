"""Trajectories of a flock, coloured by speed (Vásárhelyi et al. 2018, Fig. 4)."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from airflock.errors import RecordingError
from airflock.plots import style
from airflock.plots.scene import (
    Paths,
    details_of,
    extent,
    name_of,
    paths_of,
    speed_range,
    through_face,
    view_of,
    walls,
    world_of,
)  # fmt: skip
from airflock.world import arena

WINDOW = 60.0  # s; longer paths cover each other
MOST = 200_000  # segments; beyond, frames are skipped so that a picture stays quick to draw
MANY = 20_000  # segments; beyond, vector formats hold them as pixels


def trajectories(
    recording: xr.Dataset,
    *,
    start: float | None = None,
    stop: float | None = None,
    agent: int | None = None,
    highlight: bool = True,
) -> Figure:
    """Paths from above, or in space for a 3-D recording; dots mark where agents are at the end.

    start, stop : window of time, s; by default the last 60 s
    agent       : number of the agent highlighted in grey scale; by default one drawn at random, the same for a seed
    highlight   : False highlights none
    """
    shown = paths_of(recording, start, stop, last=WINDOW)
    world = world_of(recording)
    chosen = _chosen(recording, shown.agents, agent) if highlight else -1
    space = shown.position.shape[1] == 3
    figure = style.Picture(6.8, 4.6) if space else style.Picture(6.4, 5.6)
    axes: Any = figure.add_subplot(projection="3d") if space else figure.add_subplot()
    pieces = _pieces(shown, world)
    scale = Normalize(*speed_range(shown))
    for number in [*(i for i in range(shown.agents) if i != chosen), *([chosen] if chosen >= 0 else [])]:
        segments, speed = pieces[number]
        _draw(axes, segments, speed, scale, len(segments) * shown.agents > MANY, number == chosen)
    ends = shown.position[-1]
    size = 14.0 if shown.agents <= 150 else 5.0
    dots: dict[str, Any] = {"depthshade": False} if space else {}
    axes.scatter(*ends, s=size, color=style.INK, linewidths=0.4, edgecolors="white", zorder=5, label="end", **dots)
    _draw_world(axes, world)
    if space:
        _in_space(axes, shown, world)
        style.overall(figure, name_of(recording), details_of(recording, shown))
    else:
        _from_above(axes, shown, world)
        style.heading(axes, name_of(recording), details_of(recording, shown))
    style.colour_bar(figure, _bar(scale), axes, "speed (m/s)", shrink=0.6 if space else 0.8, pad=0.1 if space else 0.02)
    return figure


def _chosen(recording: xr.Dataset, agents: int, agent: int | None) -> int:
    if agent is None:
        seed = int(recording.attrs.get("airflock_seed", 0))
        return int(np.random.default_rng(seed).integers(agents))
    if not 0 <= agent < agents:
        raise RecordingError(f"recording: has no agent {agent}; its agents are 0 to {agents - 1}")
    return agent


def _pieces(shown: Paths, world: arena.Parameters) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Of each agent: segments (segment, end, axis) in m and their mean speeds, m/s; none through a periodic face."""
    count = len(shown.times)
    stride = max(1, -(-(count - 1) * shown.agents // MOST))
    kept = np.unique(np.append(np.arange(0, count, stride), count - 1))
    where, speed = shown.position[kept], shown.speed[kept]
    found = []
    for number in range(shown.agents):
        line = where[:, :, number]
        segments, mean = np.stack([line[:-1], line[1:]], axis=1), 0.5 * (speed[:-1, number] + speed[1:, number])
        inside = ~through_face(segments, world)
        found.append((segments[inside], mean[inside]))
    return found


def _draw(axes: Any, segments: NDArray[Any], speed: NDArray[Any], scale: Normalize, pixels: bool, grey: bool) -> None:
    if not len(segments):
        return
    space = segments.shape[2] == 3
    kind: Any = LineCollection
    if space:
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        kind = Line3DCollection
    look: dict[str, Any] = {"linewidths": 0.7, "alpha": 0.85, "cmap": style.SPEED, "zorder": 2}
    if grey:
        axes.add_collection(kind(segments, colors="white", linewidths=3.6, zorder=3.0, capstyle="round", label="_halo"))
        look = {"linewidths": 2.0, "cmap": "gray", "zorder": 3.5, "capstyle": "round"}
    lines = kind(segments, norm=Normalize(scale.vmin, 1.3 * float(scale.vmax or 1.0)) if grey else scale, **look)
    lines.set_array(speed)
    lines.set_rasterized(pixels)
    axes.add_collection(lines)


def _bar(scale: Normalize) -> Any:
    from matplotlib.cm import ScalarMappable

    return ScalarMappable(scale, style.SPEED)


def _draw_world(axes: Any, world: arena.Parameters) -> None:
    for corners, obstacle in walls(world):
        color = style.RED if obstacle else style.BLUE
        if corners.shape[1] == 2 and obstacle:
            axes.fill(*corners.T, facecolor=color, alpha=0.25, edgecolor=color, linewidth=1.0, zorder=1)
        else:
            axes.plot(*corners.T, color=color, linewidth=1.2 if corners.shape[1] == 2 else 0.8, zorder=1)


def _from_above(axes: Any, shown: Paths, world: arena.Parameters) -> None:
    left, right, bottom, top = extent(shown, world, view_of(2))
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_aspect("equal")
    style.dress(axes, "east (m)", "north (m)", grid=False)


def _in_space(axes: Any, shown: Paths, world: arena.Parameters) -> None:
    points = np.concatenate([*(w.corners for w in walls(world)), shown.position.transpose(0, 2, 1).reshape(-1, 3)])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    span = np.maximum(high - low, 1.0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(span / span.max(), zoom=1.1)
    for name, text in (("x", "east (m)"), ("y", "north (m)"), ("z", "up (m)")):
        getattr(axes, f"set_{name}label")(text, fontsize=style.TEXT, color=style.INK)
        axis = getattr(axes, f"{name}axis")
        axis.pane.set_visible(False)
        axis.set_tick_params(labelsize=style.SMALL)
        axis._axinfo["grid"].update(color=style.PALE, linewidth=0.4)
    axes.zaxis.set_major_locator(_few_ticks())
    axes.view_init(elev=25.0, azim=-60.0)


def _few_ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4)
