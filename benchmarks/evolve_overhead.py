"""What a generation of 100 costs beside its flights: store, optimiser and bookkeeping. Expectation: at most 20 ms.

Flights are replaced by a constant, so that everything measured is overhead; processor time, the best of several
rounds. With --flights the whole search is set against the bare flights of the same candidates in turn.
"""

import argparse
import tempfile
import time
from pathlib import Path

from airflock.engine import score_flight, score_flights
from airflock.runs.executors import ThreadExecutor
from airflock.runs.flight_store import CandidateBatch, FlightStore
from airflock.runs.search_space import with_parameters
from airflock.search.evolution import study_executor
from airflock.search.generations import run_search
from airflock.search.study import load_study

NAME = "vasarhelyi_2018/6ms"


def overhead(generations, rounds):
    """Processor time of a generation of 100 without its flights, s."""
    study = load_study(NAME, search={"generations": generations})
    values = score_flight(with_parameters(study.scenario, {}), 0)
    best = float("inf")
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as folder, FlightStore(Path(folder)) as store:
            executor = ThreadExecutor(lambda p, s: values, 1)
            begin = time.process_time()
            run_search(study, store, executor)
            best = min(best, (time.process_time() - begin) / generations)
            executor.close()
    return best


def ratio(generations, population, duration, rounds):
    """Processor time of a search over that of the same flights flown bare, interleaved; the median of rounds."""
    found = []
    for i in range(rounds):
        keys = {"generations": generations, "population": population, "seed": i}
        study = load_study(NAME, search=keys, settings={"duration": duration})
        with tempfile.TemporaryDirectory() as folder, FlightStore(Path(folder)) as store:
            executor = study_executor(study)
            begin = time.process_time()
            run_search(study, store, executor)
            whole = time.process_time() - begin
            executor.close()
            scenarios, seeds = [], []
            for g in range(generations):
                points = store.asked(CandidateBatch("search", 0, g))
                scenarios += [with_parameters(study.scenario, study.space.parameters(p)) for p in points]
                seeds += [study.seed(0, g * population + k) for k in range(population)]
        begin = time.process_time()
        score_flights(scenarios, seeds)
        found.append(whole / (time.process_time() - begin))
    return sorted(found)[len(found) // 2]


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--flights", action="store_true", help="also measure the ratio with real flights")
    asked = parser.parse_args()
    print(f"overhead of a generation of 100: {1e3 * overhead(30, 5):.1f} ms")
    if asked.flights:
        ratio(1, 4, 600.0, 1)  # imports and the first call of a driver cost a second, once
        print(f"search over bare flights: {ratio(2, 50, 600.0, 3):.3f}")
