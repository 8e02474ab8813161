"""The committed report: claims.toml, README.md and figures in papers/zapotecatl_2016/."""

from pathlib import Path

import numpy as np
import pandas as pd

from airflock import atomic
from airflock.papers import claims as records
from airflock.papers.claims import Claim
from airflock.papers.zapotecatl_2016 import PAPER, RADII

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


def reproduce(folder: Path, seeds: int | None = None, threads: int | None = None) -> list[Claim]:
    """Fly everything, then write claims.toml, README.md and the figures."""
    claims, flown = PAPER.recompute(None, False, seeds, threads, None)
    write(folder, claims, flown, seeds)
    return claims


def write(folder: Path, claims: list[Claim], flown: dict[str, pd.DataFrame], seeds: int | None = None) -> None:
    """Write the report into a folder."""
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    header = records.header(PAPER.title, COMMAND, seeds)
    records.write_claims(folder / "claims.toml", claims, header)
    means = {part: table.groupby(level=[0, 1]).mean() for part, table in flown.items()}
    for part, table in means.items():
        surfaces(folder / "figures" / f"{part}.png", table)
    best = means["sequential"]["quality"].idxmax()
    radii(folder / "figures" / "radii.png", best)
    text = [f"# {PAPER.title}\n", f"`{header['command']}` recomputes this page. {COUNTED}\n", records.markdown(claims)]
    for part, table in means.items():
        text += [f"\n## {part}: quality over r_s (rows) and r_a (columns), cm\n", _grid(table["quality"])]
        text += [f"\n![Figs 4-7, {part}](figures/{part}.png)\n"]
    text += ["\n## Fig. 8: the radii of the best configuration\n", "\n![radii](figures/radii.png)\n"]
    atomic.write(folder / "README.md", "\n".join(text))


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
    """Areas of perception of the best configuration, like Fig. 8."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.patches import Circle

    figure, axes = pyplot.subplots(figsize=(5, 5), layout="constrained")
    shown = ((r_c, "tab:green", "cohesion"), (best[1], "tab:blue", "alignment"), (best[0], "tab:red", "separation"))
    for radius, colour, name in shown:
        axes.add_patch(Circle((0, 0), radius, color=colour, alpha=0.3, label=f"{name} {radius} cm"))
    axes.plot(0, 0, "k>", markersize=8)
    axes.set(xlim=(-55, 55), ylim=(-55, 55), aspect="equal", xlabel="cm", ylabel="cm")
    axes.legend(loc="upper right")
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
