"""What infer found: how individuals speed up and turn by where a neighbour is, in the tracks and by each law."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.estimate import InferResult
from airflock.view.plots import style

MAX_LAWS = 5  # laws that are drawn


def plot_inferred(result: InferResult, *, ax: Axes | None = None) -> Figure:
    """Force maps, the tracks' first and then each law's, best first: along the heading above, to the left below.

    Katz et al., PNAS 108, 18720 (2011). A law that acts by velocities alone, such as alignment, shows no map.
    """
    laws = result.laws[:MAX_LAWS]
    columns = [("tracks", laws[0].maps.seen, laws[0].maps.edges)] + [(w.name, w.maps.law, w.maps.edges) for w in laws]
    figure, panels = style.figure_and_panels(
        ax, 2, len(columns), 1.0 + 2.2 * len(columns), 4.8, sharex=True, sharey=True
    )
    for part, what in enumerate(("forwards", "to the left")):
        sizes = np.abs(np.concatenate([table[part].ravel() for _, table, _ in columns[:2]]))
        most = float(np.nanquantile(sizes, 0.98)) if np.isfinite(sizes).any() else 1.0
        drawn: Any = None
        for panel, (name, table, edges) in zip(panels[part], columns, strict=True):
            style.style_axes(panel, grid=False)
            drawn = panel.pcolormesh(
                -edges, edges, np.ma.masked_invalid(table[part]), cmap="RdBu_r", vmin=-most, vmax=most, rasterized=True
            )
            panel.plot(0.0, 0.0, marker="^", color=style.INK, markersize=4.0)
            panel.set_aspect("equal")
            if part == 0:
                panel.set_title(name, fontsize=style.TEXT_SIZE, color=style.INK)
            else:
                panel.set_xlabel("left – right (m)", fontsize=style.SMALL_SIZE)
        panels[part][0].set_ylabel("back – front (m)", fontsize=style.SMALL_SIZE)
        bar = figure.colorbar(drawn, ax=list(panels[part]), shrink=0.85)
        bar.set_label(f"acceleration {what} (m/s²)", fontsize=style.SMALL_SIZE)
        bar.ax.tick_params(labelsize=style.SMALL_SIZE)
    style.set_figure_title(figure, "inferred", result.verdict)
    return style.root_figure(figure)
