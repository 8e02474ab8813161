"""Plots of order parameters: over time, over goals, over swept keys, and as transfer functions."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from airflock.core import Quantity, bell, declarations, peak, rising
from airflock.parts import METRICS
from airflock.recordings import measure_recording, over_time, recorded_faults, scenario_of_recording
from airflock.scenarios import SECTIONS, Flight, Scenario
from airflock.support import AirflockError, RecordingError
from airflock.view import style
from airflock.view.flight_paths import scenario_or_none, short_name, time_window, title_details

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
    """Plot correlation, speed in units of v_flock, nearest neighbours (m) and rotation at every instant.

    recording   : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start, stop : window of time, s; by default the whole flight
    smooth      : means over so many seconds, s (of the nearest pair the least value), named in the title; 0 draws
                  instants alone, by default a two-hundredth of what is shown
    settings    : keys such as {"metrics.r_cluster": 60.0} that replace those the recording was flown with
    ax          : axes of a grid, whose place the panels take, instead of a new figure
    The picture is that of Vásárhelyi et al. 2018, Fig. 3.

    Raises RecordingError for what is no recording, and for a window that holds none of it,
    ScenarioError for settings that its scenario does not take, and AirflockError for an `ax` that
    is none of a grid or a `smooth` below 0.

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
    return pen.titled(figure, recording)


def _mark_faults(recording: xr.Dataset, course: pd.DataFrame, upper: Axes, lower: Axes) -> None:
    """Draw a line where each fault begins, with its kind and agent where there are few."""
    shown = [fault for fault in recorded_faults(recording) if course.index[0] <= fault["begin"] <= course.index[-1]]
    for fault in shown:
        for axes in (upper, lower):
            axes.axvline(fault["begin"], color="0.55", linewidth=0.7, linestyle=":", zorder=0)
        if len(shown) <= MAX_NAMED_FAULTS:
            label = f" {fault['kind']} ({fault['agent']})"
            lower.text(
                fault["begin"], 0.98, label, transform=lower.get_xaxis_transform(), rotation=90, va="top", fontsize=6
            )


class SmoothedLines:
    """Lines that are smoothed, with every instant faint behind.

    course : order parameters over time, s; smooth : window, s; None for a two-hundredth of the
             course, 0 for none
    """

    def __init__(self, course: pd.DataFrame, smooth: float | None):
        times = course.index.to_numpy(float)
        period = float(times[1] - times[0]) if len(times) > 1 else 0.0
        span = float(times[-1] - times[0]) if len(times) else 0.0
        if smooth is not None and smooth < 0.0:
            raise AirflockError(f"smooth = {smooth:g} s must not be below 0")
        seconds = float(f"{span / WINDOW_SHARE:.1g}") if smooth is None else smooth
        self.count = round(seconds / period) if period > 0.0 else 0
        self.window_seconds = self.count * period

    def titled(self, figure: Figure, recording: xr.Dataset) -> Figure:
        """Set the title of a figure, which names the window; return the whole figure."""
        window = f" · means over {self.window_seconds:.3g} s" if self.count > 1 else ""
        return style.set_figure_title(figure, short_name(recording), f"{title_details(recording)}{window}")

    def draw(self, axes: Axes, values: pd.Series, color: str, label: str, *, least: bool = False) -> list[Any]:
        """Draw one course: its mean (or its least value) over the window around each instant. Returns its line."""
        if self.count <= 1:
            return axes.plot(values.index, values, color=color, linewidth=0.9, label=label)
        axes.plot(values.index, values, color=color, linewidth=0.6, alpha=0.25)
        # Centred, so that smoothed features stay at their time; the ends use what there is.
        around = values.rolling(self.count, center=True, min_periods=1)
        return axes.plot(
            values.index, around.min() if least else around.mean(), color=color, linewidth=1.1, label=label
        )


def _each(recording: xr.Dataset, course: pd.DataFrame, smooth: float | None, ax: Axes | None) -> Figure:
    """Plot every value of a metric set without a picture of its own, one below the other; skip missing values."""
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
    return pen.titled(figure, recording)


