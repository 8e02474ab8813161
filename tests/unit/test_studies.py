"""Studies: their folders, their bad input, their results, all with flights that cost nothing."""

import json
import shutil
import sqlite3
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import airflock
import toys
from airflock.runs.executors import BatchExecutor, Flight, ThreadExecutor
from airflock.runs.flight_store import FILE, CandidateBatch, FlightStore
from airflock.runs.folder import (
    REQUEST_FILE,
    Interrupted,
    differences,
    open_folder,
    read_request,
    write_toml_file,
)
from airflock.runs.search_space import SearchAxis, with_parameters
from airflock.search.evolution import (
    check_study_device,
    evolve_request,
    run_study,
    study_from_request,
    study_tasks,
)
from airflock.search.study import load_study, shipped_studies
from airflock.support.errors import ScenarioError, StudyError
from airflock_papers.dimock_2003.units import gains
from airflock_papers.vasarhelyi_2018.published import SPEEDS, optimum
from processes import called


def finished(folder, study=None, score=toys.bowl, **options):
    study = study or toys.study()
    open_folder(folder, study, resume=False)
    return run_study(study, folder, ThreadExecutor(score, 2), **options)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies") / "bowl"
    return finished(folder, toys.study(population=16, generations=25, restarts=1))


def test_best_is_near_the_optimum_and_its_score_is_of_fresh_seeds(done):
    assert done.fitness == pytest.approx(1.0, abs=0.02) and done.low <= done.fitness <= done.high
    assert done.parameters["model.p_rep"] == pytest.approx(0.2, abs=0.05)
    with FlightStore(done.folder, write=False) as store:
        seeds = {stage: {s for (s,) in store.rows("SELECT seed FROM flight WHERE stage=?", (stage,))} for stage in
                 ("search", "final", "score")}  # fmt: skip
    assert len(seeds["search"]) == 16 * 25 * 2 and len(seeds["final"]) == len(seeds["score"]) == 4
    assert not seeds["search"] & seeds["final"] and not seeds["score"] & (seeds["search"] | seeds["final"])
    assert min(seeds["search"]) > 2**39


def test_folder_holds_a_scenario_that_flies_tables_and_pictures(done):
    best = airflock.load(done.folder / "best.toml")
    assert best.parameters.p_rep == done.parameters["model.p_rep"] and best.published == {}
    table = pd.read_csv(done.folder / "evaluations.csv")
    assert len(table) == 16 * 25 * 2 + (2 + 3 + 1) * 4
    assert pd.read_parquet(done.folder / "evaluations.parquet").shape == table.shape
    assert {"model.p_rep", "seed", "fitness", "phi_vel", "reason", "duration", "versions"} <= set(table)
    assert all((done.folder / f"{name}.png").is_file() for name in ("convergence", "scatter", "slices"))


def test_working_ranges_span_the_candidates_that_reach_the_mean(done):
    with FlightStore(done.folder, write=False) as store:
        rows = store.rows("SELECT parameters, fitness FROM candidate WHERE stage='search'")
    good = [json.loads(p)["model.p_rep"] for p, f in rows if (json.loads(f)[0] or 0.0) >= done.fitness]
    assert done.above == len(good) and done.ranges["model.p_rep"] == (min(good), max(good))
    found = tomllib.loads((done.folder / "result.toml").read_text())
    assert found["working_ranges"]["above_mean"] == len(good)


def test_failed_candidates_are_recorded_with_their_reason_and_never_best(done):
    table = pd.read_csv(done.folder / "evaluations.csv")
    failed = table[table["model.p_rep"] < 0.03]
    assert done.failed and (failed["reason"] == "nobody can fly so").all() and failed["fitness"].isna().all()
    assert done.parameters["model.p_rep"] > 0.03


def test_nobody_flies_is_one_line(tmp_path):
    def never(parameters, seed):
        raise ZeroDivisionError("no air")

    with pytest.raises(StudyError, match="every candidate failed; the first one: no air"):
        finished(tmp_path / "a", score=never)


