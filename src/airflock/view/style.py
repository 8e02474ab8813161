"""Look of all figures: colours that colour-blind readers can separate, quiet axes, informative titles; and their
files.

Everything is set on the figure at hand; global settings of Matplotlib are neither read on purpose
nor changed, but for the two of files while one is written (`save`).
"""

import io
import os
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from airflock.support import PICTURES, AirflockError, RecordingError, atomic_path, expand_path, suffix_error
from airflock.view.agent_colours import WHEEL_STOPS

# Okabe & Ito, "Color universal design" (2008)
BLUE, GREEN, RED, ORANGE, SKY, PURPLE = "#0072B2", "#009E73", "#D55E00", "#E69F00", "#56B4E9", "#CC79A7"
INK, GREY, PALE_GREY = "#222222", "#666666", "#D9D9D9"
NIGHT_SKY = "#05070D"
LINE_COLOURS = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY)

# slow to fast; even in lightness like viridis, without the yellow that vanishes on white paper
SPEED_COLOURS = LinearSegmentedColormap.from_list(
    "speed", ["#2B1155", "#3B3C8F", "#2F6C9E", "#23938C", "#3FB76A", "#9CCB3B"], N=256
)
COMPASS_COLOURS = LinearSegmentedColormap.from_list("compass", np.vstack([WHEEL_STOPS, WHEEL_STOPS[:1]]) / 255.0, N=256)
TEXT_SIZE, SMALL_SIZE, TITLE_SIZE = 9.0, 8.0, 11.0  # points
PIXEL_RESOLUTION = 200  # dots per inch of pixel formats


class NotebookFigure(Figure):
    """Figure with a canvas of its own, which notebooks show without pyplot."""

    def __init__(self, width: float, height: float, background: str = "white"):
        """Make a figure of a size in inches."""
        super().__init__(figsize=(width, height), facecolor=background, layout="compressed", dpi=PIXEL_RESOLUTION)
        FigureCanvasAgg(self)

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=110, bbox_inches="tight", pad_inches=0.08)
        return stream.getvalue()


def figure_and_axes(ax: Axes | None, width: float, height: float, layout: str = "") -> tuple[Figure, Any]:
    """Return the axes and their figure; without axes, make a new figure of a size in inches."""
    if ax is not None:
        return ax.get_figure(root=True), ax  # type: ignore[return-value]
    figure = NotebookFigure(width, height)
    if layout:
        figure.set_layout_engine(layout)  # type: ignore[arg-type]
    return figure, figure.add_subplot()


def figure_and_panels(
    ax: Axes | None, rows: int, columns: int, width: float, height: float, *, background: str = "white",
    layout: str = "constrained", **shared: Any,
) -> tuple[Figure, Any]:  # fmt: skip
    """Return a figure of several panels and its axes (row, column): new, of a size in inches, or in the place of ax.

    The latter is a SubFigure, which draws like any; `root_figure` gives the figure that it is a
    part of.
    shared : sharex, sharey, height_ratios, as `Figure.subplots` takes them
    Raises AirflockError for axes that stand in no grid, so that nothing says where their place is.
    """
    if ax is None:
        figure: Any = NotebookFigure(width, height, background)
        if layout:
            figure.set_layout_engine(layout)
    else:
        spot = ax.get_subplotspec()
        if spot is None:
            raise AirflockError("ax: this picture has panels of its own; give axes of a grid, as figure.subplots makes")
        ax.axis("off")
        figure = ax.get_figure().add_subfigure(spot)  # type: ignore[union-attr]
        figure.set_facecolor(background)
    return figure, figure.subplots(rows, columns, squeeze=False, **shared)


def root_figure(figure: Figure) -> Figure:
    """Return the whole figure that a picture is drawn in."""
    return figure.get_figure(root=True)


def style_axes(axes: Axes, x: str = "", y: str = "", *, grid: bool = True, legend: bool = False) -> None:
    """Set labels with units, thin grey spines, a faint grid behind the data, and a legend where it hides least."""
    axes.set_xlabel(x, fontsize=TEXT_SIZE, color=INK)
    axes.set_ylabel(y, fontsize=TEXT_SIZE, color=INK)
    axes.tick_params(labelsize=SMALL_SIZE, color=GREY, labelcolor=INK, length=3, width=0.6)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(GREY)
        spine.set_linewidth(0.6)
    axes.set_axisbelow(True)
    if grid:
        axes.grid(True, color=PALE_GREY, linewidth=0.5, alpha=0.7)
    if legend:
        add_legend(axes)


def add_right_axis(axes: Axes, label: str, color: str) -> Axes:
    """Add a second vertical axis on the right, in the colour of its data."""
    other = axes.twinx()
    style_axes(other, y=label, grid=False)
    other.yaxis.label.set_color(color)
    other.tick_params(axis="y", labelcolor=color)
    other.spines["left"].set_visible(False)
    other.spines["bottom"].set_visible(False)
    other.spines["right"].set_visible(True)
    return other


def set_title(axes: Axes, title: str, details: str = "") -> None:
    """Set the title at the upper left: the subject in bold, details in grey below it."""
    lift = 18.0 if details else 6.0
    axes.set_title(title, loc="left", fontsize=TITLE_SIZE, fontweight="bold", color=INK, pad=lift, parse_math=False)
    if details:
        place: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
        axes.annotate(details, (0.0, 1.0), (0.0, 6.0), fontsize=SMALL_SIZE, color=GREY, **place)


