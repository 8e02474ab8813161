"""Plots of paths: in the plane, in space, among buildings, and the rays of one agent."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PatchCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from airflock.core import HeardNeighbour, State
from airflock.recordings import axis_names
from airflock.scenarios import FlightWorld, GoalCourse, Scenario
from airflock.support import AirflockError, RecordingError, shortened
from airflock.view import style
from airflock.view.flight_paths import (  # fmt: skip
    FlightPaths,
    Projection,
    crosses_periodic_face,
    paths_in_window,
    picture_extent,
    projection,
    scenario_or_none,
    short_name,
    speed_range,
    title_details,
    world_or_open,  # fmt: skip
)
from airflock.view.law_vectors import CastRay, rays_and_command
from airflock.view.scene import wall_lines
from airflock.world import BOX, CYLINDER, SEGMENT, SHAPES, SPHERE, TRIANGLE, arena

SCENERY_MARGIN = 40.0  # m of scenery shown around the paths
MAX_SHAPES = 4000  # shapes drawn in space
VIEW_ELEVATION_DEG = 42.0  # deg; from which a city is seen
HEIGHT_COLOURS = LinearSegmentedColormap.from_list("height", ["#F2F2F2", "#8A8A8A"], N=256)


def through(
    recording: xr.Dataset,
    *,
    start: float | None = None,
    stop: float | None = None,
    space: bool = False,
    ax: Axes | None = None,
) -> Figure:
    """Plot paths through the scene, coloured by speed; stars mark the goals.

    recording   : (time, space, keypoint, individual), flown among buildings, trees or boxes, m and m/s
    start, stop : window of time, s; by default the whole flight
    space       : outlines seen obliquely from above, instead of ground plans
    ax          : axes to draw into, instead of a new figure

    Raises RecordingError for tracks, which have no scene, for a flight in a plane, and for an empty
    window.

    Examples
    --------
    >>> import airflock
    >>> city = airflock.simulate(airflock.load("kidger/city", {"agents": 4, "duration": 2.0}))
    >>> airflock.plots.through(city).axes[0].get_xlabel()
    'east (m)'
    """
    scenario, shown = scenario_or_none(recording), paths_in_window(recording, start, stop)
    if scenario is None:
        raise RecordingError("recording: tracks have no scene; plot its trajectories")
    if space and shown.position.shape[1] == 2:
        raise RecordingError("recording: was flown in a plane; draw it from above")
    figure, axes = style.figure_and_axes(ax, 7.4, 5.4 if space else 6.0)
    scale = Normalize(*speed_range(shown))
    low, high = _around(shown)
    goals = scenario.waypoints()
    goals = goals[((goals[:, :2] >= low) & (goals[:, :2] <= high)).all(axis=1)]
    if space:
        view, rows = projection(3, elevation_deg=VIEW_ELEVATION_DEG), shapes_near_paths(scenario, shown)
        box = picture_extent(shown, scenario.world, view, margin=0.02, around=outlines_in_space(rows))
        draw_walls(axes, scenario.world, 0.8, view)
        draw_outlines(axes, rows, view)
        _draw_paths(axes, shown, scenario.world, scale, view)
        _draw_goals(axes, np.stack(view(goals), axis=-1))
        _triad(axes, view, box)
        axes.set(xlim=box[:2], ylim=box[2:], aspect="equal")
        axes.set_axis_off()
    else:
        heights = draw_ground_plans(axes, shapes_near_paths(scenario, shown))
        _draw_paths(axes, shown, scenario.world, scale, projection(2))
        _draw_goals(axes, goals[:, :2])
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        style.style_axes(axes, "east (m)", "north (m)", grid=False)
        if heights is not None and shown.position.shape[1] == 3:
            style.add_colour_bar(figure, heights, axes, "height of the scene (m)", shrink=0.8)
    bar = ScalarMappable(scale, style.SPEED_COLOURS)
    style.add_colour_bar(figure, bar, axes, "speed (m/s)", shrink=0.6 if space else 0.8)
    style.add_legend(axes, above=True)
    style.set_title(axes, short_name(recording), title_details(recording, shown))
    return figure


def _draw_goals(axes: Any, points: NDArray[Any]) -> None:
    """Draw the goals."""
    if len(points):
        look: dict[str, Any] = {"s": 90.0, "color": style.ORANGE, "edgecolors": style.INK, "linewidths": 0.5}
        axes.scatter(*points.T, marker="*", zorder=6, label="goal", **look)


def _triad(axes: Any, view: Projection, box: tuple[float, float, float, float]) -> None:
    """Draw arrows of a round length to the east, north and up, at the lower left."""
    left, right, bottom, top = box
    span = 0.16 * (right - left)
    power = 10.0 ** np.floor(np.log10(span))
    length = float(max(k * power for k in (1, 2, 5) if k * power <= span))
    tips = np.stack(view(np.eye(3) * length), axis=-1)
    corner = np.array([left + 0.02 * (right - left), bottom + 0.02 * (top - bottom)])
    foot = corner - np.minimum(tips.min(axis=0), 0.0)
    for tip, name in zip(tips, ("east", "north", "up"), strict=True):
        axes.annotate(
            "",
            foot + tip,
            foot,
            arrowprops={"arrowstyle": "-|>", "color": style.GREY, "lw": 0.9, "shrinkA": 0, "shrinkB": 0},
        )
        axes.annotate(name, foot + 1.08 * tip, fontsize=style.SMALL_SIZE, color=style.GREY, ha="center", va="center")
    below = [foot[0], corner[1] - 0.035 * (top - bottom)]  # of all arrows: one may point down
    axes.annotate(f"{length:g} m", below, fontsize=style.SMALL_SIZE, color=style.GREY)


def _around(shown: FlightPaths) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the lower and the upper corner (2,) of the ground plan that is shown around the paths, m."""
    plan = shown.position[:, :2]
    return np.nanmin(plan, axis=(0, 2)) - SCENERY_MARGIN, np.nanmax(plan, axis=(0, 2)) + SCENERY_MARGIN