def test_pareto_studies_keep_a_front(tmp_path):
    study = toys.study({"objective": {"maximise": ["fitness", "phi_vel"]}}, algorithm="nsga2", population=12)
    result = finished(tmp_path / "a", study)
    assert (tmp_path / "a" / "pareto.png").is_file() and 1 <= len(result.finalists) <= 3


@pytest.mark.usefixtures("undrawn")
def test_genetic_algorithm_and_common_random_numbers(tmp_path):
    study = toys.study(algorithm="ga", seeds=2, random_numbers="study")
    finished(tmp_path / "a", study)
    with FlightStore(tmp_path / "a", write=False) as store:
        assert store.rows("SELECT count(DISTINCT seed) FROM flight WHERE stage='search'") == [(2,)]


@pytest.mark.usefixtures("undrawn")
def test_ctrl_c_keeps_what_has_landed_and_resume_ends_the_same(tmp_path, done):
    study = toys.study(population=16, generations=25, restarts=1)

    def stop(progress):
        if progress.fresh == 100:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match=r"1\d\d flights are stored in .*continue with --resume"):
        finished(tmp_path / "a", study, on_progress=stop)
    open_folder(tmp_path / "a", study, resume=True)
    fresh = []
    again = run_study(study, tmp_path / "a", ThreadExecutor(toys.bowl, 2), lambda p: fresh.append(p.fresh))
    assert max(fresh) <= 16 * 25 * 2 - 100
    assert again.document() == done.document()


def test_overlapping_writers_are_refused_and_readers_are_not(tmp_path):
    with FlightStore(tmp_path) as first:
        first.begin({})
        with pytest.raises(StudyError, match=r"another process \(process \d+ on .*\) is writing this study"):
            FlightStore(tmp_path)
        FlightStore(tmp_path, write=False).close()
    FlightStore(tmp_path).close()


def test_flights_are_on_disk_as_soon_as_they_land_and_count_once(tmp_path):
    from airflock.runs.executors import Flight, FlightResult

    batch = CandidateBatch("search", 0, 0)
    with FlightStore(tmp_path) as store:
        store.ask(batch, [[0.5]], [{"model.p_rep": 0.1}])
        store.land(batch, FlightResult(Flight(0, 0, {}, 7), {"fitness": 0.1 + 0.2, "lost": float("nan")}))
        with sqlite3.connect(tmp_path / FILE) as other:
            assert other.execute("SELECT seed FROM flight").fetchall() == [(7,)]
        store.land(batch, FlightResult(Flight(0, 0, {}, 7), {"fitness": 9.0}))
        found = store.flown(batch)[0, 0]
        assert found["fitness"] == 0.1 + 0.2 and found["lost"] != found["lost"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"search": {"population": 20}}, "search.population = 8 there, 20 now"),
        ({"scenario": {"dt": 0.02}}, "scenario.dt"),
        ({"airflock": "9.9"}, "airflock = "),
        ({"space": {"model": {"p_rep": {"low": 0.1}}}}, "space.model.p_rep.low = 0.01 there, 0.1 now"),
    ],
)
def test_folders_of_other_studies_are_refused_with_what_differs(change, words):
    def merged(old, new):
        return {k: merged(old[k], v) if isinstance(v, dict) else v for k, v in new.items()} | {
            k: v for k, v in old.items() if k not in new
        }

    document = toys.study().document()
    found = differences(document, merged(document, change))
    assert len(found) == 1 and words in found[0]


def test_folders_are_never_written_over(tmp_path):
    study = toys.study()
    open_folder(tmp_path / "a", study, resume=False)
    before = (tmp_path / "a" / "request.toml").read_bytes()
    with pytest.raises(StudyError, match="already holds a study; continue it with --resume"):
        open_folder(tmp_path / "a", study, resume=False)
    with pytest.raises(StudyError, match="holds another study: search.seed = 0 there, 3 now; give another --out"):
        open_folder(tmp_path / "a", toys.study(seed=3), resume=True)
    assert (tmp_path / "a" / "request.toml").read_bytes() == before
    with pytest.raises(StudyError, match="no study to resume"):
        open_folder(tmp_path / "b", study, resume=True)
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "thesis.txt").write_text("years of work")
    with pytest.raises(StudyError, match="is not empty"):
        open_folder(tmp_path / "c", study, resume=False)


