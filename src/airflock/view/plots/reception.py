"""Time since the last packet by distance (Vásárhelyi et al. 2018, Fig. 8), of any flight, fleet or table of packets."""

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.recordings import BINS, packet_age
from airflock.view.plots import style
from airflock.view.plots.flight import scenario_or_none, short_name, title_details

MIN_PAIRS = 10  # pairs of a bin below which it is not drawn


def received(heard: xr.Dataset | pd.DataFrame, *, bins: int = BINS, ax: Axes | None = None) -> Figure:
    """Ages of what agents have of each other: median, half of all, nine tenths of all; and the share heard so far.

    heard : a recording with `age` (time, receiver, sender), s, or a table of packets (`recordings.reception`)
    bins  : of distance; ax : axes of a grid, whose place the panels take, instead of a new figure
    The picture is that of Vásárhelyi et al. 2018, Fig. 8.

    Raises RecordingError where the recording holds no ages or the table lacks a column, and AirflockError for an `ax`
    that is none of a grid.

    Examples
    --------
    >>> import airflock
    >>> lossy = {"agents": 5, "duration": 10.0, "radio.kind": "links"}
    >>> heard = airflock.simulate(airflock.load("vasarhelyi_2018/4ms", lossy), keep=("heard",))
    >>> airflock.plots.received(heard, bins=4).axes[1].get_xlabel()
    'distance (m)'
    """
    table = packet_age(heard, bins)
    shown = table[table["count"] >= min(MIN_PAIRS, int(table["count"].max()))]
    figure, panels = style.figure_and_panels(ax, 2, 1, 6.0, 4.2, sharex=True, height_ratios=(3.0, 1.0))
    upper, lower = panels[:, 0]
    x = shown["distance"].to_numpy()
    for low, high, alpha, label in (("q05", "q95", 0.15, "90 % of all"), ("q25", "q75", 0.3, "half of all")):
        upper.fill_between(x, shown[low], shown[high], color=style.BLUE, alpha=alpha, linewidth=0.0, label=label)
    upper.plot(x, shown["median"], color=style.BLUE, linewidth=1.8, label="median")
    if np.nanmax(shown["q95"]) > 20.0 * max(float(np.nanmin(shown["median"])), 1e-3):
        upper.set_yscale("log")
    else:
        upper.set_ylim(bottom=0.0)
    style.style_axes(upper, y="time since the last packet (s)")
    scenario = scenario_or_none(heard) if isinstance(heard, xr.Dataset) else None
    if scenario is not None:
        upper.axhline(scenario.radio.delay, color=style.RED, linewidth=1.0, linestyle=(0, (5, 3)), label="delay")
    style.add_legend(upper)
    lower.plot(x, shown["heard"], color=style.GREEN, linewidth=1.8)
    lower.set_ylim(-0.03, 1.05)
    style.style_axes(lower, "distance (m)", "heard so far")
    lower.set_xlim(0.0, float(x[-1]) if len(x) else None)
    if isinstance(heard, xr.Dataset):
        style.set_figure_title(figure, short_name(heard), title_details(heard))
    else:
        style.set_figure_title(figure, "reception", f"{len(heard)} rows, {heard['receiver'].nunique()} receivers")
    return style.root_figure(figure)
