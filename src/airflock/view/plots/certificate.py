"""A certificate in panels: how the bound fell, how near agents came, how far numbers may move, bounds over two."""

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from airflock.view.plots import style

if TYPE_CHECKING:
    from airflock.certificates import Certificate


def plot_certificate(certificate: "Certificate", *, ax: Axes | None = None) -> Figure:
    """Upper bounds by flights, smallest distances, tolerances of the environment, and a map of two of its numbers.

    Panels without data are left out.
    """
    draws = [_bounds]
    if certificate.rows and "r_min" in certificate.rows[0]:
        draws.append(_distances)
    if certificate.tolerance.get("axis"):
        draws.append(_tolerances)
    if certificate.over:
        draws.append(_bound_map)
    figure, panels = style.figure_and_panels(ax, 1, len(draws), 3.6 * len(draws) + 0.4, 3.2, layout="")
    for axes, draw, name in zip(panels[0], draws, "ABCD", strict=False):
        draw(axes, certificate)
        style.set_panel_letter(axes, name)
    said = "shown" if certificate.shown else "not shown"
    details = f"{said}, {100.0 * certificate.campaign.confidence:g} % confidence"
    style.set_figure_title(figure, certificate.campaign.scenario.name, details)
    return style.root_figure(figure)


def _bounds(axes: Axes, certificate: "Certificate") -> None:
    """Upper and lower bound of every limit at every look, and the limit itself."""
    for verdict, color in zip(certificate.verdicts, style.LINE_COLOURS, strict=False):
        if verdict.looks:
            n = [look.flights for look in verdict.looks]
            highs = [look.high if look.above > 0.0 else math.nan for look in verdict.looks]  # nan: not looked at
            axes.plot(n, highs, "o-", ms=3, lw=1.2, color=color, label=verdict.limit.event)
            lows = [look.low if look.low > 0.0 else math.nan for look in verdict.looks]
            axes.plot(n, lows, "o:", ms=2, lw=1.0, color=color)
        if verdict.probability is not None:
            axes.axhline(verdict.probability, color=color, lw=0.8, ls="--")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    shown = [line for verdict in certificate.verdicts for line in (verdict.high, verdict.probability) if line]
    axes.set_ylim(
        min([look.low for v in certificate.verdicts for look in v.looks if look.low > 0.0] + shown) / 3.0, 1.0
    )
    style.style_axes(axes, "flights", "probability of a flight with an event")
    style.add_legend(axes)


def _distances(axes: Axes, certificate: "Certificate") -> None:
    """Share of flights whose smallest distance was below a value; dashed: limits on it.

    Dotted: the tail as extreme value theory extrapolates it (`extrapolated_tail`), to look at; no bound comes from it.
    """
    from_rows = [row.get("closest") if row.get("closest") is not None else row["r_min"] for row in certificate.rows]
    values = np.sort(np.array(from_rows, float))
    values = values[np.isfinite(values)]
    if len(values):
        axes.step(values, np.arange(1, len(values) + 1) / len(values), where="post", color=style.BLUE, lw=1.2)
        axes.set_yscale("log")
        fitted = extrapolated_tail(values)
        if fitted is not None:
            axes.plot(*fitted, ":", color=style.GREY, lw=1.2, label="extrapolated, no guarantee")
            axes.set_ylim(bottom=max(0.3 / len(values), 1e-12) / 30.0)
            style.add_legend(axes)
    for verdict in certificate.verdicts:
        if verdict.limit.score == "r_min":
            axes.axvline(verdict.limit.value, color=style.RED, lw=0.8, ls="--")
    axes.set_xlim(left=0.0)
    style.style_axes(axes, "smallest distance in a flight (m)", "share of flights below")


def extrapolated_tail(distances: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Distances (point,), m, and the share of flights below them (point,), extrapolated from the nearest flights.

    distances : smallest one of each flight, growing

    A generalised Pareto distribution of how far the lowest fifth fall below its end, by moments (Hosking & Wallis
    1987). Nearer than anybody came other causes may rule, of which it knows nothing. None of fewer than 100 flights.
    """
    few = len(distances) // 5
    if few < 20:
        return None
    end = float(distances[few])
    below = end - distances[:few]
    mean, variance = float(below.mean()), float(below.var(ddof=1))
    if not (mean > 0.0 and variance > 0.0):
        return None
    ratio = mean * mean / variance
    shape, scale = 0.5 * (1.0 - ratio), 0.5 * mean * (1.0 + ratio)
    at = np.linspace(0.0, end, 200)
    inside = 1.0 + shape * (end - at) / scale
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (
            np.exp(-(end - at) / scale) if abs(shape) < 1e-9 else np.where(inside > 0.0, inside, 0.0) ** (-1.0 / shape)
        )
    return at, few / len(distances) * np.where(inside > 0.0, share, 0.0)


def _tolerances(axes: Axes, certificate: "Certificate") -> None:
    """Tornado: factor by which each number may move, from its nominal value; those from zero without a bar.

    Black: the interval that the scenario's file gives, as identified.
    """
    rows = sorted(
        certificate.tolerance["axis"], key=lambda axis: abs(math.log(axis["factor"])) if "factor" in axis else -1.0,
        reverse=True,
    )  # fmt: skip
    for y, axis in enumerate(rows):
        factor, unit = axis.get("factor", 1.0), axis["unit"] if axis["unit"] != "1" else ""
        axes.barh(y, factor - 1.0, left=1.0, height=0.6, color=style.BLUE)
        if "not_shown" in axis and "factor" in axis:
            axes.plot(axis["not_shown"] / axis["nominal"], y, "|", ms=10, color=style.RED)
        if "interval" in axis and "factor" in axis:
            axes.plot([end / axis["nominal"] for end in axis["interval"]], [y, y], color="black", lw=2.0)
        left, begin = factor < 1.0, "" if "factor" in axis else "0 to "
        axes.annotate(
            f"{begin}{axis['safe']:.3g} {unit}".rstrip(), (factor, y), (-4 if left else 4, 0),
            textcoords="offset points", va="center", ha="right" if left else "left", fontsize=style.SMALL_SIZE,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.axvline(1.0, color=style.GREY, lw=0.6)
    axes.set_yticks(range(len(rows)), [axis["key"] for axis in rows])
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.margins(x=0.3)
    style.style_axes(axes, "safe factor on the nominal value (red: not shown)")


def _bound_map(axes: Axes, certificate: "Certificate") -> None:
    """Upper bound over two numbers; the line is the level below which a cell is safe."""
    told = certificate.over
    rows, columns = (np.array(values) for values in told["axes"])
    high = np.array([cell["high"] for cell in told["cell"]]).reshape(len(rows), len(columns))
    shown = axes.pcolormesh(
        columns, rows, high, norm=LogNorm(told["level"] / 10.0, 1.0), cmap="viridis_r", shading="nearest"
    )
    if high.min() < told["level"] < high.max():
        axes.contour(columns, rows, high, levels=[told["level"]], colors=style.RED, linewidths=1.2)
    axes.plot([], [], color=style.RED, label=f"{100.0 * told['level']:g} % of flights")
    across, down = (
        key if unit == "1" else f"{key} ({unit})" for key, unit in zip(told["keys"], told["units"], strict=True)
    )
    style.style_axes(axes, down, across, grid=False)
    style.add_legend(axes, above=True)
    figure = axes.get_figure(root=True)
    assert figure is not None
    style.add_colour_bar(figure, shown, axes, "flights with an event, at most")
