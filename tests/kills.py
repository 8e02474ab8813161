"""Kill what is at work at random moments (SIGKILL), until it has died so many times: every end equals the undisturbed.

python tests/kills.py FOLDER --what evolve --kills 200 --seed 7

What is at work is one of LIVES: a life begins, or goes on with, what a folder holds, to its end. Toy flights stand for
real ones where only the store matters. `workers`, `sweep` and `certificates` kill worker processes of dask under a
study, and under a sweep and a certificate of real flights. What is done stands in FOLDER/WHAT/done.json, so that a run
that was cut off goes on.
"""

import argparse
import json
import os
import random
import shutil
import signal
import sqlite3
import sys
import time
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import toys
from airflock.runs.executors import ThreadExecutor
from airflock.runs.flight_store import FILE
from airflock.runs.folder import REQUEST_FILE, open_folder
from airflock.search.evolution import run_study
from airflock.support import atomic

NAMED = ("result.toml", "best.toml", REQUEST_FILE)
CANDIDATES = "SELECT * FROM candidate"
FLIGHTS = "SELECT stage, run, generation, candidate, repeat, seed, scores, reason FROM flight"
MINE = {
    "agents": 4, "duration": 20.0, "dt": 0.1, "model": {"kind": "vasarhelyi_2018", "v_flock": 6.0, "p_rep": 0.2},
    "world": {"side": 120.0}, "radio": {"delay": 0.4},
}  # fmt: skip


def evolve(folder):
    """A study of toy flights."""
    study = toys.study(generations=12, seeds=2, restarts=1)
    import_module("airflock.search.evolution").draw_study = lambda *_: None
    open_folder(folder, study)
    run_study(study, folder, ThreadExecutor(toys.slow_bowl, 2))


def of_study(folder):
    """Everything of a study but what tells of the machine."""
    return rows(folder), [(folder / name).read_text() for name in NAMED]


def rows(folder):
    with sqlite3.connect(folder / FILE) as connection:
        return [connection.execute(sql).fetchall() for sql in (CANDIDATES, FLIGHTS)]


def certify(folder):
    """A campaign of toy flights, so many in all, and its certificate."""
    from airflock.certificates.campaign import Campaign
    from airflock.certificates.certification import run_campaign
    from airflock.certificates.limits import parse_limits
    from airflock.scenarios.files import load

    scenario = load("vasarhelyi_2018/real_6ms")
    campaign = Campaign(scenario, parse_limits(["r_min<1 at 2%", "phi_vel>=5 in 98%"], scenario), flights=400)

    def dice(_, own):
        time.sleep(0.001)
        chance = random.Random(own)
        return {"r_min": 0.5 if chance.random() < 0.005 else 5.0, "phi_vel": 6.0 + chance.gauss(0.0, 0.4)}

    open_folder(folder, campaign)
    executor = ThreadExecutor(dice, 2)
    try:
        run_campaign(campaign, folder, executor, 60.0).save(folder / "certificate.toml")
    finally:
        executor.close()


def of_certificate(folder):
    lines = (folder / "certificate.toml").read_text().replace(str(folder), "FOLDER").splitlines()
    return rows(folder), [line for line in lines if not line.startswith("seal = ")]  # of the folder's name, too


def tune(folder):
    """A tuning of real flights, tiny ones, but for its pictures."""
    from airflock.scenarios import build_scenario

    tuning = import_module("airflock.search.tuning_run")
    tuning.measure_flight_rate = lambda *_: 1000.0  # about the least plan: six generations, ten flights of a step
    import_module("airflock.search.evolution").draw_study = lambda *_: None
    import_module("airflock.search.tune_report").save = lambda found: atomic.write_file(
        found.folder / "report.html", repr(found)
    )
    # the limit is shown after its first looks, whatever the time
    resume = (folder / REQUEST_FILE).is_file()
    tuning.tune(build_scenario(MINE, "mine"), folder, budget=1.0, limit=["r_min<0.1 at 20%"], resume=resume)


def of_tuning(folder):
    """All stages; of the certificate what counting showed, because tolerances are looked for as long as time allows."""
    from airflock.support.untrusted import read_toml

    told = read_toml(folder / "certificate.toml")
    names = (REQUEST_FILE, "start.toml", "tuned.toml")
    texts = [(folder / name).read_text().replace(str(folder), "FOLDER") for name in names]
    return rows(folder / "study"), rows(folder / "hardening_flights"), texts, told["limit"], told["flights"]


def grid(folder):
    """A sweep of real flights, tiny ones."""
    import airflock

    what = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 40.0})
    airflock.sweep(what, {"radio.delay": [0.0, 0.5]}, 60, out=folder, resume=(folder / REQUEST_FILE).is_file())


def of_grid(folder):
    return rows(folder), (folder / "result.csv").read_text()