def shapes_near_paths(scenario: Scenario, paths: FlightPaths) -> NDArray[np.float64]:
    """Return rows of the shapes around the paths, without the ground."""
    shapes = scenario.stands().shapes
    low, high = _around(paths)
    inside = (shapes[:, 3:5] > low).all(axis=1) & (shapes[:, :2] < high).all(axis=1)
    return np.asarray(shapes[inside & np.isin(shapes[:, 6], [*SHAPES])])


def draw_ground_plans(axes: Any, rows: NDArray[np.float64]) -> PatchCollection | None:
    """Draw ground plans, higher solids darker. Return the mappable of a colour bar of heights (m), or None."""
    solid = None
    boxes, trunks, balls = (rows[rows[:, 6] == kind] for kind in (BOX, CYLINDER, SPHERE))
    patches: list[Any] = [Rectangle((r[0], r[1]), r[3] - r[0], r[4] - r[1]) for r in boxes]
    patches += [Circle((r[7], r[8]), r[9]) for r in trunks] + [Circle((r[7], r[8]), r[10]) for r in balls]
    if patches:
        # Infinite shapes would take the whole range of greys.
        height = np.minimum(np.concatenate([boxes[:, 5], trunks[:, 5], balls[:, 5]]), 1000.0)
        grey = Normalize(0.0, max(float(height.max()), 1.0))
        solid = PatchCollection(
            patches, cmap=HEIGHT_COLOURS, norm=grey, edgecolors=style.GREY, linewidths=0.3, zorder=1
        )
        solid.set_array(height)
        axes.add_collection(solid)
    walls, faces = rows[rows[:, 6] == SEGMENT], rows[rows[:, 6] == TRIANGLE]
    lines = [SHAPES[row[6]].plan(row) for row in (*walls, *faces)]
    if lines:
        axes.add_collection(LineCollection(lines, colors=style.GREY, linewidths=0.8, zorder=1))
    return solid


def draw_outlines(axes: Any, rows: NDArray[np.float64], view: Projection) -> None:
    """Draw outlines of shapes in space, and pale roofs: without them front edges are easily taken for back ones."""
    lines = [np.column_stack(view(line)) for line in outlines_in_space(rows)]
    axes.add_collection(LineCollection(lines, colors=style.GREY, linewidths=0.5, alpha=0.7, zorder=1), autolim=False)
    upright = rows[np.isin(rows[:, 6], (BOX, CYLINDER))]
    rings = [(SHAPES[row[6]].plan(row), row[5]) for row in upright[:MAX_SHAPES]]
    roofs = [np.column_stack(view(np.column_stack([ring, np.full(len(ring), top)]))) for ring, top in rings]
    axes.add_collection(PolyCollection(roofs, facecolors=style.PALE_GREY, alpha=0.6, zorder=1), autolim=False)


