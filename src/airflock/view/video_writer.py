"""Video of a flight, MP4 or GIF: agents as darts with short tails, arena, obstacles and a clock.

Frames are drawn one at a time and handed to ffmpeg at once, so that the length of a flight costs no
memory.
"""

import math
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from airflock.recordings import check_recording, over_time
from airflock.support import VIDEOS, AirflockError, RecordingError, expand_path, suggest
from airflock.view import style
from airflock.view.flight_paths import (  # fmt: skip
    FlightPaths,
    crosses_periodic_face,
    paths_in_window,
    picture_extent,
    projection,
    scenario_or_none,
    short_name,
    speed_range,
    time_window,
    title_details,
    world_or_open,
)
from airflock.view.style import PictureError, atomic_picture, check_positive
from airflock.view.trajectory_plots import (
    VIEW_ELEVATION_DEG,
    draw_outlines,
    draw_walls,
    outlines_in_space,
    scenery_lines,
    shapes_near_paths,
)
from airflock.world import half_sizes

Array = NDArray[Any]
POINTS_PER_TAIL = 9
DPI_PER_PIXEL = 100.0 / 720.0  # dots per inch and pixel of height: text grows with the picture
# the outline of a dart that flies right, in units of its length
DART_OUTLINE = np.array([[0.6, 0.0], [-0.4, 0.32], [-0.22, 0.0], [-0.4, -0.32]])
HEADER_HEIGHT = 0.085  # height of title and clock, in heights of what is below them
CHART_WIDTH = 0.62  # width of the chart beside the picture, in heights of it


