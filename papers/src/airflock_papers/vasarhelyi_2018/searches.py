"""What is said of the evolution's own course: its luckiest candidate, and how alike its runs are.

Fifteen thousand flights a run are not flown again for that: evolved_runs.csv holds what the runs of part s1 found, by
rank. With a change such as search.generations = 5 one run at each speed is flown anew, so short, and stands for the
luckiest candidate and for the worst of several runs. So the change under which these sentences turn red can be made.
"""

from collections.abc import Mapping
from importlib import resources

import pandas as pd

from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.studies import QUICK, evolve
from airflock_papers.vasarhelyi_2018.published import SPEEDS
from airflock_papers.vasarhelyi_2018.table_s1 import COARSE

Data = Mapping[int, pd.DataFrame]


def runs() -> dict[int, pd.DataFrame]:
    """Largest fitness of a candidate, luck included, and fitness of the optimum, by speed (m/s) and run, best first."""
    file = resources.files(__package__) / "evolved_runs.csv"
    with file.open(encoding="utf-8") as text:
        table = pd.read_csv(text)
    return {v: table[table["v_flock"] == v].reset_index(drop=True) for v in SPEEDS}


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
        table["largest"] = short.largest
        table.loc[len(table) - 1, "fitness"] = short.fitness
    return found


def measured(data: Data) -> list[Measured]:
    """The luckiest candidate of all runs at a speed, and the fitness of the best run less that of the worst."""
    found = []
    for v, table in data.items():
        luckiest = statistics.one(float(table["largest"].max()))
        found.append(Measured(f"s1.largest.{v}ms", "fitness", f"{v} m/s, luckiest candidate", luckiest))
        if len(table) > 1:
            apart = statistics.one(float(table["fitness"].max() - table["fitness"].min()), len(table))
            found.append(Measured(f"s1.alike.{v}ms", "spread of runs", f"{v} m/s, {len(table)} runs", apart))
    return found