def rotations(
    flights: Mapping[str, xr.Dataset], *, start: float | None = None, stop: float | None = None, ax: Axes | None = None
) -> Figure:
    """Plot phi_LAP of several flights on one axis (Vásárhelyi et al. 2018, Fig. 4 D): near ±1 where they circle.

    flights     : label → recording, (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start, stop : window of time, s; ax : axes to draw into, instead of a new figure

    Raises RecordingError for what is no recording, and for a window that holds none of it, and for
    tracks, which have no phi_lap; AirflockError for an unfit `ax`.

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


LINEAR_LIMIT = 10.0  # sub-swarms or collisions up to which their axis is linear


def flocked(
    recording: xr.Dataset,
    *,
    start: float | None = None,
    stop: float | None = None,
    smooth: float | None = None,
    settings: Mapping[str, Any] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Plot the share of flocked agents, polarisation, sub-swarms and collisions over time; lines mark goals.

    recording   : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start, stop : window of time, s; settings : keys that replace those the recording was flown with
    smooth      : window of the means of shares, s, as in `series`
    ax          : axes of a grid, whose place the panels take, instead of a new figure
    The order parameters are those of Kidger, section 5.1.

    Raises RecordingError for what is no recording, and for a window that holds none of it, or whose
    order parameters do not hold the share flocked; AirflockError for an `ax` that is none of a
    grid.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("kidger/final_2d", {"agents": 4, "duration": 2.0})
    >>> recording = airflock.simulate(short)
    >>> len(airflock.plots.flocked(recording).axes)
    2
    """
    values, course = measure_recording(recording, settings)
    if "flocked" not in course:
        raise RecordingError("recording: the share flocked is measured by metrics.kind = 'kidger'; --set it")
    begin, end = time_window(course.index.to_numpy(), start, stop)
    course = course.loc[begin - 1e-9 : end + 1e-9]
    figure, panels = style.figure_and_panels(ax, 2, 1, 7.0, 4.2, sharex=True, height_ratios=(2.0, 1.0))
    upper, lower = panels[:, 0]
    pen = SmoothedLines(course, smooth)
    handles = pen.draw(upper, course["flocked"], style.BLUE, "flocked")
    handles += pen.draw(upper, course["polarisation"], style.GREEN, "polarisation")
    reached = [time for time in values.get("time_to_goal", []) if begin <= time <= end]
    lines = [upper.axvline(time, color=style.ORANGE, linewidth=0.7, zorder=0, label="goal reached") for time in reached]
    handles += lines[:1]
    upper.set_ylim(0.0, 1.05)
    style.style_axes(upper, y="share (1)")
    style.add_legend(upper, handles, columns=3, above=True)
    lower.plot(course.index, course["n_clusters"], color=style.PURPLE, linewidth=0.9, label="sub-swarms")
    lower.plot(course.index, course["n_coll"].cumsum(), color=style.RED, linewidth=0.9, label="collisions so far")
    if max(course["n_clusters"].max(), course["n_coll"].sum()) > 2.0 * LINEAR_LIMIT:  # else one tick would be all
        lower.set_yscale("symlog", linthresh=LINEAR_LIMIT)
    lower.yaxis.set_major_formatter("{x:g}")
    lower.set_ylim(bottom=0.0)
    style.style_axes(lower, "time (s)", "number")
    style.add_legend(lower, lower.get_lines(), columns=2)
    return pen.titled(figure, recording)


METRIC_UNITS = {name: unit or "1" for metric in METRICS.values() for name, (unit, _) in metric.reports.items()}
MAX_WRITTEN_CELLS = 120  # cells; in a larger map the numbers would not be legible


