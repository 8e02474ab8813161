"""Figures of the report: paths through both scenes, rays of one boid, share flocked, tuning curves."""

from pathlib import Path

import numpy as np
import pandas as pd

from airflock.recordings import simulate
from airflock.scenarios import load
from airflock_papers.kidger.tuning import DURATION, PLACES, RADII, SCALES

CURVES = ("flocked", "polarisation", "n_clusters", "r_min_mean", "n_coll", "n_env_coll")
FLIGHT = {"duration": 30.0}


def draw(folder: Path, tuning: pd.DataFrame) -> None:
    """Draw them all into a folder."""
    from airflock.view import flocked, rays, save_figure, through

    city = simulate(load("kidger/city", FLIGHT), 0)
    save_figure(through(city), folder / "city.png")
    save_figure(through(city, space=True), folder / "space.png")
    save_figure(rays(city), folder / "rays.png")
    save_figure(flocked(city), folder / "flocked.png")
    save_figure(through(simulate(load("kidger/forest", FLIGHT), 0)), folder / "forest.png")
    for place in PLACES:
        curves(folder / f"tuning_{place.replace(' ', '_')}.png", tuning, place)


def curves(path: Path, tuning: pd.DataFrame, place: str) -> None:
    """Six order parameters over every radius and scale, with 95 % intervals."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    from airflock_papers import statistics

    names = (*RADII, *SCALES)
    figure, grid = pyplot.subplots(len(CURVES), len(names), figsize=(22, 12), layout="constrained", sharey="row")
    for column, name in enumerate(names):
        values = sorted(set(tuning.loc[(place, name)].index.get_level_values(0)))
        for row, measure in enumerate(CURVES):
            found = [statistics.mean(tuning.loc[(place, name, v), measure].fillna(DURATION)) for v in values]
            middle = np.array([f.ours for f in found])
            ends = np.abs(np.array([[f.low, f.high] for f in found]).T - middle)
            axes = grid[row, column]
            axes.errorbar(range(len(values)), middle, ends, marker="o", markersize=3, linewidth=1.0, capsize=2)
            axes.set_xticks(range(len(values)), [f"{v:g}" for v in values], fontsize=7)
            axes.grid(alpha=0.3)
            if measure == "r_min_mean":
                axes.set_yscale("log")
            if column == 0:
                axes.set_ylabel(measure)
            if row == len(CURVES) - 1:
                axes.set_xlabel(f"{name} (m)" if name in RADII else f"{name} (1)")
    figure.suptitle(f"Tuning curves, {place}")
    figure.savefig(path, dpi=80)
    pyplot.close(figure)
