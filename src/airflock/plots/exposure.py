"""Long-exposure picture: each agent a lamp before a dark sky, its light added up (Vásárhelyi et al. 2018, Fig. 5)."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from airflock.plots import style
from airflock.plots.flight import (
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
)
from airflock.plots.save import positive

Array = NDArray[Any]
WINDOW = 30.0  # s
PIXELS = 1400  # along the longer side
STEP = 0.7  # pixels between two flashes of a moving lamp
FAINT = "#9AA6BC"
CHUNK = 64  # frames whose light is spread at a time

# slow amber to fast blue-white, as lamps and stars are
LAMP = LinearSegmentedColormap.from_list("lamp", ["#FF5A1F", "#FFA23A", "#FFE3B0", "#BFE0FF", "#5FA8FF"], N=256)


def exposure(
    recording: xr.Dataset,
    *,
    start: float | None = None,
    stop: float | None = None,
    fading: float | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Light trails of all agents, brighter where they linger or meet, coloured by speed; 3-D recordings obliquely.

    recording   : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start, stop : window of time, s; by default the last 30 s
    fading      : time after which a trail has faded to 37 %, s; by default half the window
    ax          : axes to draw into, instead of a new figure
    The picture is that of Vásárhelyi et al. 2018, Fig. 5.

    Raises RecordingError for what is no recording, and for a window that holds none of it; AirflockError for a `fading`
    that is not above 0.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> recording = airflock.simulate(short)
    >>> airflock.plots.exposure(recording, stop=1.0).axes[0].get_aspect()
    1.0
    """
    shown = paths_of(recording, start, stop, last=WINDOW)
    world = world_of(recording)
    view = view_of(shown.position.shape[1])
    box = extent(shown, world, view, margin=0.05)
    length = float(shown.times[-1] - shown.times[0])
    tau = fading if fading is not None else max(0.5 * length, 1e-6)
    positive(fading=tau)
    x, y = view(shown.position)
    ways = np.stack([shown.position[:-1], shown.position[1:]], axis=2).transpose(
        0, 3, 2, 1
    )  # (frame, agent, end, axis)
    leaps = through_face(ways.reshape(-1, 2, ways.shape[3]), world).reshape(ways.shape[:2])
    picture = develop(light(shown, x, y, box, tau, leaps))
    figure, axes = _sky(picture) if ax is None else style.place(ax, 0.0, 0.0)
    axes.imshow(picture, extent=box, origin="lower", interpolation="lanczos", zorder=0)
    for corners, obstacle in walls(world):
        wx, wy = view(corners)
        axes.plot(wx, wy, color=style.RED if obstacle else "#5C7CA8", linewidth=0.7, alpha=0.8 if obstacle else 0.45)
    axes.set_axis_off()
    axes.set(xlim=box[:2], ylim=box[2:])
    words: dict[str, Any] = {"va": "top", "transform": axes.transAxes}
    axes.text(0.012, 0.985, name_of(recording), color="#E8ECF4", fontsize=style.TEXT, weight="bold", **words)
    axes.text(0.988, 0.985, details_of(recording, shown), color=FAINT, fontsize=style.SMALL, ha="right", **words)
    _ruler(axes, box)
    return figure


def _sky(picture: Array) -> tuple[Figure, Any]:
    """A figure that the picture fills."""
    width = 6.4
    figure = style.Picture(width, width * picture.shape[0] / picture.shape[1], style.NIGHT)
    figure.set_layout_engine("none")
    return figure, figure.add_axes((0.0, 0.0, 1.0, 1.0))


