"""Convergence of a study: best so far and mean of each generation against its evaluations."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from airflock.view.plots import style


def convergence(
    table: pd.DataFrame, objective: str, *, maximise: bool = True, what: str = "", ax: Axes | None = None
) -> Figure:
    """Fitness over generations.

    table     : one row a candidate: run, generation, and the column `objective` (nan: failed)
    objective : what is drawn; maximise: whether more of it is better
    what      : title; ax : axes to draw into, instead of a new figure

    Examples
    --------
    >>> import airflock
    >>> import pandas as pd
    >>> table = pd.DataFrame({"run": 0, "generation": [0, 0, 1, 1], "model.p_rep": [0.1, 0.2, 0.3, 0.2],
    ...                       "model.r0_rep": [20.0, 25.0, 30.0, 25.0], "fitness": [0.1, 0.4, 0.2, 0.5]})
    >>> airflock.plots.convergence(table, "fitness").axes[0].get_xlabel()
    'generation'
    """
    figure, axes = style.figure_and_axes(ax, 5.6, 3.4)
    for i, (run, rows) in enumerate(table.groupby("run")):
        groups = rows.groupby("generation")[objective]
        color = style.LINE_COLOURS[i % len(style.LINE_COLOURS)]
        best = groups.max().cummax() if maximise else groups.min().cummin()
        low, high = groups.quantile(0.1), groups.quantile(0.9)
        axes.fill_between(low.index, low, high, color=color, alpha=0.15, linewidth=0.0)
        axes.plot(groups.mean(), color=color, linewidth=1.6, label=f"run {run}: mean, 10 to 90 %")
        axes.plot(best, color=color, linewidth=1.0, linestyle="--", label=f"run {run}: best so far")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))  # half a generation is none
    style.style_axes(axes, "generation", objective)
    style.add_legend(axes)
    style.set_title(axes, what or "Convergence", f"{len(table)} candidates")
    return figure
