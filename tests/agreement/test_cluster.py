"""Flights on workers of dask: the same study, bit by bit, also when workers are killed at random."""

import os
import pickle
import random
import signal
import threading
import warnings

import pytest

import toys
from airflock.certificates.campaign import (
    Campaign,
    CampaignTask,
)
from airflock.certificates.certification import run_campaign as certified
from airflock.certificates.limits import parse_limits
from airflock.runs import dask_cluster as executors_cluster
from airflock.runs.dask_cluster import DaskCluster
from airflock.runs.executors import Flight, ThreadExecutor, score_scenarios
from airflock.runs.flight_store import FlightStore
from airflock.runs.folder import open_folder
from airflock.scenarios.files import load
from airflock.search.evolution import run_study, study_tasks
from airflock.support.errors import FlightError, StudyError
from needed import needed

distributed = needed("distributed")
pytestmark = [pytest.mark.filterwarnings("ignore"), pytest.mark.usefixtures("undrawn")]
TABLES = (
    "SELECT * FROM candidate",
    "SELECT stage, run, generation, candidate, repeat, seed, scores, reason FROM flight",
)


def local(workers=2):
    return distributed.LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None, silence_logs=60)


@pytest.fixture(scope="module")
def cluster():
    with local() as found:
        yield found


@pytest.fixture
def doomed():
    """A cluster of one's own, because kills may leave it with fewer workers."""
    with local() as found:
        yield found


def contents(folder):
    with FlightStore(folder, write=False) as store:
        return [store.rows(sql) for sql in TABLES]


def toy_task(pause=0.0):
    best, space = dict(toys.BEST), toys.SPACE

    def task(parameters, seed):  # a closure, because workers cannot import the tests
        import random as chance
        import time as clock

        clock.sleep(pause)
        away = sum(((parameters[k] - v) / space["model"][k[6:]]["high"]) ** 2 for k, v in best.items())
        if parameters["model.p_rep"] < 0.03:
            return None, "nobody can fly so", 0.0, "worker"
        return {"fitness": 1.0 - away + 0.01 * chance.Random(seed).gauss(0.0, 1.0)}, "", 0.0, "worker"

    return task


def here(parameters, seed):
    return {"fitness": toys.bowl(parameters, seed)["fitness"]}


def test_workers_killed_at_random_change_nothing(tmp_path, doomed, seed):
    study = toys.study(population=10, generations=10, seeds=2)
    open_folder(tmp_path / "here", study, resume=False)
    wanted = run_study(study, tmp_path / "here", ThreadExecutor(here, 2))
    over, kills = threading.Event(), []

    def killer():
        chance = random.Random(seed)
        while len(kills) < 4 and not over.wait(chance.uniform(0.2, 0.6)):  # a worker takes a second to start
            worker = chance.choice(list(doomed.workers.values()))
            # one at a time: a worker that dies before it has started is given up by its nanny
            if worker.pid and len(doomed.scheduler_info["workers"]) == 2:
                os.kill(worker.pid, signal.SIGKILL)
                kills.append(worker.pid)

    thread = threading.Thread(target=killer)
    open_folder(tmp_path / "there", study, resume=False)
    executor = DaskCluster([toy_task(0.06)], doomed.scheduler_address)
    thread.start()
    try:
        found = run_study(study, tmp_path / "there", executor)
    finally:
        over.set()
        thread.join()
    assert len(kills) >= 3
    assert contents(tmp_path / "there") == contents(tmp_path / "here")
    assert found.document() == wanted.document()


def test_flights_that_never_end_are_recorded_as_failed(doomed):
    def task(parameters, seed):
        import time as clock

        clock.sleep(9.0 if parameters["model.r0_rep"] > 50.0 else 0.0)
        return {"fitness": 1.0}, "", 0.0, "worker"

    executor = DaskCluster([task], doomed.scheduler_address, timeout=2.0)
    flights = [Flight(i, 0, {"model.r0_rep": r}, i) for i, r in enumerate((20.0, 60.0, 30.0))]
    landed = {x.flight.candidate_index: x for x in executor.fly(flights)}
    executor.close()
    assert landed[1].values is None and landed[1].reason == "took longer than 2 s, 3 times"
    assert landed[0].values == landed[2].values == {"fitness": 1.0}


def test_schedulers_without_workers_are_one_line():
    with local(0) as empty, pytest.raises(StudyError, match="has no workers"):
        DaskCluster(study_tasks(toys.study()), empty.scheduler_address, connect_timeout=0.3)


def test_a_scheduler_that_loses_all_its_workers_is_one_line(monkeypatch):
    """Found by kills: two workers died while they started, their nannies gave up, and the study waited for ever."""
    monkeypatch.setattr(executors_cluster, "DESERTED", 0.5)
    with local(1) as alone:
        executor = DaskCluster([toy_task(0.2)], alone.scheduler_address)
        flying = executor.fly([Flight(0, repeat, dict(toys.BEST), repeat) for repeat in range(20)])
        next(flying)
        alone.scale(0)
        with pytest.raises(StudyError, match=r"^the scheduler has had no workers for 0.5 s; what has landed is stored"):
            list(flying)
        executor.close()