def light(
    shown: Paths,
    x: Array,
    y: Array,
    box: tuple[float, float, float, float],
    fading: float,
    leaps: Array | None = None,
) -> Array:
    """Light that falls on each pixel (row, column, colour): one unit per agent and second, faded since.

    leaps : (frame, agent), whether the way to the next frame leads through a periodic face and is dark
    x, y : positions in the picture (time, agent), m; box : its left, right, bottom, top, m; fading : s
    """
    left, right, bottom, top = box
    scale = PIXELS / max(right - left, top - bottom)
    rows, columns = max(2, round((top - bottom) * scale)), max(2, round((right - left) * scale))
    film = np.zeros((3, rows * columns))
    slow, fast = speed_range(shown)
    tint = (shown.speed - slow) / max(fast - slow, 1e-9)
    px, py = (x - left) * scale - 0.5, (y - bottom) * scale - 0.5
    last = len(shown.times) - 1
    if last == 0:
        px, py, tint = (np.repeat(a, 2, axis=0) for a in (px, py, tint))
        times, last = np.array([shown.times[0] - 1.0, shown.times[0]]), 1
    else:
        times = shown.times
    dark = np.zeros((last, x.shape[1]), bool) if leaps is None or len(leaps) != last else leaps
    moved = np.where(dark, 0.0, np.hypot(np.diff(px, axis=0), np.diff(py, axis=0)))
    flashes = int(np.clip(np.ceil(np.nanmax(moved, initial=0.0) / STEP), 1, 2000))
    share = (np.arange(flashes) + 0.5)[:, None, None] / flashes
    for a in range(0, last, CHUNK):
        b = min(a + CHUNK, last)
        fx, fy, ft = (v[a:b] + share * (v[a + 1 : b + 1] - v[a:b]) for v in (px, py, tint))
        gap = (times[a + 1 : b + 1] - times[a:b])[:, None]
        age = times[-1] - times[a:b, None] - share * gap
        weight = np.broadcast_to(np.exp(-age / fading) * gap / flashes, fx.shape)
        seen = np.isfinite(fx) & np.isfinite(fy) & ~dark[a:b]
        color = LAMP(np.nan_to_num(ft[seen]))[:, :3].T
        _spread(film, fx[seen], fy[seen], weight[seen] * color, rows, columns)
    return np.moveaxis(film.reshape(3, rows, columns), 0, -1)


def _spread(film: Array, x: Array, y: Array, colour: Array, rows: int, columns: int) -> None:
    """Add each flash to the four pixels around it."""
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    v, u = y - i, x - j
    for di, dj, part in ((0, 0, (1 - v) * (1 - u)), (0, 1, (1 - v) * u), (1, 0, v * (1 - u)), (1, 1, v * u)):
        r, c = i + di, j + dj
        inside = (r >= 0) & (r < rows) & (c >= 0) & (c < columns)
        cells = r[inside] * columns + c[inside]
        for band in range(3):
            film[band] += np.bincount(cells, (part * colour[band])[inside], minlength=rows * columns)


def develop(film: Array) -> Array:
    """Picture (row, column, colour), 0 to 1: glow around the trails, then a film's soft saturation."""
    near = gaussian_filter(film, (0.8, 0.8, 0.0))
    glow = gaussian_filter(film, (4.0, 4.0, 0.0)), gaussian_filter(film, (14.0, 14.0, 0.0))
    total = near + 0.9 * glow[0] + 0.8 * glow[1]
    lit = near.max(axis=2)
    bright = float(np.quantile(lit[lit > 1e-3 * lit.max()], 0.9)) if lit.max() > 0.0 else 1.0
    sky = np.array([0.020, 0.028, 0.050])
    return np.asarray(np.clip(sky + 1.0 - np.exp(-1.8 * total / bright), 0.0, 1.0))


def _ruler(axes: Any, box: tuple[float, float, float, float]) -> None:
    left, right, bottom, top = box
    span = 0.2 * (right - left)
    power = 10.0 ** np.floor(np.log10(span))
    length = float(max(k * power for k in (1, 2, 5) if k * power <= span))
    x, y = left + 0.02 * (right - left), bottom + 0.022 * (top - bottom)
    axes.plot([x, x + length], [y, y], color=FAINT, linewidth=1.2, solid_capstyle="butt")
    axes.text(x + length, y, f"  {length:g} m", color=FAINT, fontsize=style.SMALL, va="center")
