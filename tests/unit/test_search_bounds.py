"""Where a search looks if nobody said so, and what it says where there is nothing to find."""

import pytest

import toys
from airflock.engine import score_flight
from airflock.runs.executors import ThreadExecutor
from airflock.runs.flight_store import FlightStore
from airflock.runs.search_space import declared_numbers, with_parameters
from airflock.scenarios.files import load, presets
from airflock.search.generations import conclude_study, run_search
from airflock.search.study import default_space, load_study, make_study, unread_keys
from airflock.support.errors import StudyError

OWN = {"agents": 12, "world.side": 120.0}


def test_bounds_are_those_of_the_nearest_study_and_grow_with_the_speed():
    shipped = {axis.key: axis for axis in load_study("vasarhelyi_2018/6ms").space.axes}
    for speed in (5.0, 6.0, 6.5):
        found, notes = default_space(load("vasarhelyi_2018/real_6ms", {"model.v_flock": speed}))
        axes = {axis.key: axis for axis in found.axes}
        assert set(axes) == set(shipped) and "vasarhelyi_2018/6ms" in notes[0]
        for key in ("model.r0_rep", "model.v_shill"):
            assert axes[key].low == pytest.approx(shipped[key].low * speed / 6.0)
        assert axes["model.p_rep"].high == shipped["model.p_rep"].high  # a rate does not grow


@pytest.mark.parametrize("name", sorted(presets()))
def test_bounds_of_every_preset_hold_its_own_values_and_lie_inside_the_declared_ones(name):
    scenario = load(name)
    known = declared_numbers(scenario)
    for axis in default_space(scenario)[0].axes:
        how, value = known[axis.key]
        assert how.low <= axis.low <= value <= axis.high <= how.high and axis.low < axis.high


def test_no_length_is_searched_beyond_the_arena_unless_the_scenario_has_it():
    scenario = load("vasarhelyi_2018/real_6ms", {"agents": 2, "world.side": 40.0})
    known = declared_numbers(scenario)
    for axis in default_space(scenario)[0].axes:
        if axis.unit == "m":
            assert axis.high <= max(40.0 * 2.0**0.5, known[axis.key][1]) + 1e-9


def test_a_number_that_nothing_reads_changes_no_flight_and_is_not_searched():
    tiny = {**OWN, "agents": 4, "duration": 2.0, "dt": 0.1}
    free, capped = load("vasarhelyi_2018/6ms", tiny), load("vasarhelyi_2018/6ms", {**tiny, "model.limit": "cap"})
    assert unread_keys(free) == {"model.v_max"} and unread_keys(capped) == set()
    assert "model.v_max" not in default_space(free)[0].keys and "v_max" in default_space(free)[1][1]
    assert score_flight(free) == score_flight(with_parameters(free, {"model.v_max": 1.0}))


def run(study, score, folder):
    executor = ThreadExecutor(score, 2)
    with FlightStore(folder) as store:
        try:
            return conclude_study(study, store, executor, run_search(study, store, executor), folder)
        finally:
            executor.close()


def still(parameters, seed):
    return {"fitness": 0.0, "f_speed": 0.0, "f_wall": 0.0 if seed % 4 else 0.5, "f_coll": 1.0}


def test_a_landscape_without_a_hill_ends_early_and_says_which_factor_is_zero_and_what_to_change(tmp_path):
    study = toys.study(population=20, generations=30)
    with pytest.raises(StudyError) as fault:
        run(study, still, tmp_path)
    said = str(fault.value)
    assert "fitness is flat, 0 for all of 60 candidates: f_speed is zero in 100 % of flights, f_wall" in said
    assert "lower model.v_flock" in said and "f_coll" not in said and "\n" not in said
    with FlightStore(tmp_path, write=False) as store:
        assert store.count() == 60


def test_what_does_not_fly_is_never_called_best(tmp_path):
    """A candidate of the search was lucky; on fresh seeds nothing flies."""
    study = toys.study(population=8, generations=6, top=1)
    lucky = study.seed(0, 5)

    def score(parameters, seed):
        return {**still(parameters, seed), "fitness": 0.3 if seed == lucky else 0.0}

    found = run(study, score, tmp_path)
    assert "no candidate flies, so there is no best one: f_speed is zero in 100 % of flights" in found.dead_reason
    assert not (tmp_path / "best.toml").exists()


def test_a_scenario_as_it_is_becomes_a_study_between_usual_bounds():
    study = make_study({}, "mine", scenario=load("vasarhelyi_2018/real_6ms", OWN))
    assert (
        study.space == default_space(study.scenario)[0] and "bounds of the study vasarhelyi_2018/6ms" in study.notes[0]
    )
    assert not load_study("vasarhelyi_2018/6ms").notes