def test_schedulers_that_do_not_answer_are_one_line():
    with pytest.raises(StudyError, match="--scheduler tcp://127.0.0.1:9: does not answer"):
        DaskCluster(study_tasks(toys.study()), "tcp://127.0.0.1:9", connect_timeout=0.3)


def test_workers_with_different_processors_are_named(cluster, monkeypatch):
    executor = DaskCluster(study_tasks(toys.study()), cluster.scheduler_address)
    monkeypatch.setattr(executor.client, "run", lambda _, **_given: {"a": "Epyc", "b": "Xeon"})
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        executor._warn_of_mixed_processors()
    executor.close()
    assert "workers have different processors (Epyc; Xeon)" in str(told[0].message)


def test_a_task_flies_the_same_flight_as_this_process():
    from airflock.engine import score_flight
    from airflock.runs.search_space import with_parameters
    from airflock.search.study import load_study

    study = load_study("vasarhelyi_2018/4ms", settings={"duration": 2.0, "agents": 10})
    parameters = study.space.parameters([0.5] * 11)
    values, reason, _, _ = study_tasks(study)[0](parameters, 5)
    assert not reason and values == score_flight(with_parameters(study.scenario, parameters), 5)


def test_a_certificate_over_workers_that_are_killed_is_that_of_one_process(tmp_path, doomed, seed):
    scenario = load("vasarhelyi_2018/real_6ms")
    campaign = Campaign(scenario, parse_limits(["r_min<1 at 5%"], scenario))

    def task(parameters, own):  # a closure, because workers cannot import the tests
        import random as chance
        import time as clock

        clock.sleep(0.03)
        near = chance.Random(own).random() < 0.01
        return {"r_min": 0.5, "closest": 0.4, "first": [3.0]} if near else {"r_min": 5.0}, "", 0.0, "worker"

    open_folder(tmp_path / "here", campaign, resume=False)
    wanted = certified(
        campaign, tmp_path / "here", ThreadExecutor(lambda p, own: task(p, own)[0], 4), 600.0, is_stored=False
    )
    open_folder(tmp_path / "there", campaign, resume=False)
    executor = DaskCluster([task], doomed.scheduler_address)
    worker = random.Random(seed).choice(list(doomed.workers.values()))
    killer = threading.Timer(0.5, os.kill, (worker.pid, signal.SIGKILL))
    killer.start()
    try:
        found = certified(campaign, tmp_path / "there", executor, 600.0, is_stored=False)
    finally:
        executor.close()
        killer.join()
    assert found.shown and found.document() == wanted.document()
    assert contents(tmp_path / "there") == contents(tmp_path / "here")


def test_a_worker_flies_a_certificate_to_the_bits_of_one_process():
    scenario = load("vasarhelyi_2018/real_4ms", {"agents": 6, "duration": 10.0})
    limits = parse_limits(["r_min<60 at 5%", "phi_wall>0 at 5%"], scenario)
    task = pickle.loads(pickle.dumps(CampaignTask(scenario, limits, 32)))
    score = CampaignTask(scenario, limits, 32).score
    for own in range(3):
        values, reason, _, _ = task({}, own)
        assert values == score({}, own) and not reason
    assert any("closest" in task({}, own)[0] for own in range(3))


def test_scores_over_workers_are_those_of_this_process(cluster):
    plain = load("vicsek_1995/ordered", {"agents": 6, "duration": 2.0})
    louder = load("vicsek_1995/ordered", {"agents": 6, "duration": 2.0, "model.eta": 1.0})
    scenarios, seeds = [plain, louder, plain, louder], [0, 0, 1, 1]
    landed = []
    found = score_scenarios(scenarios, seeds, scheduler=cluster.scheduler_address, on_done=lambda: landed.append(1))
    assert found == score_scenarios(scenarios, seeds) and len(landed) == 4


def test_a_flight_that_goes_wrong_on_a_worker_is_one_line(cluster, monkeypatch):
    def task(parameters, seed):
        return (
            (None, f"seed {seed}: agent 0 left the finite numbers", 0.0, "worker") if seed == 3 else ({}, "", 0.0, "")
        )

    monkeypatch.setattr(
        "airflock.runs.executors.make_executor", lambda *_, scheduler, **__: DaskCluster([task], scheduler)
    )
    with pytest.raises(FlightError, match="^seed 3: agent 0 left the finite numbers$"):
        score_scenarios([load("vicsek_1995/ordered")] * 5, range(5), scheduler=cluster.scheduler_address)


def test_workers_fly_on_their_own_processors():
    with pytest.raises(StudyError, match="device = cuda: workers of a scheduler fly on their cpu"):
        score_scenarios([load("vicsek_1995/ordered")], [0], scheduler="tcp://127.0.0.1:9", device="cuda")
