"""Hardening and sensitivity: the recipe of Table S4 stays in range, steps are paired, known effects are found."""

import numpy as np
import pytest

import toys
from airflock.engine.simulate import score_flights
from airflock.errors import ScenarioError
from airflock.evolve import harden
from airflock.evolve.executors.here import Here
from airflock.evolve.sensitivity import sensitivity
from airflock.evolve.space import with_parameters
from airflock.evolve.store import Store
from airflock.evolve.study import load_study
from airflock.scenarios.files import load, make


def test_recipe_moves_the_way_of_table_s4_and_stays_inside_ranges():
    plans = harden.recipe(load("vasarhelyi_2018/6ms"))
    first, last = plans[0][1], plans[-1][1]
    assert first["model.p_rep"] == 0.07 and plans[0][0].name == "optimum"
    assert last["model.p_rep"] == pytest.approx(0.105) and last["model.c_frict"] == pytest.approx(0.45)
    assert last["model.v_shill"] == pytest.approx(0.7 * 19.7) and last["model.r0_shill"] == pytest.approx(3.5)
    tight = load("vasarhelyi_2018/6ms", {"model.p_rep": 9.0})
    assert harden.recipe(tight)[-1][1]["model.p_rep"] == 10.0


def test_models_without_these_parameters_are_refused():
    with pytest.raises(ScenarioError, match="zapotecatl_2016/best: no recipe for model reynolds_1987: model.c_frict"):
        harden.recipe(load("zapotecatl_2016/best"))


def test_steps_are_measured_against_the_optimum_on_the_same_seeds(monkeypatch):
    def score_flights(scenarios, seeds, **_):
        chance = {seed: np.random.default_rng(seed).normal() for seed in seeds}
        return [
            {
                "fitness": s.parameters.p_rep + chance[seed],
                "r_min": 2.0 * s.parameters.p_rep + chance[seed],
                "n_coll": 0.0,
            }
            for s, seed in zip(scenarios, seeds, strict=True)
        ]

    monkeypatch.setattr("airflock.engine.simulate.score_flights", score_flights)
    steps = harden.harden(load("vasarhelyi_2018/6ms"), range(20))
    assert steps[1].cost == pytest.approx((-0.035,) * 3) and steps[1].gain == pytest.approx((0.07,) * 3)
    found = make(harden.document(load("vasarhelyi_2018/6ms"), steps[-1]), "hardened")
    assert found.parameters.p_rep == pytest.approx(0.105) and found.published == {}


def test_evolving_again_flies_a_stricter_scenario_but_is_measured_in_the_given_one(tmp_path):
    """Workaround (i): the search minds larger spheres and a longer delay; what it costs and gains is told without."""
    given = load("vasarhelyi_2018/6ms", {"agents": 8, "duration": 20.0, "dt": 0.05})
    settings = harden.cautious(given, r_coll=2.0, delay=1.5)
    search = {"population": 4, "generations": 2, "top": 1, "pool": 0, "final_seeds": 2}
    study = harden.stricter(given, load_study("vasarhelyi_2018/6ms").space, settings, search)
    assert study.scenario.metrics.r_coll == 2.0 * given.metrics.r_coll
    assert study.scenario.radio.delay == 1.5 * given.radio.delay
    steps = harden.evolved_again(given, study, settings, tmp_path / "again", range(3))
    optimum, again = steps
    assert optimum.parameters["model.p_rep"] == given.parameters.p_rep and "metrics.r_coll = 6" in again.reason
    for step in steps:
        rows = score_flights([with_parameters(given, step.parameters)] * 3, range(3))
        assert step.fitness == np.mean([row["fitness"] for row in rows])
    continued = harden.evolved_again(given, study, settings, tmp_path / "again", range(3))
    assert continued[1].parameters == again.parameters


def test_sensitivity_finds_the_share_of_each_parameter(tmp_path):
    """Sobol's indices of a + 2 b + 0 c over the unit cube are 1/5, 4/5, 0."""
    study = toys.study()
    axes = {axis.key: axis for axis in study.space.axes}

    def plane(parameters, seed):
        a, b, _ = (axes[key].coordinate(parameters[key]) for key in study.space.keys)
        return {"fitness": a + 2.0 * b}

    for method in ("sobol", "morris"):
        with Store(tmp_path) as store:
            executor = Here(plane, 2)
            table = sensitivity(study, store, executor, method=method, samples=64)
            executor.close()
        if method == "sobol":
            assert table["ST"].to_numpy() == pytest.approx([0.2, 0.8, 0.0], abs=0.05)
        else:
            assert table["mu_star"].to_numpy() == pytest.approx([1.0, 2.0, 0.0], abs=1e-9)
