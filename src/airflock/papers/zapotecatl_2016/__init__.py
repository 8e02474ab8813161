"""Zapotecatl, Muñoz-Meléndez and Gershenson 2016: performance metrics of collective coordinated motion in flocks.

Parts: sequential (the authors' order of updates), synchronous, printed (Eqs 2-12 as they stand). Each flies boids with
r_s and r_a in {0, 10, .. 50} cm and compares extension, polarization, collisions, consistencies and quality.
"""

import csv
from importlib import resources
from typing import Any

import pandas as pd

from airflock.errors import AirflockError
from airflock.papers.claims import Claim
from airflock.papers.flights import Flights, Progress, progress_bar
from airflock.papers.zapotecatl_2016 import marks, verdicts
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario

TITLE = "Zapotecatl et al. 2016, Performance Metrics of Collective Coordinated Motion in Flocks"
PARTS = ("sequential", "synchronous", "printed")
RADII = (0, 10, 20, 30, 40, 50)  # cm
COARSE = {"dt": 0.004, "duration": 89.996}  # 22,500 samples
COARSE_OFF = [(0, 0), (20, 10)]  # where the step of the coarse form shows


def configurations(preset: str, **settings: Any) -> dict[tuple[int, int], Scenario]:
    """The 36 scenarios of Figs 4-7 by (r_s, r_a) in cm."""
    return {
        (r_s, r_a): load(preset, {"model.r_s": r_s / 100, "model.r_a": r_a / 100, **settings})
        for r_s in RADII
        for r_a in RADII
    }


def published() -> pd.DataFrame:
    """Figure 7 and the consistencies, digitised from the plots in the authors' slides; index (r_s, r_a) in cm.

    The index has no names, as that of flights: pandas joins indices of different rows by name only.
    """
    text = resources.files(__package__).joinpath("figures.csv").read_text(encoding="utf-8")
    table = pd.DataFrame(list(csv.DictReader(text.splitlines()))).astype(float)
    return table.astype({"r_s": int, "r_a": int}).set_index(["r_s", "r_a"]).rename_axis([None, None])


def run(
    only: str | None = None,
    quick: bool = False,
    seeds: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> list[Claim]:
    """Recompute the paper's numbers.

    only    : one of PARTS; quick : dt of 4 ms, few seeds; seeds : flights per configuration instead of the paper's 15
    threads : flights side by side; progress : called with (title, flights done, flights in all), by default a bar
    """
    return recompute(only, quick, seeds, threads, progress)[0]


def recompute(
    only: str | None, quick: bool, seeds: int | None, threads: int | None, progress: Progress | None
) -> tuple[list[Claim], dict[str, pd.DataFrame]]:
    """Claims, and by part the order parameters of every flight."""
    if only is not None and only not in PARTS:
        raise AirflockError(f"only = {only!r} is no part; known: {', '.join(PARTS)}")
    if progress is None:
        with progress_bar() as bar:
            return recompute(only, quick, seeds, threads, bar)
    flights = Flights(quick=quick, seeds=seeds, threads=threads, progress=progress)
    found: dict[str, pd.DataFrame] = {}
    claims: list[Claim] = []
    usual = PARTS if not quick else ("sequential", "printed")
    for part in usual if only is None else (only,):
        found[part] = _fly(part, flights)
        claims += verdicts.claims(part, found[part], published().drop(COARSE_OFF if quick else []))
        claims += marks.claims(flights) if part == "sequential" and not quick else []
    return claims, found


def _fly(part: str, flights: Flights) -> pd.DataFrame:
    if part == "printed":
        scenarios = configurations("zapotecatl_2016/literal", duration=9_999.0)
        return flights.score("Eqs 2-12 as printed", scenarios, flights.count(3, 1))
    settings = COARSE if flights.quick else {}
    scenarios = configurations("zapotecatl_2016/best", update=part, **settings)
    return flights.score(f"Figs 4-7, {part} update", scenarios, flights.count(15, 2))
