"""Paths through a scene, from above and in space: buildings, trees and meshes, the goals, and the flock's ways."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

from airflock.errors import RecordingError
from airflock.plots import style
from airflock.plots.scene import Paths, details_of, flown_with, name_of, paths_of, speed_range
from airflock.scenarios.scenario import Scenario
from airflock.world.shapes import BOX, CYLINDER, SEGMENT, TRIANGLE

MARGIN = 40.0  # m of scenery shown around the paths
MOST = 4000  # shapes drawn in space


def through(
    recording: xr.Dataset, *, start: float | None = None, stop: float | None = None, space: bool = False
) -> Figure:
    """Paths through what stands in the scene, coloured by speed; stars mark the goals.

    start, stop : window of time, s; by default the whole flight; space : in three dimensions instead of from above
    """
    scenario, shown = flown_with(recording), paths_of(recording, start, stop)
    if scenario is None:
        raise RecordingError("recording: tracks have no scene; plot its trajectories")
    if space and shown.position.shape[1] == 2:
        raise RecordingError("recording: was flown in a plane; look at it from above")
    figure = style.Picture(7.0, 6.0)
    axes: Any = figure.add_subplot(projection="3d") if space else figure.add_subplot()
    rows = nearby(scenario, shown)
    (_solid if space else ground_plans)(axes, rows)
    scale = Normalize(*speed_range(shown))
    _paths(axes, shown, scale, space)
    _frame(axes, rows, shown, space)
    points = _goals(scenario, space)
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    points = points[((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1)]
    if len(points):
        axes.scatter(*points.T, marker="*", s=90.0, color=style.ORANGE, edgecolors=style.INK, linewidths=0.5, zorder=6)
    from matplotlib.cm import ScalarMappable

    bar = ScalarMappable(scale, style.SPEED)
    style.colour_bar(figure, bar, axes, "speed (m/s)", shrink=0.6 if space else 0.8, pad=0.1 if space else 0.02)
    style.overall(figure, name_of(recording), details_of(recording, shown))
    return figure


def nearby(scenario: Scenario, shown: Paths) -> NDArray[np.float64]:
    """Rows of the shapes around the paths, without the ground."""
    shapes = scenario.stands().shapes
    flat = shown.position[:, :2].transpose(0, 2, 1).reshape(-1, 2)
    low, high = np.nanmin(flat, axis=0) - MARGIN, np.nanmax(flat, axis=0) + MARGIN
    inside = (shapes[:, 3:5] > low).all(axis=1) & (shapes[:, :2] < high).all(axis=1)
    return np.asarray(shapes[inside & np.isin(shapes[:, 6], (BOX, CYLINDER, SEGMENT, TRIANGLE))])


def _goals(scenario: Scenario, space: bool) -> NDArray[np.float64]:
    return np.asarray(scenario.waypoints()[:, : 3 if space else 2])


def ground_plans(axes: Any, rows: NDArray[np.float64]) -> None:
    """Ground plans; a higher solid is darker."""
    boxes, trunks = rows[rows[:, 6] == BOX], rows[rows[:, 6] == CYLINDER]
    patches: list[Any] = [Rectangle((r[0], r[1]), r[3] - r[0], r[4] - r[1]) for r in boxes]
    patches += [Circle((r[7], r[8]), r[9]) for r in trunks]
    if patches:
        height = np.minimum(np.concatenate([boxes[:, 5], trunks[:, 5]]), 1000.0)
        grey = Normalize(0.0, 1.6 * max(float(height.max()), 1.0))
        solid = PatchCollection(patches, cmap="Greys", norm=grey, edgecolors=style.GREY, linewidths=0.3, zorder=1)
        solid.set_array(height)
        axes.add_collection(solid)
    walls, faces = rows[rows[:, 6] == SEGMENT], rows[rows[:, 6] == TRIANGLE]
    lines = [outline_from_above(row) for row in (*walls, *faces)]
    if lines:
        axes.add_collection(LineCollection(lines, colors=style.GREY, linewidths=0.8, zorder=1))


def _solid(axes: Any, rows: NDArray[np.float64]) -> None:
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    lines = outlines_in_space(rows)
    if lines:
        axes.add_collection(Line3DCollection(lines, colors=style.GREY, linewidths=0.35, alpha=0.6))


def outlines_in_space(rows: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Edges of boxes and triangles, rims and four uprights of cylinders: lines (point, 3), m."""
    lines: list[NDArray[np.float64]] = []
    for r in rows[:MOST]:
        if r[6] == TRIANGLE:
            lines.append(r[[7, 8, 9, 10, 11, 12, 13, 14, 15, 7, 8, 9]].reshape(4, 3))
            continue
        low, high, ring = max(r[2], -100.0), min(r[5], 100.0), outline_from_above(r)
        lines += [np.column_stack([ring, np.full(len(ring), z)]) for z in (low, high)]
        lines += [np.array([[*p, low], [*p, high]]) for p in ring[:: 3 if r[6] == CYLINDER else 1]]
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


def scenery(recording: xr.Dataset, shown: Paths) -> list[NDArray[np.float64]]:
    """Outlines of what stands around the paths, as lines (point, axis) in m; none for tracks."""
    scenario = flown_with(recording)
    if scenario is None or scenario.scene.kind == "none":
        return []
    rows = nearby(scenario, shown)
    return outlines_in_space(rows) if shown.position.shape[1] == 3 else [outline_from_above(r) for r in rows]


def _paths(axes: Any, shown: Paths, scale: Normalize, space: bool) -> None:
    kind: Any = LineCollection
    if space:
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        kind = Line3DCollection
    dims = 3 if space else 2
    stride = max(1, len(shown.times) * shown.agents // 60_000)
    where, speed = shown.position[::stride, :dims], shown.speed[::stride]
    for agent in range(shown.agents):
        line = where[:, :, agent]
        pieces = kind(np.stack([line[:-1], line[1:]], axis=1), norm=scale, cmap=style.SPEED, linewidths=0.9, zorder=3)
        pieces.set_array(speed[:-1, agent])
        axes.add_collection(pieces)
    axes.scatter(*shown.position[-1, :dims], s=14.0, color=style.INK, edgecolors="white", linewidths=0.4, zorder=5)


def _frame(axes: Any, rows: NDArray[np.float64], shown: Paths, space: bool) -> None:
    points = shown.position.transpose(0, 2, 1).reshape(-1, shown.position.shape[1])
    low, high = np.nanmin(points, axis=0) - MARGIN, np.nanmax(points, axis=0) + MARGIN
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    if not space:
        axes.set_aspect("equal")
        style.dress(axes, "east (m)", "north (m)", grid=False)
        return
    top = max([float(high[2]) - MARGIN, *np.minimum(rows[:, 5], 100.0).tolist()])
    axes.set(zlim=(0.0, top), xlabel="east (m)", ylabel="north (m)", zlabel="up (m)")
    axes.set_box_aspect((high[0] - low[0], high[1] - low[1], top))
    axes.view_init(elev=35.0, azim=-60.0)
