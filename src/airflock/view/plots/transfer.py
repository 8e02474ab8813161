"""The three transfer functions that turn order parameters into fitness (Vásárhelyi et al. 2018, Fig. 7)."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.core import bell, peak, rising
from airflock.scenarios import Scenario
from airflock.view.plots import style
from airflock.view.plots.flight import short_name


def transfer(scenario: Scenario | None = None, *, ax: Axes | None = None) -> Figure:
    """F1, F2 and F3 (Vásárhelyi et al. 2018, Eqs 17-20 and Fig. 7), each over the order parameter that it judges.

    scenario : draws them with its v_flock, tolerances and units; without it, in units of their own parameters
    ax       : axes of a grid, whose place the panels take, instead of a new figure

    Raises AirflockError for an `ax` that is none of a grid.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> len(airflock.plots.transfer(short).axes)
    3
    """
    figure, grid = style.figure_and_panels(ax, 1, 3, 7.4, 2.5, sharey=True)
    panels = grid[0]
    if scenario is None:
        v0, d, s, a = 1.0, 0.375, 1.0, 1.0
        labels = (r"$\phi/\phi_0$   ($d = 0.375\,\phi_0$)", r"$\phi/s$", r"$\phi/a$")
    else:
        q = scenario.resolved_metrics()
        v0, d, s, a = q.v_flock or 1.0, q.v_tol or 0.375, q.r_tol, q.a_tol
        labels = (
            r"mean speed $\phi^{\mathrm{vel}}$ (m/s)",
            r"excursion $\phi^{\mathrm{wall}}$ (m)",
            r"collision risk $\phi^{\mathrm{coll}}$ (1)",
        )
        style.set_figure_title(figure, short_name(scenario), "transfer functions of the fitness")
    lowest = -3.0 * s if scenario is None else 0.0  # an excursion is never negative
    judge: Any = (lambda x: rising(x, v0, d), lambda x: bell(x, s), lambda x: peak(x, a))
    spans = (np.linspace(0.0, 1.4 * v0, 561), np.linspace(lowest, 3.0 * s, 601), np.linspace(0.0, 6.0 * a, 601))
    names = (r"$F_1(\phi, \phi_0, d)$", r"$F_2(\phi, s)$", r"$F_3(\phi, a)$")
    curves = zip(spans, judge, names, (style.BLUE, style.GREEN, style.RED), strict=True)
    marks = (
        ((v0 - d, 0.0, r"$\phi_0 - d$"), (v0, 1.0, r"$\phi_0$")),
        ((s, float(np.exp(-1.0)), r"$s,\ 1/e$"),),
        ((a, 0.25, r"$a,\ 1/4$"),),
    )
    for axes, (x, rule, name, color), label, points in zip(panels, curves, labels, marks, strict=True):
        axes.plot(x, [rule(float(v)) for v in x], color=color, linewidth=1.8)
        for px, py, text in points:
            axes.plot([px], [py], "o", color=style.INK, markersize=4.0)
            side = (6.0, 4.0) if 0.0 < py < 1.0 else (-5.0, 6.0)
            where = "left" if side[0] > 0 else "right"
            axes.annotate(text, (px, py), side, textcoords="offset points", fontsize=style.SMALL_SIZE, ha=where)
        style.style_axes(axes, label)
        style.set_panel_letter(axes, name)
        axes.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
        axes.xaxis.get_offset_text().set_fontsize(style.SMALL_SIZE)
        axes.set_ylim(-0.03, 1.12)
    panels[0].set_ylabel("partial fitness (1)", fontsize=style.TEXT_SIZE, color=style.INK)
    return style.root_figure(figure)
