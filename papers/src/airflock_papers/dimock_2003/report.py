"""The committed report: claims.toml, README.md and figures in papers/dimock_2003/."""

from pathlib import Path
from typing import Any

import numpy as np

from airflock_papers import page
from airflock_papers.claims import Claim
from airflock_papers.dimock_2003 import PAPER
from airflock_papers.dimock_2003.flights import Flight
from airflock_papers.dimock_2003.ga import WEIGHTS
from airflock_papers.dimock_2003.units import FOOT, FT_LBF
from airflock_papers.page import Section

SEEDS = "genetic algorithm and CMA-ES 1 to 3; robust search 7; its held-out flights from 1000000"
COMMAND = "airflock paper dimock_2003"
ABOUT = (
    "`python papers/dimock_2003/reproduce.py` also rewrites this folder. Powers are in ft lbf/s per bird, the unit "
    "that the printed HP are read as; nothing in the text states it."
)
SECTIONS = (
    Section("static.", "Formations that stand still", "The unit of the fitness, bounds, and what selfishness costs."),
    Section(
        "controller.",
        "The published controller flown again",
        "Eqs 1 and 2 of the surviving scan are illegible. C1 and 1/n weights are reconstructions, fitted to what the "
        "paper says its controller does, and not read from it; the spacing of the start is not printed either.",
    ),
    Section(
        "ga.",
        "The genetic algorithm, Figs 5-8",
        "Three seeds of each reading of Eq. 2 and of the start; gradients with the others' circulations held. "
        "Intervals are the least and the greatest of the seeds. Figures are of the first seed with 1/(n-1) weights.",
        ("fig5", "fig6", "fig7", "fig8"),
    ),
    Section(
        "robust.",
        "A sound fitness",
        "CMA-ES on V, tight, wide, column and random starts in the plane in which the paper's birds stay, and a V in "
        "space; 60 s, noise at the start and in flight; penalties for closeness, collisions, unrest, no formation. "
        "Judged on flights that no search has seen.",
        ("pareto",),
    ),
)


def reproduce(folder: Path, threads: int | None = None) -> list[Claim]:
    """Compute everything and write the report."""
    claims, found = PAPER.recompute(None, False, None, threads, None)
    write(folder, claims, found)
    return claims


def write(folder: Path, claims: list[Claim], found: dict[str, Any]) -> None:
    """Write claims.toml, README.md and the figures into a folder."""
    figures = folder / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    if "ga" in found:
        run = found["ga"].runs["mean"][0]
        convergence(figures / "fig5.png", found["ga"])
        for name, (number, flight) in {"early": (6, "early"), "midway": (7, "midway"), "final": (8, "final")}.items():
            traces(figures / f"fig{number}.png", run.flights[flight], f"Fig. {number}: best-ever, {name}")
    if "robust" in found:
        front(figures / "pareto.png", found["robust"])
    page.write(folder, PAPER.title, COMMAND, claims, SECTIONS, ABOUT, SEEDS)


def _axes(title: str, rows: int = 1) -> Any:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, rows, figsize=(5.5 * rows, 4.2), layout="constrained")
    figure.suptitle(title)
    return figure, axes


def _save(figure: Any, path: Path) -> None:
    from matplotlib import pyplot

    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def convergence(path: Path, found: Any) -> None:
    """Best-ever and mean fitness over the generations of every seed, like Fig. 5."""
    figure, axes = _axes("Fig. 5: best-ever (solid) and average (dashed) fitness")
    for name, colour in (("mean", "C0"), ("n", "C1")):
        for run in found.runs[name]:
            label = f"{WEIGHTS[run.reading.centroid]} weights" if run is found.runs[name][0] else None
            axes.plot(-np.array(run.best) / FT_LBF, color=colour, linewidth=1.0, label=label)
            axes.plot(-np.array(run.mean) / FT_LBF, "--", color=colour, linewidth=0.6)
    axes.axhline(-9.8, color="0.6", linewidth=0.8, label="published best")
    axes.set(xlabel="generation", ylabel="fitness, ft lbf/s per bird")
    axes.legend()
    _save(figure, path)


def traces(path: Path, flight: Flight, title: str) -> None:
    """Traces in the frame of the flock, and the mean induced drag over time, like Figs 6-8."""
    from airflock.parts.aero import wing as wings
    from airflock.scenarios import load
    from airflock_papers.dimock_2003.static import Air

    wing: wings.Parameters = load("dimock_2003/published").wing
    air = Air(wing)
    figure, (left, right) = _axes(title, 2)
    x, y = flight.frames[:, 0] / FOOT, flight.frames[:, 1] / FOOT
    for i in range(x.shape[1]):
        left.plot(y[:, i], x[:, i], linewidth=0.8)
        left.plot(y[0, i], x[0, i], "^", color="0.4", markersize=5)
        left.plot(y[-1, i], x[-1, i], "ko", markersize=4)
    left.set(xlabel="aside, ft", ylabel="ahead, ft (frame of the air)", aspect="equal")
    every = range(len(x))
    cells = [np.round(flight.frames[k, :3].T.astype(float) / air.h) * air.h for k in every]
    drag = [air.powers(places).mean() / wing.speed for places in cells]
    right.plot([0.1 * k for k in every], drag)
    right.set(xlabel="time, s", ylabel="mean induced drag, N")
    _save(figure, path)


def front(path: Path, found: Any) -> None:
    """Power against crowding: every candidate of the search, and controllers on held-out starts."""
    figure, axes = _axes("Power and closeness over 60 s")
    tried = [c for c in found.tried if np.isfinite(c.power)]
    axes.plot(
        [c.power / FT_LBF for c in tried], [c.crowding for c in tried], ".", color="0.8", label="tried, in training"
    )
    kept = sorted(found.front, key=lambda c: c.power)
    axes.plot([c.power / FT_LBF for c in kept], [c.crowding for c in kept], "s-", color="0.3", label="front, held out")
    for name, flights in found.flights.items():
        alive = [f.power / FT_LBF for f in flights if not f.collided]
        crowding = np.mean([f.values["crowding"] for f in flights])
        told = f"{name}, held out, {1.0 - len(alive) / len(flights):.0%} collide"
        axes.plot(np.mean(alive) if alive else np.nan, crowding, "o", markersize=9, label=told)
    axes.set(xlabel="mean power of those that survive, ft lbf/s per bird", ylabel="crowding")
    axes.legend(fontsize="small")
    _save(figure, path)