def set_panel_letter(axes: Axes, name: str) -> None:
    """Write the letter of a panel at its upper left, as journals print it."""
    axes.set_title(name, loc="left", fontsize=TEXT_SIZE, fontweight="bold", color=INK, pad=6.0)


def set_figure_title(figure: Figure, heading: str, details: str = "") -> Figure:
    """Set the title of several panels: the subject in bold, details behind it; both may hold any character.

    Returns the whole figure that the panels are drawn in.
    """
    look: dict[str, Any] = {"fontsize": TEXT_SIZE + 0.5, "color": INK, "parse_math": False}
    title = figure.suptitle(heading, x=0.01, ha="left", fontweight="bold", **look)
    if details:
        behind = Annotation(details, (1.0, 0.0), (10.0, 0.0), title, "offset points", va="bottom", **look)
        figure.add_artist(behind)
    return root_figure(figure)


def add_legend(axes: Axes, handles: Iterable[Any] | None = None, columns: int = 4, *, above: bool = False) -> None:
    """Add a legend without a frame; above the axes, or where it hides least."""
    entries = list(handles) if handles is not None else axes.get_legend_handles_labels()[0]
    if not entries:
        return
    look: dict[str, Any] = {"loc": "best"}
    if above:
        look = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "ncols": columns, "columnspacing": 1.2}
        look["borderaxespad"] = 0.2
    axes.legend(handles=entries, frameon=False, fontsize=SMALL_SIZE, handlelength=1.6, **look)


def add_colour_bar(
    figure: Figure,
    shown: Any,
    axes: Axes | list[Axes],
    label: str,
    *,
    shrink: float = 0.8,
    pad: float = 0.02,
) -> Colorbar:
    """Add a colour bar beside axes, without a frame."""
    bar = figure.colorbar(shown, ax=axes, shrink=shrink, aspect=32, pad=pad)
    bar.set_label(label, fontsize=TEXT_SIZE, color=INK)
    bar.ax.tick_params(labelsize=SMALL_SIZE, labelcolor=INK, color=INK, length=2.5, width=0.6)
    bar.outline.set_visible(False)
    return bar


# no dates: the same figure gives the same file
UNDATED_METADATA: dict[str, dict[str, Any]] = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
# TrueType, because many publishers refuse the Type 3 fonts that are Matplotlib's default; and ids
# in .svg that do not differ from time to time. Both can be said only to all of Matplotlib.
FILE_SETTINGS: Any = {"pdf.fonttype": 42, "svg.hashsalt": "airflock"}
_settings_lock = threading.Lock()


class PictureError(RecordingError):
    """A figure or a video cannot be written: names the file and the reason."""


def save_figure(figure: Figure, path: str | os.PathLike[str], *, resolution: float = 200.0) -> Path:
    """Write a figure as .png, .pdf or .svg.

    path       : of the picture; its ending says of which kind it is
    resolution : dots per inch of .png, and of what is drawn as pixels within the others

    Raises PictureError where it cannot be written; then nothing is left behind.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> recording = airflock.simulate(short)
    >>> airflock.plots.save_figure(airflock.plots.trajectories(recording), "flight.png").name
    'flight.png'
    """
    with atomic_picture(path, PICTURES) as temporary, print_settings():
        ending, content = temporary.suffix.lower(), io.BytesIO()
        figure.savefig(  # in memory: the writer of .pdf breaks in its own ways where a disk is full
            content, format=ending[1:], dpi=resolution, metadata=UNDATED_METADATA.get(ending, {}),
            facecolor=figure.get_facecolor(), bbox_inches="tight", pad_inches=0.08,
        )  # fmt: skip
        temporary.write_bytes(content.getvalue())  # no buffer of it: Python 3.12 crashes where an error holds one
    return expand_path(path)


@contextmanager
def print_settings() -> Iterator[None]:
    """Set Matplotlib so that files embed their fonts, as publishers want, and are identical at each run.

    One thread at a time: the settings are those of all of Matplotlib, and are put back as they
    were.
    """
    with _settings_lock, rc_context(FILE_SETTINGS):
        yield


@contextmanager
def atomic_picture(path: str | os.PathLike[str], suffixes: tuple[str, ...]) -> Iterator[Path]:
    """Yield a temporary path to write to, renamed at the end; report every error in one line."""
    target = expand_path(path)
    error = suffix_error(target, suffixes)
    if error:
        raise PictureError(error)
    if target.is_dir():
        raise PictureError(f"{target}: is a folder; give a file name")
    try:
        with atomic_path(target) as temporary:
            yield temporary
    except (OSError, RuntimeError) as wrong:
        # Matplotlib and ffmpeg raise with several lines; the first one names the cause.
        reason = getattr(wrong, "strerror", None) or (str(wrong).splitlines() or [type(wrong).__name__])[0]
        raise PictureError(f"{target}: cannot be written: {reason}; nothing was saved") from wrong


def check_positive(**numbers: float) -> None:
    """Raise an AirflockError that names the first number that is not above zero."""
    for name, number in numbers.items():
        if not number > 0.0:
            raise AirflockError(f"{name} = {number:g} must be above 0")
