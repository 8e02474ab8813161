"""A display as the audience sees it: each shape at the instant it is left."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.displays import Show
from airflock.view.plots import style


def stood(show: Show, titles: list[str], *, ax: Axes | None = None) -> Figure:
    """Every shape from the south, at the end of its leg; drones that failed are not shown.

    titles : one for each shape; ax : axes of a grid, whose place the panels take, instead of a new figure

    Raises AirflockError for an `ax` that is none of a grid.

    Examples
    --------
    >>> import airflock
    >>> show = airflock.display(["AIR"], 20)
    >>> len(airflock.plots.stood(show, ["AIR"]).axes)
    1
    """
    count = len(show.shape_reports)
    figure, panels = style.figure_and_panels(ax, 1, count, 2.6 * count, 2.8, background=style.NIGHT_SKY, layout="")
    for axes, title, formed, frame in zip(panels[0], titles, show.shape_reports, show.ends, strict=True):
        x, z = show.frames[frame, 0], show.frames[frame, 2]
        axes.scatter(x, z, s=6.0, color=style.ORANGE, linewidths=0.0)
        axes.set_facecolor(style.NIGHT_SKY)
        axes.set_aspect("equal")
        axes.axis("off")
        axes.set_title(
            f"{title}\n{formed.drones} drones, {formed.time:.0f} s", fontsize=style.SMALL_SIZE, color="white"
        )
    return style.root_figure(figure)
