"""Video of a flight, MP4 or GIF: agents as darts with short tails, arena, obstacles and a clock.

Frames are drawn one at a time and handed to ffmpeg at once, so that the length of a flight costs no memory.
"""

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from airflock.endings import VIDEOS
from airflock.errors import AirflockError
from airflock.plots import style
from airflock.plots.save import complete_or_absent, positive
from airflock.plots.scene import (
    Paths,
    details_of,
    extent,
    name_of,
    paths_of,
    speed_range,
    view_of,
    walls,
    window,
    world_of,
)  # fmt: skip
from airflock.plots.through import scenery

Array = NDArray[Any]
TAIL_POINTS = 9
DPI = 100.0 / 720.0  # dots per inch and pixel of height: text grows with the picture
# the outline of a dart that flies right, in units of its length
DART = np.array([[0.6, 0.0], [-0.4, 0.32], [-0.22, 0.0], [-0.4, -0.32]])
# GIF: a palette for each frame, because one for all would need all frames in memory
PALETTE = "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=none"


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
    done: Callable[[], None] | None = None,
) -> Path:
    """Write a video of a recording.

    Parameters
    ----------
    recording : xarray.Dataset
        Simulated or flown.
    path : str or path
        Ends in .mp4 or .gif.
    fps : float
        Pictures per second; `frame_count` says how many there will be.
    speed : float
        Times real time.
    start, stop : float, optional
        Window of time, s; by default all of it.
    tail : float
        Flight behind each agent that is drawn, s; 0 draws none.
    height : int
        Of the picture, pixels; its width follows from the arena; both are made even.
    done : callable, optional
        Called after each picture.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    PictureError
        When it cannot be written; then nothing is left behind.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> airflock.video(airflock.simulate(short), "flight.gif", fps=5, height=120).name
    'flight.gif'
    """
    instants = _instants(recording, fps, speed, start, stop)
    positive(height=height)
    with complete_or_absent(path, VIDEOS) as temporary:
        stage = Stage(recording, start, stop, tail=tail, height=height, speed=speed)
        film = _film(temporary, stage.size, fps)
        try:
            for number, instant in enumerate(instants):
                try:
                    film.send(stage.picture(float(instant)))
                except OSError as fault:  # a broken pipe: ffmpeg is gone and does not say why
                    raise RuntimeError(f"ffmpeg stopped after {number} pictures; is the disk full?") from fault
                if done is not None:
                    done()
        finally:
            film.close()
        _complete(temporary, len(instants))
    return Path(path)


def frame_count(
    recording: xr.Dataset,
    *,
    fps: float = 25.0,
    speed: float = 10.0,
    start: float | None = None,
    stop: float | None = None,
) -> int:
    """Number of pictures in such a video."""
    return len(_instants(recording, fps, speed, start, stop))


def _instants(recording: xr.Dataset, fps: float, speed: float, start: float | None, stop: float | None) -> Array:
    """Instants of the pictures, s."""
    positive(fps=fps, speed=speed)
    if fps > 240.0:
        raise AirflockError(f"fps = {fps:g} lies outside (0, 240] 1/s")
    times = recording["time"].values.astype(float)
    begin, end = window(times, start, stop)
    begin, end = max(begin, float(times[0])), min(end, float(times[-1]))
    count = max(1, math.floor((end - begin) * fps / speed + 1e-9) + 1)
    return begin + np.arange(count) * (speed / fps)


