"""The committed report: claims.toml, README.md and figures in papers/kidger/."""

from pathlib import Path
from typing import Any

import pandas as pd

from airflock import atomic
from airflock.papers import claims as records
from airflock.papers.claims import VERDICTS, Claim
from airflock.papers.kidger import PAPER, figures
from airflock.papers.kidger.schemes import COLUMNS, SCENES, SCHEMES
from airflock.papers.kidger.tuning import CURVE, DURATION, SEEDS

COMMAND = "airflock paper kidger"
SECTIONS = (
    (
        "schemes",
        "Five recombination schemes in a city and a forest",
        "Ten boids, 120 s, 20 seeds, the final set. The table gives means; below, why scheme 2 collides: the last "
        "decision before each of 200 collisions, made once more oracle by oracle.",
    ),
    (
        "corners",
        "Thin walls and corners",
        "Walls 1 cm thick, crosses of two of them and sharp corners in a plane; 100 flights of 100 boids that know "
        "nothing but obstacles and their way.",
    ),
    (
        "tuning",
        "Every radius and scale alone",
        f"{DURATION:g} s, final set, in open air (the city without buildings) and in the city. {SEEDS} seeds for the "
        f"points that a statement compares, {CURVE} for the others. n_coll counts how often two boids meet: boids that "
        "stay in contact meet once. A flock that never was complete counts with the whole flight.",
    ),
    ("presets", "Presets: final, natural, poor", "120 s, 20 seeds each."),
    ("shepherd", "The negative goal", ""),
    (
        "cost",
        "What a boid costs",
        "Processor time of one core, the least of five flights; decisions, motion and every order parameter at 60 "
        "frames per second.",
    ),
    (
        "learnt",
        "Learnt parameters",
        "120 s, 20 seeds; every flight has a city or forest of its own, which no study has seen, and both sets fly the "
        "same ones: intervals are of paired differences. `airflock evolve kidger/city` and `kidger/forest` learnt nine "
        "radii and scales by CMA-ES on the fitness of `metrics/fitness_kidger.py`: share flocked, share of goals "
        "reached averaged over the flight, collisions of two boids (when they meet, and for every second in contact), "
        "collisions with the scene.",
    ),
    (
        "display",
        "A drone display",
        "200 drones form AIR, 2026, <3, FLOCK and OK one after another (`airflock display`). Drones that fail fall or "
        "hover, in turns; windy is 3 m/s with gusts of 3 m/s. Time counts from the shape before.",
    ),
)
PICTURES = {"schemes": ("city", "forest", "space", "rays", "flocked"), "tuning": ("tuning_open_air", "tuning_city")}


def reproduce(folder: Path, seeds: int | None = None, threads: int | None = None) -> list[Claim]:
    """Fly everything, then write claims.toml, README.md and the figures."""
    claims, flown = PAPER.recompute(None, False, seeds, threads, None)
    write(folder, claims, flown, seeds)
    return claims


def write(folder: Path, claims: list[Claim], flown: dict[str, Any], seeds: int | None = None) -> None:
    """Write the report into a folder."""
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    figures.draw(folder / "figures", flown["tuning"])
    records.write_claims(folder / "claims.toml", claims, records.header(PAPER.title, COMMAND, seeds))
    read = records.read_claims(folder / "claims.toml")[1]  # so that both show the same rounded numbers
    atomic.write(folder / "README.md", page(read, flown["schemes"].table))


def page(claims: list[Claim], schemes: pd.DataFrame) -> str:
    """README.md: verdicts, tables and figures."""
    count = {verdict: sum(claim.verdict == verdict for claim in claims) for verdict in VERDICTS}
    lines = [
        f"# {PAPER.title}",
        "",
        f"`{COMMAND}` flies all this again; `python papers/kidger/reproduce.py` also rewrites this folder. The thesis "
        "shows its results by videos, which are not available; here its statements are tests. Lengths are in m (one "
        "unit is 1 m), 60 frames are a second. Tests and sources of each claim stand in [claims.toml](claims.toml).",
        "",
        f"**{count['reproduced']} reproduced, {count['not reproduced']} not reproduced, {count['finding']} findings.** "
        "A finding has nothing printed to agree with.",
        "",
        "## Not reproduced",
        "",
        records.markdown([claim for claim in claims if claim.verdict == "not reproduced"]),
    ]
    for part, title, words in SECTIONS:
        mine = [claim for claim in claims if claim.id.startswith(f"{part}.")]
        lines += [f"## {title}", "", *([words, ""] if words else [])]
        lines += [_table(schemes), ""] if part == "schemes" else []
        lines += [text for name in PICTURES.get(part, ()) for text in (f"![{name}](figures/{name}.png)", "")]
        told = [claim for claim in mine if claim.reason and claim.verdict != "not reproduced"]
        lines += [records.markdown(mine, reasons=False)]
        lines += [*(f"* `{claim.id}`: {claim.reason}" for claim in told), ""] if told else []
    return "\n".join(lines).rstrip() + "\n"


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
