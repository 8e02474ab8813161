"""What is said of the evolution's own course: its luckiest candidate, and how alike its runs are.

Fifteen thousand flights a run are not flown again for that: evolved_runs.csv holds what the runs of part s1 found, by
rank, and is written with its page. With a change such as search.generations = 5 one run at each speed is flown anew, so
short, and stands for the luckiest candidate and for the worst of several runs. So the change under which these
sentences turn red can be made.
"""

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

import pandas as pd

from airflock.search import EvolveResult
from airflock.support import atomic
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.studies import QUICK, evolve
from airflock_papers.vasarhelyi_2018.published import SPEEDS, optimum

COARSE = {"dt": 0.05, "metrics.period": 1.0}  # our choice: changes a fitness by less than 0.005 and halves the time
WALLS = ("v_shill", "a_shill")  # by what runs differ

Data = Mapping[int, pd.DataFrame]


def by_rank(runs: Mapping[int, Sequence[EvolveResult]]) -> dict[int, pd.DataFrame]:
    """Runs of each speed (m/s), best first: largest fitness of a candidate, luck included, and what the optimum has."""
    return {v: pd.DataFrame([_row(run) for run in several]) for v, several in runs.items()}


def _row(run: EvolveResult) -> dict[str, float]:
    walls = {name: run.parameters[f"model.{name}"] for name in WALLS}
    return {"largest": run.largest, "fitness": run.fitness, **walls}


def write(runs: Mapping[int, Sequence[EvolveResult]]) -> None:
    """Commit what is said of the runs, by speed and rank."""
    table = pd.concat(by_rank(runs), names=["v_flock", "run"]).rename(lambda rank: rank + 1, level="run")
    atomic.write_file(_path(), table.to_csv(float_format="%.9g", lineterminator="\n"))


def runs() -> dict[int, pd.DataFrame]:
    """The committed runs, see `by_rank`."""
    table = pd.read_csv(_path(), index_col=["v_flock", "run"])
    return {v: table.loc[v].reset_index(drop=True) for v in SPEEDS}


def _path() -> Path:
    return Path(str(resources.files(__package__).joinpath("evolved_runs.csv")))


def fly(flights: Flights) -> Data:
    """The runs of part s1; of a shorter search, that search in place of the last run."""
    found = runs()
    generations = flights.changes.get("search.generations")
    if generations is None:
        return found
    for v, table in found.items():
        search = {"generations": generations, **{key: QUICK[key] for key in ("pool", "top", "final_seeds")}}
        title = f"Evolution at {v} m/s, {generations} generations"
        folder = f"vasarhelyi_2018/{v}ms_{generations}_generations"
        short = evolve(flights, title, f"vasarhelyi_2018/{v}ms", 0, COARSE, folder=folder, search=search)
        table.loc[len(table) - 1] = _row(short)
        table["largest"] = short.largest
    return found


def measured(data: Data) -> list[Measured]:
    """The luckiest candidate of all runs at a speed, and the fitness of the best run less that of the worst."""
    found = []
    for v, table in data.items():
        luckiest = statistics.one(float(table["largest"].max()))
        found.append(Measured(f"s1.largest.{v}ms", "fitness", f"{v} m/s, luckiest candidate", luckiest))
        if len(table) > 1:
            apart = statistics.one(float(table["fitness"].max() - table["fitness"].min()), len(table))
            at = f"{v} m/s, {len(table)} runs"
            found.append(Measured(f"s1.alike.{v}ms", "spread of runs", at, apart, _told(v, table)))
    return found


def _told(v: int, table: pd.DataFrame) -> str:
    """Fitness of every run, and what its optimum brakes by at the walls."""
    printed = optimum(v).parameters
    walls = ", ".join(
        f"{name} {', '.join(f'{value:.3g}' for value in table[name])} (printed {getattr(printed, name):g})"
        for name in WALLS
    )
    return f"fitness {', '.join(f'{value:.3f}' for value in table['fitness'])}; {walls}"
