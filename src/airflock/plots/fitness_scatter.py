"""Fitness against each parameter: every candidate of a study a dot, so that working ranges can be seen."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from airflock.plots import style

COLUMNS = 4


def fitness_scatter(
    table: pd.DataFrame,
    units: Mapping[str, str],
    objective: str,
    best: Mapping[str, float] | None = None,
    *,
    what: str = "",
) -> Figure:
    """One panel a parameter.

    table     : one row a candidate: generation, a column for each key of `units`, and `objective`
    units     : key of a parameter → its unit
    best      : the chosen parameters, a line in each panel
    """
    rows = -(-len(units) // COLUMNS)
    figure = style.Picture(10.0, 2.3 * rows + 0.4)
    panels = np.atleast_1d(figure.subplots(rows, min(COLUMNS, len(units)), sharey=True, squeeze=False)).ravel()
    shown = table.sort_values("generation", kind="stable")
    for axes, (key, unit) in zip(panels, units.items(), strict=False):
        dots = axes.scatter(
            shown[key], shown[objective], c=shown["generation"], s=2.0, cmap="viridis", linewidths=0.0, rasterized=True
        )
        if best is not None:
            axes.axvline(best[key], color=style.RED, linewidth=1.0)
        style.dress(axes, f"{key} ({unit})", objective if axes in panels[::COLUMNS] else "")
    for axes in panels[len(units) :]:
        axes.set_visible(False)
    style.colour_bar(figure, dots, panels.tolist(), "generation")
    style.overall(figure, what or "Fitness against parameters", f"{len(table)} candidates; line: chosen")
    return figure