class VideoFrame:
    """Still parts of a video, drawn once, and a method that draws the moving parts at any instant."""

    def __init__(
        self, recording: xr.Dataset, start: float | None, stop: float | None, *, tail: float, height: int, speed: float,
        space: bool | None = None, chart: str = "",
    ):  # fmt: skip
        first = paths_in_window(recording, start, stop)
        # what lies before the window is only needed for tails
        before = max(float(first.times[0]) - tail, float(recording["time"].values[0]))
        self.paths: FlightPaths = paths_in_window(recording, before, stop)
        self.flat = self.paths.position.shape[1] == 2
        self.is_oblique = not self.flat if space is None else space
        self.tail_seconds, self.speed = tail, speed
        self.world = world = world_or_open(recording)
        scenario = scenario_or_none(recording)
        rows = None  # of the scene, where it is seen obliquely
        self.view = projection(3 if self.is_oblique else 2)
        if self.is_oblique and not self.flat and scenario is not None and scenario.scene.kind != "none":
            rows = shapes_near_paths(scenario, first)
            self.view = projection(3, elevation_deg=VIEW_ELEVATION_DEG)
        around = [] if rows is None else outlines_in_space(rows)
        left, right, bottom, top = picture_extent(first, world, self.view, margin=0.03, around=around)
        head = HEADER_HEIGHT * (top - bottom)
        aspect = float(np.clip((right - left) / (top + head - bottom), 0.4, 3.0))
        # The chart widens the picture; the height, and with it the size of agents, stays.
        beside = CHART_WIDTH if chart else 0.0
        share = aspect / (aspect + beside)
        self.size = (to_even(height * (aspect + beside)), to_even(height))
        self.dart_length = 0.022 * max(right - left, top - bottom) * (1.0 if self.paths.agents <= 150 else 0.6)
        self.canvas = _canvas(self.size)
        self.axes = axes = self.canvas.figure.add_axes((0.0, 0.0, share, 1.0))
        axes.set(xlim=(left, right), ylim=(bottom, top + head), aspect="equal")
        axes.set_axis_off()
        draw_walls(axes, world, 1.4, self.view)
        if rows is not None:
            draw_outlines(axes, rows, self.view)
        else:
            lines = [np.column_stack(self.view(line)) for line in scenery_lines(recording, first)]
            axes.add_collection(LineCollection(lines, colors=style.GREY, linewidths=0.6, alpha=0.6), autolim=False)
        self.clock = _head(axes, recording, speed)
        self.scale = Normalize(*speed_range(first))
        self.tails = LineCollection([], linewidths=1.6, animated=True, capstyle="butt")
        edge: dict[str, Any] = {"edgecolors": "white", "linewidths": 0.5}
        self.darts = PolyCollection([], cmap=style.SPEED_COLOURS, norm=self.scale, animated=True, **edge)
        axes.add_collection(self.tails, autolim=False)
        axes.add_collection(self.darts, autolim=False)
        _key(axes, self.scale)
        self.chart_cursor = _chart(self.canvas.figure, recording, chart, share, first) if chart else None
        self.canvas.draw()
        # Blitting: axes, walls and text are drawn once; each frame restores these pixels and draws
        # what moves.
        self.still = self.canvas.copy_from_bbox(self.canvas.figure.bbox)

    def render(self, instant: float) -> Array:
        """Draw an instant (s): (row, column, red green blue alpha), 8 bits each; valid until the next call."""
        where = self._positions(instant)
        x, y = self.view(where, axis=0)
        x0, y0, tempo = self._velocities(instant)
        self.canvas.restore_region(self.still)
        self._set_tails(instant)
        self.darts.set_verts(list(_dart_corners(x, y, x0, y0, self.dart_length)))
        self.darts.set_array(tempo)
        self.clock.set_text(f"{instant:7.1f} s")
        for artist in (self.tails, self.darts, self.clock):
            self.axes.draw_artist(artist)
        if self.chart_cursor is not None:
            self.chart_cursor.set_xdata([instant, instant])
            self.chart_cursor.axes.draw_artist(self.chart_cursor)
        return np.asarray(self.canvas.buffer_rgba())

    def _positions(self, instant: float) -> Array:
        """Return positions of all agents (axis, agent), m; a step of more than half a period leads through a face."""
        axes = self.paths.position.shape[1]
        halves = np.array(half_sizes(self.world)[:axes]) if self.world.edges == "periodic" else None
        return _interpolated(self.paths.times, self.paths.position, instant, halves)

    def _velocities(self, instant: float) -> tuple[Array, Array, Array]:
        """Return velocities of all agents along the picture, and their speeds, m/s."""
        values = _interpolated(self.paths.times, self.paths.velocity, instant)
        return *self.view(values, axis=0), np.sqrt((values**2).sum(0))

    def _set_tails(self, instant: float) -> None:
        begin = max(instant - self.tail_seconds, float(self.paths.times[0]))
        if self.tail_seconds <= 0.0 or instant - begin < 1e-9:
            self.tails.set_segments([])
            return
        # Tails are resampled at equal times, so that they fade evenly whatever the period of the
        # recording.
        moments = np.linspace(begin, instant, POINTS_PER_TAIL)
        past = np.stack([self._positions(float(m)) for m in moments])  # (moment, axis, agent)
        pieces = np.stack([past[:-1], past[1:]], axis=1)  # (moment, end, axis, agent)
        ways = np.moveaxis(pieces, 3, 1).reshape(-1, 2, past.shape[1])
        kept = ~crosses_periodic_face(ways, self.world)
        self.tails.set_segments(list(np.stack(self.view(ways[kept], axis=2), axis=-1)))
        paces = np.stack([self._velocities(float(m))[2] for m in moments[1:]])
        colors = style.SPEED_COLOURS(self.scale(paces.ravel()))
        age = (moments[1:] - instant) / self.tail_seconds
        colors[:, 3] = np.repeat(np.clip(0.6 * (1.0 + age), 0.02, 1.0), past.shape[2])
        self.tails.set_color(colors[kept])


def _canvas(size: tuple[int, int]) -> Any:
    """Make a canvas of so many pixels (width, height), on a figure whose text grows with its height."""
    dots = DPI_PER_PIXEL * size[1]
    figure = style.NotebookFigure((size[0] + 1e-3) / dots, (size[1] + 1e-3) / dots)
    figure.set_dpi(dots)
    figure.set_layout_engine("none")
    canvas: Any = FigureCanvasAgg(figure)
    return canvas


def _head(axes: Any, recording: xr.Dataset, speed: float) -> Any:
    """Draw title and details above the picture; return the clock, which is drawn with the moving parts."""
    words: dict[str, Any] = {"va": "top", "transform": axes.transAxes}
    large: dict[str, Any] = {"fontsize": 12, "color": style.INK}
    small: dict[str, Any] = {"fontsize": 9, "color": style.GREY}
    axes.text(0.02, 0.985, short_name(recording), weight="bold", **large, **words)
    axes.text(0.02, 0.948, title_details(recording), **small, **words)
    axes.text(0.98, 0.948, f"{speed:g} × real time", ha="right", **small, **words)
    mono: dict[str, Any] = {"family": "DejaVu Sans Mono", "animated": True}
    return axes.text(0.98, 0.985, "", ha="right", **mono, **large, **words)