class Stage:
    """Everything that stands still, drawn once; and a picture of what moves at any instant."""

    def __init__(
        self, recording: xr.Dataset, start: float | None, stop: float | None, *, tail: float, height: int, speed: float
    ):
        first = paths_of(recording, start, stop)
        # what lies before the window is only needed for tails
        before = max(float(first.times[0]) - tail, float(recording["time"].values[0]))
        self.paths: Paths = paths_of(recording, before, stop)
        self.view = view_of(self.paths.position.shape[1])
        self.tail, self.speed = tail, speed
        world = world_of(recording)
        left, right, bottom, top = extent(first, world, self.view, margin=0.03)
        head = 0.085 * (top - bottom)  # for title and clock
        aspect = float(np.clip((right - left) / (top + head - bottom), 0.4, 3.0))
        self.size = (_even(height * aspect), _even(height))
        self.dart = 0.022 * max(right - left, top - bottom) * (1.0 if self.paths.agents <= 150 else 0.6)
        dots = DPI * self.size[1]
        figure = style.Picture((self.size[0] + 1e-3) / dots, (self.size[1] + 1e-3) / dots)
        figure.set_dpi(dots)
        figure.set_layout_engine("none")
        canvas: Any = FigureCanvasAgg(figure)
        self.canvas = canvas
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(left, right), ylim=(bottom, top + head), aspect="equal")
        axes.set_axis_off()
        for corners, obstacle in walls(world):
            x, y = self.view(corners)
            color = style.RED if obstacle else style.BLUE
            if obstacle and corners.shape[1] == 2:
                axes.fill(x, y, facecolor=color, alpha=0.25, edgecolor=color, linewidth=1.2)
            else:
                axes.plot(x, y, color=color, linewidth=1.4)
        around = [np.column_stack(self.view(line)) for line in scenery(recording, first)]
        axes.add_collection(LineCollection(around, colors=style.GREY, linewidths=0.6, alpha=0.6), autolim=False)
        words: dict[str, Any] = {"va": "top", "transform": axes.transAxes}
        large: dict[str, Any] = {"fontsize": 12, "color": style.INK}
        small: dict[str, Any] = {"fontsize": 9, "color": style.GREY}
        axes.text(0.02, 0.985, name_of(recording), weight="bold", **large, **words)
        axes.text(0.02, 0.948, details_of(recording), **small, **words)
        axes.text(0.98, 0.948, f"{speed:g} × real time", ha="right", **small, **words)
        mono: dict[str, Any] = {"family": "DejaVu Sans Mono", "animated": True}
        self.clock = axes.text(0.98, 0.985, "", ha="right", **mono, **large, **words)
        self.scale = Normalize(*speed_range(first))
        self.tails = LineCollection([], linewidths=1.6, animated=True, capstyle="butt")
        edge: dict[str, Any] = {"edgecolors": "white", "linewidths": 0.5}
        self.darts = PolyCollection([], cmap=style.SPEED, norm=self.scale, animated=True, **edge)
        axes.add_collection(self.tails, autolim=False)
        axes.add_collection(self.darts, autolim=False)
        self.axes = axes
        _key(axes, self.scale)
        canvas.draw()
        self.still = canvas.copy_from_bbox(figure.bbox)

    def picture(self, instant: float) -> Array:
        """Picture at an instant (s): (row, column, red green blue alpha), 8 bits each; valid until the next one."""
        x, y, _ = self._at(instant)
        x0, y0, tempo = self._at(instant, velocity=True)
        self.canvas.restore_region(self.still)
        self._set_tails(instant)
        self.darts.set_verts(list(_darts(x, y, x0, y0, self.dart)))
        self.darts.set_array(tempo)
        self.clock.set_text(f"{instant:7.1f} s")
        for artist in (self.tails, self.darts, self.clock):
            self.axes.draw_artist(artist)
        return np.asarray(self.canvas.buffer_rgba())

    def _at(self, instant: float, *, velocity: bool = False) -> tuple[Array, Array, Array]:
        """Positions in the picture (or velocities along it) of all agents, and their speeds, m/s."""
        values = _between(self.paths.times, self.paths.velocity if velocity else self.paths.position, instant)
        across, up = self.view(values, axis=0)
        return across, up, np.sqrt((values**2).sum(0)) if velocity else np.zeros(0)

    def _set_tails(self, instant: float) -> None:
        begin = max(instant - self.tail, float(self.paths.times[0]))
        if self.tail <= 0.0 or instant - begin < 1e-9:
            self.tails.set_segments([])
            return
        moments = np.linspace(begin, instant, TAIL_POINTS)
        past = np.stack([np.stack(self._at(float(m))[:2]) for m in moments])  # (moment, axis, agent)
        pieces = np.stack([past[:-1], past[1:]], axis=1)  # (moment, end, axis, agent)
        self.tails.set_segments(list(np.moveaxis(pieces, 3, 1).reshape(-1, 2, 2)))
        paces = np.stack([self._at(float(m), velocity=True)[2] for m in moments[1:]])
        colors = style.SPEED(self.scale(paces.ravel()))
        age = (moments[1:] - instant) / self.tail
        colors[:, 3] = np.repeat(np.clip(0.6 * (1.0 + age), 0.02, 1.0), past.shape[2])
        self.tails.set_color(colors)  # type: ignore[arg-type]


