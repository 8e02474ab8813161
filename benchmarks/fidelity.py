"""Do cheaper flights rank candidates as whole ones do? python benchmarks/fidelity.py STUDY

STUDY is the folder of a study of one scenario in a square. Candidates from early and from late generations of its
search fly TRUTH whole flights each, whose mean counts as the truth, and FLIGHTS of each cheaper kind: with longer
motion steps, shorter, or with half of the agents in half of the area. The table has, for each kind: processor time of a
flight, Kendall's tau between the truth and single flights (mean of FLIGHTS of them), and between the truth and their
means. Whole flights on other seeds than the truth's are the row to compare with.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.stats import kendalltau

from airflock.engine import score_flight, score_flights
from airflock.runs.flight_store import CandidateBatch, FlightStore
from airflock.runs.folder import read_request
from airflock.runs.search_space import with_parameters
from airflock.scenarios.scenario_builder import build_scenario, rebuilt
from airflock.search.study import read_space
from airflock.support import ErrorCollector

PARTS = {"early": (2, 4, 6, 8, 10, 12), "late": (40, 46, 52, 58, 64, 70)}  # generations, five candidates of each
EACH, TRUTH, FLIGHTS, FIRST = 5, 16, 6, 3_300_000_000


def kinds(scenario):
    """Kinds of flights: the scenario as the study flew it, and cheaper ones."""
    dt, duration = scenario.flight.dt, scenario.flight.duration
    half = {"agents": scenario.agents // 2, "world.side": scenario.world.side / 2.0**0.5}
    changes = {
        "whole": {}, "steps twice as long": {"dt": 2.0 * dt}, "a quarter of the time": {"duration": duration / 4.0},
        "half of the agents": half, "all three": {"dt": 2.0 * dt, "duration": duration / 4.0, **half},
    }  # fmt: skip
    return {name: rebuilt(scenario, change) if change else scenario for name, change in changes.items()}


def flown(scenario, parameters, flights, first):
    """Fitness (candidate, flight), and processor time of one flight, s."""
    varied = [with_parameters(scenario, each) for each in parameters]
    score_flight(scenario, 0)  # compiles
    begin = time.process_time()
    seeds = [first + i for i in range(flights)]
    rows = score_flights([s for s in varied for _ in seeds], seeds * len(varied), threads=1)
    seconds = (time.process_time() - begin) / len(rows)
    return np.array([row["fitness"] for row in rows]).reshape(len(varied), flights), seconds


def main():
    """One row for each kind and part of the search."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    scenario = build_scenario(read_request(folder, "study")["scenario"], str(folder))
    space = read_space(read_request(folder, "study")["space"], scenario, ErrorCollector())
    print("| part of the search | flights | ms | one flight and truth | means and truth | mean fitness |")
    print("|---|---|---|---|---|---|")
    for part, numbers in PARTS.items():
        with FlightStore(folder, write=False) as store:
            points = [point for number in numbers for point in store.asked(CandidateBatch("search", 0, number))[:EACH]]
        parameters = [space.parameters(np.array(point)) for point in points]
        truth = flown(scenario, parameters, TRUTH, FIRST)[0].mean(axis=1)
        for name, kind in kinds(scenario).items():
            found, seconds = flown(kind, parameters, FLIGHTS, FIRST + TRUTH)
            single = np.mean([kendalltau(truth, column).statistic for column in found.T])
            means = kendalltau(truth, found.mean(axis=1)).statistic
            cost = f"{name} | {1e3 * seconds:.1f}"
            print(f"| {part} | {cost} | {single:.2f} | {means:.2f} | {found.mean():.3f} |", flush=True)


if __name__ == "__main__":
    main()