def check_chart(chart: str, known_charts: Sequence[str], owner: str) -> None:
    """Raise RecordingError for a chart of an order parameter that a flight does not have, also before the flight."""
    if chart and chart not in known_charts:
        hint = suggest(chart, known_charts, lead="; ")
        raise RecordingError(f"chart = {chart!r} is none that {owner} has: {', '.join(known_charts)}{hint}")


def _chart(figure: Any, recording: xr.Dataset, name: str, share: float, first: FlightPaths) -> Any:
    """Draw an order parameter over time beside the picture; return the line that moves."""
    course = over_time(recording)
    check_chart(name, list(course.columns), "this recording")
    values = course[name].dropna()
    values = values.loc[first.times[0] - 1e-9 : first.times[-1] + 1e-9]
    axes = figure.add_axes((share + 0.3 * (1.0 - share), 0.14, 0.62 * (1.0 - share), 0.7))
    axes.plot(values.index, values, color=style.BLUE, linewidth=1.0)
    style.style_axes(axes, "time (s)", name)
    return axes.axvline(float(first.times[0]), color=style.RED, linewidth=1.0, animated=True)


def _interpolated(times: Array, values: Array, instant: float, period: Array | None = None) -> Array:
    """Interpolate values (time, axis, agent) linearly between frames; at a jump take the nearer frame's."""
    after = int(np.clip(np.searchsorted(times, instant), 1, max(len(times) - 1, 1)))
    if len(times) == 1:
        return np.asarray(values[0])
    share = float(np.clip((instant - times[after - 1]) / (times[after] - times[after - 1]), 0.0, 1.0))
    step = values[after] - values[after - 1]
    if period is not None:
        # An agent that leaves through a periodic face must not be drawn on a line across the whole
        # world.
        through = (np.abs(step) > period[:, None]).any(axis=0)
        near = values[after if share >= 0.5 else after - 1]
        return np.asarray(np.where(through, near, values[after - 1] + share * step))
    return np.asarray(values[after - 1] + share * step)


def _dart_corners(x: Array, y: Array, along: Array, up: Array, length: float) -> Array:
    """Return corners (agent, corner, axis) of darts at (x, y) along the velocities (along, up); all m, m/s."""
    pace = np.hypot(along, up)
    still = ~(pace > 1e-9)
    # An agent at rest has no heading; it points east instead of dividing by zero.
    hx, hy = np.where(still, 1.0, along / np.maximum(pace, 1e-9)), np.where(still, 0.0, up / np.maximum(pace, 1e-9))
    ahead, side = length * DART_OUTLINE[:, 0], length * DART_OUTLINE[:, 1]
    cx = x[:, None] + hx[:, None] * ahead - hy[:, None] * side
    cy = y[:, None] + hy[:, None] * ahead + hx[:, None] * side
    return np.stack([cx, cy], axis=2)


def _key(axes: Any, scale: Normalize) -> None:
    """Draw a small colour bar of speed in the second line of the head."""
    low, high = float(scale.vmin or 0.0), float(scale.vmax or 1.0)
    inset = axes.inset_axes((0.42, 0.929, 0.16, 0.014))
    inset.imshow(np.linspace(0.0, 1.0, 256)[None, :], cmap=style.SPEED_COLOURS, aspect="auto")
    inset.set_axis_off()
    words: dict[str, Any] = {"fontsize": 9, "color": style.GREY, "va": "center", "transform": inset.transAxes}
    inset.text(-0.04, 0.45, f"{low:g}", ha="right", **words)
    inset.text(1.04, 0.45, f"{high:g} m/s", ha="left", **words)


def to_even(pixels: float) -> int:
    """Return the nearest even number of pixels, which encoders need."""
    return 2 * max(16, round(pixels / 2.0))


# GIF: a palette for each frame, because one for all would need all frames in memory
GIF_PALETTE_FILTER = "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=none"


