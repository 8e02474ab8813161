"""Order parameters over time (Vásárhelyi et al. 2018, Figs 3 and 4 D)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.recordings import over_time, recorded_faults, scenario_of_recording
from airflock.support import AirflockError, RecordingError
from airflock.view.plots import style
from airflock.view.plots.flight import scenario_or_none, short_name, time_window, title_details

CORRELATION_LABEL, VELOCITY_LABEL, ROTATION_LABEL = (
    r"$\phi^{\mathrm{corr}}$",
    r"$\phi^{\mathrm{vel}}/v^{\mathrm{flock}}$",
    r"$\phi^{\mathrm{LAP}}$",
)
MIN_RELATIVE_SPREAD = 1e-3  # share of its value by which a steady value differs
WALL_METRICS = ("out", "outside")  # courses that say nothing where there are none
MAX_NAMED_FAULTS = 8  # faults that are named where they begin; more are lines only
WINDOW_SHARE = 200.0  # of a course that is shown, its smoothing window
NEAREST_LABEL, NEAREST_MEAN_LABEL = r"min $r_{ij}^{\mathrm{min}}$", r"mean $r_{ij}^{\mathrm{min}}$"


def series(
    recording: xr.Dataset,
    *,
    start: float | None = None,
    stop: float | None = None,
    smooth: float | None = None,
    settings: Mapping[str, Any] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Correlation, speed in units of v_flock, nearest neighbours (m) and rotation at every instant.

    recording   : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start, stop : window of time, s; by default the whole flight
    smooth      : means over so many seconds, s (of the nearest pair the least value), told in the title; 0 draws
                  instants alone, by default a two-hundredth of what is shown
    settings    : keys such as {"metrics.r_cluster": 60.0} that replace those the recording was flown with
    ax          : axes of a grid, whose place the panels take, instead of a new figure
    The picture is that of Vásárhelyi et al. 2018, Fig. 3.

    Raises RecordingError for what is no recording, and for a window that holds none of it, ScenarioError for settings
    that its scenario does not take, and AirflockError for an `ax` that is none of a grid or a `smooth` below 0.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> recording = airflock.simulate(short)
    >>> len(airflock.plots.series(recording).axes)
    3
    """
    course = _in_window(over_time(recording, settings), start, stop)
    if "flocked" in course:
        from airflock.view.plots.flocked import flocked

        return flocked(recording, start=start, stop=stop, smooth=smooth, settings=settings, ax=ax)
    if not {"phi_corr", "phi_vel", "phi_lap"} <= set(course):
        return _each(recording, course, smooth, ax)
    v_flock = scenario_of_recording(recording, settings).resolved_metrics().v_flock or 1.0
    figure, panels = style.figure_and_panels(ax, 2, 1, 7.0, 4.2, sharex=True, height_ratios=(2.0, 1.0))
    upper, lower = panels[:, 0]
    pen = SmoothedLines(course, smooth)
    handles = pen.draw(upper, course["phi_corr"], style.BLUE, CORRELATION_LABEL)
    handles += pen.draw(upper, course["phi_vel"] / v_flock, style.GREEN, VELOCITY_LABEL)
    style.style_axes(upper, y=f"{CORRELATION_LABEL},  {VELOCITY_LABEL}   (1)")
    highest = float(max(1.0, (course["phi_vel"] / v_flock).max()))
    upper.set_ylim(min(0.0, float(course["phi_corr"].min())) - 0.02, 1.05 * highest)
    if recording.sizes["individual"] > 1:
        right = style.add_right_axis(upper, "nearest neighbour (m)", style.RED)
        handles += pen.draw(right, course["r_min_mean"], style.RED, NEAREST_MEAN_LABEL)
        handles += pen.draw(right, course["r_min"], style.ORANGE, NEAREST_LABEL, least=True)
        right.set_ylim(0.0, 1.35 * float(course["r_min_mean"].max()))
    style.add_legend(upper, handles, columns=4, above=True)
    _rotation(lower, course, style.PURPLE, ROTATION_LABEL, pen)
    _mark_faults(recording, course, upper, lower)
    lower.set_xlim(float(course.index[0]), float(course.index[-1]) if len(course) > 1 else None)
    style.set_figure_title(figure, short_name(recording), f"{title_details(recording)}{pen.told}")
    return style.root_figure(figure)


def _mark_faults(recording: xr.Dataset, course: pd.DataFrame, upper: Axes, lower: Axes) -> None:
    """A line where each fault begins, with its kind and agent where there are few."""
    shown = [told for told in recorded_faults(recording) if course.index[0] <= told["begin"] <= course.index[-1]]
    for told in shown:
        for axes in (upper, lower):
            axes.axvline(told["begin"], color="0.55", linewidth=0.7, linestyle=":", zorder=0)
        if len(shown) <= MAX_NAMED_FAULTS:
            label = f" {told['kind']} ({told['agent']})"
            lower.text(
                told["begin"], 0.98, label, transform=lower.get_xaxis_transform(), rotation=90, va="top", fontsize=6
            )