def heatmap(
    table: pd.DataFrame,
    keys: Sequence[str],
    value: str,
    *,
    scenario: Scenario | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Plot one order parameter over one or two swept keys.

    table    : tidy, one row per flight: a column for each key, one for `value`, usually `seed`
    keys     : one or two swept keys; the first is the horizontal axis
    value    : order parameter drawn: its mean over the rows of a point; with one key also ±1 standard deviation
    scenario : what was swept, for the title and for the units of its model's keys
    ax       : axes to draw into, instead of a new figure

    Raises AirflockError for a table without these columns, and for more keys than two.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> swept = airflock.sweep(short, {"radio.delay": [0.2, 0.4]}, seeds=2)
    >>> airflock.plots.heatmap(swept, ["radio.delay"], "phi_vel", scenario=short).axes[0].get_xlabel()
    'radio.delay (s)'
    """
    missing = [name for name in (*keys, value) if name not in table.columns]
    if missing:
        raise AirflockError(f"table has no column {missing[0]}; its columns: {', '.join(map(str, table.columns))}")
    if len(keys) not in (1, 2) or not len(table):
        raise AirflockError(
            f"a sweep of {len(keys)} keys with {len(table)} rows cannot be drawn; give 1 or 2 keys and rows"
        )
    figure, axes = style.figure_and_axes(ax, *((5.2, 3.4) if len(keys) == 1 else (5.6, 4.4)), layout="constrained")
    labels = [_axis_label(key, scenario) for key in keys]
    shown = f"{value} ({METRIC_UNITS.get(value, '1')})"
    flights = table.groupby(list(keys), sort=True)[value].count()
    per_point = f"{flights.min()}" if flights.min() == flights.max() else f"{flights.min()} to {flights.max()}"
    if len(keys) == 1:
        _line(axes, table, keys[0], value)
        style.style_axes(axes, labels[0], shown)
        details = f"mean ± SD of {per_point} flights per point"
    else:
        _map(figure, axes, table, keys, value, shown)
        style.style_axes(axes, labels[0], labels[1], grid=False)
        details = f"mean of {per_point} flights per cell"
    style.set_title(axes, short_name(scenario) if scenario else f"{value} over {', '.join(keys)}", details)
    return figure


def _axis_label(key: str, scenario: Scenario | None) -> str:
    section, _, name = key.rpartition(".")
    record: Any = SECTIONS.get(section, Flight if not section else None)
    if section == "model":
        record = scenario.model.Parameters if scenario else None
    for known, declared, _ in declarations(record) if record is not None else ():
        if known == name:
            return f"{key} ({declared.unit})" if isinstance(declared, Quantity) else key
    return key


def _are_numbers(levels: list[Any]) -> bool:
    return all(isinstance(v, (int, float, np.number)) and not isinstance(v, bool) for v in levels)


def _named_ticks(axes: Axes, axis: str, levels: list[Any]) -> None:
    """Label levels as names at 0, 1, 2, ...; only every n-th of them when there are many."""
    # Twelve names fit below one panel without touching.
    every = max(1, -(-len(levels) // 12))
    names = [f"{v:g}" if isinstance(v, (int, float, np.number)) else str(v) for v in levels]
    getattr(axes, f"set_{axis}ticks")(range(0, len(levels), every), names[::every])


def _line(axes: Axes, table: pd.DataFrame, key: str, value: str) -> None:
    groups = table.groupby(key, sort=True)[value]
    levels = list(groups.mean().index)
    x: Any = np.array(levels, dtype=float) if _are_numbers(levels) else np.arange(len(levels))
    if not _are_numbers(levels):
        _named_ticks(axes, "x", levels)
    mean, spread = groups.mean().to_numpy(), groups.std(ddof=1).fillna(0.0).to_numpy()
    places = dict(zip(levels, x, strict=True))
    single = [places[level] for level in table[key]]
    axes.plot(single, table[value], "o", color=style.BLUE, markersize=2.2, alpha=0.35, markeredgewidth=0.0, zorder=2)
    axes.fill_between(x, mean - spread, mean + spread, color=style.BLUE, alpha=0.18, linewidth=0.0, zorder=1)
    axes.plot(x, mean, color=style.BLUE, linewidth=1.8, marker="o", markersize=4.0, zorder=3)
    axes.margins(x=0.03)


def _map(figure: Figure, axes: Axes, table: pd.DataFrame, keys: Sequence[str], value: str, label: str) -> None:
    grid = table.pivot_table(index=keys[1], columns=keys[0], values=value, aggfunc="mean", sort=True, dropna=False)
    levels = list(grid.columns), list(grid.index)
    edges = [_cell_edges(axes, which, v) for which, v in zip("xy", levels, strict=True)]
    cells = np.ma.masked_invalid(grid.to_numpy(dtype=float))
    low, high = (float(cells.min()), float(cells.max())) if cells.count() else (0.0, 1.0)
    # Values of both signs get a diverging map whose white is zero.
    signed = low < 0.0 < high
    most = max(-low, high)
    axes.set_facecolor(style.PALE_GREY)  # a point that was not flown
    mesh = axes.pcolormesh(
        *edges, cells, cmap="RdBu_r" if signed else "viridis",
        vmin=-most if signed else low, vmax=most if signed else high, edgecolors="white", linewidth=0.4,
    )  # fmt: skip
    if cells.size <= MAX_WRITTEN_CELLS:
        _write(axes, mesh, edges, cells)
    style.add_colour_bar(figure, mesh, axes, label, shrink=0.9)


def _write(axes: Axes, mesh: Any, edges: list[Any], cells: Any) -> None:
    """Write the number into each cell, dark or light, whichever reads better on its colour."""
    size = style.SMALL_SIZE - 1.0 if max(cells.shape) <= 8 else style.SMALL_SIZE - 2.5
    for (row, column), number in np.ndenumerate(cells):
        if np.ma.is_masked(cells[row, column]):
            continue
        red, green, blue = to_rgb(mesh.cmap(mesh.norm(number)))
        # Luma of ITU-R BT.601: dark text on light cells and the other way round.
        color = style.INK if 0.299 * red + 0.587 * green + 0.114 * blue > 0.5 else "white"
        x, y = (0.5 * (e[i] + e[i + 1]) for e, i in ((edges[0], column), (edges[1], row)))
        axes.text(x, y, f"{number:.3g}", ha="center", va="center", fontsize=size, color=color)


def _cell_edges(axes: Axes, axis: str, levels: list[Any]) -> Any:
    """Return the borders of cells: to scale for evenly spaced numbers, else cells of equal size with a name each."""
    steps = np.diff(np.array(levels, dtype=float)) if _are_numbers(levels) else np.zeros(0)
    if len(levels) > 12 and steps.size and steps.max() < 1.01 * steps.min():
        places: Any = np.array(levels, dtype=float)
    else:
        places = np.arange(len(levels), dtype=float)
        _named_ticks(axes, axis, levels)
    if len(places) == 1:
        return np.array([-0.5, 0.5])
    middle = 0.5 * (places[1:] + places[:-1])
    return np.concatenate([[2.0 * places[0] - middle[0]], middle, [2.0 * places[-1] - middle[-1]]])


def transfer(scenario: Scenario | None = None, *, ax: Axes | None = None) -> Figure:
    """Plot F1, F2 and F3 (Vásárhelyi et al. 2018, Eqs 17-20 and Fig. 7), each over its order parameter.

    scenario : draws them with its v_flock, tolerances and units; without it, in units of their own parameters
    ax       : axes of a grid, whose place the panels take, instead of a new figure

    Raises AirflockError for an `ax` that is none of a grid.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> len(airflock.plots.transfer(short).axes)
    3
    """
    figure, grid = style.figure_and_panels(ax, 1, 3, 7.4, 2.5, sharey=True)
    panels = grid[0]
    if scenario is None:
        v0, d, s, a = 1.0, 0.375, 1.0, 1.0
        labels = (r"$\phi/\phi_0$   ($d = 0.375\,\phi_0$)", r"$\phi/s$", r"$\phi/a$")
    else:
        q = scenario.resolved_metrics()
        v0, d, s, a = q.v_flock or 1.0, q.v_tol or 0.375, q.r_tol, q.a_tol
        labels = (
            r"mean speed $\phi^{\mathrm{vel}}$ (m/s)",
            r"excursion $\phi^{\mathrm{wall}}$ (m)",
            r"collision risk $\phi^{\mathrm{coll}}$ (1)",
        )
        style.set_figure_title(figure, short_name(scenario), "transfer functions of the fitness")
    lowest = -3.0 * s if scenario is None else 0.0  # an excursion is never negative
    curves: Any = (
        (r"$F_1(\phi, \phi_0, d)$", style.BLUE, (0.0, 1.4 * v0, 561), lambda x: rising(x, v0, d),
         ((v0 - d, 0.0, r"$\phi_0 - d$"), (v0, 1.0, r"$\phi_0$"))),
        (r"$F_2(\phi, s)$", style.GREEN, (lowest, 3.0 * s, 601), lambda x: bell(x, s),
         ((s, float(np.exp(-1.0)), r"$s,\ 1/e$"),)),
        (r"$F_3(\phi, a)$", style.RED, (0.0, 6.0 * a, 601), lambda x: peak(x, a), ((a, 0.25, r"$a,\ 1/4$"),)),
    )  # fmt: skip
    for axes, label, (name, color, span, rule, points) in zip(panels, labels, curves, strict=True):
        x = np.linspace(*span)
        axes.plot(x, [rule(float(v)) for v in x], color=color, linewidth=1.8)
        for px, py, text in points:
            axes.plot([px], [py], "o", color=style.INK, markersize=4.0)
            side = (6.0, 4.0) if 0.0 < py < 1.0 else (-5.0, 6.0)
            where = "left" if side[0] > 0 else "right"
            axes.annotate(text, (px, py), side, textcoords="offset points", fontsize=style.SMALL_SIZE, ha=where)
        style.style_axes(axes, label)
        style.set_panel_letter(axes, name)
        axes.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
        axes.xaxis.get_offset_text().set_fontsize(style.SMALL_SIZE)
        axes.set_ylim(-0.03, 1.12)
    panels[0].set_ylabel("partial fitness (1)", fontsize=style.TEXT_SIZE, color=style.INK)
    return style.root_figure(figure)
