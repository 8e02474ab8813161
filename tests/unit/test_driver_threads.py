"""Threads that ask for one driver at the same moment all get it whole."""

import random
import threading

from airflock.engine.store import load_driver


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
