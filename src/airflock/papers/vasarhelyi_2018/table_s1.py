"""Table S1: the paper's evolution repeated, its optima and working ranges against ours.

Long: three runs of 15,000 flights at 4, 6, 8 m/s, one at 16 and 32 m/s, so it is flown only when it is asked for by
name. The studies lie in Airflock's cache folder and are continued where they were left.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import pandas as pd

from airflock.engine.store import cache_folder
from airflock.evolve.after import Result
from airflock.evolve.folder import STUDY, open_folder
from airflock.evolve.run import executor_for, run
from airflock.evolve.search import Progress
from airflock.evolve.study import load_study
from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.papers.vasarhelyi_2018.published import SPEEDS, optimum

RUNS = {4: 3, 6: 3, 8: 3, 16: 1, 32: 1}  # "at least three independent runs" at the first three speeds
PAIRS = 400  # paired flights, ours against S1
LARGEST = {4: 0.918, 6: 0.873, 8: 0.798, 16: 0.910, 32: 0.892}  # F^max of Table S1
COLUMNS = (
    "r0_rep", "p_rep", "r0_frict", "c_frict", "v_frict", "p_frict", "a_frict", "r0_shill", "v_shill",
    "p_shill", "a_shill",
)  # fmt: skip
QUICK = {"population": 12, "generations": 4, "pool": 24, "top": 4, "final_seeds": 10}
CLOSE = 0.02  # by which a fitness may miss a published one
LOWEST = -0.01  # lower end of the 95 % interval of ours minus S1


class Data(NamedTuple):
    """Best run by speed, the fitness of every run, and paired flights of ours and of S1 by speed."""

    best: Mapping[int, Result]
    runs: Mapping[int, list[float]]
    ours: Mapping[int, pd.DataFrame]
    published: Mapping[int, pd.DataFrame]


def fly(flights: Flights) -> Data:
    """All studies, and the paired flights."""
    base = cache_folder() / "studies" / "vasarhelyi_2018"
    best: dict[int, Result] = {}
    runs: dict[int, list[float]] = {}
    for v in SPEEDS:
        found = []
        for number in range(flights.count(RUNS[v], 1) if flights.seeds is None else RUNS[v]):
            search: dict[str, Any] = {"seed": number, **(QUICK if flights.quick else {})}
            study = load_study(f"vasarhelyi_2018/{v}ms", search=search)
            folder = base / f"{v}ms_{number}{'_quick' if flights.quick else ''}"
            open_folder(folder, study, resume=(folder / STUDY).exists())
            title = f"Table S1, evolution at {v} m/s, run {number + 1}"
            found.append(run(study, folder, executor_for(study, threads=flights.threads), _watch(flights, title)))
        best[v] = max(found, key=lambda result: result.fitness)
        runs[v] = [result.fitness for result in found]
    pairs = flights.count(PAIRS, 20)
    ours = flights.score("Table S1, our optima", {v: best[v].scenario for v in SPEEDS}, pairs)
    published = flights.score("Table S1, published optima", {v: optimum(v) for v in SPEEDS}, pairs)
    return Data(best, runs, {v: ours.loc[v] for v in SPEEDS}, {v: published.loc[v] for v in SPEEDS})


def _watch(flights: Flights, title: str) -> Any:
    def watch(p: Progress) -> None:
        if flights.progress:
            flights.progress(title, p.done, p.total)

    return watch


def claims(data: Data) -> list[Claim]:
    """All claims about Table S1."""
    found = []
    for v in data.best:
        ours = data.ours[v]
        found += [
            largest(v, data.best[v].largest),
            mean(v, ours),
            against_published(v, ours, data.published[v]),
            soft_repulsion(v, data.best[v].parameters, ours),
            long_alignment(v, data.best[v].parameters),
            working_range(v, data.best[v].ranges),
        ]
    return found


def largest(v: int, ours: float) -> Claim:
    """Highest fitness during the evolution."""
    return Claim(
        id=f"s1.largest.{v}ms", statement=f"highest fitness of the evolution at {v} m/s", source="Table S1, F^max",
        test=f"at least the published one less {CLOSE}", published=LARGEST[v], ours=ours, runs=1,
        **judged(ours >= LARGEST[v] - CLOSE, f"the luckiest candidate of ours reaches {ours:.3f}"),
    )  # fmt: skip


def mean(v: int, ours: pd.DataFrame) -> Claim:
    """Mean fitness of the optimum on fresh seeds."""
    published, sd = optimum(v).published["fitness"]
    found = statistics.mean(ours["fitness"])
    return Claim(
        id=f"s1.mean.{v}ms", statement=f"mean fitness of the optimum at {v} m/s", source="Table S1, mean F",
        test=f"upper end of the interval at least the published mean less {CLOSE}", published=published,
        published_sd=sd, **found.fields(), **judged(found.high >= published - CLOSE, f"ours is {found.ours:.3f}"),
    )  # fmt: skip


def against_published(v: int, ours: pd.DataFrame, published: pd.DataFrame) -> Claim:
    """Ours against the printed parameters, in the same simulator on the same seeds."""
    found = statistics.mean(ours["fitness"] - published["fitness"])
    return Claim(
        id=f"s1.against_published.{v}ms",
        statement=f"our optimum less the printed one at {v} m/s, paired flights",
        source="Table S1",
        test=f"lower end of the 95 % interval at least {LOWEST}",
        **found.fields(),
        **judged(found.low >= LOWEST, f"difference {found.ours:.3f} ({found.low:.3f} to {found.high:.3f})"),
    )


def soft_repulsion(v: int, p: Mapping[str, float], ours: pd.DataFrame) -> Claim:
    """The first surprise: a repulsion that reaches far and is soft."""
    reach, gap = p["model.r0_rep"], float(ours["r_min_mean"].mean())
    return Claim(
        id=f"s1.soft_repulsion.{v}ms",
        statement="a spatially extended, soft repulsion is preferable to a hard core",
        source="Results, surprise (1)",
        test="r0_rep at least 1.5 times the mean distance of nearest neighbours",
        ours=reach / gap, runs=len(ours),
        **judged(reach >= 1.5 * gap, f"r0_rep = {reach:.1f} m, nearest neighbours {gap:.1f} m apart"),
    )  # fmt: skip


def long_alignment(v: int, p: Mapping[str, float]) -> Claim:
    """The second surprise: alignment everywhere, with a small slack."""
    reach, slack = p["model.r0_frict"] / optimum(v).radio.range, p["model.v_frict"] / v
    return Claim(
        id=f"s1.long_alignment.{v}ms",
        statement="alignment is maximal and independent of distance, with a small slack",
        source="Results, surprise (2)",
        test="r0_frict at least 0.6 of the radio's range, v_frict at most 0.4 of v_flock",
        ours=reach, runs=1,
        **judged(reach >= 0.6 and slack <= 0.4, f"r0_frict {reach:.2f} of the range, v_frict {slack:.2f} of v_flock"),
    )  # fmt: skip


def working_range(v: int, ranges: Mapping[str, tuple[float, float]]) -> Claim:
    """Published optima inside our working ranges."""
    p = optimum(v).parameters
    inside = [
        name
        for name in COLUMNS
        if f"model.{name}" in ranges and ranges[f"model.{name}"][0] <= getattr(p, name) <= ranges[f"model.{name}"][1]
    ]
    outside = ", ".join(name for name in COLUMNS if name not in inside)
    return Claim(
        id=f"s1.working_range.{v}ms",
        statement=f"printed parameters inside our working ranges at {v} m/s, of 11",
        source="Table S1, brackets",
        test="at least 9",
        ours=float(len(inside)), runs=1,
        **judged(len(inside) >= 9, f"outside: {outside}" if outside else ""),
    )  # fmt: skip
