"""Processor time to the fitness of Table S1 at 6 m/s: searches side by side, each judged on paired fresh flights.

python benchmarks/time_to_target.py FOLDER --seeds 0,1,2           # continues where it was left
python benchmarks/time_to_target.py FOLDER --table                 # the table of what FOLDER holds

Every search starts knowing nothing but the bounds of the shipped study, flies at coarse steps (dt 0.05 s, metrics each
second) on one thread, and has about the same number of flights, its final included. The judge flies the winner and
Table S1's set as the paper does (dt 0.01 s) on the same seeds, which no search uses. Processor time depends on the
machine and on who else uses it; the cost in whole flights does not.
"""

import argparse
import json
import shutil
import time
from pathlib import Path

import numpy as np

from airflock import __version__, atomic
from airflock.engine import score_flight, score_flights
from airflock.evolve.after import interval
from airflock.evolve.folder import open_folder
from airflock.evolve.run import executor_for, run
from airflock.evolve.space import with_parameters
from airflock.evolve.store import Store
from airflock.evolve.study import load_study
from airflock.scenarios.files import load

NAME, COARSE = "vasarhelyi_2018/6ms", {"dt": 0.05, "metrics.period": 1.0}
END = {"pool": 40, "top": 8, "final_seeds": 100}
SEARCHES = {
    "population 100": {"population": 100, "generations": 43, **END},
    "population 24, averages": {"population": 24, "generations": 170, "averages": 3, **END},
    "population 24, averages, growing": {
        "population": 24, "generations": 190, "averages": 3, "flights": "growing", **END,
    },
    "population 24, averages, growing, warm from 4 m/s": {
        "population": 24, "generations": 60, "averages": 3, "flights": "growing", "start": "scenario", **END,
    },
}  # fmt: skip
FIRST, PAIRS = 3_000_000_000, 400  # seeds of the judge, unlike those of any study


def study_of(what, seed):
    """A search by its name here."""
    settings = dict(COARSE)
    if "warm" in what:
        known = load("vasarhelyi_2018/4ms").parameters
        keys = load_study(NAME).space.keys
        settings |= {key: getattr(known, key.removeprefix("model.")) for key in keys}
        settings["model.v_shill"] = max(settings["model.v_shill"], 6.0)
    return load_study(NAME, settings=settings, search={**SEARCHES[what], "seed": seed})


def flown(folder, whole):
    """Cost of a study in whole flights."""
    with Store(folder, write=False) as store:
        rows = store.rows(
            "SELECT json_extract(c.parameters, '$.duration'), count(*) FROM flight f "
            "JOIN candidate c USING (stage, run, generation, candidate) GROUP BY 1"
        )
    return sum(count * (1.0 if duration is None else duration / whole) for duration, count in rows)


def searched(what, seed, folder):
    """Fly a search from its beginning; its winner, processor time (s) and cost."""
    shutil.rmtree(folder, ignore_errors=True)  # of one that was cut off: its processor time is not known
    study = study_of(what, seed)
    executor = executor_for(study, threads=1)
    score_flight(study.scenario, 0)
    open_folder(folder, study, resume=False)
    begin = time.process_time()
    result = run(study, folder, executor)
    seconds = time.process_time() - begin
    return {
        "search": what, "seed": seed, "seconds": seconds, "flights": flown(folder, study.scenario.flight.duration),
        "parameters": result.parameters, "origin": result.origin, "coarse": result.fitness, "airflock": __version__,
    }  # fmt: skip


def judged(parameters):
    """Fitness of a set on the judge's seeds, at the steps of the paper."""
    scenario = with_parameters(load(NAME), parameters)
    seeds = [FIRST + i for i in range(PAIRS)]
    return np.array([row["fitness"] for row in score_flights([scenario] * PAIRS, seeds, threads=1)])


def table(folder):
    """Rows of RESULTS-searches.md."""
    published = np.array(json.loads((folder / "published.json").read_text()))
    found = [json.loads(path.read_text()) for path in sorted(folder.glob("*_*.json"))]
    print("| search | seed | whole flights | processor s | winner | difference to Table S1 (95 %) | reached |")
    print("|---|---|---|---|---|---|---|")
    for row in sorted(found, key=lambda row: (list(SEARCHES).index(row["search"]), row["seed"])):
        mean, _, low, high = interval((np.array(row["judged"]) - published).tolist())
        reached = "yes" if low > -0.01 else "no"
        print(
            f"| {row['search']} | {row['seed']} | {row['flights']:.0f} | {row['seconds']:.0f} | {row['origin']} | "
            f"{mean:+.4f} ({low:+.4f} to {high:+.4f}) | {reached} |"
        )


def main():
    """Searches in turn, one seed after another."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", default="0,1,2", help="seeds of the searches")
    parser.add_argument("--only", default="", help="a search by a part of its name")
    parser.add_argument("--table", action="store_true", help="only print the table")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    if not asked.table:
        if not (asked.folder / "published.json").is_file():
            atomic.write(asked.folder / "published.json", json.dumps(judged({}).tolist()))
        for seed in map(int, asked.seeds.split(",")):
            for number, what in enumerate(SEARCHES):
                path = asked.folder / f"{number}_{seed}.json"
                if path.is_file() or asked.only not in what:
                    continue
                row = searched(what, seed, asked.folder / f"study_{number}_{seed}")
                row["judged"] = judged(row["parameters"]).tolist()
                atomic.write(path, json.dumps(row))
    table(asked.folder)


if __name__ == "__main__":
    main()
