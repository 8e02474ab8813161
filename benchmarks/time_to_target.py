"""Processor time to the fitness of Table S1 at 6 m/s: searches side by side, each judged on paired fresh flights.

python benchmarks/time_to_target.py FOLDER --only fast --seeds 0:10                # continues where it was left
python benchmarks/time_to_target.py FOLDER --only "full study" --seeds 0           # what is shipped, for comparison
python benchmarks/time_to_target.py FOLDER --table                                 # tables and the figure of FOLDER

Every search starts knowing nothing but the bounds of the shipped study, flies at coarse steps (dt 0.05 s, metrics each
second) on one thread; the driver is compiled beforehand. The judge flies winners, Table S1's set and the set of the
full study (preset vasarhelyi_2018/evolved_6ms) as the paper does (dt 0.01 s) on the same seeds, which no search uses:
the first 400 against Table S1, all 1,000 against the full study. Processor time depends on the machine and on who else
uses it; the cost in whole flights does not. The curve of a search is the average of its last half of means after so
many flights, without the race and the final that follow, on 100 coarse flights paired with Table S1's set.
"""

import argparse
import json
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np
from surrogate import LqCMAES

from airflock import __version__
from airflock.engine import score_flight, score_flights
from airflock.runs.flight_store import CandidateBatch, FlightStore
from airflock.runs.folder import open_folder
from airflock.runs.search_space import with_parameters
from airflock.scenarios.files import load
from airflock.search import generations
from airflock.search.evolution import run_study, study_executor
from airflock.search.generations import averaged_means
from airflock.search.optimisers import make_optimiser
from airflock.search.study import FAST, load_study
from airflock.search.study_result import mean_interval
from airflock.support import atomic

NAME, FULL, COARSE = "vasarhelyi_2018/6ms", "vasarhelyi_2018/evolved_6ms", {"dt": 0.05, "metrics.period": 1.0}
LQ_PARTS = 576  # parts of generations, which lq-CMA-ES asks for one by one: eight of each that flies as a whole
SEARCHES: dict[str, dict[str, Any]] = {
    "population 100": {"population": 100, "generations": 43, "pool": 40, "top": 8, "final_seeds": 100},
    "population 50": {**FAST, "generations": 96, "late_seeds": 0},
    "fast": dict(FAST),
    "fast, warm from 4 m/s": {**FAST, "generations": 40, "start": "scenario"},
    "full study": {},
    "fast, growing flights": {**FAST, "flights": "growing", "generations": 80},
    "fast, lq-CMA-ES": {**FAST, "generations": LQ_PARTS},
}  # fmt: skip
FIRST, PAIRS, MOST = 3_000_000_000, 400, 1000  # seeds of the judge, unlike those of any study
STEP, CURVE, CURVE_FIRST = 500, 100, 3_100_000_000  # flights between points of a curve; flights and seeds of a point
TARGET, KNOWN = -0.01, "known.json"


def study_of(what, seed):
    """A search by its name here."""
    settings = dict(COARSE)
    if "warm" in what:
        known = load("vasarhelyi_2018/4ms").parameters
        keys = load_study(NAME).space.keys
        settings |= {key: getattr(known, key.removeprefix("model.")) for key in keys}
        settings["model.v_shill"] = max(settings["model.v_shill"], 6.0)
    return load_study(NAME, settings=settings, search={**SEARCHES[what], "seed": seed})


def lq_optimiser(algorithm, dimension, objectives, population, seed, *, spread, start):
    """As `optimiser`, but lq-CMA-ES."""
    return LqCMAES(dimension, population, seed, spread, start)


def flown(folder, whole, where=""):
    """Cost of a study, or of a part of it, in whole flights."""
    with FlightStore(folder, write=False) as store:
        rows = store.rows(
            "SELECT json_extract(c.parameters, '$.duration'), count(*) FROM flight f "
            f"JOIN candidate c USING (stage, run, generation, candidate) {where} GROUP BY 1"
        )
    return sum(count * (1.0 if duration is None else duration / whole) for duration, count in rows)