def _between(times: Array, values: Array, instant: float) -> Array:
    """Values (time, axis, agent) at an instant, linear between frames."""
    after = int(np.clip(np.searchsorted(times, instant), 1, max(len(times) - 1, 1)))
    if len(times) == 1:
        return np.asarray(values[0])
    share = float(np.clip((instant - times[after - 1]) / (times[after] - times[after - 1]), 0.0, 1.0))
    return np.asarray(values[after - 1] + share * (values[after] - values[after - 1]))


def _darts(x: Array, y: Array, along: Array, up: Array, length: float) -> Array:
    """Corners (agent, corner, axis) of darts at (x, y) that point along the velocities (along, up); all m, m/s."""
    pace = np.hypot(along, up)
    still = ~(pace > 1e-9)
    hx, hy = np.where(still, 1.0, along / np.maximum(pace, 1e-9)), np.where(still, 0.0, up / np.maximum(pace, 1e-9))
    ahead, side = length * DART[:, 0], length * DART[:, 1]
    cx = x[:, None] + hx[:, None] * ahead - hy[:, None] * side
    cy = y[:, None] + hy[:, None] * ahead + hx[:, None] * side
    return np.stack([cx, cy], axis=2)


def _key(axes: Any, scale: Normalize) -> None:
    """Small colour bar of speed in the second line of the head."""
    low, high = float(scale.vmin or 0.0), float(scale.vmax or 1.0)
    inset = axes.inset_axes((0.42, 0.929, 0.16, 0.014))
    inset.imshow(np.linspace(0.0, 1.0, 256)[None, :], cmap=style.SPEED, aspect="auto")
    inset.set_axis_off()
    words: dict[str, Any] = {"fontsize": 9, "color": style.GREY, "va": "center", "transform": inset.transAxes}
    inset.text(-0.04, 0.45, f"{low:g}", ha="right", **words)
    inset.text(1.04, 0.45, f"{high:g} m/s", ha="left", **words)


def _even(pixels: float) -> int:
    return 2 * max(16, round(pixels / 2.0))


def _film(path: Path, size: tuple[int, int], fps: float) -> Any:
    """A running ffmpeg that takes one picture at a time."""
    given: dict[str, Any] = {"fps": fps, "pix_fmt_in": "rgba", "macro_block_size": 1, "ffmpeg_log_level": "quiet"}
    if path.suffix.lower() == ".gif":
        given |= {"codec": "gif", "pix_fmt_out": "pal8", "output_params": ["-filter_complex", PALETTE], "quality": None}
    else:
        given |= {"codec": "libx264", "quality": 8, "output_params": ["-movflags", "+faststart", "-f", "mp4"]}
    film: Iterator[Any] = imageio_ffmpeg.write_frames(str(path), size, **given)
    next(film)
    return film


def _complete(path: Path, frames: int) -> None:
    """Raise unless the file holds what was handed over; ffmpeg itself says nothing about a full disk at the end."""
    try:
        found, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    except (RuntimeError, OSError) as fault:
        raise RuntimeError("ffmpeg wrote no complete video; is the disk full?") from fault
    if found != frames:
        raise RuntimeError(f"ffmpeg kept {found} of {frames} pictures; is the disk full?")
