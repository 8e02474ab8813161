"""What racing inside a generation saves, on candidates of a search that was flown: python benchmarks/racing.py STUDY

STUDY is the folder of a study of one scenario. Candidates of some of its generations fly four common seeds each; then
races are replayed on these values: how many flights they need, and whether their better half is that of all flights.
"""

import sys
from pathlib import Path

import numpy as np

from airflock.engine import score_flights
from airflock.runs.flight_store import CandidateBatch, FlightStore
from airflock.runs.folder import read_toml_file
from airflock.runs.search_space import with_parameters
from airflock.scenarios.scenario_builder import build_scenario
from airflock.search.generations import remaining_candidates
from airflock.search.study_space import read_space

SEEDS, GENERATIONS, FIRST = 4, (0, 3, 10, 30, 100), 4_000_000_000


def race(values, seeds):
    """Flights that a race of so many seeds flies, and its better half; values (candidate, seed)."""
    alive, flown = list(range(len(values))), np.zeros(len(values), int)
    for seen in range(1, seeds + 1):
        flown[alive] = seen
        told = [row[:count].tolist() for row, count in zip(values, flown, strict=True)]
        alive = remaining_candidates(told, alive, seeds - seen, True)
    means = np.array([row[:count].mean() for row, count in zip(values, flown, strict=True)])
    return flown.sum(), better(means)


def better(means):
    """Indices of the better half."""
    return set(np.argsort(-means, kind="stable")[: len(means) // 2].tolist())


def main():
    """One row for each generation and number of seeds."""
    folder = Path(sys.argv[1])
    scenario = build_scenario(read_toml_file(folder / "study.toml")["scenario"], str(folder))
    space, _ = read_space(read_toml_file(folder / "study.toml")["space"], scenario)
    print("| generation | seeds | median fitness | flights saved | of the better half kept |")
    print("|---|---|---|---|---|")
    with FlightStore(folder, write=False) as store:
        for generation in GENERATIONS:
            points = store.asked(CandidateBatch("search", 0, generation))
            if not points:
                continue
            varied = [with_parameters(scenario, space.parameters(point)) for point in points]
            seeds = [FIRST + SEEDS * generation + j for j in range(SEEDS)]
            rows = score_flights([s for s in varied for _ in seeds], seeds * len(varied), threads=1)
            values = np.array([row["fitness"] for row in rows]).reshape(len(varied), SEEDS)
            for count in (2, SEEDS):
                flights, half = race(values, count)
                whole = better(values[:, :count].mean(axis=1))
                saved, kept = 1.0 - flights / (count * len(varied)), len(half & whole) / len(whole)
                median = np.median(values.mean(axis=1))
                print(f"| {generation} | {count} | {median:.3f} | {100 * saved:.0f} % | {100 * kept:.0f} % |")


if __name__ == "__main__":
    main()