@pytest.mark.usefixtures("undrawn")
def test_a_study_goes_on_with_what_its_folder_holds(tmp_path):
    """Settings, keys of the search and limits need not be asked for again; what is, counts."""
    first = {"agents": 5, "radio.kind": "links", "model.p_rep": 0.1}, {"generations": 2, "seeds": 2}, "r_min<3 at 1%"
    name, folder = "vasarhelyi_2018/6ms", tmp_path / "a"
    begun = study_from_request(name, first[0], search_keys=first[1], limit=first[2])
    open_folder(folder, begun, resume=False)
    for scenario in (name, None):
        again, note = evolve_request(scenario, folder=folder)
        assert again.document() == begun.document()
        assert note.startswith(f"goes on with what {folder} holds: ") == (scenario is not None)
        assert not note or "scenario.agents = 5 there, 100 now" in note
        open_folder(folder, again, resume=True)
    other, _ = evolve_request(name, {"agents": 6}, search_keys={"generations": 3}, folder=folder)
    assert other.scenario.agents == 6 and other.search.generations == 3 and other.search.seeds == 2
    assert evolve_request(name, first[0], search_keys=first[1], limit=first[2], folder=folder)[1] == ""


def test_files_that_are_no_store_and_full_disks_are_one_line(tmp_path):
    (tmp_path / FILE).write_text("years of work, and no database at all" * 100)
    with pytest.raises(StudyError, match="file is not a database"):
        FlightStore(tmp_path)
    assert "years of work" in (tmp_path / FILE).read_text()
    other = tmp_path / "full"
    other.mkdir()
    with FlightStore(other) as store:
        store.connection.execute("PRAGMA max_page_count = 20")  # the smallest full disk
        with pytest.raises(StudyError, match="database or disk is full; what was stored before is kept"):
            store.ask(CandidateBatch("search", 0, 0), [[0.5] * 4000] * 50, [{}] * 50)
        assert store.asked(CandidateBatch("search", 0, 0)) == []


@pytest.mark.parametrize(
    ("tables", "search", "words"),
    [
        ({"objective": {"maximize": "fitness"}}, {}, "objective.maximize: unknown key; did you mean objective.max"),
        ({"objective": {"over_seeds": "median"}}, {}, "'median' is none of mean, worst, quantile"),
        ({"objective": {"quantile": 2.0}}, {}, "objective.quantile = 2.0 lies outside [0, 1]"),
        ({"objective": {"own": "mine.py"}}, {}, "objective.own = 'mine.py': no such Python file"),
        ({}, {"population": 1}, "search.population = 1 lies outside [2, 1e+06]"),
        ({}, {"population": 10.5}, "search.population = 10.5 is not a whole number"),
        ({}, {"late_seeds": 2.5}, "search.late_seeds = 2.5 is not a whole number"),
        ({}, {"algorithm": "cma"}, "search.algorithm = 'cma' is none of cmaes, ga"),
        ({}, {"algorithm": "nsga2"}, "is for several objectives, but there is one"),
        ({"objective": {"maximise": ["a", "b"]}}, {}, "takes one objective, but there are 2"),
        ({"searhc": {}}, {}, "searhc: unknown key; did you mean search?"),
    ],
)
def test_each_fault_of_a_study_is_one_line(tables, search, words):
    with pytest.raises(ScenarioError) as fault:
        toys.study(tables, **search)
    assert words in str(fault.value) and len(fault.value.errors) == 1


def test_unknown_order_parameters_name_the_known_ones(tmp_path):
    with pytest.raises(StudyError, match="objective beauty: unknown order parameter; known: fitness, phi"):
        finished(tmp_path / "a", toys.study({"objective": {"maximise": "beauty"}}))


