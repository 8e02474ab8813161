"""Zapotecatl, Muñoz-Meléndez and Gershenson 2016: performance metrics of collective coordinated motion in flocks.

Parts: sequential (the authors' order of updates), synchronous, printed (Eqs 2-12 as they stand). Each flies boids with
r_s and r_a in {0, 10, .. 50} cm and compares extension, polarization, collisions, consistencies and quality. Then
subgroups (what the measures make of a flock that split), and evolved (radii, fields of view and weights evolved for
quality), which is flown only when it is asked for by name.

The figures were measured by the authors' program, so the first two parts count collisions as it does
(`metrics.count = "program"`); printed counts by Eq. 18, and one claim shows what Eq. 18 would change. The sentences of
the paper are judged by the sequential flights.
"""

import csv
from collections.abc import Sequence
from importlib import resources
from typing import Any

import pandas as pd

from airflock.scenarios import Scenario, load
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.paper import Flown, Paper
from airflock_papers.zapotecatl_2016 import evolved, subgroups, verdicts

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


def fly(wanted: Sequence[str], flights: Flights) -> Flown:
    """Fly the parts that are wanted; without a name, a quick run leaves the synchronous boids out."""
    found: dict[str, Any] = {}
    measured: list[Measured] = []
    for part in wanted:
        if part == "synchronous" and flights.quick and len(wanted) > 1:
            continue
        if part == "evolved":
            found[part] = evolved.fly(flights)
            measured += evolved.measured(found[part])
            continue
        if part == "subgroups":
            found[part] = subgroups.fly(flights)
            measured += subgroups.measured(found[part])
            continue
        found[part] = _fly(part, flights)
        measured += verdicts.measured(part, found[part], published().drop(COARSE_OFF if flights.quick else []))
        if part == "sequential" and not flights.quick:
            measured.append(verdicts.by_eq_18(_fly_by_eq_18(flights)))
            settled = verdicts.seldom(_fly_seldom(flights))
            measured = [settled if each.id == settled.id else each for each in measured]
    return measured, found


def _fly(part: str, flights: Flights) -> pd.DataFrame:
    if part == "printed":
        scenarios = configurations("zapotecatl_2016/literal", duration=9_999.0)
        return flights.score("Eqs 2-12 as printed", scenarios, flights.count(3, 1))
    settings = {"metrics.count": "program", **(COARSE if flights.quick else {})}
    scenarios = configurations("zapotecatl_2016/best", update=part, **settings)
    return flights.score(f"Figs 4-7, {part} update", scenarios, flights.count(15, 2))


def _fly_by_eq_18(flights: Flights) -> pd.DataFrame:
    r_s = verdicts.DENSE
    scenario = load("zapotecatl_2016/best", {"model.r_s": r_s / 100, "model.r_a": 0.0, "metrics.count": "each"})
    return flights.score("Collisions by Eq. 18", {(r_s, 0): scenario}, flights.count(15, 2))


def _fly_seldom(flights: Flights) -> pd.DataFrame:
    """More flights where collisions are the fewest: a tenth of them has six tenths of all contacts."""
    at, _ = verdicts.MINIMA["f_collision"]
    scenario = configurations("zapotecatl_2016/best", update="sequential", **{"metrics.count": "program"})[at]
    return flights.score("Fewest collisions", {at: scenario}, flights.count(120, 2))


PAPER = Paper(
    "Zapotecatl et al. 2016, Performance Metrics of Collective Coordinated Motion in Flocks",
    __name__,
    ("sequential", "synchronous", "printed", "subgroups"),
    fly,
    long=("evolved",),
)
