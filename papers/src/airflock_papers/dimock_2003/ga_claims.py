"""What is measured of Figs 5-8: what the genetic algorithm reaches, the collapse of K_a, the V of its winners."""

from collections.abc import Sequence

import numpy as np

from airflock.scenarios import load
from airflock_papers.claims import Measured
from airflock_papers.dimock_2003.flights import Flight, holds_vee, spacing
from airflock_papers.dimock_2003.ga import EARLY, FIRST, GENERATIONS, GREEDY, READINGS, Evolution, Run
from airflock_papers.dimock_2003.static import Air
from airflock_papers.dimock_2003.units import FT_LBF, SPAN
from airflock_papers.statistics import Estimate

TAKEN = 10  # the generation by which the paper says that the small gain had taken hold
TENTH = 10  # generations that are compared with as many later ones
BEFORE, AFTER = slice(0, 10), slice(-10, None)  # frames: the first and the last second


def measured(found: Evolution) -> list[Measured]:
    """Everything measured, over the seeds of each reading."""
    every = [run for runs in found.runs.values() for run in runs]
    solo = _solo()
    saved = [1.0 - run.best[-1] / solo for run in every]
    best = _spread(_powers(every))
    return [
        Measured("ga.best", "power", "best-ever of all runs", best._replace(ours=best.low or 0.0), _least(every)),
        Measured("ga.saves", "share saved", "best-ever of every run against a bird alone", _spread(saved)),
        Measured(
            "ga.converges",
            "fall of the mean",
            "first generation over last",
            _spread([run.mean[0] / run.mean[-1] for run in found.runs["mean"]]),
            "collided ones left out",
        ),
        *(_timid(name, runs) for name, runs in found.runs.items()),
        *(_vee(name, runs) for name, runs in found.runs.items()),
        *_course_of_the_search(found.runs["mean"]),
        *_collisions(found.runs["mean"]),
        *([_rows(found.first)] if found.first else []),
        *(
            Measured(
                f"ga.range.{name}",
                "power",
                f"best-ever of every seed, {READINGS[name].words}",
                _spread(_powers(runs)),
                f"{_each(_powers(runs))} ft lbf/s by seed",
            )
            for name, runs in found.runs.items()
        ),
        *_full(every),
        _cmaes(found),
    ]


def _course_of_the_search(runs: Sequence[Run]) -> list[Measured]:
    """The early controller against the last, and the last over its flight; a quick search ends before the paper's."""
    last = len(runs[0].best) - 1
    if last != GENERATIONS - 1:
        return []
    swings = [spacing(run.flights["early"])[1] - spacing(run.flights["final"])[1] for run in runs]
    note = f"{_each(swings, 3)} ft by seed"
    courses = [_course(run.flights["final"]) for run in runs]
    return [
        Measured(
            "ga.early", "disorder", f"generation {EARLY} less generation {last}, swing in ft", _spread(swings), note
        ),
        Measured("ga.drag", "power over time", f"generation {last}, last second over first", _spread(courses)),
    ]


def _collisions(runs: Sequence[Run]) -> list[Measured]:
    """How the share of controllers that collide grows, and how many of those with a small K_a do."""
    words = READINGS["mean"].words
    found = []
    if len(runs[0].lost) >= 2 * TENTH:
        stretches = (slice(0, TENTH), slice(TENTH, 2 * TENTH), slice(-TENTH, None))
        parts = [[float(np.mean(run.lost[stretch])) for run in runs] for stretch in stretches]
        note = f"{', '.join(_percent(part) for part in parts)} in the first ten generations, the next and the last"
        at = f"share of controllers, generations {TENTH} to {2 * TENTH - 1} less 0 to {TENTH - 1}, {words}"
        rise = [b - a for a, b in zip(*parts[:2], strict=True)]
        found.append(Measured("ga.sporadic.rise", "collided", at, _spread(rise), note))
    late = [np.sum(run.careless[TAKEN:], axis=0) for run in runs if len(run.careless) > TAKEN]
    shares = [float(collided / timid) for timid, collided in late if timid]
    if shares:
        at = f"share of those with K_a below 2, generation {TAKEN} to the last, {words}"
        note = f"{_percent(shares)} by seed"
        found.append(Measured("ga.sporadic.stay", "collided", at, _spread(shares), note))
    return found


