"""One set for many scenarios: mean and worst are what they say, every seed flies everywhere, cuts change nothing."""

import json
import pickle
import statistics
import tomllib

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, strategies as st

import airflock
import toys
from airflock.cli.search_verbs import _optima
from airflock.engine import score_flight, score_flights
from airflock.runs.executors import BatchExecutor, ScenarioTask, ThreadExecutor
from airflock.runs.flight_store import CandidateBatch, FlightStore
from airflock.runs.folder import Interrupted, open_folder
from airflock.runs.search_space import with_parameters
from airflock.scenarios.files import load
from airflock.scenarios.scenario_builder import build_scenario
from airflock.search import hardening as harden
from airflock.search.evolution import run_study, study_executor, study_tasks
from airflock.search.generations import Evaluator
from airflock.search.study import combine_scenarios, load_study, make_study
from airflock.support.errors import ScenarioError

pytestmark = pytest.mark.usefixtures("undrawn")

FAR = {"radio.delay": 0.8}


def two(over="mean", **search):
    """A study of two scenarios whose flights cost nothing."""
    first = load("vasarhelyi_2018/6ms")
    keys = {"population": 16, "generations": 25, **search}
    return toys.study({"over_scenarios": over}, [first, build_scenario(first.document, "late", FAR)], **keys)


def valley(best, height):
    """Fitness that only p_rep decides: `height` at `best`, less elsewhere, with a little chance of the seed."""

    def score(parameters, seed):
        return {"fitness": height - 4.0 * (parameters["model.p_rep"] - best) ** 2 + 1e-6 * (seed % 7), "phi_vel": 1.0}

    return score


def flown(folder, study, watch=None, resume=False):
    open_folder(folder, study, resume=resume)
    return run_study(study, folder, ThreadExecutor(valley(0.1, 1.0), 2, [valley(0.3, 0.5)]), watch)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=5))
def test_over_scenarios_is_the_mean_or_the_worst_and_fails_with_any(values):
    assert combine_scenarios(values, "mean", True) == pytest.approx(statistics.fmean(values), abs=1e-9)
    assert combine_scenarios(values, "worst", True) == min(values)
    assert combine_scenarios(values, "worst", False) == max(values)
    assert combine_scenarios([*values, None], "mean", True) is None


@pytest.mark.parametrize(("over", "best"), [("mean", 0.2), ("worst", 0.3)])
def test_the_mean_of_two_valleys_lies_between_them_and_the_worst_where_the_lower_one_is(tmp_path, over, best):
    result = flown(tmp_path / "a", two(over))
    assert result.parameters["model.p_rep"] == pytest.approx(best, abs=0.01)
    first, late = (mean for mean, _, _ in result.scenarios.values())
    assert result.fitness == pytest.approx(0.5 * (first + late) if over == "mean" else late)
    assert list(result.scenarios) == ["vasarhelyi_2018/6ms", "late"] and first > late


def test_every_seed_flies_in_every_scenario_and_rows_and_result_tell_which(tmp_path):
    study = two("worst", seeds=2, generations=3)
    result = flown(tmp_path / "a", study)
    table = pd.read_csv(tmp_path / "a" / "evaluations.csv")
    search = table[table["stage"] == "search"]
    assert len(search) == 16 * 3 * 2 * 2
    for _, one in search.groupby(["generation", "candidate"]):
        each = one.groupby("scenario")["seed"].apply(list)
        assert each["late"] == each["vasarhelyi_2018/6ms"] and len(set(each["late"])) == 2
    with FlightStore(tmp_path / "a", write=False) as store:
        told = store.rows("SELECT generation, candidate, fitness FROM candidate WHERE stage='search'")
    worst = search.groupby(["generation", "candidate", "scenario"])["fitness"].mean().groupby(level=[0, 1]).min()
    assert all(json.loads(f)[0] == pytest.approx(worst[g, c], abs=1e-12) for g, c, f in told)
    document = tomllib.loads((tmp_path / "a" / "result.toml").read_text())
    assert [row["scenario"] for row in document["scenarios"]] == list(result.scenarios)
    assert [each.radio.delay for each in _optima(str(tmp_path / "a"), {}, False)] == [1.0, 0.8]
    for name in ("best.toml", "best_2.toml"):
        assert load(tmp_path / "a" / name).parameters.p_rep == result.parameters["model.p_rep"]


def test_a_study_of_several_that_is_cut_off_ends_the_same(tmp_path):
    study = two(generations=8, flights="growing", random_numbers="generation")
    whole = flown(tmp_path / "whole", study)

    def stop(progress):
        if progress.fresh == 77:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        flown(tmp_path / "cut", study, stop)
    assert flown(tmp_path / "cut", study, resume=True).document() == whole.document()
    other = two("worst", generations=8, flights="growing", random_numbers="generation")
    with pytest.raises(airflock.support.errors.StudyError, match="over_scenarios = mean there, worst now"):
        open_folder(tmp_path / "cut", other, resume=True)