def video(
    recording: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    fps: float = 25.0,
    speed: float = 10.0,
    start: float | None = None,
    stop: float | None = None,
    tail: float = 4.0,
    height: int = 720,
    space: bool | None = None,
    chart: str = "",
    done: Callable[[], None] | None = None,
) -> Path:
    """Write a video of a recording.

    Parameters
    ----------
    recording : xarray.Dataset
        (time, space, keypoint, individual), simulated or flown: position m, velocity m/s.
    path : str or path
        Ends in .mp4 or .gif.
    fps : float in [1, 120]
        Pictures per second; `frame_count` says how many there will be.
    speed : float in [0.01, 1000]
        Speed of the picture, times real time.
    start : float, optional
        First instant shown, s; by default the first.
    stop : float, optional
        Last instant shown, s; by default the end.
    tail : float
        Flight behind each agent that is drawn, s; 0 draws none.
    height : int
        Height of the picture, pixels; its width follows from the arena; both are made even.
    space : bool, optional
        View at an angle, or from above; by default as it was flown.
    chart : str (NAME)
        Show this order parameter over time beside the picture.
    done : callable, optional
        Called after each picture.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    AirflockError
        For what is no recording, an empty window, or numbers that are not above 0.
    PictureError
        When it cannot be written, then nothing is left behind; or without imageio-ffmpeg
        (`pip install 'airflock[video]'`).

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> airflock.video(airflock.simulate(short), "flight.gif", fps=5, height=120).name
    'flight.gif'
    """
    instants = _frame_times(recording, fps, speed, start, stop)
    check_positive(height=height)
    import_ffmpeg()
    with atomic_picture(path, VIDEOS) as temporary:
        stage = VideoFrame(recording, start, stop, tail=tail, height=height, speed=speed, space=space, chart=chart)
        film = _film(temporary, stage.size, fps)
        try:
            for number, instant in enumerate(instants):
                try:
                    film.send(stage.render(float(instant)))
                except OSError as error:  # a broken pipe: ffmpeg is gone and does not say why
                    raise RuntimeError(f"ffmpeg stopped after {number} pictures; is the disk full?") from error
                if done is not None:
                    done()
        finally:
            film.close()
        _complete(temporary, len(instants))
    return expand_path(path)


def import_ffmpeg() -> Any:
    """Import the package imageio_ffmpeg, which brings an ffmpeg; raise PictureError with an install hint."""
    try:
        import imageio_ffmpeg
    except ModuleNotFoundError as error:
        raise PictureError(
            "videos need imageio-ffmpeg: pip install 'airflock[video]'; airflock replay makes a page without it"
        ) from error
    return imageio_ffmpeg


def frame_count(
    recording: xr.Dataset,
    *,
    fps: float = 25.0,
    speed: float = 10.0,
    start: float | None = None,
    stop: float | None = None,
) -> int:
    """Return the number of frames of such a video."""
    return len(_frame_times(recording, fps, speed, start, stop))


def _frame_times(recording: xr.Dataset, fps: float, speed: float, start: float | None, stop: float | None) -> Array:
    """Return the instants of the frames, s."""
    check_positive(fps=fps, speed=speed)
    if fps > 240.0:
        raise AirflockError(f"fps = {fps:g} lies outside (0, 240] 1/s")
    check_recording(recording)
    times = recording["time"].values.astype(float)
    begin, end = time_window(times, start, stop)
    begin, end = max(begin, float(times[0])), min(end, float(times[-1]))
    # 1e-9: a window of a whole number of frames keeps its last one in spite of rounding.
    count = max(1, math.floor((end - begin) * fps / speed + 1e-9) + 1)
    return begin + np.arange(count) * (speed / fps)


def _film(path: Path, size: tuple[int, int], fps: float) -> Any:
    """Start an ffmpeg that takes one frame at a time."""
    options: dict[str, Any] = {"fps": fps, "pix_fmt_in": "rgba", "macro_block_size": 1, "ffmpeg_log_level": "quiet"}
    if path.suffix.lower() == ".gif":
        options |= {
            "codec": "gif",
            "pix_fmt_out": "pal8",
            "output_params": ["-filter_complex", GIF_PALETTE_FILTER],
            "quality": None,
        }
    else:
        options |= {"codec": "libx264", "quality": 8, "output_params": ["-movflags", "+faststart", "-f", "mp4"]}
    film: Iterator[Any] = import_ffmpeg().write_frames(str(path), size, **options)
    next(film)
    return film


def _complete(path: Path, frames: int) -> None:
    """Raise unless the file holds every frame; ffmpeg itself reports nothing when the disk is full at the end."""
    try:
        count, _ = import_ffmpeg().count_frames_and_secs(str(path))
    except (RuntimeError, OSError) as error:
        raise RuntimeError("ffmpeg wrote no complete video; is the disk full?") from error
    if count != frames:
        raise RuntimeError(f"ffmpeg kept {count} of {frames} pictures; is the disk full?")