def searched(what, seed, folder):
    """Fly a search from its beginning; its winner, processor time (s) and cost."""
    shutil.rmtree(folder, ignore_errors=True)  # of one that was cut off: its processor time is not known
    study = study_of(what, seed)
    executor = study_executor(study, threads=1)
    generations.make_optimiser = lq_optimiser if "lq" in what else make_optimiser
    score_flight(study.scenario, 0)
    open_folder(folder, study, resume=False)
    begin = time.process_time()
    result = run_study(study, folder, executor)
    seconds = time.process_time() - begin
    return {
        "search": what, "seed": seed, "seconds": seconds, "flights": flown(folder, study.scenario.flight.duration),
        "parameters": result.parameters, "origin": result.origin, "coarse": result.fitness, "airflock": __version__,
    }  # fmt: skip


def curve(what, seed, folder):
    """(whole flights, difference to Table S1 at coarse steps) of the average of a search's means so far."""
    study, points, means, cost = study_of(what, seed), [], [], 0.0
    state = make_optimiser("cmaes", len(study.space.axes), 1, study.whole("population"), study.whole("seed") << 16)
    seeds = [CURVE_FIRST + i for i in range(CURVE)]
    known = fitness(study.scenario, seeds)
    with FlightStore(folder, write=False) as store:
        for generation in range(study.whole("generations")):
            asked, batch = state.ask(), CandidateBatch("search", 0, generation)
            rows = [scores["fitness"] for _, scores in sorted(store.flown(batch).items())]
            state.tell(asked, -np.array(rows).reshape(len(asked), -1).mean(axis=1)[:, None])
            where = f"WHERE f.stage = 'search' AND f.generation = {generation}"
            spent = flown(folder, study.scenario.flight.duration, where)
            means = means if spent < len(asked) else [*means, np.clip(state.centre(), 0.0, 1.0)]
            if means and (cost + spent) // STEP > cost // STEP:
                varied = with_parameters(study.scenario, study.space.parameters(averaged_means(means, 1)[0]))
                points.append((cost + spent, float((fitness(varied, seeds) - known).mean())))
            cost += spent
    return points


def fitness(scenario, seeds):
    """Fitness of a scenario's flights (seed,)."""
    rows = score_flights([scenario] * len(seeds), seeds, threads=1)
    return np.array([row["fitness"] for row in rows])


def judged(name, parameters, known, flights):
    """Fitness of a set on so many of the judge's seeds, at the steps of the paper; `known` ones are not flown again."""
    seeds = [FIRST + i for i in range(len(known), flights)]
    return [*known, *(fitness(with_parameters(load(name), parameters), seeds).tolist() if seeds else [])]


def spans(judged, other):
    """Mean difference of two sets, SD and 95 % interval, one pair for each seed of the judge that both have flown."""
    pairs = min(len(judged), len(other))
    return mean_interval((np.array(judged[:pairs]) - np.array(other[:pairs])).tolist())


def table(folder):
    """Print the tables for RESULTS.md."""
    known = read(folder / KNOWN)
    found = [read(path) for path in sorted(folder.glob("*_*.json"))]
    print("| search | seed | whole flights | processor s | winner | less Table S1, 400 pairs (95 %) | reached | "
          "less the full study (95 %) |\n|---|---|---|---|---|---|---|---|")  # fmt: skip
    for what in SEARCHES:
        rows = sorted((row for row in found if row["search"] == what), key=lambda row: row["seed"])
        for row in rows:
            mean, _, low, high = spans(row["judged"][:PAIRS], known["S1"])
            other, _, least, most = spans(row["judged"], known["full"])
            told = "yes" if low > TARGET else "no"
            print(
                f"| {what} | {row['seed']} | {row['flights']:.0f} | {row['seconds']:.0f} | {row['origin']} | "
                f"{mean:+.4f} ({low:+.4f} to {high:+.4f}) | {told} | {other:+.4f} ({least:+.4f} to {most:+.4f}) |"
            )
        if len(rows) > 1 and all(len(row["judged"]) == MOST for row in rows):
            together(what, rows, known, [row["judged"] for row in found if row["search"] == "full study"])