def tracks(folder):
    """A table of tracks becomes a recording and a table again."""
    import numpy as np
    import pandas as pd

    from airflock.recordings.exports import export
    from airflock.recordings.imports.load_tracks import load_tracks
    from airflock.recordings.recording_files import save

    folder.mkdir(exist_ok=True)
    os.chdir(folder)  # recordings tell the names of their sources
    time_, who = np.meshgrid(0.1 * np.arange(3000), np.arange(6), indexing="ij")
    east, north = 20.0 * np.sin(0.1 * time_ + who), 20.0 * np.cos(0.1 * time_ + who)
    columns = {"t": time_, "id": who, "x": east, "y": north}
    atomic.write_file("tracks.csv", pd.DataFrame({k: v.ravel() for k, v in columns.items()}).to_csv(index=False))
    found = load_tracks("tracks.csv")
    save(found, "flight.nc")
    export(found, "again.csv")


def of_tracks(folder):
    """Every file, by its content; nothing else is left, not even what a dead process had begun."""
    atomic.FRESH = -1.0
    atomic.remove_leftovers.cache_clear()
    atomic.remove_leftovers(folder)
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def studio(folder):
    """What the live page writes: a tuned scenario, the flight again as a recording, its replay."""
    from airflock.studio.player import FlightRequest, Player

    folder.mkdir(exist_ok=True)
    player = Player(FlightRequest("vasarhelyi_2018/4ms", {"agents": 4}, seed=3))
    player.fly(40)
    player.change("model.p_rep", 0.2)
    player.fly(40)
    player.save_toml(folder / "tuned.toml")
    player.save_recording(folder / "tuned.nc")
    player.save_replay(folder / "tuned.html")


# Imported before the first life: each dies at its work, not at imports, which cost more than it.
HEAVY = {
    "evolve": ("cma",),
    "tune": ("cma", "fontTools.subset", "airflock.engine.compiler", "airflock.search.tune_report"),
}

LIVES = {
    "evolve": (evolve, of_study),
    "certify": (certify, of_certificate),
    "tune": (tune, of_tuning),
    "grid": (grid, of_grid),
    "import": (tracks, of_tracks),
    "studio": (studio, of_tracks),
}


def child(life, folder):
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


def killed(what, folder, kills, seed):
    """Kill lives until so many have died; a line for each study that came to its end, and the sum."""
    life, contents = LIVES[what]
    for name in HEAVY.get(what, ()):
        import_module(name)
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / "done.json"
    done = json.loads(kept.read_text()) if kept.exists() else {"kills": 0, "studies": 0, "usual": None}
    if done["usual"] is None:
        for _ in range(2):  # the first one imports and compiles
            shutil.rmtree(folder / "undisturbed", ignore_errors=True)
            begin = time.perf_counter()
            assert os.waitpid(child(life, folder / "undisturbed"), 0)[1] == 0
            done["usual"] = time.perf_counter() - begin
        kept.write_text(json.dumps(done))
    wanted = contents(folder / "undisturbed")
    while done["kills"] < kills:
        chance, mine = random.Random(f"{seed} {done['studies']}"), 0
        place = folder / f"study{done['studies']}"
        shutil.rmtree(place, ignore_errors=True)
        while True:
            pid = child(life, place)
            limit, dead = time.perf_counter() + chance.uniform(0.0, 0.9 * done["usual"]), 0
            while not dead and (time.perf_counter() < limit or done["kills"] + mine >= kills):
                dead, status = os.waitpid(pid, os.WNOHANG)
                time.sleep(0.001)
            if dead:
                assert status == 0, f"{what} {done['studies']} failed after {mine} kills"
                break
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            mine += 1
        assert contents(place) == wanted, f"{what} {done['studies']} ended differently after {mine} kills"
        done["kills"], done["studies"] = done["kills"] + mine, done["studies"] + 1
        kept.write_text(json.dumps(done))
        shutil.rmtree(place)
        sys.stderr.write(f"{what}: {done['kills']} of {kills} kills\n")
    sys.stdout.write(f"{what}: {done['kills']} kills in {done['studies']} lives of {done['usual']:.2f} s: "
                     "all ends identical\n")  # fmt: skip


@contextmanager
def dying_workers(chance, died):
    """Address of two workers of dask, of which one at random is killed now and then; `died` is told of each."""
    import threading

    import distributed

    over = threading.Event()
    how = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 60}
    with distributed.LocalCluster(**how) as cluster:

        def killer():
            quiet = 0
            while not over.wait(chance.uniform(0.2, 0.6)):
                quiet = 0 if cluster.scheduler_info["workers"] else quiet + 1
                if quiet == 50:  # both died while they started, and their nannies gave up: hire two others
                    cluster.scale(0)
                    cluster.scale(2)
                    quiet = 0
                worker = chance.choice([*cluster.workers.values(), None])
                # one at a time: a worker that dies before it has started is given up by its nanny
                if worker is not None and worker.pid and len(cluster.scheduler_info["workers"]) == 2:
                    os.kill(worker.pid, signal.SIGKILL)
                    died.append(worker.pid)

        thread = threading.Thread(target=killer)
        thread.start()
        try:
            yield cluster.scheduler_address
        finally:
            over.set()
            thread.join()


