"""Processes that need the same driver compile it once; one that dies or is stopped holds nobody up for ever."""

import json
import os
import signal
import subprocess
import sys
import threading
import time

from inside import alone

COMPILED = """
import json
from airflock.engine.store import load_driver

text = '''
import numpy as np
from numba import njit
@njit(cache=True)
def advance(x):
    return np.sort(np.sort(x) ** 2).sum() + len(np.unique(x))
'''
driver = load_driver(text, "locked")
print("ready", flush=True)
input()
import numpy as np
driver.advance(np.arange(3.0))
print(json.dumps([sum(driver.advance.stats.cache_hits.values()), sum(driver.advance.stats.cache_misses.values())]))
"""
HELD = """
import sys, time
from pathlib import Path
from airflock.engine.numba_private.sealed_cache import folder_lock

with folder_lock(Path(sys.argv[1])) as held:
    print(held, flush=True)
    time.sleep(600.0)
"""


def test_of_two_processes_one_compiles_and_the_other_loads(tmp_path):
    paths = os.environ | {"AIRFLOCK_CACHE": str(tmp_path)}
    both = [
        subprocess.Popen([sys.executable, "-c", COMPILED], env=paths, text=True, stdin=-1, stdout=-1) for _ in range(2)
    ]
    for process in both:
        assert process.stdout.readline() == "ready\n"
    for process in both:
        process.stdin.write("now\n")
        process.stdin.flush()
    found = [process.communicate()[0] for process in both]
    assert sorted(json.loads(text) for text in found) == [[0, 1], [1, 0]]  # hits and misses of the cache


def test_a_process_that_was_killed_holds_no_lock(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", HELD, str(tmp_path)], text=True, stdout=-1)
    assert process.stdout.readline() == "True\n"
    with alone(tmp_path, timeout=0.0) as held:
        assert not held
    process.send_signal(signal.SIGKILL)
    process.wait()
    with alone(tmp_path, timeout=0.0) as held:
        assert held


def test_a_thread_waits_for_another_and_no_longer(tmp_path):
    order, inside = [], threading.Event()

    def first():
        with alone(tmp_path):
            inside.set()
            time.sleep(0.2)
            order.append("first")

    thread = threading.Thread(target=first)
    thread.start()
    inside.wait()
    with alone(tmp_path) as held:
        order.append("second")
    thread.join()
    assert held and order == ["first", "second"]


def test_without_a_folder_nobody_waits(tmp_path):
    with alone(tmp_path / "removed") as held:
        assert not held
