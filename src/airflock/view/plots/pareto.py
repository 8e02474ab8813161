"""Pareto front of a study with several objectives: who is bettered by nobody in everything."""

from collections.abc import Sequence
from itertools import combinations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.view.plots import style


def pareto(
    table: pd.DataFrame, front: Sequence[int], objectives: Sequence[str], *, what: str = "", ax: Axes | None = None
) -> Figure:
    """One panel for each pair of objectives.

    table : one row a candidate, a column for each objective; front : rows of the front, by position
    what  : title; objectives: columns that are drawn
    ax    : axes of a grid, whose place the panels take, instead of a new figure

    Raises AirflockError for an `ax` that is none of a grid.

    Examples
    --------
    >>> import airflock
    >>> import pandas as pd
    >>> table = pd.DataFrame({"phi_vel": [3.0, 4.0, 3.5], "phi_corr": [0.9, 0.5, 0.6]})
    >>> airflock.plots.pareto(table, [0, 1], ["phi_vel", "phi_corr"]).axes[0].get_xlabel()
    'phi_vel'
    """
    pairs = list(combinations(objectives, 2))
    figure, panels = style.figure_and_panels(ax, 1, len(pairs), 3.6 * len(pairs) + 0.4, 3.4, layout="")
    best = table.iloc[list(front)]
    for axes, (x, y) in zip(panels[0], pairs, strict=True):
        axes.plot(table[x], table[y], ".", color=style.GREY, markersize=1.5, alpha=0.4, rasterized=True)
        axes.plot(best[x], best[y], "o", color=style.BLUE, markersize=4.0, markeredgewidth=0.0, label="front")
        style.style_axes(axes, x, y)
    style.set_figure_title(figure, what or "Pareto front", f"{len(best)} of {len(table)} candidates")
    return style.root_figure(figure)