def under_deaths(what, folder, kills, seed, life):
    """Lives under dying workers until so many have died: life(number, address) raises where one ends differently."""
    kept = folder / "done.json"
    done = json.loads(kept.read_text()) if kept.exists() else {"kills": 0, "lives": 0}
    folder.mkdir(parents=True, exist_ok=True)
    while done["kills"] < kills:
        died = []
        with dying_workers(random.Random(f"{seed} {done['lives']}"), died) as address:
            life(done["lives"], address)
        done = {"kills": done["kills"] + len(died), "lives": done["lives"] + 1}
        kept.write_text(json.dumps(done))
        sys.stderr.write(f"{what}: {done['kills']} of {kills} kills\n")
    sys.stdout.write(f"{what}: {done['kills']} workers killed in {done['lives']} lives: all ends identical\n")


def workers(folder, kills, seed):
    """Kill workers of dask under studies until so many have died."""
    from airflock.runs.dask_cluster import DaskCluster

    best, space = dict(toys.BEST), toys.SPACE

    def task(parameters, own):  # a closure, because workers cannot import the tests
        import random as chance
        import time as clock

        clock.sleep(0.03)
        away = sum(((parameters[k] - v) / space["model"][k[6:]]["high"]) ** 2 for k, v in best.items())
        return {"fitness": 1.0 - away + 0.01 * chance.Random(own).gauss(0.0, 1.0)}, "", 0.0, "worker"

    study = toys.study(population=10, generations=10, seeds=2)

    def ended(name, executor):
        shutil.rmtree(folder / name, ignore_errors=True)
        open_folder(folder / name, study, resume=False)
        run_study(study, folder / name, executor)
        return rows(folder / name)

    wanted = ended("here", ThreadExecutor(lambda p, s: task(p, s)[0], 2))

    def life(number, address):
        assert ended(f"there{number}", DaskCluster([task], address)) == wanted, f"study {number} ended differently"

    under_deaths("workers", folder, kills, seed, life)


def sweeps(folder, kills, seed):
    """Kill workers of dask under sweeps of real flights until so many have died."""
    import airflock

    over = {"radio.delay": [0.0, 0.5, 1.0], "agents": [10, 20]}
    what = airflock.load("vasarhelyi_2018/4ms", {"duration": 300.0})
    wanted = airflock.sweep(what, over, seeds=range(60))

    def life(number, address):
        found = airflock.sweep(what, over, seeds=range(60), scheduler=address)
        assert found.equals(wanted), f"sweep {number} ended differently"

    under_deaths("sweep", folder, kills, seed, life)


def certificates(folder, kills, seed):
    """Kill workers of dask under campaigns of real flights until so many have died."""
    from airflock.certificates.campaign import Campaign, CampaignTask
    from airflock.certificates.certification import run_campaign
    from airflock.certificates.limits import parse_limits
    from airflock.runs.dask_cluster import DaskCluster
    from airflock.scenarios.files import load

    scenario = load("vasarhelyi_2018/real_4ms", {"agents": 10, "duration": 300.0})
    limits = parse_limits(["r_min<3 at 5%", "phi_vel>=2 in 90%"], scenario)
    campaign = Campaign(scenario, limits, flights=1000)
    task = CampaignTask(scenario, limits, 32)

    def ended(name, executor):
        place = folder / name
        shutil.rmtree(place, ignore_errors=True)
        open_folder(place, campaign, resume=False)
        try:
            run_campaign(campaign, place, executor, 600.0, is_stored=False).save(place / "certificate.toml")
        finally:
            executor.close()
        return of_certificate(place)

    wanted = ended("here", ThreadExecutor(lambda p, s: task(p, s)[0], 1))

    def life(number, address):
        assert ended(f"there{number}", DaskCluster([task], address)) == wanted, f"campaign {number} ended differently"

    under_deaths("certificates", folder, kills, seed, life)


CLUSTERS = {"workers": workers, "sweep": sweeps, "certificates": certificates}


def main():
    """Exit status 0 if all ends are identical."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=lambda name: Path(name).resolve())
    parser.add_argument("--what", choices=[*LIVES, *CLUSTERS], default="evolve")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    if asked.what in CLUSTERS:
        CLUSTERS[asked.what](asked.folder / asked.what, asked.kills, asked.seed)
    else:
        killed(asked.what, asked.folder / asked.what, asked.kills, asked.seed)


if __name__ == "__main__":
    main()