@pytest.mark.usefixtures("undrawn")
def test_own_fitness_is_read_from_beside_the_study(tmp_path):
    (tmp_path / "mine.py").write_text("def hurry(score):\n    return 2.0 * score['phi_vel']\n")
    (tmp_path / "study.toml").write_text(
        'scenario = "vasarhelyi_2018/4ms"\n[objective]\nmaximise = "hurry"\nown = "mine.py"\n'
        "[space.model]\np_rep = { low = 0.1, high = 0.2 }\n"
    )
    study = load_study(tmp_path / "study.toml", trust=True)
    before = study.document()
    (tmp_path / "mine.py").write_text("def hurry(score):\n    return 2.0 * score['phi_vel'] + 0.0\n")
    found = differences(before, load_study(tmp_path / "study.toml", trust=True).document())
    assert len(found) == 1 and found[0].startswith("objective")
    assert study.objectives[0].of_candidate([{"phi_vel": 3.0}]) == 6.0 and study.space.keys == ("model.p_rep",)


@pytest.mark.usefixtures("undrawn")
def test_a_law_in_a_file_of_its_own_comes_along_with_the_winner(tmp_path):
    law = Path(airflock.__file__).parent / "parts" / "laws" / "viragh_2014" / "law.py"
    (tmp_path / "mine.py").write_text(law.read_text())
    (tmp_path / "mine.toml").write_text('duration = 1.0\nagents = 3\n[model]\nkind = "mine.py"\n')
    search = {"population": 4, "generations": 1, "top": 1, "final_seeds": 2}
    study = load_study(tmp_path / "mine.toml", search=search, trust=True)
    finished(tmp_path / "a", study, lambda parameters, seed: {"fitness": sum(parameters.values())})
    again = airflock.load(tmp_path / "a" / "best.toml", trust=True)
    assert again.model.name == "mine" and (tmp_path / "a" / "mine.py").is_file()


def test_shipped_studies_hold_the_published_optima_and_table_s6():
    names = [f"vasarhelyi_2018/{speed}ms" for speed in SPEEDS]
    assert set(names) <= set(shipped_studies())
    for name, speed in zip(names, SPEEDS, strict=True):
        study = load_study(name)
        published = optimum(speed).parameters
        assert len(study.space.axes) == 11 and study.scenario.parameters.v_flock == speed
        for axis in study.space.axes:
            assert axis.low <= getattr(published, axis.key[6:]) <= axis.high, (name, axis.key)
        assert (study.whole("population"), study.whole("generations"), study.search.algorithm) == (100, 150, "cmaes")


def test_command_tells_bad_input_in_lines_with_status_2(tmp_path):
    asked = called("evolve", "vasarhelyi_2018/4m", "--out", tmp_path / "a")
    assert asked.returncode == 2 and "did you mean vasarhelyi_2018/4ms?" in asked.stderr
    asked = called("evolve", "vasarhelyi_2018/4ms", "--out", tmp_path / "a", "--scheduler", "tcp://127.0.0.1:9")
    assert asked.returncode == 2 and asked.stderr.count("\n") == 1
    assert "--scheduler tcp://127.0.0.1:9: does not answer" in asked.stderr
    assert not (tmp_path / "a" / FILE).exists()


@pytest.mark.parametrize(("what", "few"), [("evolve", 8), ("certify", 8), ("tune", 2), ("grid", 4)])
def test_kills_at_random_moments_change_nothing(tmp_path, seed, request, what, few):
    kills = 200 if request.config.getoption("--papers") else few
    script = Path(__file__).parents[1] / "kills.py"
    command = [sys.executable, script, tmp_path, "--what", what, "--kills", str(kills), "--seed", str(seed)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=1800)
    assert ended.returncode == 0, ended.stderr
    assert "all ends identical" in ended.stdout


def test_a_study_that_is_made_takes_no_keys_beside_itself(tmp_path):
    made = load_study("vasarhelyi_2018/6ms")
    with pytest.raises(StudyError, match=r"^settings, limit, population: a Study object sets this itself"):
        airflock.evolve(made, tmp_path / "s", settings={"agents": 4}, limit="r_min<3 at 1%", population=8)
    assert not (tmp_path / "s").exists()


