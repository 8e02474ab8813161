"""Verdicts on Figs 5-8: what the genetic algorithm reaches, the collapse of K_a, the V of its winners."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from airflock.papers.claims import Claim, judged
from airflock.papers.dimock_2003.flights import holds_vee, spacing
from airflock.papers.dimock_2003.ga import READINGS, Evolution, Run
from airflock.papers.dimock_2003.units import FT_LBF, SPAN, both

BAND = (11.0, 12.4)  # ft lbf/s
PROTOTYPE = {"mean": ("11.68, 11.96, 12.02", 11.9), "near": ("11.19, 11.27", 11.23)}
FIG5 = "Results, Fig. 5"


def claims(found: Evolution) -> list[Claim]:
    """All verdicts, over the seeds of each reading."""
    return [
        _best(found),
        *(_range(name, found.runs[name]) for name in PROTOTYPE),
        _finding("ga.range.n", f"best-ever, {READINGS['n'].words}", found.runs["n"], "no value to compare with"),
        _full(found),
        _fall(found.runs["mean"]),
        *(_timid(name, runs) for name, runs in found.runs.items()),
        *(_vee(name, found.runs[name]) for name in ("mean", "n")),
        _near(found.runs["near"]),
        _cmaes(found),
    ]


def _spread(values: Sequence[float]) -> dict[str, Any]:
    """Fields of a claim over seeds: median, least and greatest (an interval of three runs would say nothing)."""
    return {"ours": float(np.median(values)), "low": min(values), "high": max(values), "runs": len(values)}


def _each(values: Sequence[float], digits: int = 4) -> str:
    return ", ".join(f"{value:.{digits}g}" for value in values)


def _powers(runs: Sequence[Run]) -> list[float]:
    return [run.best[-1] / FT_LBF for run in runs]


def _best(found: Evolution) -> Claim:
    every = [run for runs in found.runs.values() for run in runs]
    least = min(every, key=lambda run: run.best[-1])
    return Claim(
        id="ga.best", statement="the GA reaches -9.8 (read as ft lbf/s per bird)", source=FIG5,
        test="best-ever of a run within 5 % of it", published=9.8 * FT_LBF,
        **_spread([run.best[-1] for run in every]),
        **judged(
            least.best[-1] <= 1.05 * 9.8 * FT_LBF,
            f"{both(least.best[-1])} is the least of {len(every)} runs: {least.reading.words}, {least.gains.text()}; "
            "9.8 needs coarser filaments or another start",
        ),
    )  # fmt: skip


def _range(name: str, runs: list[Run]) -> Claim:
    theirs, middle = PROTOTYPE[name]
    found = _powers(runs)
    return Claim(
        id=f"ga.range.{name}", statement=f"best-ever of every seed, {READINGS[name].words}",
        source=f"a prototype with the same conventions: {theirs} ft lbf/s",
        test=f"between {BAND[0]} and {BAND[1]} ft lbf/s for every seed", published=middle * FT_LBF,
        **_spread([run.best[-1] for run in runs]),
        **judged(all(BAND[0] <= power <= BAND[1] for power in found), f"{_each(found)} ft lbf/s by seed"),
    )  # fmt: skip


def _finding(id_: str, statement: str, runs: list[Run], test: str) -> Claim:
    return Claim(
        id=id_, statement=statement, source="Eq. 2 is illegible: 1/n holds the published V", test=test,
        verdict="finding", **_spread([run.best[-1] for run in runs]),
        reason=f"{_each(_powers(runs))} ft lbf/s by seed",
    )  # fmt: skip


def _full(found: Evolution) -> Claim:
    every = [run for runs in found.runs.values() for run in runs]
    alive = [run for run in every if not run.flights["full gradient"].collided]
    gaps = [abs(run.flights["full gradient"].power - run.best[-1]) / FT_LBF for run in alive]
    return Claim(
        id="ga.full", statement="winners flown again with the full gradient", source="Eq. 8",
        test="no published value; change of power in ft lbf/s", verdict="finding", **_spread(gaps),
        reason=f"{len(every) - len(alive)} of {len(every)} collide, the others change by at most {max(gaps):.2g} "
        "ft lbf/s: the frozen gradient is good enough to search by",
    )  # fmt: skip


def _fall(runs: list[Run]) -> Claim:
    falls = [run.mean[0] / run.mean[-1] for run in runs]
    return Claim(
        id="ga.fall", statement="the population's mean power falls as the GA converges", source=FIG5,
        test="by a factor of 1.7 or more (the figure: about 25 to about 11)", published=2.3, **_spread(falls),
        **judged(min(falls) >= 1.7, f"by factors of {_each(falls, 3)}, collided ones left out"),
    )  # fmt: skip


def _timid(name: str, runs: list[Run]) -> Claim:
    last = len(runs[0].best) - 1
    shares = [run.timid[-1] for run in runs]
    early = ", ".join(f"{run.timid[min(10, last)]:.0%}" for run in runs)
    return Claim(
        id=f"ga.timid.{name}", statement=f"the gain of avoidance collapses: K_a < 2, {READINGS[name].words}",
        source="Results: in over 75 % of controllers within 10 generations",
        test=f"median over seeds of the share at generation {last} is over 75 %", published=0.75, **_spread(shares),
        **judged(
            float(np.median(shares)) > 0.75,
            f"{', '.join(f'{share:.0%}' for share in shares)} at the end by seed, {early} at generation "
            f"{min(10, last)}: later than in the paper{'' if min(shares) > 0.75 else ', and not from every seed'}",
        ),
    )  # fmt: skip


def _vee(name: str, runs: list[Run]) -> Claim:
    aside = [spacing(run.flights["final"])[0] / SPAN for run in runs]
    swings = [spacing(run.flights["final"])[1] for run in runs]
    held = [holds_vee(run.flights["final"]) for run in runs]
    return Claim(
        id=f"ga.vee.{name}", statement=f"winners fly in a stable V, {READINGS[name].words}", source="Results, Fig. 8",
        test="a V at the end, neighbours 0.88 to 0.95 spans aside, for every seed", **_spread(aside),
        **judged(
            all(held) and all(0.88 <= value <= 0.95 for value in aside),
            f"{_each(aside, 3)} spans by seed; {sum(held)} of {len(held)} in a V; birds swing {_each(swings, 2)} ft",
        ),
    )  # fmt: skip


def _near(runs: list[Run]) -> Claim:
    aside = [spacing(run.flights["final"])[0] / SPAN for run in runs]
    k_d = ", ".join(f"{run.gains.k_d:.3g}" for run in runs)
    return Claim(
        id="ga.vee.near", statement="from a V tip to tip the GA learns to do little", source="our test of the start",
        test="no published value; spans aside", verdict="finding", **_spread(aside),
        reason=f"{_each(aside, 3)} spans by seed, K_d {k_d}: the start is near what the fitness asks for",
    )  # fmt: skip


def _cmaes(found: Evolution) -> Claim:
    pairs = list(zip(found.runs["mean"], found.cmaes, strict=True))
    gaps = [(c.best[-1] - g.best[-1]) / FT_LBF for g, c in pairs]
    best = min(found.cmaes, key=lambda run: run.best[-1])
    return Claim(
        id="ga.cmaes", statement="CMA-ES on the same fitness and as many flights: its best minus the GA's",
        source="computed here; the paper has the GA alone", test="no published value; ft lbf/s, less is better",
        verdict="finding", **_spread(gaps),
        reason=f"{_each(_powers([c for _, c in pairs]))} against {_each(_powers([g for g, _ in pairs]))} ft lbf/s by "
        f"seed; best {best.gains.text()}",
    )  # fmt: skip
