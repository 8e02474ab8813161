"""Paths through a scene, from above and in space: buildings, trees and meshes, the goals, and the flock's ways."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PatchCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

from airflock.scenarios import Scenario
from airflock.support import RecordingError
from airflock.view.plots import style
from airflock.view.plots.flight import (
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
    wall_lines,
)  # fmt: skip
from airflock.world import BOX, CYLINDER, SEGMENT, TRIANGLE

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
    """Paths through what stands in the scene, coloured by speed; stars mark the goals.

    recording   : (time, space, keypoint, individual), flown among buildings, trees or boxes, m and m/s
    start, stop : window of time, s; by default the whole flight
    space       : outlines seen obliquely from above, instead of ground plans
    ax          : axes to draw into, instead of a new figure

    Raises RecordingError for tracks, which have no scene, for a flight in a plane, and for an empty window.

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
        draw_in_space(axes, scenario, shown, scale, goals)
    else:
        rows = shapes_near_paths(scenario, shown)
        heights = draw_ground_plans(axes, rows)
        _paths(axes, shown, scale)
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


def draw_in_space(axes: Any, scenario: Scenario, paths: FlightPaths, scale: Normalize, goals: NDArray[Any]) -> None:
    """Draw outlines of the scene, paths, goals and a scale of three axes, obliquely from above."""
    view, rows = projection(3, elevation_deg=VIEW_ELEVATION_DEG), shapes_near_paths(scenario, paths)
    box = picture_extent(paths, scenario.world, view, margin=0.02, around=outlines_in_space(rows))
    for wall in wall_lines(scenario.world):
        axes.plot(*view(wall.corners), color=style.RED if wall.obstacle else style.BLUE, linewidth=0.8, zorder=1)
    draw_outlines(axes, rows, view)
    stride = max(1, len(paths.times) * paths.agents // 60_000)
    where, speed = paths.position[::stride], paths.speed[::stride]
    pieces = np.stack([where[:-1], where[1:]], axis=1).transpose(0, 3, 1, 2).reshape(-1, 2, 3)
    pace = (0.5 * (speed[:-1] + speed[1:])).ravel()
    kept = np.isfinite(pieces).all(axis=(1, 2)) & ~crosses_periodic_face(pieces, scenario.world)
    flat = np.stack(view(pieces[kept], axis=2), axis=-1)
    lines = LineCollection(list(flat), norm=scale, cmap=style.SPEED_COLOURS, linewidths=0.9, zorder=3)
    lines.set_array(pace[kept])
    axes.add_collection(lines)
    ends = np.stack(view(paths.position[-1].T), axis=-1)
    axes.scatter(*ends.T, s=14.0, color=style.INK, edgecolors="white", linewidths=0.4, zorder=5, label="at the end")
    _draw_goals(axes, np.stack(view(goals), axis=-1))
    _triad(axes, view, box)
    axes.set(xlim=box[:2], ylim=box[2:], aspect="equal")
    axes.set_axis_off()


def _draw_goals(axes: Any, points: NDArray[Any]) -> None:
    """Goals."""
    if len(points):
        look: dict[str, Any] = {"s": 90.0, "color": style.ORANGE, "edgecolors": style.INK, "linewidths": 0.5}
        axes.scatter(*points.T, marker="*", zorder=6, label="goal", **look)


def _triad(axes: Any, view: Projection, box: tuple[float, float, float, float]) -> None:
    """Arrows of a round length to the east, north and up, at the lower left."""
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
    """Rows of the shapes around the paths, without the ground."""
    shapes = scenario.stands().shapes
    low, high = _around(paths)
    inside = (shapes[:, 3:5] > low).all(axis=1) & (shapes[:, :2] < high).all(axis=1)
    return np.asarray(shapes[inside & np.isin(shapes[:, 6], (BOX, CYLINDER, SEGMENT, TRIANGLE))])


def draw_ground_plans(axes: Any, rows: NDArray[np.float64]) -> PatchCollection | None:
    """Ground plans; a higher solid is darker. Returns what a colour bar of heights (m) needs, where there are any."""
    solid = None
    boxes, trunks = rows[rows[:, 6] == BOX], rows[rows[:, 6] == CYLINDER]
    patches: list[Any] = [Rectangle((r[0], r[1]), r[3] - r[0], r[4] - r[1]) for r in boxes]
    patches += [Circle((r[7], r[8]), r[9]) for r in trunks]
    if patches:
        height = np.minimum(np.concatenate([boxes[:, 5], trunks[:, 5]]), 1000.0)
        grey = Normalize(0.0, max(float(height.max()), 1.0))
        solid = PatchCollection(
            patches, cmap=HEIGHT_COLOURS, norm=grey, edgecolors=style.GREY, linewidths=0.3, zorder=1
        )
        solid.set_array(height)
        axes.add_collection(solid)
    walls, faces = rows[rows[:, 6] == SEGMENT], rows[rows[:, 6] == TRIANGLE]
    lines = [outline_from_above(row) for row in (*walls, *faces)]
    if lines:
        axes.add_collection(LineCollection(lines, colors=style.GREY, linewidths=0.8, zorder=1))
    return solid


def draw_outlines(axes: Any, rows: NDArray[np.float64], view: Projection) -> None:
    """Draw outlines of shapes in space, and pale roofs: without them front edges are easily taken for back ones."""
    lines = [np.column_stack(view(line)) for line in outlines_in_space(rows)]
    axes.add_collection(LineCollection(lines, colors=style.GREY, linewidths=0.5, alpha=0.7, zorder=1), autolim=False)
    upright = rows[np.isin(rows[:, 6], (BOX, CYLINDER))]
    rings = [(outline_from_above(row), row[5]) for row in upright[:MAX_SHAPES]]
    roofs = [np.column_stack(view(np.column_stack([ring, np.full(len(ring), top)]))) for ring, top in rings]
    axes.add_collection(PolyCollection(roofs, facecolors=style.PALE_GREY, alpha=0.6, zorder=1), autolim=False)


def outlines_in_space(rows: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return edges of boxes and triangles, rims and four uprights of cylinders, as lines (point, 3) in m.

    Segments are left out: they are the plans of the world's own walls, which `walls` gives with their heights.
    """
    lines: list[NDArray[np.float64]] = []
    for r in rows[rows[:, 6] != SEGMENT][:MAX_SHAPES]:
        if r[6] == TRIANGLE:
            lines.append(r[[7, 8, 9, 10, 11, 12, 13, 14, 15, 7, 8, 9]].reshape(4, 3))
            continue
        ring = outline_from_above(r)
        lines += [np.column_stack([ring, np.full(len(ring), z)]) for z in (r[2], r[5])]
        lines += [np.array([[*p, r[2]], [*p, r[5]]]) for p in ring[: -1 : 3 if r[6] == CYLINDER else 1]]
    return lines


def outline_from_above(row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ground plan of a shape as a line (point, 2), m."""
    if row[6] == CYLINDER:
        turn = np.linspace(0.0, 2.0 * np.pi, 13)
        return np.column_stack([row[7] + row[9] * np.cos(turn), row[8] + row[9] * np.sin(turn)])
    if row[6] == SEGMENT:
        return np.asarray(row[7:11].reshape(2, 2))
    if row[6] == TRIANGLE:
        return np.asarray(row[[7, 8, 10, 11, 13, 14, 7, 8]].reshape(4, 2))
    return np.array([[row[0], row[1]], [row[3], row[1]], [row[3], row[4]], [row[0], row[4]], [row[0], row[1]]])


def scenery_lines(recording: xr.Dataset, paths: FlightPaths) -> list[NDArray[np.float64]]:
    """Outlines of what stands around the paths, as lines (point, axis) in m; none for tracks."""
    scenario = scenario_or_none(recording)
    if scenario is None or scenario.scene.kind == "none":
        return []
    rows = shapes_near_paths(scenario, paths)
    return outlines_in_space(rows) if paths.position.shape[1] == 3 else [outline_from_above(r) for r in rows]


def _paths(axes: Any, paths: FlightPaths, scale: Normalize) -> None:
    stride = max(1, len(paths.times) * paths.agents // 60_000)
    where, speed = paths.position[::stride, :2], paths.speed[::stride]
    for agent in range(paths.agents):
        line = where[:, :, agent]
        segments = np.stack([line[:-1], line[1:]], axis=1)
        pieces = LineCollection(list(segments), norm=scale, cmap=style.SPEED_COLOURS, linewidths=0.9, zorder=3)
        pieces.set_array(speed[:-1, agent])
        axes.add_collection(pieces)
    look: dict[str, Any] = {"s": 14.0, "color": style.INK, "edgecolors": "white", "linewidths": 0.4}
    axes.scatter(*paths.position[-1, :2], zorder=5, label="at the end", **look)
