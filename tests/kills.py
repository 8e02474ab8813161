"""Kill a study at random moments (SIGKILL) until it has died so many times; every end must equal the undisturbed one.

python tests/kills.py FOLDER --kills 200 --seed 7
"""

import argparse
import os
import random
import signal
import sqlite3
import sys
import time
from pathlib import Path

import toys
from airflock.evolve.after import conclude
from airflock.evolve.folder import STUDY, open_folder, sweep, versions
from airflock.evolve.search import search
from airflock.evolve.store import FILE, Store
from airflock.executors.here import Here

RUN, NAMED = versions(), ("result.toml", "best.toml", "study.toml")
CANDIDATES = "SELECT * FROM candidate"
FLIGHTS = "SELECT stage, run, generation, candidate, repeat, seed, scores, reason FROM flight"


def life(folder):
    """Begin or continue the study in a folder, to its end."""
    study = toys.study(generations=12, seeds=2, restarts=1)
    open_folder(folder, study, resume=(folder / STUDY).exists())
    executor = Here(toys.slow_bowl, 2)
    with Store(folder) as store:
        store.begin(RUN)
        sweep(folder)
        conclude(study, store, executor, search(study, store, executor), folder)
    executor.close()


def child(folder):
    """Process that lives one life."""
    pid = os.fork()
    if pid == 0:
        try:
            life(folder)
            os._exit(0)
        except BaseException as fault:  # whatever it is, the parent must hear of it
            sys.stderr.write(f"{type(fault).__name__}: {fault}\n")
            os._exit(1)
    return pid


def contents(folder):
    """Everything of a study but what tells of the machine."""
    with sqlite3.connect(folder / FILE) as connection:
        found = [connection.execute(sql).fetchall() for sql in (CANDIDATES, FLIGHTS)]
    return found, [(folder / name).read_text() for name in NAMED]


def main():
    """Exit status 0 if all ends are identical."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    chance = random.Random(asked.seed)
    begin = time.perf_counter()
    os.waitpid(child(asked.folder / "undisturbed"), 0)
    usual = time.perf_counter() - begin
    wanted = contents(asked.folder / "undisturbed")
    kills = studies = 0
    while kills < asked.kills:
        folder = asked.folder / f"study{studies}"
        while True:
            pid = child(folder)
            limit, dead = time.perf_counter() + chance.uniform(0.0, 0.9 * usual), 0
            while not dead and (time.perf_counter() < limit or kills >= asked.kills):
                dead, status = os.waitpid(pid, os.WNOHANG)
                time.sleep(0.001)
            if dead:
                assert status == 0, f"study {studies} failed after {kills} kills"
                break
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            kills += 1
        assert contents(folder) == wanted, f"study {studies} ended differently after {kills} kills"
        studies += 1
    sys.stdout.write(f"{kills} kills in {studies} studies of {usual:.2f} s: all ends identical\n")


if __name__ == "__main__":
    main()
