"""Plots of a search: fitness by generation, against each parameter, over pairs of parameters, and Pareto fronts."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from airflock.view import style


def convergence(
    table: pd.DataFrame, objective: str, *, maximise: bool = True, what: str = "", ax: Axes | None = None
) -> Figure:
    """Plot fitness over generations.

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
    style.style_axes(axes, "generation", objective, legend=True)
    style.set_title(axes, what or "Convergence", f"{len(table)} candidates")
    return figure


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
    """Plot fitness against each parameter: every candidate of a study is a dot.

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
    return style.set_figure_title(
        figure, what or "Fitness against parameters", f"{len(table)} candidates; line: chosen"
    )


CELLS_PER_AXIS = 14


def slices(
    table: pd.DataFrame,
    bounds: Mapping[str, tuple[float, float]],
    objective: str,
    best: Mapping[str, float] | None = None,
    *,
    maximise: bool = True,
    what: str = "",
    ax: Axes | None = None,
) -> Figure:
    """Plot a triangle of maps, one for each pair of parameters.

    table  : one row a candidate: a column for each key of `bounds`, and `objective`
    bounds : key of a parameter → range that is drawn
    best   : the chosen parameters, a cross in each map
    what   : title; maximise: whether more of the objective is better
    ax     : axes of a grid, whose place the panels take, instead of a new figure

    Raises AirflockError for an `ax` that is none of a grid.

    Examples
    --------
    >>> import airflock
    >>> import pandas as pd
    >>> table = pd.DataFrame({"run": 0, "generation": [0, 0, 1, 1], "model.p_rep": [0.1, 0.2, 0.3, 0.2],
    ...                       "model.r0_rep": [20.0, 25.0, 30.0, 25.0], "fitness": [0.1, 0.4, 0.2, 0.5]})
    >>> bounds = {"model.p_rep": (0.0, 1.0), "model.r0_rep": (10.0, 40.0)}
    >>> airflock.plots.slices(table, bounds, "fitness").axes[0].get_ylabel()
    'r0_rep'
    """
    keys = list(bounds)
    n = max(len(keys) - 1, 1)
    figure, grid = style.figure_and_panels(ax, n, n, 1.2 * n + 1.6, 1.2 * n + 1.0, layout="")
    values = table[objective].to_numpy(float)
    sound = np.isfinite(values)
    low, high = (float(values[sound].min()), float(values[sound].max())) if sound.any() else (0.0, 1.0)
    mesh, drawn = None, []
    for row in range(n):
        for column in range(n):
            axes = grid[row, column]
            if column > row or len(keys) < 2:
                axes.remove()  # laid out with the others it would take half of the time
                continue
            drawn.append(axes)
            x, y = keys[column], keys[row + 1]
            cells = _best_in_cells(table.loc[sound, [x, y]].to_numpy(), values[sound], bounds[x], bounds[y], maximise)
            edges = [np.linspace(*bounds[key], CELLS_PER_AXIS + 1) for key in (x, y)]
            mesh = axes.pcolormesh(*edges, cells, cmap="viridis", vmin=low, vmax=high, rasterized=True)
            axes.set_facecolor(style.PALE_GREY)  # nobody was there
            if best is not None:
                axes.plot(best[x], best[y], "x", color=style.RED, markersize=4.0)
            labels = (x.rpartition(".")[2] if row == n - 1 else "", y.rpartition(".")[2] if column == 0 else "")
            style.style_axes(axes, *labels, grid=False)
            axes.tick_params(labelbottom=row == n - 1, labelleft=column == 0, labelsize=style.SMALL_SIZE - 2.0)
    if mesh is not None:
        style.add_colour_bar(figure, mesh, drawn, f"best {objective} in each cell")
    return style.set_figure_title(figure, what or "Pairwise slices", "grey: no candidate there; cross: chosen")


def _best_in_cells(
    points: np.ndarray, values: np.ndarray, x: tuple[float, float], y: tuple[float, float], maximise: bool
) -> np.ma.MaskedArray:
    """Return the best value (row, column) in each cell of two ranges, masked where there is none."""
    sign = 1.0 if maximise else -1.0
    index = [
        np.clip(((points[:, i] - low) / (high - low) * CELLS_PER_AXIS).astype(int), 0, CELLS_PER_AXIS - 1)
        for i, (low, high) in enumerate((x, y))
    ]
    cells = np.full((CELLS_PER_AXIS, CELLS_PER_AXIS), -np.inf)
    np.maximum.at(cells, (index[1], index[0]), sign * values)
    return np.ma.masked_invalid(np.where(np.isfinite(cells), sign * cells, np.nan))


def pareto(
    table: pd.DataFrame, front: Sequence[int], objectives: Sequence[str], *, what: str = "", ax: Axes | None = None
) -> Figure:
    """Plot one panel for each pair of objectives.

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
    return style.set_figure_title(figure, what or "Pareto front", f"{len(best)} of {len(table)} candidates")