@pytest.mark.usefixtures("undrawn")
def test_public_door_evolves_a_short_flight_with_a_fitness_of_ones_own(tmp_path):
    """Real flights, from the call to a scenario that flies: faster is better, and the faster speed is found."""
    space = {"model": {"v_flock": {"low": 1.0, "high": 5.0}}}
    scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": 3.0, "agents": 10})
    search = {"population": 6, "generations": 4, "top": 2, "pool": 0, "final_seeds": 2}
    result = airflock.evolve(scenario, tmp_path / "a", space=space, fitness=lambda score: score["phi_vel"], **search)
    assert result.parameters["model.v_flock"] > 4.0
    assert airflock.load(tmp_path / "a" / "best.toml").parameters.v_flock == result.parameters["model.v_flock"]


@pytest.mark.parametrize("name", sorted(shipped_studies()))
def test_every_shipped_study_can_be_begun(name):
    study = load_study(name)
    parameters = study.space.parameters([0.5] * len(study.space.axes))
    assert with_parameters(study.scenario, parameters).parameters is not None
    assert all(axis.low < axis.high for axis in study.space.axes) and study.title


def test_pairs_of_parents_are_asked_for_before_a_study_begins():
    with pytest.raises(ScenarioError, match="search.population = 7 is odd"):
        load_study("dimock_2003/published", search={"population": 7})


def test_the_study_of_dimock_2003_searches_the_bounds_of_the_paper_with_cohesion_reaching_farther():
    study = load_study("dimock_2003/published")
    assert study.scenario.parameters.gradient == "cells_frozen"
    for unit in (np.zeros(5), np.full(5, 0.3), np.full(5, 0.9)):
        ours, theirs = study.space.parameters(unit), gains(unit)
        assert ours["model.r_c"] >= ours["model.r_a"]
        for key in ("k_c", "k_a", "k_d", "r_a"):
            assert ours[f"model.{key}"] == pytest.approx(theirs.si()[key], rel=1e-5)


def test_batches_flown_together_are_the_same_flights_and_faults_stay_alone(monkeypatch):
    from airflock.support.errors import FlightError
    from inside import simulate

    study = load_study("vasarhelyi_2018/4ms", settings={"duration": 2.0, "agents": 10})
    space, flights = study.space, []
    for i in range(7):
        flights.append(Flight(i, 0, space.parameters([0.1 + 0.1 * i] * 11), 40 + i))
    executor = ThreadExecutor(study_tasks(study)[0].score, 2)
    alone = {landed.flight.candidate_index: landed.values for landed in executor.fly(flights)}
    executor.close()
    together = {x.flight.candidate_index: x.values for x in BatchExecutor(study_tasks(study)).fly(flights)}
    assert together == alone
    whole = simulate.score_flights

    def faulty(scenarios, seeds, **keywords):
        if 43 in seeds:
            raise FlightError("seed 43: agent 1 left the finite numbers at step 3")
        return whole(scenarios, seeds, **keywords)

    monkeypatch.setattr("airflock.engine.score_flights", faulty)
    landed = {x.flight.candidate_index: x for x in BatchExecutor(study_tasks(study)).fly(flights)}
    assert landed[3].values is None and landed[3].reason.startswith("seed 43")
    assert {i: x.values for i, x in landed.items() if i != 3} == {i: v for i, v in alone.items() if i != 3}


@pytest.mark.parametrize(
    ("device", "scheduler", "words"),
    [("tpu", None, "device = 'tpu' is none of cpu, cuda, auto"), ("cuda", "tcp://x:1", "leave out one of the two")],
)
def test_devices_that_cannot_be_are_one_line(device, scheduler, words):
    with pytest.raises(StudyError, match=words):
        check_study_device(device, scheduler)


def test_a_study_of_another_device_is_another_study():
    assert differences(toys.study().document(), replace(toys.study(), device="cuda").document()) == [
        "device = cpu there, cuda now"
    ]


