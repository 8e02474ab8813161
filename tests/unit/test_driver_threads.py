"""Drivers are compiled when that is asked for, and threads that ask for one at the same moment all get it whole."""

import random
import threading

from airflock.engine import compile_for, plan_of, score_flight
from airflock.scenarios.files import load
from inside import flight_driver, load_driver


def test_no_thread_gets_a_driver_that_another_is_still_executing(tmp_path, monkeypatch):
    monkeypatch.setenv("AIRFLOCK_CACHE", str(tmp_path))
    text = f"import time\n\ntime.sleep(0.1)\nROWS = {random.Random(7).random()}\n"
    found, start = [], threading.Barrier(4)

    def ask():
        start.wait()
        found.append(getattr(load_driver(text, "threads"), "ROWS", None))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(found)) == 1 and None not in found


def test_what_has_been_compiled_for_a_scenario_is_what_flies_it():
    scenario = load("vicsek_1995/ordered", {"agents": 5, "duration": 1.0})
    compile_for(scenario)
    driver = flight_driver(plan_of(scenario))
    compiled = list(driver.advance.signatures)
    assert len(compiled) == 1
    score_flight(scenario)
    assert list(driver.advance.signatures) == compiled
