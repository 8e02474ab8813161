"""A sweep as a picture: one order parameter against one key with its spread, or against two keys as a heat map."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from airflock.core import Quantity, declarations
from airflock.parts.metrics import METRICS
from airflock.scenarios import SECTIONS, Flight, Scenario
from airflock.support import AirflockError
from airflock.view.plots import style
from airflock.view.plots.flight import short_name

METRIC_UNITS = {name: unit or "1" for metric in METRICS.values() for name, (unit, _) in metric.reports.items()}
MAX_WRITTEN_CELLS = 120  # cells; in a larger map the numbers would not be legible


def heatmap(
    table: pd.DataFrame,
    keys: Sequence[str],
    value: str,
    *,
    scenario: Scenario | None = None,
    ax: Axes | None = None,
) -> Figure:
    """One order parameter over one or two swept keys.

    table    : tidy, one row per flight: a column for each key, one for `value`, usually `seed`
    keys     : one or two swept keys; the first is the horizontal axis
    value    : order parameter drawn: its mean over the rows of a point; with one key also ±1 standard deviation
    scenario : what was swept, for the title and for the units of its model's keys
    ax       : axes to draw into, instead of a new figure

    Raises AirflockError for a table without these columns, and for more keys than two.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> swept = airflock.sweep(short, {"radio.delay": [0.2, 0.4]}, seeds=2)
    >>> airflock.plots.heatmap(swept, ["radio.delay"], "phi_vel", scenario=short).axes[0].get_xlabel()
    'radio.delay (s)'
    """
    missing = [name for name in (*keys, value) if name not in table.columns]
    if missing:
        raise AirflockError(f"table has no column {missing[0]}; its columns: {', '.join(map(str, table.columns))}")
    if len(keys) not in (1, 2) or not len(table):
        raise AirflockError(
            f"a sweep of {len(keys)} keys with {len(table)} rows cannot be drawn; give 1 or 2 keys and rows"
        )
    figure, axes = style.figure_and_axes(ax, *((5.2, 3.4) if len(keys) == 1 else (5.6, 4.4)), layout="constrained")
    labels = [_axis_label(key, scenario) for key in keys]
    shown = f"{value} ({METRIC_UNITS.get(value, '1')})"
    flights = table.groupby(list(keys), sort=True)[value].count()
    per_point = f"{flights.min()}" if flights.min() == flights.max() else f"{flights.min()} to {flights.max()}"
    if len(keys) == 1:
        _line(axes, table, keys[0], value)
        style.style_axes(axes, labels[0], shown)
        details = f"mean ± SD of {per_point} flights per point"
    else:
        _map(figure, axes, table, keys, value, shown)
        style.style_axes(axes, labels[0], labels[1], grid=False)
        details = f"mean of {per_point} flights per cell"
    style.set_title(axes, short_name(scenario) if scenario else f"{value} over {', '.join(keys)}", details)
    return figure


def _axis_label(key: str, scenario: Scenario | None) -> str:
    section, _, name = key.rpartition(".")
    record: Any = SECTIONS.get(section, Flight if not section else None)
    if section == "model":
        record = scenario.model.Parameters if scenario else None
    for known, declared, _ in declarations(record) if record is not None else ():
        if known == name:
            return f"{key} ({declared.unit})" if isinstance(declared, Quantity) else key
    return key


def _are_numbers(levels: list[Any]) -> bool:
    return all(isinstance(v, (int, float, np.number)) and not isinstance(v, bool) for v in levels)


def _named_ticks(axes: Axes, axis: str, levels: list[Any]) -> None:
    """Levels as names at 0, 1, 2, ...; every so many of them when there are many."""
    every = max(1, -(-len(levels) // 12))
    names = [f"{v:g}" if isinstance(v, (int, float, np.number)) else str(v) for v in levels]
    getattr(axes, f"set_{axis}ticks")(range(0, len(levels), every), names[::every])


def _line(axes: Axes, table: pd.DataFrame, key: str, value: str) -> None:
    groups = table.groupby(key, sort=True)[value]
    levels = list(groups.mean().index)
    x: Any = np.array(levels, dtype=float) if _are_numbers(levels) else np.arange(len(levels))
    if not _are_numbers(levels):
        _named_ticks(axes, "x", levels)
    mean, spread = groups.mean().to_numpy(), groups.std(ddof=1).fillna(0.0).to_numpy()
    places = dict(zip(levels, x, strict=True))
    single = [places[level] for level in table[key]]
    axes.plot(single, table[value], "o", color=style.BLUE, markersize=2.2, alpha=0.35, markeredgewidth=0.0, zorder=2)
    axes.fill_between(x, mean - spread, mean + spread, color=style.BLUE, alpha=0.18, linewidth=0.0, zorder=1)
    axes.plot(x, mean, color=style.BLUE, linewidth=1.8, marker="o", markersize=4.0, zorder=3)
    axes.margins(x=0.03)


def _map(figure: Figure, axes: Axes, table: pd.DataFrame, keys: Sequence[str], value: str, label: str) -> None:
    grid = table.pivot_table(index=keys[1], columns=keys[0], values=value, aggfunc="mean", sort=True, dropna=False)
    levels = list(grid.columns), list(grid.index)
    edges = [_cell_edges(axes, which, v) for which, v in zip("xy", levels, strict=True)]
    cells = np.ma.masked_invalid(grid.to_numpy(dtype=float))
    low, high = (float(cells.min()), float(cells.max())) if cells.count() else (0.0, 1.0)
    signed = low < 0.0 < high
    most = max(-low, high)
    axes.set_facecolor(style.PALE_GREY)  # a point that was not flown
    mesh = axes.pcolormesh(
        *edges, cells, cmap="RdBu_r" if signed else "viridis",
        vmin=-most if signed else low, vmax=most if signed else high, edgecolors="white", linewidth=0.4,
    )  # fmt: skip
    if cells.size <= MAX_WRITTEN_CELLS:
        _write(axes, mesh, edges, cells)
    style.add_colour_bar(figure, mesh, axes, label, shrink=0.9)


def _write(axes: Axes, mesh: Any, edges: list[Any], cells: Any) -> None:
    """The number in each cell, dark or light, whichever reads better on its colour."""
    size = style.SMALL_SIZE - 1.0 if max(cells.shape) <= 8 else style.SMALL_SIZE - 2.5
    for (row, column), number in np.ndenumerate(cells):
        if np.ma.is_masked(cells[row, column]):
            continue
        red, green, blue = to_rgb(mesh.cmap(mesh.norm(number)))
        color = style.INK if 0.299 * red + 0.587 * green + 0.114 * blue > 0.5 else "white"
        x, y = (0.5 * (e[i] + e[i + 1]) for e, i in ((edges[0], column), (edges[1], row)))
        axes.text(x, y, f"{number:.3g}", ha="center", va="center", fontsize=size, color=color)


def _cell_edges(axes: Axes, axis: str, levels: list[Any]) -> Any:
    """Borders of cells: to scale where levels are evenly spaced numbers, else of equal size and named one by one."""
    steps = np.diff(np.array(levels, dtype=float)) if _are_numbers(levels) else np.zeros(0)
    if len(levels) > 12 and steps.size and steps.max() < 1.01 * steps.min():
        places: Any = np.array(levels, dtype=float)
    else:
        places = np.arange(len(levels), dtype=float)
        _named_ticks(axes, axis, levels)
    if len(places) == 1:
        return np.array([-0.5, 0.5])
    middle = 0.5 * (places[1:] + places[:-1])
    return np.concatenate([[2.0 * places[0] - middle[0]], middle, [2.0 * places[-1] - middle[-1]]])