class SmoothedLines:
    """Draws courses smoothed, with every instant faint behind.

    course : order parameters over time, s; smooth : window, s; None for a two-hundredth of the course, 0 for none
    """

    def __init__(self, course: pd.DataFrame, smooth: float | None):
        times = course.index.to_numpy(float)
        period = float(times[1] - times[0]) if len(times) > 1 else 0.0
        span = float(times[-1] - times[0]) if len(times) else 0.0
        if smooth is not None and smooth < 0.0:
            raise AirflockError(f"smooth = {smooth:g} s must not be below 0")
        wanted = float(f"{span / WINDOW_SHARE:.1g}") if smooth is None else smooth
        self.count = round(wanted / period) if period > 0.0 else 0
        self.window_seconds = self.count * period

    @property
    def told(self) -> str:
        """What a title says of the window."""
        return f" · means over {self.window_seconds:.3g} s" if self.count > 1 else ""

    def draw(self, axes: Axes, values: pd.Series, color: str, label: str, *, least: bool = False) -> list[Any]:
        """Draw one course: its mean (or its least value) over the window around each instant. Returns its line."""
        if self.count <= 1:
            return axes.plot(values.index, values, color=color, linewidth=0.9, label=label)
        axes.plot(values.index, values, color=color, linewidth=0.6, alpha=0.25)
        around = values.rolling(self.count, center=True, min_periods=1)
        return axes.plot(
            values.index, around.min() if least else around.mean(), color=color, linewidth=1.1, label=label
        )


def _each(recording: xr.Dataset, course: pd.DataFrame, smooth: float | None, ax: Axes | None) -> Figure:
    """Every value of a metric set that has no picture of its own, one below the other; none of what is not there."""
    walled = scenario_or_none(recording) is not None
    names = [name for name in course.columns if course[name].notna().any() and (walled or name not in WALL_METRICS)]
    units = course.attrs.get("units", {})
    course = course[names]
    figure, grid = style.figure_and_panels(
        ax, len(course.columns), 1, 7.0, 0.6 + 1.1 * len(course.columns), sharex=True
    )
    panels = grid[:, 0]
    pen = SmoothedLines(course, smooth)
    for number, (name, axes) in enumerate(zip(course.columns, panels, strict=True)):
        values = course[name].dropna()  # values of the collision clock stand at its instants only
        own = pen if len(values) == len(course) else SmoothedLines(course.loc[values.index], smooth)
        own.draw(axes, values, style.LINE_COLOURS[number % len(style.LINE_COLOURS)], name)
        style.style_axes(axes, "time (s)" if axes is panels[-1] else "", f"{name}\n({units.get(name) or 1})")
        axes.ticklabel_format(axis="y", useOffset=False)
        middle, spread = float(values.mean()), float(np.ptp(values)) if len(values) else 0.0
        if spread < MIN_RELATIVE_SPREAD * abs(middle):  # rounding is no course
            axes.set_ylim(middle - 0.05 * abs(middle), middle + 0.05 * abs(middle))
    figure.align_ylabels(list(panels))
    style.set_figure_title(figure, short_name(recording), f"{title_details(recording)}{pen.told}")
    return style.root_figure(figure)


def rotations(
    flights: Mapping[str, xr.Dataset], *, start: float | None = None, stop: float | None = None, ax: Axes | None = None
) -> Figure:
    """phi_LAP of several flights on one axis (Vásárhelyi et al. 2018, Fig. 4 D): near ±1 where they circle.

    flights     : label → recording, (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start, stop : window of time, s; ax : axes to draw into, instead of a new figure

    Raises RecordingError for what is no recording, and for a window that holds none of it, and for tracks, which have
    no phi_lap; AirflockError for an unfit `ax`.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> flights = {f"seed {seed}": airflock.simulate(short, seed=seed) for seed in (1, 2)}
    >>> labels = [line.get_label() for line in airflock.plots.rotations(flights).axes[0].lines]
    >>> "seed 1" in labels and "seed 2" in labels
    True
    """
    figure, axes = style.figure_and_axes(ax, 7.0, 2.6, layout="constrained")
    for number, (label, recording) in enumerate(flights.items()):
        course = _in_window(over_time(recording), start, stop)
        if "phi_lap" not in course:
            raise RecordingError(f"{label}: has no phi_lap, because tracks do not say which point they turn about")
        _rotation(axes, course, style.LINE_COLOURS[number % len(style.LINE_COLOURS)], label, SmoothedLines(course, 0.0))
    style.add_legend(axes, columns=len(flights), above=True)
    return figure


def _rotation(axes: Axes, course: pd.DataFrame, color: str, label: str, pen: SmoothedLines) -> None:
    axes.axhline(0.0, color=style.GREY, linewidth=0.6)
    pen.draw(axes, course["phi_lap"], color, label)
    style.style_axes(axes, "time (s)", f"{ROTATION_LABEL} (1)")
    most = max(1.05, 1.05 * float(course["phi_lap"].abs().max()))
    axes.set_ylim(-most, most)


def _in_window(course: pd.DataFrame, start: float | None, stop: float | None) -> pd.DataFrame:
    begin, end = time_window(course.index.to_numpy(), start, stop)
    return course.loc[begin - 1e-9 : end + 1e-9]
