"""Table S1: the paper's evolution repeated, its optima and working ranges against ours.

Long: three runs of 15,000 flights at 4, 6, 8 m/s, one at 16 and 32 m/s, so it is flown only when it is asked for by
name. The studies lie in Airflock's cache folder and are continued where they were left. The search flies in coarser
steps than the paper (`COARSE`); what is claimed of the optima is measured with the paper's own.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from airflock.runs import with_parameters
from airflock.search import EvolveResult
from airflock.support import holm_correction
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.studies import evolve
from airflock_papers.vasarhelyi_2018 import searches
from airflock_papers.vasarhelyi_2018.published import EVALUATIONS, REFIT, SPEEDS, optimum
from airflock_papers.vasarhelyi_2018.searches import COARSE

RUNS = {4: 3, 6: 3, 8: 3, 16: 1, 32: 1}  # "at least three independent runs" at the first three speeds
FLIGHTS = 1600  # of each of our optima: with 400 the p of a mean near its bound was 0.02 or 0.16, by chance
PAIRS = 400  # paired flights, ours against S1: the first of those
COLUMNS = (
    "r0_rep",
    "p_rep",
    "r0_frict",
    "c_frict",
    "v_frict",
    "p_frict",
    "a_frict",
    "r0_shill",
    "v_shill",
    "p_shill",
    "a_shill",
)


class Data(NamedTuple):
    """By speed: the result of every run, the best first; flights of its optimum, of S1, and of S1 refitted."""

    runs: Mapping[int, list[EvolveResult]]
    ours: Mapping[int, pd.DataFrame]
    published: Mapping[int, pd.DataFrame]
    refitted: Mapping[int, pd.DataFrame]


def fly(flights: Flights, runs: Mapping[int, int] = RUNS) -> Data:
    """All studies, and the flights of their optima; runs: independent runs by speed (m/s)."""
    found = {
        v: sorted(
            (
                evolve(flights, f"Table S1, evolution at {v} m/s, run {i + 1}", f"vasarhelyi_2018/{v}ms", i, COARSE)
                for i in range(1 if flights.quick else several)
            ),
            key=lambda result: -result.fitness,
        )
        for v, several in runs.items()
    }
    pairs = flights.count(PAIRS, 20)
    optima = {v: with_parameters(optimum(v), found[v][0].parameters) for v in found}
    ours = flights.score("Table S1, our optima", optima, flights.count(FLIGHTS, 20))
    published = flights.score("Table S1, published optima", {v: optimum(v) for v in found}, pairs)
    fits = {v: optimum(v, REFIT[v]) for v in found if v in REFIT}
    refitted = flights.score("Table S1, refitted inside its rounding", fits, pairs) if fits else pd.DataFrame()
    return Data(
        found,
        {v: ours.loc[v] for v in found},
        {v: published.loc[v] for v in found},
        {v: refitted.loc[v] for v in fits},
    )


def measured(data: Data) -> list[Measured]:
    """Everything that is said of the evolution."""
    optima = {v: {name: runs[0].parameters[f"model.{name}"] for name in COLUMNS} for v, runs in data.runs.items()}
    found = [exponent(optima, name) for name in ("r0_rep", "v_shill")] if len(optima) > 2 else []
    found += searches.measured(searches.by_rank(data.runs))
    for v, runs in data.runs.items():
        best, at = runs[0], f"{v} m/s"
        ranges = {name: _range(best, name) for name in COLUMNS}
        found += [
            *gains(v, data.ours[v], data.published[v], data.refitted.get(v)),
            Measured(
                f"s1.count.{v}ms", "evaluations above the mean", at, statistics.one(best.above, best.candidate_count)
            ),
            *of_optimum(v, optima[v], data.ours[v], ranges),
        ]
    return means_tested(found)


def means_tested(found: Sequence[Measured]) -> list[Measured]:
    """Mean fitnesses with p of Welch's test against Table S1, corrected over its columns; the rest as it is."""
    means = {each.id: each.value for each in found if each.id.startswith("s1.mean.")}
    printed = {v: optimum(v).published["fitness"] for v in SPEEDS}
    ps = holm_correction([
        statistics.welch(means[name], mean, sd or 0.0, EVALUATIONS) if (name := f"s1.mean.{v}ms") in means else math.nan
        for v, (mean, sd) in printed.items()
    ])  # fmt: skip
    by_id = {f"s1.mean.{v}ms": p for v, p in zip(printed, ps, strict=True)}
    return [replace(each, p=by_id.get(each.id, each.p)) for each in found]