def _rows(runs: Sequence[Run]) -> Measured:
    """Share of the flights with a high K_d, on wings of one horseshoe, that end in a row; all seeds together."""
    ends = {
        greedy: [row for run in runs for k_d, row in run.rows if (k_d >= GREEDY) == greedy] for greedy in (True, False)
    }
    share = {greedy: float(np.mean(rows)) if rows else 0.0 for greedy, rows in ends.items()}
    best = _each([run.best[-1] / FT_LBF for run in runs])
    lost = sum(run.scattered for run in runs)
    note = (
        f"{share[False]:.1%} of {len(ends[False])} flights with a lower K_d; {lost} scatter beyond the finite numbers; "
        f"best-ever {best} ft lbf/s by seed: {'; '.join(run.gains.text() for run in runs)}"
    )
    at = f"flights with K_d of {GREEDY:g} ft²/(lbf s) or more, one horseshoe a wing, {FIRST.words}"
    return Measured("ga.row", "rows", at, Estimate(share[True], None, None, None, len(ends[True])), note)


def _percent(shares: Sequence[float]) -> str:
    return " / ".join(f"{share:.1%}" for share in shares)


def _solo() -> float:
    """Power of a bird alone, W."""
    return float(Air(load("dimock_2003/published").wing).powers(np.zeros((1, 3)))[0])


def _spread(values: Sequence[float]) -> Estimate:
    """Median, least and greatest over seeds (an interval of three runs would say nothing)."""
    return Estimate(float(np.median(values)), None, float(min(values)), float(max(values)), len(values))


def _each(values: Sequence[float], digits: int = 4) -> str:
    return ", ".join(f"{value:.{digits}g}" for value in values)


def _powers(runs: Sequence[Run]) -> list[float]:
    return [run.best[-1] / FT_LBF for run in runs]


def _least(every: Sequence[Run]) -> str:
    least = min(every, key=lambda run: run.best[-1])
    return f"{least.reading.words}, {least.gains.text()}; 9.8 needs coarser filaments or another start"


def _timid(name: str, runs: Sequence[Run]) -> Measured:
    early, last = ([run.timid[min(at, len(run.timid) - 1)] for run in runs] for at in (TAKEN, len(runs[0].timid) - 1))
    note = f"{', '.join(f'{share:.0%}' for share in early)} by seed; at the end {', '.join(f'{s:.0%}' for s in last)}"
    return Measured(
        f"ga.timid.{name}", "share of K_a below 2", f"generation {TAKEN}, {READINGS[name].words}", _spread(early), note
    )


def _vee(name: str, runs: Sequence[Run]) -> Measured:
    aside = [spacing(run.flights["final"])[0] / SPAN for run in runs]
    held = [float(holds_vee(run.flights["final"])) for run in runs]
    note = f"neighbours {_each(aside, 3)} spans aside by seed"
    return Measured(
        f"ga.vee.{name}", "share in a V", f"winners at the end, {READINGS[name].words}", _spread(held), note
    )


def _course(flight: Flight) -> float:
    """Mean power of the last second over that of the first."""
    air = Air(load("dimock_2003/published").wing)
    cells = np.round(flight.frames[:, :3].transpose(0, 2, 1).astype(float) / air.h) * air.h
    first, last = (np.mean([air.powers(places).mean() for places in cells[part]]) for part in (BEFORE, AFTER))
    return float(last / first)


def _full(every: Sequence[Run]) -> list[Measured]:
    """Winners flown again with the full gradient; nothing if they all collide."""
    alive = [run for run in every if not run.flights["full gradient"].collided]
    gaps = [abs(run.flights["full gradient"].power - run.best[-1]) / FT_LBF for run in alive]
    note = f"{len(every) - len(alive)} of {len(every)} collide"
    at = "winners with the full gradient, change"
    return [Measured("ga.full", "power", at, _spread(gaps), note)] if gaps else []


def _cmaes(found: Evolution) -> Measured:
    pairs = list(zip(found.runs["mean"], found.cmaes, strict=True))
    gaps = [(c.best[-1] - g.best[-1]) / FT_LBF for g, c in pairs]
    note = f"{_each(_powers([c for _, c in pairs]))} against {_each(_powers([g for g, _ in pairs]))} ft lbf/s by seed"
    return Measured("ga.cmaes", "power", "best of CMA-ES less the GA's, as many flights", _spread(gaps), note)