def together(what, rows, known, studies):
    """What several runs of one search say; studies: fitness of full studies on the judge's seeds."""
    reached = [spans(row["judged"][:PAIRS], known["S1"])[2] > TARGET for row in rows]
    seconds = [row["seconds"] if good else np.inf for row, good in zip(rows, reached, strict=True)]
    print(f"\n{what}: {sum(reached)} of {len(rows)} reached; median {np.median(seconds):.0f} processor s\n")
    others = {"the full study that is shipped": known["full"]}
    if studies and all(len(judged) == MOST for judged in studies):
        others[f"the mean of {len(studies)} full studies here"] = np.mean(studies, axis=0)
    for other, fitness in others.items():
        less = np.array([row["judged"] for row in rows]) - np.array(fitness)
        for name, values in (("flights", less.mean(axis=0)), ("runs", less.mean(axis=1))):
            mean, _, low, high = mean_interval(values.tolist())
            print(f"less {other}, interval over {name}: {mean:+.4f} ({low:+.4f} to {high:+.4f})\n")


def curves(folder, what):
    """Table and figure of how near searches stand after so many flights, those whose folders are there."""
    import matplotlib.pyplot as plt

    found = []
    for path in sorted(folder.glob("*_*.json")):
        row = read(path)
        if row["search"] != what:
            continue
        if "curve" not in row:
            row["curve"] = curve(what, row["seed"], folder / f"study_{path.stem}")
            atomic.write_file(path, json.dumps(row))
        found.append(row)
    figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
    for row in found:
        cost, less = np.array(row["curve"]).T
        axes.plot(cost * row["seconds"] / row["flights"], less, color="0.4", linewidth=0.8)
    axes.axhline(TARGET, linestyle="--", color="tab:red")
    axes.set(xlabel="processor time (s)", ylabel="fitness less Table S1's", ylim=(-0.2, 0.03), title=what)
    figure.savefig(folder / "time_to_target.png", dpi=110)
    print("| whole flights | processor s | least | median | largest | runs above -0.01 |\n|---|---|---|---|---|---|")
    for place in range(min(len(row["curve"]) for row in found)):
        less = [row["curve"][place][1] for row in found]
        cost = np.median([row["curve"][place][0] for row in found])
        seconds = np.median([row["curve"][place][0] * row["seconds"] / row["flights"] for row in found])
        print(f"| {cost:.0f} | {seconds:.0f} | {min(less):+.3f} | {np.median(less):+.3f} | {max(less):+.3f} | "
              f"{sum(value > TARGET for value in less)} of {len(less)} |")  # fmt: skip


def read(path):
    """What a file of the folder holds."""
    return json.loads(path.read_text()) if path.is_file() else {}


def main():
    """Searches in turn, one seed after another."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", default="0:3", help="seeds of the searches, FIRST:END or one number")
    parser.add_argument("--only", default="", help="a search by its name, or by how it ends")
    parser.add_argument("--flights", type=int, default=MOST, help="flights of the judge")
    parser.add_argument("--table", action="store_true", help="only print the table")
    parser.add_argument("--curves", metavar="SEARCH", help="fly and draw the curves of a search by its name")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    if asked.curves:
        return curves(asked.folder, asked.curves)
    if not asked.table:
        known = read(asked.folder / KNOWN)
        known = {
            name: judged(place, {}, known.get(name, []), asked.flights)
            for name, place in (("S1", NAME), ("full", FULL))
        }
        atomic.write_file(asked.folder / KNOWN, json.dumps(known))
        first, _, end = asked.seeds.partition(":")
        for seed in range(int(first), int(end) if end else int(first) + 1):
            for number, what in enumerate(SEARCHES):
                if not what.endswith(asked.only):
                    continue
                path = asked.folder / f"{number}_{seed}.json"
                row = read(path) or searched(what, seed, asked.folder / f"study_{number}_{seed}")
                atomic.write_file(path, json.dumps(row))
                row["judged"] = judged(NAME, row["parameters"], row.get("judged", []), asked.flights)
                atomic.write_file(path, json.dumps(row))
    table(asked.folder)


if __name__ == "__main__":
    main()
