"""The thesis's second wish, a drone display: time to form, residual error and collisions while drones fail."""

from functools import partial
from typing import Any

import pandas as pd

from airflock.displays import fly_show, shape_points
from airflock.support import run_in_threads
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

DRONES = 200
SHAPES = ("AIR", "2026", "<3", "FLOCK", "OK")
FAILING = (0.0, 0.05, 0.1, 0.2)
SEEDS = 20  # of 10 % failing, which a claim is about
FEW = 5  # of the other shares
GUST = {"wind.gust": 3.0, "wind.east": 3.0}


def fly(flights: Flights) -> pd.DataFrame:
    """Figures of every shape by (share failing, wind, seed, shape)."""
    count = 30 if flights.quick else DRONES
    shapes = [shape_points(text, count, seed=number) for number, text in enumerate(SHAPES)]
    many, few = flights.count(SEEDS, 1), flights.count(FEW, 1)
    cases: list[tuple[float, str, int]] = [(s, "calm", k) for s in FAILING for k in range(many if s == 0.1 else few)]
    cases += [(0.1, "windy", k) for k in range(few)]
    jobs: list[Any] = [
        partial(fly_show, shapes, count, share, "both", seed, GUST if wind == "windy" else None)
        for share, wind, seed in cases
    ]
    jobs[0]()  # compiles before threads ask for it
    rows: dict[Any, dict[str, Any]] = {}
    for case, show in zip(cases, run_in_threads(jobs, flights.threads), strict=True):
        rows |= {(*case, number): vars(formed) for number, formed in enumerate(show.shape_reports)}
    return pd.DataFrame.from_dict(rows, orient="index").sort_index()


def measured(table: pd.DataFrame) -> list[Measured]:
    """Largest distance from the point and collisions with a tenth failing; time to form with every share."""
    tenth = table.loc[(0.1, "calm")]
    hits = tenth[["collisions", "hulls", "struck"]].sum()
    at, never = "200 drones, 10 % failing, calm", int(tenth["time"].isna().sum())
    worst = statistics.mean(tenth["worst"])._replace(ours=float(tenth["worst"].max()), low=None, high=None)
    found = [
        Measured(
            "display.placed", "distance to the point", f"{at}, largest of all", worst, f"{never} shapes never complete"
        ),
        Measured(
            "display.collisions",
            "n_coll",
            at,
            statistics.mean(tenth["collisions"] + tenth["hulls"]),
            f"{hits['struck']} struck by one that fell, of {len(tenth)} shapes",
        ),
    ]
    for (share, wind), rows in table.groupby(level=[0, 1]):
        hit = rows[["collisions", "hulls", "struck"]].sum().tolist()
        note = (
            f"residual error {rows['error'].mean():.2g} m in the mean, {rows['worst'].max():.2g} m at most; {hit[0]} "
            f"collisions of two drones, {hit[1]} with one that hovers, {hit[2]} struck by one that fell; "
            f"{rows['time'].isna().sum()} of {len(rows)} shapes never complete"
        )
        name, at = f"display.{wind}.{100 * share:.0f}", f"s to form a shape, {share:.0%} failing, {wind}"
        found.append(Measured(name, "time to form", at, statistics.mean(rows["time"]), note))
    return found
