"""Share flocked over time, with sub-swarms, order and avoidance (Kidger, section 5.1)."""

from collections.abc import Mapping
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.recordings import measure_recording
from airflock.support import RecordingError
from airflock.view.plots import style
from airflock.view.plots.flight import short_name, time_window, title_details
from airflock.view.plots.series import SmoothedLines

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
    """Share of agents flocked and their polarisation, sub-swarms and collisions at every instant; lines mark goals.

    recording   : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start, stop : window of time, s; settings : keys that replace those the recording was flown with
    smooth      : window of the means of shares, s, as in `series`
    ax          : axes of a grid, whose place the panels take, instead of a new figure
    The order parameters are those of Kidger, section 5.1.

    Raises RecordingError for what is no recording, and for a window that holds none of it, or whose order parameters do
    not hold the share flocked; AirflockError for an `ax` that is none of a grid.

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
    style.set_figure_title(figure, short_name(recording), f"{title_details(recording)}{pen.told}")
    return style.root_figure(figure)