def test_real_flights_are_those_of_each_scenario_here_together_and_on_workers(tmp_path):
    small = load("vasarhelyi_2018/4ms", {"duration": 2.0, "agents": 5})
    longer = build_scenario(small.document, "longer", {"duration": 3.0, **FAR})
    study = make_study({"space": toys.SPACE}, "two", scenario=[small, longer])
    points = np.array([[0.2, 0.4, 0.6]])
    given = study.space.parameters(points[0])
    wanted = [score_flight(with_parameters(each, given), 7)["fitness"] for each in (small, longer)]
    rows = []
    for name, executor in (("here", study_executor(study, threads=2)), ("together", BatchExecutor(study_tasks(study)))):
        (tmp_path / name).mkdir()
        with FlightStore(tmp_path / name) as store:
            evaluator = Evaluator(study, store, executor)
            rows += evaluator.evaluate(CandidateBatch("search", 0, 0), points, seeds=[[7]])
            half = evaluator.evaluate(CandidateBatch("search", 0, 1), points, seeds=[[7]], duration_share=0.5)
        executor.close()
    assert rows == [[sum(wanted) / 2.0]] * 2
    shorter = [with_parameters(each, {**given, "duration": d}) for each, d in ((small, 1.0), (longer, 1.5))]
    assert half == [[sum(row["fitness"] for row in score_flights(shorter, [7, 7])) / 2.0]]
    there = [pickle.loads(pickle.dumps(task)).scenario for task in study_tasks(study)]
    assert [score_flight(with_parameters(each, given), 7)["fitness"] for each in there] == wanted


def test_a_list_of_scenarios_is_searched_between_bounds_that_hold_them_all():
    slow, fast = (load(f"vasarhelyi_2018/{speed}ms") for speed in (4, 8))
    axes = {axis.key: axis for axis in make_study({}, "two", scenario=[slow, fast]).space.axes}
    for one in (slow, fast):
        for axis in make_study({}, "one", scenario=one).space.axes:
            assert axes[axis.key].low <= axis.low and axes[axis.key].high >= axis.high


def test_a_study_file_of_several_is_read_validated_and_can_be_begun(tmp_path):
    (tmp_path / "two.toml").write_text(
        'scenarios = ["vasarhelyi_2018/6ms", { scenario = "vasarhelyi_2018/6ms", set = { "radio.delay" = 0.4 } }]\n'
        'over_scenarios = "worst"\n[set]\nduration = 100.0\n[space.model]\np_rep = { low = 0.1, high = 0.2 }\n'
    )
    study = load_study(tmp_path / "two.toml")
    assert [each.radio.delay for each in study.scenarios] == [1.0, 0.4]
    assert [each.flight.duration for each in study.scenarios] == [100.0, 100.0]
    assert study.labels[1] == "vasarhelyi_2018/6ms with radio.delay = 0.4"
    verdict = airflock.validate(tmp_path / "two.toml").verdict
    assert "1 parameters of vasarhelyi_2018/6ms, vasarhelyi_2018/6ms with radio.delay = 0.4 vary" in verdict


def test_all_faults_of_scenarios_are_told_together():
    document = {
        "scenarios": [
            "vasarhelyi_2018/6m",
            {"scenario": "vasarhelyi_2018/6ms", "set": {"radio.delay": -1.0}},
            {"scenari": "vasarhelyi_2018/6ms"},
            {"scenario": "vasarhelyi_2018/6ms", "sett": {}},
            {"scenario": "vasarhelyi_2018/6ms", "set": 3},
        ]
    }
    with pytest.raises(ScenarioError) as fault:
        make_study(document, "two.toml")
    told = str(fault.value)
    for words in (
        "did you mean vasarhelyi_2018/6ms?",
        "radio.delay = -1 s lies outside [0, 30] s",
        "scenarios[2] = {'scenari': 'vasarhelyi_2018/6ms'} names no scenario",
        "scenarios[3].sett: unknown key; known: scenario, set",
        "scenarios[4].set = 3 is not a table",
    ):
        assert words in told
    assert len(fault.value.errors) == 5


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({"scenario": "vasarhelyi_2018/6ms", "scenarios": []}, "scenario and scenarios are both given"),
        ({"scenarios": []}, "scenarios = [] is not a list of presets"),
        ({"scenarios": "vasarhelyi_2018/6ms"}, "scenarios = 'vasarhelyi_2018/6ms' is not a list of presets"),
        ({"scenarios": ["vasarhelyi_2018/6ms", "vicsek_1995/ordered"]}, "one set of numbers needs one law"),
        ({"scenario": "vasarhelyi_2018/6ms", "over_scenarios": "best"}, "'best' is none of mean, worst"),
        ({"scenario": "vasarhelyi_2018/6ms", "set": 3}, "set = 3 is not a table"),
        ({}, 'scenario is missing; write scenario = "NAME", of a preset or a scenario file'),
        ({"scenario": 3}, "scenario = 3 is not a name; write"),
    ],
)
def test_each_fault_of_several_scenarios_is_one_line(document, words):
    with pytest.raises(ScenarioError) as fault:
        make_study(document, "two.toml")
    assert words in str(fault.value) and len(fault.value.errors) == 1


def test_a_step_of_hardening_that_breaks_what_held_in_one_of_two_scenarios_is_undone(monkeypatch):
    """More repulsion widens distances in both, and drives agents into the walls of the second."""
    first = load("vasarhelyi_2018/6ms")
    late = build_scenario(first.document, "late", FAR)

    def scored(task, parameters, seed):
        repulsion = parameters["model.p_rep"]
        walls = 0.2 if task.scenario.radio.delay == 0.8 and repulsion > 0.08 else 1.0
        return {"fitness": 0.9, "r_min": repulsion, "n_coll": 0.0, "f_coll": 1.0, "f_wall": walls}

    monkeypatch.setattr(ScenarioTask, "score", scored)
    monkeypatch.setattr(ScenarioTask, "compile", lambda _: None)
    alone = harden.harden(first, range(5))
    assert alone[-1].verdict == "kept: p_rep up"
    both = harden.harden([first, late], range(5))
    assert both[1].verdict == "undone: f_wall falls from 1 to 0.2, in late" and not both[-1].kept
    assert both[0].fitness == pytest.approx(0.9) and both[-1].parameters["model.p_rep"] == first.parameters.p_rep
