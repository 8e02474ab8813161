"""The committed report: claims.toml, README.md and figures in papers/zapotecatl_2016/."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from airflock.support import atomic
from airflock_papers import page
from airflock_papers.claims import Claim
from airflock_papers.page import Section
from airflock_papers.zapotecatl_2016 import PAPER, RADII
from airflock_papers.zapotecatl_2016.verdicts import BEST

COMMAND = "airflock paper zapotecatl_2016"
COUNTED = (
    "The figures were measured by the authors' program; sequential and synchronous flights are counted as it counts, "
    'with `metrics.count = "program"`, printed ones by Eq. 18. Boids evolved for quality: [EVOLVED.md](EVOLVED.md).'
)
SURFACES = {
    "extension_cm": ("Fig. 4", "extension, cm"),
    "polarization_deg": ("Fig. 5", "polarization, °"),
    "f_collision": ("Fig. 6", "frequency of collision"),
    "quality": ("Fig. 7", "quality"),
}
MAPS = ("sequential", "synchronous", "printed")  # parts that fly all 36 configurations
SECTIONS = (
    *(Section(part, f"{part}: quality over r_s (rows) and r_a (columns), cm", "", (part,)) for part in MAPS),
    Section(
        "radii",
        "Fig. 8",
        "Left the paper's best radii, (r_s, r_a) = (20, 30) cm, right the best of our 36 configurations.",
        ("radii",),
    ),
)


def reproduce(folder: Path, seeds: int | None = None, threads: int | None = None) -> list[Claim]:
    """Fly everything, then write claims.toml, README.md and the figures."""
    claims, flown = PAPER.recompute(None, False, seeds, threads, None)
    write(folder, claims, flown)
    return claims


def write(folder: Path, claims: list[Claim], flown: dict[str, Any]) -> None:
    """Write the report into a folder."""
    figures = folder / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    means = {part: flown[part].groupby(level=[0, 1]).mean() for part in MAPS}
    for part, table in means.items():
        surfaces(figures / f"{part}.png", table)
    radii(figures / "radii.png", means["sequential"]["quality"].idxmax())
    columns = [*SURFACES, "cns_ext", "cns_pol"]
    rounded = means["sequential"][columns].rename_axis(["r_s", "r_a"]).map(lambda value: float(f"{value:.5g}"))
    atomic.write_file(folder / "configurations.csv", rounded.to_csv())
    sections = [
        replace(each, words=_grid(means[each.start]["quality"])) if each.start in means else each for each in SECTIONS
    ]
    page.write(folder, PAPER.title, COMMAND, claims, sections, COUNTED)


def _grid(values: pd.Series) -> str:
    head = "| r_s \\ r_a | " + " | ".join(str(r) for r in RADII) + " |\n|" + "---|" * (len(RADII) + 1)
    rows = [f"| {s} | " + " | ".join(f"{values[(s, a)]:.3f}" for a in RADII) + " |" for s in RADII]
    return "\n".join([head, *rows])


def surfaces(path: Path, means: pd.DataFrame) -> None:
    """Surfaces like Figs 4-7."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=(10, 8), layout="constrained")
    a, s = np.meshgrid(RADII, RADII)
    for number, (column, (title, label)) in enumerate(SURFACES.items(), 1):
        axes = figure.add_subplot(2, 2, number, projection="3d")
        height = np.array([[means[column][(r_s, r_a)] for r_a in RADII] for r_s in RADII])
        axes.plot_surface(s, a, height, cmap="viridis", edgecolor="0.3", linewidth=0.3)
        axes.set(title=title, xlabel="r_s, cm", ylabel="r_a, cm", zlabel=label)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def radii(path: Path, best: tuple[int, int], r_c: int = 50) -> None:
    """Areas of perception of the paper's best configuration, Fig. 8, and of ours."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.patches import Circle

    figure, both = pyplot.subplots(1, 2, figsize=(10, 5), layout="constrained")
    for axes, (r_s, r_a), title in zip(both, (BEST, best), ("Fig. 8 of the paper", "ours"), strict=True):
        shown = ((r_c, "tab:green", "cohesion"), (r_a, "tab:blue", "alignment"), (r_s, "tab:red", "separation"))
        for radius, colour, name in shown:
            axes.add_patch(Circle((0, 0), radius, color=colour, alpha=0.3, label=f"{name} {radius} cm"))
        axes.plot(0, 0, "k>", markersize=8)
        axes.set(xlim=(-55, 55), ylim=(-55, 55), aspect="equal", xlabel="cm", ylabel="cm", title=title)
        axes.legend(loc="upper right")
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
