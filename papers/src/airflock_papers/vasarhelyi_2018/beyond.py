"""Evolutions that the paper speaks of and did not print: a higher velocity, and optima whose drones keep farther apart.

The search is that of Table S1 in its coarser steps, one run a case: 15,000 flights at the higher velocity, 5,000
candidates for each of the others (ten minutes of one core). `evolve` writes the optima to beyond.csv. The part of that
name flies them, with the paper's own steps; the optima that were to keep drones farther apart in the scenario of Table
S2, beside ours of Table S1.
"""

import csv
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from airflock.runs import with_parameters
from airflock.scenarios import Scenario, load
from airflock.search import load_study
from airflock.support import atomic
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.studies import evolve as evolved
from airflock_papers.vasarhelyi_2018.searches import COARSE
from airflock_papers.vasarhelyi_2018.table_s1 import COLUMNS

FILE = "beyond.csv"
FAST = 64.0  # m/s: twice the highest of the paper; range and arena grow as from 16 to 32 m/s
TWICE = {"model.v_flock": FAST, "model.v_max": FAST + 2.0, "radio.range": 640.0, "world.side": 2000.0}
STRETCHED = ("r0_rep", "r0_frict", "v_frict", "r0_shill", "v_shill")  # bounds of the search that grow likewise
FLIGHTS = 100
R_COLL, DELAY = 6.0, 1.5  # m and s; the paper's are 3 m and 1 s


class Case(NamedTuple):
    """An evolution: the study of Table S1 that it starts from, what is set, by how much lengths and speeds grow."""

    study: str
    settings: Mapping[str, Any]
    stretch: float = 1.0
    generations: int = 150

    def space(self) -> dict[str, Any]:
        """The table `space` of the study, stretched."""
        table = load_study(self.study).space.document()
        for name in STRETCHED:
            axis = table["model"][name]
            table["model"][name] = {**axis, "low": self.stretch * axis["low"], "high": self.stretch * axis["high"]}
        return table


CASES = {
    "fast": Case("vasarhelyi_2018/32ms", TWICE, 2.0),
    "radius": Case("vasarhelyi_2018/4ms", {"metrics.r_coll": R_COLL}, generations=50),
    "delay": Case("vasarhelyi_2018/4ms", {"radio.delay": DELAY}, generations=50),
}
WORDS = {
    "radius": f"4 m/s, evolved with r_coll = {R_COLL:g} m less evolved with 3 m",
    "delay": f"4 m/s, evolved with a delay of {DELAY:g} s less evolved with 1 s",
}


def evolve(flights: Flights, cases: Sequence[str] = tuple(CASES)) -> dict[str, dict[str, float]]:
    """Optima by case; each is begun, or continued in Airflock's cache folder."""
    found = {}
    for name in cases:
        case = CASES[name]
        title = f"Evolution beyond Table S1, {name}"
        folder = f"vasarhelyi_2018/beyond_{name}"
        settings = {**COARSE, **case.settings}
        search = {"generations": case.generations}
        result = evolved(flights, title, case.study, 0, settings, space=case.space(), folder=folder, search=search)
        found[name] = {key: result.parameters[f"model.{key}"] for key in COLUMNS}
    return found


def optima() -> dict[str, dict[str, float]]:
    """The committed optima by case; a case that was not evolved is not there."""
    found: dict[str, dict[str, float]] = {}
    for row in csv.DictReader(_path().read_text(encoding="utf-8").splitlines()):
        found.setdefault(row["case"], {})[row["parameter"]] = float(row["value"])
    return found


def write(found: Mapping[str, Mapping[str, float]]) -> None:
    """Commit optima; those of other cases stay."""
    rows = [f"{case},{name},{value:.6g}" for case, p in {**optima(), **found}.items() for name, value in p.items()]
    atomic.write_file(_path(), "\n".join(["case,parameter,value", *rows]) + "\n")


def _path() -> Path:
    return Path(str(resources.files(__package__).joinpath(FILE)))


def scenarios() -> dict[str, Scenario]:
    """What is flown: each optimum in the paper's scenario, the fast one in its own; and our optimum of Table S1."""
    found = {}
    for name, p in optima().items():
        scenario = load(CASES[name].study, TWICE if name == "fast" else None)
        found[name] = with_parameters(scenario, {f"model.{key}": value for key, value in p.items()})
    return {**found, "table": load("vasarhelyi_2018/evolved_4ms")}


def fly(flights: Flights) -> dict[str, pd.DataFrame]:
    """Order parameters of every scenario, by seed."""
    flown = flights.score("Evolutions beyond Table S1", scenarios(), flights.count(FLIGHTS, 20))
    return {name: flown.loc[name] for name in flown.index.get_level_values(0).unique()}


def measured(flown: Mapping[str, pd.DataFrame]) -> list[Measured]:
    """Fitness at the higher velocity, and how much farther drones keep from one another."""
    found = []
    if "fast" in flown:
        fast = flown["fast"]
        partial = ", ".join(f"{name} {fast[name].mean():.3g}" for name in fast if name.startswith("f_"))
        note = f"{partial}; {fast['phi_vel'].mean():.3g} m/s, {fast['n_coll'].mean():.2g} collisions a flight"
        at = f"{FAST:g} m/s, evolved; mean fitness"
        found.append(Measured("model.fast", "fitness at a velocity", at, statistics.mean(fast["fitness"]), note))
    for name, words in WORDS.items():
        if name in flown:
            ours, table = flown[name], flown["table"]
            note = (
                f"{ours['r_min'].mean():.3g} m against {table['r_min'].mean():.3g} m, nearest neighbours "
                f"{ours['r_min_mean'].mean():.3g} m against {table['r_min_mean'].mean():.3g} m, fitness "
                f"{ours['fitness'].mean():.3g} against {table['fitness'].mean():.3g}, collisions a flight "
                f"{ours['n_coll'].mean():.2g} against {table['n_coll'].mean():.2g}"
            )
            gap = statistics.mean(ours["r_min"] - table["r_min"])
            found.append(Measured(f"model.workaround.{name}", "r_min", words, gap, note))
    return found
