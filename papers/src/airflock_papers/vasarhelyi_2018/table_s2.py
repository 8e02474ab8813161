"""Table S2: order parameters and fitness at the optima, against the table and against the authors' own program."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from airflock.support import holm_correction
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018.published import COLUMNS, EVALUATIONS, REFIT, SPEEDS, optimum, program_runs

PROGRAM = ("phi_vel", "r_min_mean", "f_corr", "f_speed")  # compared with the authors' program
PARTIAL = ("f_disc", "f_coll", "f_wall", "f_cluster", "f_corr", "f_speed")

Tables = Mapping[int, pd.DataFrame]


class Data(NamedTuple):
    """Order parameters by speed: parameters as printed, refitted inside their rounding, and with the cap of Eq. 11."""

    printed: Tables
    refitted: Tables
    capped: Tables


def fly(flights: Flights) -> Data:
    """All flights behind the claims about Table S2."""
    seeds = flights.count(EVALUATIONS, 10)
    printed = flights.score("Table S2, printed parameters", {v: optimum(v) for v in SPEEDS}, seeds)
    refitted = flights.score("Table S2, refitted p_rep", {v: optimum(v, REFIT[v]) for v in REFIT}, seeds)
    caps = {v: optimum(v, {"model.limit": "cap"}) for v in SPEEDS}
    capped = flights.score("Table S2, cap of Eq. 11", caps, flights.count(20, 5))
    return Data(
        {v: printed.loc[v] for v in SPEEDS}, {v: refitted.loc[v] for v in REFIT}, {v: capped.loc[v] for v in SPEEDS}
    )


def measured(data: Data) -> list[Measured]:
    """Everything that is said of Table S2."""
    printed, refitted, capped = data
    return [
        *corrected([against_paper(v, column, printed, refitted) for v in SPEEDS for column in COLUMNS]),
        *(best(v, printed[v]) for v in SPEEDS[:3]),
        loss_by_collisions(printed[32]),
        *(against_program(v, column, printed[v]) for v in SPEEDS for column in PROGRAM),
        *(collisions(v, printed[v]) for v in SPEEDS),
        *(rounding(v, printed[v], refitted[v]) for v in REFIT),
        *(cap(v, capped[v]) for v in SPEEDS),
    ]


def corrected(rows: Sequence[Measured]) -> list[Measured]:
    """Rows of the table with p corrected for their number; what the row would give by itself stands in its note."""
    ps = holm_correction([math.nan if row.p is None else row.p for row in rows])
    return [replace(row, p=p, note=row.note + _alone(row.p or 0.0, p)) for row, p in zip(rows, ps, strict=True)]


def _alone(p: float, in_table: float) -> str:
    """What an entry would give by itself."""
    kept = p < 0.05 <= in_table
    return f"; p = {p:.2g} by itself" + (", by which it was not reproduced until 2026-11-22" if kept else "")


def against_paper(v: int, column: str, printed: Tables, refitted: Tables) -> Measured:
    """One entry of Table S2, by Welch's test of the means, its p not yet corrected."""
    mean, sd = optimum(v).published[column]
    found = statistics.mean(printed[v][column])
    p = statistics.welch(found, mean, sd or 0.0, EVALUATIONS)
    off = f"{(found.ours - mean) / sd:+.1f} printed SD" if sd else f"off by {found.ours - mean:+.2g}"
    return Measured(f"s2.{column}.{v}ms", column, f"{v} m/s", found, off + _others(v, column, refitted, p), p)


def _others(v: int, column: str, refitted: Tables, p: float) -> str:
    """What the authors' program and the refitted parameters give where the printed ones miss the table."""
    if p >= 0.05:
        return ""
    program = statistics.mean(program_runs(v, ("stock_abs", "stock") if v < 32 else ("stock_abs",))[column])
    text = f"; the authors' program with the same digits {program.ours:.3g} ± {program.sd:.2g} ({program.runs} runs)"
    if v in refitted:
        fit = statistics.mean(refitted[v][column])
        text += f"; ours with {_fitted(v)}, inside the rounding of Table S1, {fit.ours:.3g} ± {fit.sd:.2g}"
    if column == "f_wall" or (column == "fitness" and v == 32):
        text += "; the program's own average divides by steps, not agents, and gives a higher F_wall than Eq. 15"
    return text