def of_optimum(
    v: int, p: Mapping[str, float], ours: pd.DataFrame, ranges: Mapping[str, str] | None = None
) -> list[Measured]:
    """What is said of one optimum: its parameters p, its flights, and a note on the working range of each."""
    at, gap, reach = f"{v} m/s", float(ours["r_min_mean"].mean()), optimum(v).radio.range
    apart = f"r0_rep = {p['r0_rep']:.1f} m, nearest neighbours {gap:.1f} m apart"
    slack = f"v_frict {p['v_frict'] / v:.2f} of v_flock"
    one = statistics.one
    return [
        Measured(f"s1.mean.{v}ms", "fitness", at, statistics.mean(ours["fitness"])),
        Measured(f"s1.soft.{v}ms", "r0_rep over r_min_mean", at, one(p["r0_rep"] / gap, len(ours)), apart),
        Measured(f"s1.long.{v}ms", "r0_frict over range", at, one(p["r0_frict"] / reach), slack),
        Measured(f"s1.twice.{v}ms", "v_shill over v_flock", at, one(p["v_shill"] / v)),
        *(
            Measured(f"s1.range.{name}.{v}ms", f"evolved {name}", at, one(p[name]), (ranges or {}).get(name, ""))
            for name in COLUMNS
        ),
    ]


def gains(v: int, ours: pd.DataFrame, printed: pd.DataFrame, refitted: pd.DataFrame | None) -> list[Measured]:
    """Fitness of our optimum less that of Table S1, as printed and refitted, with and without F_wall.

    Paired: of ours, which may have flown more seeds, those that the other has flown.
    """
    found = []
    for name, at, theirs in (("", "paired", printed), (".refit", "paired, S1 refitted", refitted)):
        if theirs is None:
            continue
        mine = ours.loc[theirs.index]
        pairs = {"": mine["fitness"] - theirs["fitness"], ".no_wall": without_wall(mine) - without_wall(theirs)}
        for wall, gap in pairs.items():
            words = f"{v} m/s, {at}" + ", without F_wall" * bool(wall)
            found.append(Measured(f"s1.gain{name}{wall}.{v}ms", "fitness", words, statistics.mean(gap)))
    return found


def without_wall(scores: pd.DataFrame) -> pd.Series:
    """Fitness of flights as if nobody had left the arena."""
    return scores[["f_speed", "f_coll", "f_disc", "f_cluster", "f_corr"]].prod(axis=1)


def _range(best: EvolveResult, name: str) -> str:
    low, high = best.ranges[f"model.{name}"]
    return f"our working range {low:.3g} to {high:.3g}"


def exponent(optima: Mapping[int, Mapping[str, float]], name: str) -> Measured:
    """Exponent of the flocking speed with which an evolved parameter grows; 1 is linear through 0."""
    speeds = np.log(list(optima))
    fit = stats.linregress(speeds, np.log([p[name] for p in optima.values()]))
    half = float(stats.t.ppf(0.975, len(speeds) - 2)) * fit.stderr
    value = statistics.Estimate(fit.slope, None, fit.slope - half, fit.slope + half, len(speeds))
    return Measured(f"s1.linear.{name}", f"exponent of {name}", "optima of all speeds", value)
