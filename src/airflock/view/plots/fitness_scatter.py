"""Fitness against each parameter: every candidate of a study a dot, so that working ranges can be seen."""

from collections.abc import Mapping

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.view.plots import style

PANEL_COLUMNS = 4


def fitness_scatter(
    table: pd.DataFrame,
    units: Mapping[str, str],
    objective: str,
    best: Mapping[str, float] | None = None,
    *,
    what: str = "",
    ax: Axes | None = None,
) -> Figure:
    """One panel a parameter.

    table     : one row a candidate: generation, a column for each key of `units`, and `objective`
    units     : key of a parameter → its unit
    best      : the chosen parameters, a line in each panel
    what      : title; ax : axes of a grid, whose place the panels take, instead of a new figure

    Raises AirflockError for an `ax` that is none of a grid.

    Examples
    --------
    >>> import airflock
    >>> import pandas as pd
    >>> table = pd.DataFrame({"run": 0, "generation": [0, 0, 1, 1], "model.p_rep": [0.1, 0.2, 0.3, 0.2],
    ...                       "model.r0_rep": [20.0, 25.0, 30.0, 25.0], "fitness": [0.1, 0.4, 0.2, 0.5]})
    >>> units = {"model.p_rep": "1/s", "model.r0_rep": "m"}
    >>> figure = airflock.plots.fitness_scatter(table, units, "fitness")
    >>> [axes.get_xlabel() for axes in figure.axes[:2]]
    ['model.p_rep (1/s)', 'model.r0_rep (m)']
    """
    rows = -(-len(units) // PANEL_COLUMNS)
    columns = min(PANEL_COLUMNS, len(units))
    figure, grid = style.figure_and_panels(ax, rows, columns, 10.0, 2.3 * rows + 0.4, layout="", sharey=True)
    panels = grid.ravel()
    shown = table.sort_values("generation", kind="stable")
    for axes, (key, unit) in zip(panels, units.items(), strict=False):
        dots = axes.scatter(
            shown[key], shown[objective], c=shown["generation"], s=2.0, cmap="viridis", linewidths=0.0, rasterized=True
        )
        if best is not None:
            axes.axvline(best[key], color=style.RED, linewidth=1.0)
        style.style_axes(axes, f"{key} ({unit})", objective if axes in panels[::PANEL_COLUMNS] else "")
    for axes in panels[len(units) :]:
        axes.set_visible(False)
    style.add_colour_bar(figure, dots, panels.tolist(), "generation")
    style.set_figure_title(figure, what or "Fitness against parameters", f"{len(table)} candidates; line: chosen")
    return style.root_figure(figure)
