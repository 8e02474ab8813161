"""The thesis's second wish, a drone display: time to form, residual error and collisions while drones fail."""

from functools import partial
from typing import Any

import pandas as pd

from airflock.display import fly_show, points_of
from airflock.engine.threads import in_threads
from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights

DRONES = 200
SHAPES = ("AIR", "2026", "<3", "FLOCK", "OK")
FAILING = (0.0, 0.05, 0.1, 0.2)
SEEDS = 20  # of 10 % failing, which a claim is about
FEW = 5  # of the other shares
GUST = {"wind.gust": 3.0, "wind.east": 3.0}


def fly(flights: Flights) -> pd.DataFrame:
    """Figures of every shape by (share failing, wind, seed, shape)."""
    count = 30 if flights.quick else DRONES
    shapes = [points_of(text, count, seed=number) for number, text in enumerate(SHAPES)]
    many, few = flights.count(SEEDS, 1), flights.count(FEW, 1)
    cases: list[tuple[float, str, int]] = [(s, "calm", k) for s in FAILING for k in range(many if s == 0.1 else few)]
    cases += [(0.1, "windy", k) for k in range(few)]
    jobs: list[Any] = [
        partial(fly_show, shapes, count, share, "both", seed, GUST if wind == "windy" else None)
        for share, wind, seed in cases
    ]
    jobs[0]()  # compiles before threads ask for it
    rows: dict[Any, dict[str, Any]] = {}
    for case, show in zip(cases, in_threads(jobs, flights.threads), strict=True):
        rows |= {(*case, number): vars(formed) for number, formed in enumerate(show.formed)}
    return pd.DataFrame.from_dict(rows, orient="index").sort_index()


def claims(table: pd.DataFrame) -> list[Claim]:
    """What must hold with a tenth failing; and the figures of every share."""
    tenth = table.loc[(0.1, "calm")]
    hits = tenth[["collisions", "hulls", "struck"]].sum()
    placed = bool((tenth["worst"] <= 1.0).all() and tenth["time"].notna().all())
    found = [
        Claim(
            id="display.placed", statement="200 drones, five shapes, 10 % failing: largest distance from the point, m",
            source="Kidger, section 7", test="every surviving drone within 1 m of its point, in every shape",
            **statistics.mean(tenth["worst"]).fields(),
            **judged(placed, f"largest of all {tenth['worst'].max():.2g} m"),
        ),
        Claim(
            id="display.collisions", statement="the same flights: collisions per shape",
            source="Kidger, section 7", test="none of two drones, none with one that hovers",
            **statistics.mean(tenth["collisions"] + tenth["hulls"]).fields(),
            **judged(
                hits["collisions"] + hits["hulls"] == 0,
                f"{hits['collisions']} of two drones, {hits['hulls']} with one that hovers; "
                f"{hits['struck']} struck by one that fell, of {len(tenth)} shapes",
            ),
        ),
    ]  # fmt: skip
    for (share, wind), rows in table.groupby(level=[0, 1]):
        hit = rows[["collisions", "hulls", "struck"]].sum().tolist()
        found.append(
            Claim(
                id=f"display.{wind}.{100 * share:.0f}", statement=f"s to form a shape, {share:.0%} failing, {wind}",
                source="Kidger, section 7", test="none: a wish", **statistics.mean(rows["time"]).fields(),
                verdict="finding",
                reason=f"residual error {rows['error'].mean():.2g} m in the mean, {rows['worst'].max():.2g} m at most; "
                f"{hit[0]} collisions of two drones, {hit[1]} with one that hovers, {hit[2]} struck by one that fell; "
                f"{rows['time'].isna().sum()} of {len(rows)} shapes never complete",
            )
        )  # fmt: skip
    return found