def best(v: int, ours: pd.DataFrame) -> Measured:
    """The least of disc, coll, wall and cluster in the best flight."""
    row = ours.loc[ours["fitness"].idxmax()]
    least = statistics.one(min(row["f_disc"], row["f_coll"], row["f_wall"], row["f_cluster"]), len(ours))
    note = f"fitness {row['fitness']:.3f} in the best of {len(ours)} flights, F^coll {row['f_coll']:.3f}"
    return Measured(f"s2.best.{v}ms", "four partial fitnesses", f"{v} m/s, the best flight", least, note)


def loss_by_collisions(ours: pd.DataFrame) -> Measured:
    """Share of F^coll in the logarithm of the product of the mean partial fitnesses."""
    loss = -np.log(ours[list(PARTIAL)].mean())
    told = ", ".join(f"{name} {ours[name].mean():.3f}" for name in PARTIAL)
    share = statistics.one(float(loss["f_coll"] / loss.sum()), len(ours))
    return Measured("s2.loss.32ms", "share of the loss by f_coll", "32 m/s, means of the flights", share, told)


def against_program(v: int, column: str, ours: pd.DataFrame) -> Measured:
    """One order parameter against the authors' program with the same parameters.

    Medians at 4 m/s, where flights settle in one of two patterns and a mean depends on how many settle in which.
    """
    runs = program_runs(v)[column]
    middle = statistics.median if v == 4 else statistics.mean
    theirs, sd = float(runs.median() if v == 4 else runs.mean()), float(runs.std(ddof=1))
    found = middle(ours[column])
    z = (found.ours - theirs) / ((found.sd or 0.0) ** 2 / found.runs + sd**2 / len(runs)) ** 0.5
    at = f"{v} m/s, {'median' if v == 4 else 'mean'}"
    return Measured(
        f"program.{column}.{v}ms",
        column,
        at,
        found,
        f"z = {z:+.1f}; {len(runs)} runs of the program",
        reference=(theirs, sd),
    )


def collisions(v: int, ours: pd.DataFrame) -> Measured:
    """Number of collisions over that of the authors' program: rank test, and ratio of means with its interval.

    Up to 16 m/s both variants of the program are pooled, of each seed the stock_abs run where there is one, as in the
    other comparisons. The note tells what the stock runs alone would give, since the choice matters at 6 m/s.
    """
    variants = ("stock_abs", "stock") if v < 32 else ("stock_abs",)
    runs = program_runs(v, variants)["n_coll"]
    note = f"{ours['n_coll'].mean():.2f} against {runs.mean():.2f} ({len(runs)} runs of the program)"
    if v < 32:
        stock = program_runs(v, ("stock",))["n_coll"]
        chance = statistics.rank_test(ours["n_coll"], stock)
        note += (
            f"; against its {len(stock)} runs of the variant stock alone p = {chance:.2g}: which variant to prefer was "
            "settled after both had been seen"
        )
    return Measured(
        f"program.n_coll.{v}ms",
        "n_coll",
        f"{v} m/s, ratio of means",
        statistics.ratio(ours["n_coll"], runs),
        note,
        statistics.rank_test(ours["n_coll"], runs),
        (1.0, None),
    )


def rounding(v: int, printed: pd.DataFrame, refitted: pd.DataFrame) -> Measured:
    """What p_rep inside the rounding of Table S1 does to the distance of the nearest neighbour."""
    s2 = optimum(v).published
    others = "; ".join(
        f"{c} {printed[c].mean():.4g} → {refitted[c].mean():.4g} (S2 {s2[c][0]:g})"
        for c in ("r_min_mean", "phi_vel", "f_corr", "n_coll", "f_wall", "fitness")
    )
    found = statistics.mean(refitted["r_min_mean"])
    return Measured(f"s2.refit.{v}ms", "r_min_mean", f"{v} m/s", found, f"with {_fitted(v)}: {others}")


def cap(v: int, capped: pd.DataFrame) -> Measured:
    """What the printed limit of Eq. 11 gives instead of the rescaling to v_flock."""
    s2 = optimum(v).published
    others = "; ".join(f"{c} {capped[c].mean():.3g} (S2 {s2[c][0]:g})" for c in ("r_min_mean", "f_corr", "fitness"))
    found = statistics.mean(capped["phi_vel"])
    off = f"{found.ours / s2['phi_vel'][0] - 1.0:+.0%} of Table S2"
    return Measured(f"s2.cap.{v}ms", "phi_vel", f"{v} m/s", found, f"{off}; {others}")


def _fitted(v: int) -> str:
    return ", ".join(f"{key.split('.')[1]} = {value:g}" for key, value in REFIT[v].items())