def outlines_in_space(rows: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return edges of shapes, as lines (point, 3) in m."""
    drawn = rows[rows[:, 6] != SEGMENT][:MAX_SHAPES]
    return [line for row in drawn for line in SHAPES[row[6]].lines(row)]


def scenery_lines(recording: xr.Dataset, paths: FlightPaths) -> list[NDArray[np.float64]]:
    """Return outlines of the solids around the paths, as lines (point, axis) in m; none for tracks."""
    scenario = scenario_or_none(recording)
    if scenario is None or scenario.scene.kind == "none":
        return []
    rows = shapes_near_paths(scenario, paths)
    return outlines_in_space(rows) if paths.position.shape[1] == 3 else [SHAPES[r[6]].plan(r) for r in rows]


def _draw_paths(axes: Any, paths: FlightPaths, world: arena.Parameters, scale: Normalize, view: Projection) -> None:
    """Draw all paths, coloured by speed, and where they end."""
    segments, speed = map(np.concatenate, zip(*_agent_segments(paths, world, paths.speed, 0.5), strict=True))
    flat = np.stack(view(segments, axis=2), axis=-1)
    lines = LineCollection(list(flat), norm=scale, cmap=style.SPEED_COLOURS, linewidths=0.9, zorder=3)
    lines.set_array(speed)
    axes.add_collection(lines)
    look: dict[str, Any] = {"s": 14.0, "color": style.INK, "edgecolors": "white", "linewidths": 0.4}
    axes.scatter(*view(paths.position[-1], axis=0), zorder=5, label="at the end", **look)


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
    """Plot paths from above, or in space for a 3-D recording; dots mark where agents are at the end.

    Where a city, forest or mesh stands, the paths through it, from above. The picture is that of
    Vásárhelyi et al. 2018, Fig. 4.

    recording   : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start, stop : window of time, s; by default the last 60 s, or fewer where so many paths would cover each other
    agent       : number of the agent highlighted in grey scale; by default one drawn at random, the same for a seed
    highlight   : False highlights none
    colour      : speed, heading (in the plane) or agent; auto: speed, unless all fly equally fast
    ax          : axes to draw into, in space with projection="3d", instead of a new figure

    Raises RecordingError for what is no recording, and for a window that holds none of it, or
    without such an agent; AirflockError for an unknown colour.

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
    draw_walls(axes, world, 0.8 if space else 1.2)
    labels = axis_names(recording)
    if space:
        _in_space(axes, shown, world, labels)
    else:
        _from_above(axes, shown, world, labels)
    details = title_details(recording, shown) + (" · each agent in its own colour" if way == "agent" else "")
    details += " · dots: at the end" + (f" · thick: {_agent_label(recording, chosen)}" if chosen >= 0 else "")
    if space and ax is None:
        style.set_figure_title(figure, short_name(recording), details)
    else:
        style.set_title(axes, short_name(recording), details)
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
    """Return the window of time in which the paths are short enough not to cover each other, s."""
    known = paths.speed[np.isfinite(paths.speed)]  # of one frame of tracks there is none
    length = float(known.mean()) * paths.agents if known.size else 0.0
    extent = float(np.max(np.nanmax(paths.position, axis=(0, 2)) - np.nanmin(paths.position, axis=(0, 2))))
    # All paths together may cross the picture so many times before they hide each other.
    window = MAX_CROSSINGS * extent / max(length, 1e-12)
    return MAX_SECONDS if window >= MAX_SECONDS else float(f"{max(window, 1e-9):.1g}")


def _most_telling_colour(paths: FlightPaths) -> str:
    """Choose the colouring: speed, or heading where all fly equally fast; in space the agent."""
    speed = paths.speed[np.isfinite(paths.speed)]
    # Quantiles: one agent that starts late must not decide the colouring.
    low, high = np.quantile(speed, (0.05, 0.95)) if speed.size else (0.0, 0.0)
    if high - low > EQUAL_SPEED_SHARE * max(float(high), 1e-12):
        return "speed"
    return "heading" if paths.position.shape[1] == 2 else "agent"


def _colour_values(paths: FlightPaths, colouring: str) -> tuple[Normalize, Any, NDArray[Any]]:
    """Return scale and colours, and the value of each agent at each frame (time, agent)."""
    if colouring == "heading":
        angle = np.degrees(np.arctan2(paths.velocity[:, 1], paths.velocity[:, 0])) % 360.0
        return Normalize(0.0, 360.0), style.COMPASS_COLOURS, angle
    if colouring == "agent":
        # Golden ratio: neighbouring numbers get hues far apart.
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
    """Return segments (segment, end, axis), m, of each agent and their values; none through a periodic face.

    values : (time, agent); middle : 0.5 for the value half-way, 0 for that at the beginning
    """
    count = len(paths.times)
    stride = max(1, -(-(count - 1) * paths.agents // MAX_SEGMENTS))
    # The last frame is always kept: the dots at the end lie on it.
    kept = np.unique(np.append(np.arange(0, count, stride), count - 1))
    where, speed = paths.position[kept], values[kept]
    step = np.diff(speed, axis=0)
    per_agent = []
    for number in range(paths.agents):
        line = where[:, :, number]
        segments, mean = np.stack([line[:-1], line[1:]], axis=1), speed[:-1, number] + middle * step[:, number]
        inside = ~crosses_periodic_face(segments, world)
        per_agent.append((segments[inside], mean[inside]))
    return per_agent


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
        # A white halo and a grey ramp make the chosen path readable on top of all colours.
        dark = Normalize(scale.vmin, 1.3 * float(scale.vmax or 1.0))
        look = {"linewidths": 2.0, "cmap": "gray", "zorder": 3.5, "capstyle": "round", "norm": dark}
        values = values if cmap is style.SPEED_COLOURS else np.full(len(segments), scale.vmin)
    lines = kind(segments, **look)
    lines.set_array(values)
    lines.set_rasterized(pixels)
    axes.add_collection(lines)


def draw_walls(axes: Any, world: arena.Parameters, width: float, view: Projection | None = None) -> None:
    """Draw the lines of arena and obstacles, `width` points wide; in the plane obstacles are filled."""
    for corners, obstacle in wall_lines(world):
        color, points = style.RED if obstacle else style.BLUE, corners.T if view is None else view(corners)
        if corners.shape[1] == 2 and obstacle:
            axes.fill(*points, facecolor=color, alpha=0.25, edgecolor=color, linewidth=width - 0.2, zorder=1)
        else:
            axes.plot(*points, color=color, linewidth=width, zorder=1)


def _agent_label(recording: xr.Dataset, agent: int) -> str:
    """Return the label of an agent: its number in a flight, its name in tracks."""
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
    axes.zaxis.set_major_locator(MaxNLocator(4))
    axes.view_init(elev=25.0, azim=-60.0)


def rays_at_frame(recording: xr.Dataset, agent: int, frame: int) -> tuple[list[CastRay], tuple[float, float, float]]:
    """Return the rays that an agent cast at a frame of its recording, and the command (m/s) that it decided on."""
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
    """Plot the rays of one agent from above: red where they hit, green the first free one, black the flown command.

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
    cast, command = rays_at_frame(recording, agent, frame)
    scenario, shown = scenario_or_none(recording), paths_in_window(recording)
    assert scenario is not None
    x, y = (float(c) for c in shown.position[frame, :2, agent])
    reach = 1.3 * max(ray.length for ray in cast)
    figure, axes = style.figure_and_axes(ax, 6.0, 5.6)
    draw_ground_plans(axes, shapes_near_paths(scenario, shown))
    lines = [[(x, y), (x + ray.free * ray.x, y + ray.free * ray.y)] for ray in cast]
    colours = [style.GREEN if ray.free >= ray.length else style.RED for ray in cast]
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
    words = f"agent {agent} at {times[frame]:.4g} s · {len(cast)} rays cast"
    style.set_title(axes, short_name(recording), f"{words} · {title_details(recording)}")
    return figure
