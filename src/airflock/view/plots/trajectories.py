"""Trajectories of a flock, coloured by speed (Vásárhelyi et al. 2018, Fig. 4)."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from airflock.recordings import axis_names
from airflock.support import AirflockError, RecordingError, shortened
from airflock.view.plots import style
from airflock.view.plots.flight import (
    FlightPaths,
    crosses_periodic_face,
    paths_in_window,
    picture_extent,
    projection,
    scenario_or_none,
    short_name,
    speed_range,
    title_details,
    wall_lines,
    world_or_open,
)  # fmt: skip
from airflock.view.plots.scene_paths import through
from airflock.world import arena

MAX_SECONDS = 60.0  # s; longer paths cover each other
MAX_SEGMENTS = 200_000  # segments; beyond, frames are skipped so that a picture stays quick to draw
MAX_CROSSINGS = 150.0  # how often all paths together would cross the picture at most
EQUAL_SPEED_SHARE = 0.02  # share of their speed by which agents that fly equally fast may differ
COLOUR_CHOICES = ("auto", "speed", "heading", "agent")
MAX_VECTOR_SEGMENTS = 20_000  # segments; beyond, vector formats hold them as pixels


def trajectories(
    recording: xr.Dataset,
    *,
    start: float | None = None,
    stop: float | None = None,
    agent: int | None = None,
    highlight: bool = True,
    colour: str = "auto",
    ax: Axes | None = None,
) -> Figure:
    """Paths from above, or in space for a 3-D recording; dots mark where agents are at the end.

    Where a city, forest or mesh stands, the paths through it, from above. The picture is that of
    Vásárhelyi et al. 2018, Fig. 4.

    recording   : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start, stop : window of time, s; by default the last 60 s, or fewer where so many paths would cover each other
    agent       : number of the agent highlighted in grey scale; by default one drawn at random, the same for a seed
    highlight   : False highlights none
    colour      : speed, heading (in the plane) or agent; auto: speed, unless all fly equally fast
    ax          : axes to draw into, in space with projection="3d", instead of a new figure

    Raises RecordingError for what is no recording, and for a window that holds none of it, or without such an agent;
    AirflockError for an unknown colour.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> recording = airflock.simulate(short)
    >>> airflock.plots.trajectories(recording, agent=2).axes[0].get_aspect()
    1.0
    """
    if colour not in COLOUR_CHOICES:
        raise AirflockError(f"colour = {colour!r} is none of {', '.join(COLOUR_CHOICES)}")
    scenario = scenario_or_none(recording)
    if scenario is not None and scenario.scene.kind != "none":
        return through(recording, start=start, stop=stop, ax=ax)
    shown = paths_in_window(recording, start, stop, last=MAX_SECONDS)
    if start is None:
        shown = paths_in_window(recording, None, stop, last=_legible_seconds(shown))
    world = world_or_open(recording)
    chosen = _highlighted_agent(recording, shown.agents, agent) if highlight else -1
    space = shown.position.shape[1] == 3
    if space and ax is None:
        figure: Figure = style.NotebookFigure(6.8, 4.6)
        axes: Any = figure.add_subplot(projection="3d")
    else:
        figure, axes = style.figure_and_axes(ax, 6.4, 5.6)
    way = _most_telling_colour(shown) if colour == "auto" else colour
    scale, cmap, values = _colour_values(shown, way)
    pieces = _agent_segments(shown, world, values, 0.5 if way == "speed" else 0.0)  # headings have no mean of this kind
    for number in [*(i for i in range(shown.agents) if i != chosen), *([chosen] if chosen >= 0 else [])]:
        segments, tone = pieces[number]
        pixels = len(segments) * shown.agents > MAX_VECTOR_SEGMENTS
        _draw(axes, segments, tone, scale, cmap, pixels, number == chosen)
    ends = shown.position[-1]
    size = 14.0 if shown.agents <= 150 else 5.0
    dots: dict[str, Any] = {"depthshade": False} if space else {}
    axes.scatter(*ends, s=size, color=style.INK, linewidths=0.4, edgecolors="white", zorder=5, label="end", **dots)
    _draw_world(axes, world)
    labels = axis_names(recording)
    if space:
        _in_space(axes, shown, world, labels)
    else:
        _from_above(axes, shown, world, labels)
    said = title_details(recording, shown) + (" · each agent in its own colour" if way == "agent" else "")
    said += " · dots: at the end" + (f" · thick: {_agent_label(recording, chosen)}" if chosen >= 0 else "")
    if space and ax is None:
        style.set_figure_title(figure, short_name(recording), said)
    else:
        style.set_title(axes, short_name(recording), said)
    if way != "agent":
        bar = style.add_colour_bar(
            figure, ScalarMappable(scale, cmap), axes, "heading" if way == "heading" else "speed (m/s)",
            shrink=0.6 if space else 0.8, pad=0.1 if space else 0.02,
        )  # fmt: skip
        if way == "heading":
            right, up, _ = labels
            turn = ["east", "north", "west", "south"]
            if right != "east":
                turn = [f"+{right}", f"+{up}", f"−{right}", f"−{up}"]
            bar.set_ticks([0.0, 90.0, 180.0, 270.0, 360.0], labels=[*turn, turn[0]])
    return figure


def _legible_seconds(paths: FlightPaths) -> float:
    """Window of time in which all paths together are not so long that they cover each other, s."""
    known = paths.speed[np.isfinite(paths.speed)]  # of one frame of tracks there is none
    length = float(known.mean()) * paths.agents if known.size else 0.0
    extent = float(np.max(np.nanmax(paths.position, axis=(0, 2)) - np.nanmin(paths.position, axis=(0, 2))))
    window = MAX_CROSSINGS * extent / max(length, 1e-12)
    return MAX_SECONDS if window >= MAX_SECONDS else float(f"{max(window, 1e-9):.1g}")


def _most_telling_colour(paths: FlightPaths) -> str:
    """What colours say most: speed, or where all fly equally fast the heading; in space who it is."""
    speed = paths.speed[np.isfinite(paths.speed)]
    low, high = np.quantile(speed, (0.05, 0.95)) if speed.size else (0.0, 0.0)
    if high - low > EQUAL_SPEED_SHARE * max(float(high), 1e-12):
        return "speed"
    return "heading" if paths.position.shape[1] == 2 else "agent"


def _colour_values(paths: FlightPaths, colouring: str) -> tuple[Normalize, Any, NDArray[Any]]:
    """Scale and colours, and the value of each agent at each frame (time, agent)."""
    if colouring == "heading":
        angle = np.degrees(np.arctan2(paths.velocity[:, 1], paths.velocity[:, 0])) % 360.0
        return Normalize(0.0, 360.0), style.COMPASS_COLOURS, angle
    if colouring == "agent":
        share = np.arange(paths.agents) * 0.6180339887 % 1.0
        return Normalize(0.0, 1.0), style.COMPASS_COLOURS, np.broadcast_to(share, paths.speed.shape)
    return Normalize(*speed_range(paths)), style.SPEED_COLOURS, paths.speed


def _highlighted_agent(recording: xr.Dataset, agents: int, agent: int | None) -> int:
    if agent is None:
        seed = int(recording.attrs.get("airflock_seed", 0))
        return int(np.random.default_rng(seed).integers(agents))
    if not 0 <= agent < agents:
        raise RecordingError(f"recording: has no agent {agent}; its agents are 0 to {agents - 1}")
    return agent


def _agent_segments(
    paths: FlightPaths, world: arena.Parameters, values: NDArray[Any], middle: float
) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Of each agent: segments (segment, end, axis) in m, and the value on them; none through a periodic face.

    values : (time, agent); middle : 0.5 for the value half-way, 0 for that at the beginning
    """
    count = len(paths.times)
    stride = max(1, -(-(count - 1) * paths.agents // MAX_SEGMENTS))
    kept = np.unique(np.append(np.arange(0, count, stride), count - 1))
    where, speed = paths.position[kept], values[kept]
    step = np.diff(speed, axis=0)
    found = []
    for number in range(paths.agents):
        line = where[:, :, number]
        segments, mean = np.stack([line[:-1], line[1:]], axis=1), speed[:-1, number] + middle * step[:, number]
        inside = ~crosses_periodic_face(segments, world)
        found.append((segments[inside], mean[inside]))
    return found


def _draw(
    axes: Any,
    segments: NDArray[Any],
    values: NDArray[Any],
    scale: Normalize,
    cmap: Any,
    pixels: bool,
    is_highlighted: bool,
) -> None:
    if not len(segments):
        return
    kind: Any = LineCollection
    if segments.shape[2] == 3:
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        kind = Line3DCollection
    look: dict[str, Any] = {"linewidths": 0.7, "alpha": 0.85, "cmap": cmap, "zorder": 2, "norm": scale}
    if is_highlighted:
        axes.add_collection(kind(segments, colors="white", linewidths=3.6, zorder=3.0, capstyle="round", label="_halo"))
        dark = Normalize(scale.vmin, 1.3 * float(scale.vmax or 1.0))
        look = {"linewidths": 2.0, "cmap": "gray", "zorder": 3.5, "capstyle": "round", "norm": dark}
        values = values if cmap is style.SPEED_COLOURS else np.full(len(segments), scale.vmin)
    lines = kind(segments, **look)
    lines.set_array(values)
    lines.set_rasterized(pixels)
    axes.add_collection(lines)


def _draw_world(axes: Any, world: arena.Parameters) -> None:
    for corners, obstacle in wall_lines(world):
        color = style.RED if obstacle else style.BLUE
        if corners.shape[1] == 2 and obstacle:
            axes.fill(*corners.T, facecolor=color, alpha=0.25, edgecolor=color, linewidth=1.0, zorder=1)
        else:
            axes.plot(*corners.T, color=color, linewidth=1.2 if corners.shape[1] == 2 else 0.8, zorder=1)


def _agent_label(recording: xr.Dataset, agent: int) -> str:
    """What a picture calls an agent: its number in a flight, its name of tracks."""
    name = str(recording["individual"].values[agent]) if "individual" in recording.coords else str(agent)
    if name == f"agent_{agent}":
        return f"agent {agent}"
    return f"individual {name}" if name.isdigit() else shortened(name, 30)


def _from_above(axes: Any, paths: FlightPaths, world: arena.Parameters, labels: tuple[str, str, str]) -> None:
    left, right, bottom, top = picture_extent(paths, world, projection(2))
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_aspect("equal")
    style.style_axes(axes, f"{labels[0]} (m)", f"{labels[1]} (m)", grid=False)


def _in_space(axes: Any, paths: FlightPaths, world: arena.Parameters, labels: tuple[str, str, str]) -> None:
    points = np.concatenate([*(w.corners for w in wall_lines(world)), paths.position.transpose(0, 2, 1).reshape(-1, 3)])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    span = np.maximum(high - low, 1.0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(span / span.max(), zoom=1.1)
    for name, text in zip("xyz", labels, strict=True):
        getattr(axes, f"set_{name}label")(f"{text} (m)", fontsize=style.TEXT_SIZE, color=style.INK)
        axis = getattr(axes, f"{name}axis")
        axis.pane.set_visible(False)
        axis.set_tick_params(labelsize=style.SMALL_SIZE)
        axis._axinfo["grid"].update(color=style.PALE_GREY, linewidth=0.4)
    axes.zaxis.set_major_locator(_sparse_locator())
    axes.view_init(elev=25.0, azim=-60.0)


def _sparse_locator() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4)
