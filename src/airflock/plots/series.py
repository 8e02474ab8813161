"""Order parameters over time (Vásárhelyi et al. 2018, Figs 3 and 4 D)."""

from collections.abc import Mapping
from typing import Any

import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.plots import style
from airflock.plots.scene import details_of, name_of, window
from airflock.recordings.scores import over_time, scenario_of

CORR, VEL, LAP = r"$\phi^{\mathrm{corr}}$", r"$\phi^{\mathrm{vel}}/v^{\mathrm{flock}}$", r"$\phi^{\mathrm{LAP}}$"
NEAREST, NEAREST_MEAN = r"min $r_{ij}^{\mathrm{min}}$", r"mean $r_{ij}^{\mathrm{min}}$"


def series(
    recording: xr.Dataset,
    *,
    start: float | None = None,
    stop: float | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Figure:
    """Correlation, speed in units of v_flock, nearest neighbours (m) and rotation at every instant.

    start, stop : window of time, s; by default the whole flight
    settings    : keys such as {"metrics.r_cluster": 60.0} that replace those the recording was flown with
    """
    course = _window(over_time(recording, settings), start, stop)
    if "flocked" in course:
        from airflock.plots.flocked import flocked

        return flocked(recording, start=start, stop=stop, settings=settings)
    if not {"phi_corr", "phi_vel", "phi_lap"} <= set(course):
        return _each(recording, course)
    v_flock = scenario_of(recording, settings).measured_by().v_flock or 1.0
    figure = style.Picture(7.0, 4.2)
    figure.set_layout_engine("constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    handles = upper.plot(course.index, course["phi_corr"], color=style.BLUE, linewidth=0.9, label=CORR)
    handles += upper.plot(course.index, course["phi_vel"] / v_flock, color=style.GREEN, linewidth=0.9, label=VEL)
    style.dress(upper, y=f"{CORR},  {VEL}   (1)")
    highest = float(max(1.0, (course["phi_vel"] / v_flock).max()))
    upper.set_ylim(min(0.0, float(course["phi_corr"].min())) - 0.02, 1.05 * highest)
    if recording.sizes["individual"] > 1:
        right = style.second_axis(upper, "nearest neighbour (m)", style.RED)
        handles += right.plot(course.index, course["r_min_mean"], color=style.RED, linewidth=0.9, label=NEAREST_MEAN)
        handles += right.plot(course.index, course["r_min"], color=style.ORANGE, linewidth=0.9, label=NEAREST)
        right.set_ylim(0.0, 1.35 * float(course["r_min_mean"].max()))
    style.legend(upper, handles, columns=4, above=True)
    _rotation(lower, course, style.PURPLE, LAP)
    lower.set_xlim(float(course.index[0]), float(course.index[-1]) if len(course) > 1 else None)
    style.overall(figure, name_of(recording), details_of(recording))
    return figure


def _each(recording: xr.Dataset, course: pd.DataFrame) -> Figure:
    """Every value of a metric set that has no picture of its own, one below the other."""
    figure = style.Picture(7.0, 0.6 + 1.1 * len(course.columns))
    figure.set_layout_engine("constrained")
    panels = figure.subplots(len(course.columns), 1, sharex=True, squeeze=False)[:, 0]
    for number, (name, axes) in enumerate(zip(course.columns, panels, strict=True)):
        values = course[name].dropna()  # values of the collision clock stand at its instants only
        axes.plot(values.index, values, color=style.LINES[number % len(style.LINES)], linewidth=0.9)
        style.dress(axes, "time (s)" if axes is panels[-1] else "", name)
    style.overall(figure, name_of(recording), details_of(recording))
    return figure


def rotations(flights: Mapping[str, xr.Dataset], *, start: float | None = None, stop: float | None = None) -> Figure:
    """phi_LAP of several flights on one axis (Fig. 4 D): circling is near ±1, diagonal flight near 0.

    flights : label → recording
    """
    figure = style.Picture(7.0, 2.6)
    figure.set_layout_engine("constrained")
    axes = figure.subplots()
    for number, (label, recording) in enumerate(flights.items()):
        course = _window(over_time(recording), start, stop)
        _rotation(axes, course, style.LINES[number % len(style.LINES)], label)
    style.legend(axes, columns=len(flights), above=True)
    return figure


def _rotation(axes: Axes, course: pd.DataFrame, color: str, label: str) -> None:
    axes.axhline(0.0, color=style.GREY, linewidth=0.6)
    axes.plot(course.index, course["phi_lap"], color=color, linewidth=0.9, label=label)
    style.dress(axes, "time (s)", f"{LAP} (1)")
    most = max(1.05, 1.05 * float(course["phi_lap"].abs().max()))
    axes.set_ylim(-most, most)


def _window(course: pd.DataFrame, start: float | None, stop: float | None) -> pd.DataFrame:
    begin, end = window(course.index.to_numpy(), start, stop)
    return course.loc[begin - 1e-9 : end + 1e-9]
