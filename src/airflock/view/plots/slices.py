"""Pairwise slices: the best fitness that any candidate reached in each cell of two parameters."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.view.plots import style

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
    """A triangle of maps, one for each pair of parameters.

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
    style.set_figure_title(figure, what or "Pairwise slices", "grey: no candidate there; cross: chosen")
    return style.root_figure(figure)


def _best_in_cells(
    points: np.ndarray, values: np.ndarray, x: tuple[float, float], y: tuple[float, float], maximise: bool
) -> np.ma.MaskedArray:
    """Best value (row, column) in each cell of two ranges, masked where there is none."""
    sign = 1.0 if maximise else -1.0
    index = [
        np.clip(((points[:, i] - low) / (high - low) * CELLS_PER_AXIS).astype(int), 0, CELLS_PER_AXIS - 1)
        for i, (low, high) in enumerate((x, y))
    ]
    cells = np.full((CELLS_PER_AXIS, CELLS_PER_AXIS), -np.inf)
    np.maximum.at(cells, (index[1], index[0]), sign * values)
    return np.ma.masked_invalid(np.where(np.isfinite(cells), sign * cells, np.nan))
