"""Figures of the report: Table S2, Fig. 1, Fig. 2 and pressure, each from the flights of its part."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from airflock_papers.vasarhelyi_2018 import fig2, table_s2
from airflock_papers.vasarhelyi_2018.published import SPEEDS, optimum, program_runs

OURS, PAPER, PROGRAM = "#1b6ca8", "#d1495b", "#8d99ae"
TITLES = {
    "phi_vel": "φ_vel / v_flock",
    "r_min_mean": "nearest neighbour / S2",
    "f_corr": "F_corr",
    "n_coll": "collisions",
}


def draw(folder: Path, flown: dict[str, Any]) -> list[Path]:
    """Draw the figures of all parts that were flown; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    made: dict[str, Callable[[Any], Figure]] = {
        "s2": _table_s2,
        "fig1": _fig1,
        "fig2": _fig2,
        "fig34": _fig34,
        "pressure": _pressure,
    }
    paths = []
    for part, make in made.items():
        if part in flown:
            paths.append(folder / f"{part}.png")
            make(flown[part]).savefig(paths[-1], dpi=110, bbox_inches="tight")
    return paths


def _axes(rows: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel().tolist()
    for ax in axes:
        ax.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _table_s2(data: table_s2.Data) -> Figure:
    """Ours, the program's and the table's mean and SD of four columns."""
    printed, refitted, _ = data
    figure, axes = _axes(1, 4, 12.0, 3.2)
    for ax, (column, title) in zip(axes, TITLES.items(), strict=True):
        for k, v in enumerate(SPEEDS):
            mean, sd = optimum(v).published[column]
            unit = {"phi_vel": float(v), "r_min_mean": mean}.get(column, 1.0)
            points = [
                (-0.2, mean, sd or 0.0, PAPER, "s", "Table S2"),
                (-0.07, *_moments(program_runs(v)[column]), PROGRAM, "^", "authors' program"),
                (0.07, *_moments(printed[v][column]), OURS, "o", "ours, S1 as printed"),
            ]
            if v in refitted:
                points.append((0.2, *_moments(refitted[v][column]), OURS, "x", "ours, p_rep refitted"))
            for shift, m, s, colour, marker, label in points:
                name = label if k == 1 else None
                ax.errorbar(k + shift, m / unit, s / unit, fmt=marker, color=colour, ms=5, capsize=2, label=name)
        ax.set_xticks(range(len(SPEEDS)), [str(v) for v in SPEEDS])
        ax.set_xlabel("v_flock, m/s")
        ax.set_title(title, fontsize=10)
    axes[0].legend(fontsize=7, frameon=False)
    return figure


def _moments(values: pd.Series) -> tuple[float, float]:
    return float(values.mean()), float(values.std(ddof=1))


def _fig1(data: Any) -> Figure:
    """Timelines of one flight each, and A over r2 and the side, with the box of the caption."""
    figure, axes = _axes(1, 3, 12.0, 3.2)
    lines = ((data.a[0], PAPER, "A"), (data.early[0], PROGRAM, "A, delay 0.1 s"), (data.b[0], OURS, "B"))
    for course, colour, label in lines:
        axes[0].plot(course.index, course["phi_corr"].rolling(10).mean(), color=colour, lw=0.8, label=label)
        axes[1].plot(course.index, (course["phi_vel"] / 4.0).rolling(10).mean(), color=colour, lw=0.8, label=label)
    for ax, title in zip(axes, ("φ_corr", "φ_vel / v_flock"), strict=False):
        ax.set(xlabel="time, s", title=title, xlim=(0.0, 300.0), ylim=(-0.1, 1.05))
    axes[0].legend(fontsize=8, frameon=False)
    points = data.points.groupby(level=["side", "r2"])[["phi_corr", "phi_vel"]].mean()
    for side, colour in zip(points.index.unique("side"), (PROGRAM, PAPER, "0.5"), strict=False):
        rows = points.xs(side, level="side")
        axes[2].plot(rows["phi_corr"], rows["phi_vel"], "o-", color=colour, ms=4, lw=0.8, label=f"A, side {side:g} m")
        for r2, row in rows.iterrows():
            axes[2].annotate(f"{r2:g} m", (row["phi_corr"] + 0.01, row["phi_vel"] - 0.05), fontsize=7)
    box = Rectangle((0.56, 3.22), 0.14, 0.3, fill=False, ls=":", lw=0.8)  # 0.63 ± 0.07 and 3.37 ± 0.15 m/s
    axes[2].add_patch(box)
    axes[2].errorbar(0.63, 3.37, 0.15, 0.07, fmt="k+", capsize=3, label="A, caption")
    axes[2].errorbar(0.92, 3.83, 0.005, 0.002, fmt="kx", label="B, caption")
    b = data.scores.loc["b"]
    axes[2].plot(b["phi_corr"].median(), b["phi_vel"].median(), "o", color=OURS, label="B, ours")
    axes[2].set(xlabel="φ_corr", ylabel="φ_vel, m/s")
    axes[2].legend(fontsize=7, frameon=False)
    return figure


def _fig2(data: fig2.Data) -> Figure:
    """Heat maps over range and delay."""
    found = data.bins
    figure, axes = _axes(1, 2, 9.0, 3.6)
    titles = (("n_coll", "collisions per flight + 0.01"), ("r_min_mean", "nearest neighbour, m"))
    for ax, (column, title) in zip(axes, titles, strict=True):
        bins = found[column].groupby(level=["delay", "range"]).mean().unstack()
        values = np.log10(bins.to_numpy() + 0.01) if column == "n_coll" else bins.to_numpy()
        mesh = ax.pcolormesh(bins.columns, bins.index, values, cmap="magma" if column == "n_coll" else "viridis")
        bar = figure.colorbar(mesh, ax=ax)
        if column == "n_coll":
            ticks = range(-1, 4)
            bar.set_ticks(list(ticks), labels=[f"{10.0**k:g}" for k in ticks])
        ax.plot([fig2.SAFE_RANGE, fig2.SAFE_RANGE, 420.0], [-0.1, fig2.SAFE_DELAY, fig2.SAFE_DELAY], "w--", lw=1)
        ax.set(xlabel="range, m", ylabel="delay, s", title=title, xlim=(60.0, 420.0), ylim=(-0.1, 2.1))
    return figure


def _fig34(found: dict[str, list[pd.DataFrame]]) -> Figure:
    """Order parameters over time of one flight of each scene, as in Fig. 3, and phi_LAP as in Fig. 4 D."""
    shown = ("4ms", "obstacles", "8ms", "6ms")
    figure, axes = _axes(2, 4, 12.0, 4.4)
    for k, key in enumerate(shown):
        # where a scene shows both patterns, the diagonal one
        course = min(found[key], key=lambda c: abs(c["phi_lap"].mean()))
        for column, colour in (("r_min_mean", OURS), ("r_min", PAPER)):
            axes[k].plot(course.index, course[column], color=colour, lw=0.7, label=column)
        axes[k].set(title=key, ylim=(0.0, 32.0))
        for column, colour in (("phi_corr", PROGRAM), ("phi_lap", "k")):
            axes[4 + k].plot(course.index, course[column], color=colour, lw=0.7, label=column)
        axes[4 + k].set(ylim=(-1.05, 1.05), xlabel="time, s")
    for ax in (axes[0], axes[4]):
        ax.legend(fontsize=7, frameon=False)
    return figure


def _pressure(found: pd.DataFrame) -> Figure:
    """Collisions per drone and smallest distance against the number of drones."""
    figure, axes = _axes(1, 2, 8.0, 3.2)
    for obstacles, colour, label in ((False, PAPER, "no obstacles"), (True, OURS, "obstacles")):
        part = found.xs(obstacles, level="obstacles")
        sizes = part.index.get_level_values("agents")
        for ax, values in ((axes[0], part["n_coll"] / sizes), (axes[1], part["r_min"])):
            grouped = values.groupby(level="agents")
            mean, error = grouped.mean(), grouped.sem()
            ax.errorbar(mean.index, mean, error, fmt="o-", color=colour, ms=4, capsize=2, label=label)
    axes[0].set(xscale="log", xlabel="drones", title="collisions per drone and flight")
    axes[1].set(xscale="log", xlabel="drones", title="smallest distance of a flight, m", ylim=(0.0, None))
    axes[0].legend(fontsize=8, frameon=False)
    return figure
