"""What infer found: how individuals speed up and turn by where a neighbour is, in the tracks and by each law."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.estimate.infer.result import Inferred
from airflock.view.plots import style

MOST = 5  # laws that are drawn


def inferred(found: Inferred, *, ax: Axes | None = None) -> Figure:
    """Force maps, the tracks' first and then each law's, best first: along the heading above, to the left below.

    Katz et al., PNAS 108, 18720 (2011). A law that acts by velocities alone, such as alignment, shows no map.
    """
    laws = found.laws[:MOST]
    columns = [("tracks", laws[0].maps.seen, laws[0].maps.edges)] + [(w.name, w.maps.law, w.maps.edges) for w in laws]
    figure, panels = style.panels(ax, 2, len(columns), 1.0 + 2.2 * len(columns), 4.8, sharex=True, sharey=True)
    for part, what in enumerate(("forwards", "to the left")):
        sizes = np.abs(np.concatenate([table[part].ravel() for _, table, _ in columns[:2]]))
        most = float(np.nanquantile(sizes, 0.98)) if np.isfinite(sizes).any() else 1.0
        drawn: Any = None
        for panel, (name, table, edges) in zip(panels[part], columns, strict=True):
            style.dress(panel, grid=False)
            drawn = panel.pcolormesh(
                -edges, edges, np.ma.masked_invalid(table[part]), cmap="RdBu_r", vmin=-most, vmax=most, rasterized=True
            )
            panel.plot(0.0, 0.0, marker="^", color=style.INK, markersize=4.0)
            panel.set_aspect("equal")
            if part == 0:
                panel.set_title(name, fontsize=style.TEXT, color=style.INK)
            else:
                panel.set_xlabel("left – right (m)", fontsize=style.SMALL)
        panels[part][0].set_ylabel("back – front (m)", fontsize=style.SMALL)
        bar = figure.colorbar(drawn, ax=list(panels[part]), shrink=0.85)
        bar.set_label(f"acceleration {what} (m/s²)", fontsize=style.SMALL)
        bar.ax.tick_params(labelsize=style.SMALL)
    style.overall(figure, "inferred", found.verdict)
    return style.root(figure)