def test_folders_of_before_there_was_one_format_go_on(tmp_path, done):
    """The request had another name for each kind of run, and keys of the search that did nothing."""
    folder = tmp_path / "old"
    shutil.copytree(done.folder, folder)
    held = read_request(folder, "study")
    held["search"] |= {"racing": "none", "growth": 1}
    (folder / REQUEST_FILE).unlink()
    write_toml_file(folder / "study.toml", held)
    open_folder(folder, toys.study(population=16, generations=25, restarts=1), resume=True)
    with pytest.raises(StudyError, match="holds a study and no campaign"):
        read_request(folder, "campaign")
    write_toml_file(folder / "study.toml", {**held, "search": {**held["search"], "racing": "optimistic"}})
    with pytest.raises(StudyError, match="holds another study: search.racing = optimistic there, missing now"):
        open_folder(folder, toys.study(population=16, generations=25, restarts=1), resume=True)


@pytest.mark.usefixtures("undrawn")
def test_a_study_from_its_folder_alone_is_the_same_to_the_bit(tmp_path):
    """Axes whose order a file cannot keep, a tie, a fitness of one's own in a file, two scenarios, limits."""
    (tmp_path / "mine.py").write_text("def hurry(score):\n    return 2.0 * score['phi_vel']\n")
    (tmp_path / "two.toml").write_text(
        'scenarios = ["vasarhelyi_2018/4ms", { scenario = "vasarhelyi_2018/4ms", set = { "radio.delay" = 0.5 } }]\n'
        '[set]\nagents = 4\n[objective]\nmaximise = "hurry"\nown = "mine.py"\nlimits = ["r_min<3 at 1%"]\n'
        "[space.model]\np_rep = { low = 0.1, high = 0.2 }\n"
        "r0_rep = { low = 5.0, high = 20.0, above = 'model.r0_shill' }\n"
        "r0_shill = { low = 0.0, high = 1.0 }\nv_frict = { tied = 'model.p_rep', factor = 2.0 }\n"
        "[search]\npopulation = 4\ngenerations = 2\n"
    )
    study = load_study(tmp_path / "two.toml", trust=True)
    axes = [*study.space.axes, SearchAxis("duration", "s", 10.0, 20.0), SearchAxis("radio.delay", "s", 0.1, 0.2)]
    study = replace(study, space=replace(study.space, axes=(axes[3], axes[1], axes[4], axes[0], axes[2])))
    open_folder(tmp_path / "a", study, resume=False)
    found, _ = evolve_request(None, folder=tmp_path / "a", trust=True)
    assert found.document() == study.document() and found.space == study.space and found.labels == study.labels
    assert found.objectives[0].of_candidate([{"phi_vel": 3.0}]) == 6.0
    open_folder(tmp_path / "a", found, resume=True)
    with pytest.raises(ScenarioError, match="would run the code in"):
        evolve_request(None, folder=tmp_path / "a")


def test_a_function_as_fitness_has_to_be_given_to_a_folder_again(tmp_path):
    def quick(score):
        return score["phi_vel"]

    study = study_from_request("vasarhelyi_2018/4ms", fitness=quick)
    open_folder(tmp_path / "a", study, resume=False)
    with pytest.raises(StudyError, match="its fitness is a function of your own; give it again"):
        evolve_request(None, folder=tmp_path / "a")
    assert evolve_request(None, folder=tmp_path / "a", fitness=quick)[0].document() == study.document()
    with pytest.raises(StudyError, match="no scenario and no folder to resume"):
        evolve_request(None)


def test_a_finished_study_flies_and_draws_nothing_more(tmp_path, done):
    folder = tmp_path / "a"
    shutil.copytree(done.folder, folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix in (".csv", ".png")}
    study = toys.study(population=16, generations=25, restarts=1)
    open_folder(folder, study, resume=True)
    again = run_study(study, folder, ThreadExecutor(lambda *_: pytest.fail("flown"), 1))
    assert again.document() == done.document()
    assert {name: (folder / name).read_bytes() for name in before} == before
