"""The committed report: claims.toml, README.md and figures in papers/kidger/."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from airflock_papers import page
from airflock_papers.claims import Claim
from airflock_papers.kidger import PAPER, figures, readings
from airflock_papers.kidger.schemes import COLUMNS, SCENES, SCHEMES
from airflock_papers.kidger.tuning import CURVE, DURATION, SEEDS
from airflock_papers.page import Section

COMMAND = "airflock paper kidger"
ABOUT = (
    "`python papers/kidger/reproduce.py` also rewrites this folder. The thesis shows its results by videos, which are "
    "not available; here its sentences are judged by numbers. Lengths are in m (one unit is 1 m), 60 frames are a "
    "second. Separation is flown as the thesis prints it: the inverse vector itself, a metre being a metre per frame."
)
TUNING = (
    f"{DURATION:g} s, final set, in open air (the city without buildings) and in the city. {SEEDS} seeds for the "
    f"points that a sentence compares, {CURVE} for the others. n_coll counts how often two boids meet: boids that "
    "stay in contact meet once. A flock that never was complete counts with the whole flight."
)


READINGS = (
    "The thesis prints separation as the inverse vector to a neighbour, which at more than 4 m fills the cap of scheme "
    '5 and so comes before everything else; it leaves the radius of "flocked" open, and prints a cohesion that is a '
    "bare offset of up to 40 m. The default is the reading with the fewest collisions; among equals that with the most "
    "goals, then that with the largest share flocked. Ten flights of 120 s with ten boids, means."
)


SECTIONS = (
    Section("readings.", "The reading of separation", READINGS),
    Section("conduct.", "Collisions, and how boids behave", "Final set, 20 seeds; 120 s in each scene."),
    Section(
        "only.",
        "One rule alone, or missing",
        "30 s in open air, 20 seeds, against boids without the rule on the same seeds; obstacle avoidance in the city.",
    ),
    Section(
        "schemes.",
        "Five recombination schemes in a city and a forest",
        "Ten boids, 120 s, 20 seeds, the final set; means.",
        ("city", "forest", "space", "rays", "flocked"),
    ),
    Section(
        "corners.",
        "Thin walls and corners",
        "Walls 1 cm thick, crosses of two of them and sharp corners in a plane; 100 flights of 100 boids that know "
        "nothing but obstacles and their way.",
    ),
    Section("tuning.", "Every radius and scale alone", TUNING, ("tuning_open_air", "tuning_city")),
    Section("shepherd.", "The negative goal"),
)


def sections(readings_flown: pd.DataFrame, schemes: pd.DataFrame) -> tuple[Section, ...]:
    """Sections of the page; order parameters by (reading, scene, seed) and by (scene, scheme, seed)."""
    shown = {"readings.": readings.shown(readings_flown), "schemes.": _table(schemes)}
    return tuple(
        replace(each, words=f"{each.words}\n\n{shown[each.start]}") if each.start in shown else each
        for each in SECTIONS
    )


def reproduce(folder: Path, threads: int | None = None) -> list[Claim]:
    """Fly everything, then write claims.toml, README.md and the figures."""
    claims, flown = PAPER.recompute(None, False, None, threads, None)
    write(folder, claims, flown)
    return claims


def write(folder: Path, claims: list[Claim], flown: dict[str, Any]) -> None:
    """Write the report into a folder."""
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    figures.draw(folder / "figures", flown["tuning"])
    page.write(folder, PAPER.title, COMMAND, claims, sections(flown["readings"], flown["schemes"].table), ABOUT)


def _table(schemes: pd.DataFrame) -> str:
    """Five schemes in two scenes, means over the seeds."""
    means = schemes.groupby(level=[0, 1])[list(COLUMNS)].mean()
    head = ["| scene | scheme | " + " | ".join(COLUMNS) + " |", "|" + "---|" * (2 + len(COLUMNS))]
    rows = [
        f"| {scene} | {scheme} | " + " | ".join(f"{means.loc[(scene, scheme), c]:.4g}" for c in COLUMNS) + " |"
        for scene in SCENES
        for scheme in SCHEMES
    ]
    return "\n".join([*head, *rows])
