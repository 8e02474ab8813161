"""Hardening and sensitivity: the recipe of Table S4 stays in range, steps are paired, known effects are found."""

import numpy as np
import pytest

import toys
from airflock.cli import search_verbs as cli_harden
from airflock.parts.radios.links import received
from airflock.runs.executors import ScenarioTask, ThreadExecutor
from airflock.runs.flight_store import FlightStore
from airflock.runs.search_space import with_parameters
from airflock.scenarios.files import load
from airflock.scenarios.scenario_builder import build_scenario
from airflock.search import hardening as harden
from airflock.search.evolution import run_sensitivity
from airflock.search.hardening import CARRIED, STOPS, StepResult, measures
from airflock.support.errors import ScenarioError

pytestmark = pytest.mark.usefixtures("undrawn")


def recipe(scenario):
    """Numbers of the optimum, and after all steps of Table S4."""
    first = last = harden.optimum_parameters(scenario)
    for step in harden.TABLE_S4_STEPS:
        last = harden.parameters_after_step(scenario, last, step)
    return first, last


def test_recipe_moves_the_way_of_table_s4_and_stays_inside_ranges():
    first, last = recipe(load("vasarhelyi_2018/6ms"))
    assert first["model.p_rep"] == 0.07
    assert last["model.p_rep"] == pytest.approx(0.105) and last["model.c_frict"] == pytest.approx(0.45)
    assert last["model.v_shill"] == pytest.approx(0.7 * 19.7) and last["model.r0_shill"] == pytest.approx(3.5)
    assert recipe(load("vasarhelyi_2018/6ms", {"model.p_rep": 9.0}))[1]["model.p_rep"] == 10.0


def test_models_without_these_parameters_are_refused():
    with pytest.raises(ScenarioError, match="zapotecatl_2016/best: no recipe for model reynolds_1987: model.c_frict"):
        harden.optimum_parameters(load("zapotecatl_2016/best"))


def flown_by(monkeypatch, score):
    """Flights whose scores are a function of the parameters and of the seed's chance."""

    def scored(task, parameters, seed):
        return score(with_parameters(task.flown, parameters).parameters, np.random.default_rng(seed).normal())

    monkeypatch.setattr(ScenarioTask, "score", scored)
    monkeypatch.setattr(ScenarioTask, "compile", lambda _: None)


def test_steps_are_measured_against_the_optimum_on_the_same_seeds(monkeypatch):
    def score(p, chance):
        return {"fitness": 5.0 + p.p_rep + chance, "r_min": 2.0 * p.p_rep + chance, "n_coll": 0.0}

    flown_by(monkeypatch, score)
    steps = harden.harden(load("vasarhelyi_2018/6ms"), range(20))
    assert steps[1].cost == pytest.approx((-0.035,) * 3) and steps[1].gain == pytest.approx((0.07,) * 3)
    assert [step.kept for step in steps] == [True, True, False, False, True]  # c_frict again would be the same
    assert (
        steps[-1].verdict == "kept: p_rep up" and steps[2].verdict == "undone: gains no distance and no room at walls"
    )
    found = build_scenario(harden.hardened_document(load("vasarhelyi_2018/6ms"), steps[-1]), "hardened")
    assert found.parameters.p_rep == pytest.approx(0.105) and found.published == {}


def test_a_step_that_drives_the_flock_into_trees_is_undone_however_much_distance_it_gains(monkeypatch):
    """In the field of trees Table S4's walls cost everything: f_wall 0.995 before, 0.14 after. Half is as bad."""

    def score(p, chance):
        wall = 0.14 if p.v_shill < 19.0 else 0.995
        return {
            "fitness": 0.9 * wall, "r_min": 3.0 * p.p_rep - 0.1 * p.v_shill + 0.001 * chance, "n_coll": 0.0,
            "f_wall": wall, "phi_wall": 3.0 * (wall < 0.5), "f_coll": 1.0,
        }  # fmt: skip

    flown_by(monkeypatch, score)
    steps = harden.harden(load("vasarhelyi_2018/6ms"), range(20))
    (whole, half) = (step for step in steps if "v_shill" in step.name)
    assert not whole.kept and whole.gain[1] > 0.0 and whole.verdict == "undone: f_wall falls from 0.995 to 0.14"
    assert not half.kept and half.name == "half of: v_shill down, r0_shill up"
    last = steps[-1]
    assert last.kept and last.parts["f_wall"] == pytest.approx(0.995) and last.contacts == 0.0
    assert last.parameters["model.v_shill"] == load("vasarhelyi_2018/6ms").parameters.v_shill


def test_half_a_step_is_kept_where_the_whole_one_costs_too_much(monkeypatch):
    def score(p, chance):  # 0.07 to 0.105 costs 0.07; half a step, to 0.0857, costs 0.031
        return {"fitness": 0.9 - 2.0 * (p.p_rep - 0.07), "r_min": p.p_rep, "n_coll": 0.0, "f_coll": 1.0}

    flown_by(monkeypatch, score)
    steps = harden.harden(load("vasarhelyi_2018/6ms"), range(5))
    assert steps[1].verdict == "undone: costs 0.07 of fitness, more than 0.05" and steps[2].kept
    assert steps[-1].parameters["model.p_rep"] == pytest.approx(0.07 * 1.5**0.5)


def test_walls_come_first_where_they_are_what_is_short(monkeypatch):
    def score(p, chance):
        return {"fitness": 0.5, "r_min": 5.0, "n_coll": 0.0, "f_wall": 0.5, "phi_wall": 0.1, "f_coll": 0.9}

    flown_by(monkeypatch, score)
    assert "v_shill" in harden.harden(load("vasarhelyi_2018/6ms"), range(5))[1].name


def test_agents_brake_earlier_where_they_touch_walls_and_that_helps(monkeypatch):
    """Every flight touches a wall by the chance of its seed, unless agents brake 5 m earlier (0.5 s twice at 6 m/s)."""

    def score(p, chance):
        wall = max(0.0, 0.1 - 0.02 * p.r0_shill + 0.01 * chance)
        return {"fitness": 0.9, "r_min": 5.0, "n_coll": 0.0, "f_wall": 0.99, "phi_wall": wall, "f_coll": 1.0}

    flown_by(monkeypatch, score)
    found = harden.harden(load("vasarhelyi_2018/6ms", {"model.r0_shill": 0.0}), range(20))
    kept = [step.name for step in found[1:-1] if step.kept]
    assert kept[0] == "v_shill down, r0_shill up" and "r0_shill up" in kept
    assert found[0].contacts == 1.0 and found[-1].contacts < 0.1


def test_walls_come_first_where_their_limit_is_short_though_nobody_touched_one(monkeypatch):
    """Clearance is 4 +- 2 m: a contact in some 45 flights, and the limit allows one in 100 of a reserve of ten."""

    def score(p, chance):
        room = 4.0 + 0.8 * p.r0_shill + 2.0 * min(abs(chance), 1.9) * (1.0 if chance > 0.0 else -1.0)
        return {
            "fitness": 0.9, "r_min": 30.0 + p.p_rep + 0.01 * chance, "n_coll": 0.0, "f_wall": 1.0, "phi_wall": 0.0,
            "clearance": room, "f_coll": 1.0,
        }  # fmt: skip

    flown_by(monkeypatch, score)
    limits = ["r_min<3 at 1%", "clearance<0 at 1%"]
    found = harden.harden(load("vasarhelyi_2018/6ms", {"model.r0_shill": 0.0}), range(40), limit=limits)
    assert found[0].contacts == 0.0 and found[1].name == "v_shill down, r0_shill up" and found[1].kept
    assert found[-1].clearance > found[0].clearance + 4.0  # three steps of 3 m at 0.8 m a metre


def test_what_was_kept_by_luck_is_undone_on_fresh_seeds(monkeypatch):
    """On the seeds of the steps all is well; on those after them more repulsion makes agents collide."""
    lucky = {np.random.default_rng(seed).normal() for seed in range(20)}

    def score(p, chance):
        coll = 1.0 if chance in lucky or p.p_rep < 0.1 else 0.2
        return {"fitness": 0.9, "r_min": 5.0 + p.p_rep, "n_coll": 0.0, "f_coll": coll}

    flown_by(monkeypatch, score)
    steps = harden.harden(load("vasarhelyi_2018/6ms"), range(20))
    assert steps[1].kept and not steps[-1].kept
    assert steps[-1].parameters == steps[0].parameters and "no step was kept" in steps[-1].verdict


def test_a_contact_in_a_few_flights_is_found_on_further_fresh_seeds(monkeypatch):
    """The steps and the first round of fresh seeds see none; from then on 5 % of flights with more repulsion touch."""
    luck = {np.random.default_rng(seed).normal() for seed in range(120, 240) if seed % 10 < 1}

    def score(p, chance):
        return {
            "fitness": 0.9,
            "r_min": 5.0 + p.p_rep,
            "n_coll": 0.0,
            "phi_wall": 1.0 * (chance in luck and p.p_rep > 0.1),
        }

    flown_by(monkeypatch, score)
    steps = harden.harden(load("vasarhelyi_2018/6ms"), range(60))
    assert steps[1].kept and steps[1].contacts == 0.0
    assert not steps[-1].kept and "no step was kept" in steps[-1].verdict


def test_measures_beside_the_law_are_tried_where_agents_collide_and_are_no_part_of_the_set(monkeypatch):
    """Late packets bring agents together; carried forward they do not. Stopping is tried where packets are lost."""

    def scored(task, parameters, seed):
        s = task.scenario
        near = s.radio.delay if s.radio.rule.name == "constant" and s.silence.rule == "fly_on" else 0.0
        return {"fitness": 0.9, "r_min": 9.0 - 8.0 * near, "n_coll": 1.0 * (near > 0.8), "f_coll": 0.9}

    monkeypatch.setattr(ScenarioTask, "score", scored)
    monkeypatch.setattr(ScenarioTask, "compile", lambda _: None)
    lossy = load("vasarhelyi_2018/6ms", {"radio.loss": 0.1, "radio.delay": 1.0})
    steps = harden.harden(lossy, range(5))
    tried = {step.name: step for step in steps[:-1] if step.verdict.startswith("no part of the set")}
    assert list(tried) == [CARRIED, STOPS] and steps[-1].name == "on fresh seeds"
    assert tried[CARRIED].gain == pytest.approx((8.0,) * 3) and not tried[CARRIED].kept
    assert "0 % of flights have collisions, 100 % without it; --set radio.kind=links" in tried[CARRIED].verdict
    assert build_scenario(harden.hardened_document(lossy, steps[-1]), "hardened").radio.rule.name == "constant"
    sound = load("vasarhelyi_2018/6ms", {"radio.delay": 0.5})
    assert not any(step.name in (CARRIED, STOPS) for step in harden.harden(sound, range(5)))
    assert [step.name for step, _, _ in measures([sound])] == [CARRIED]  # nothing is lost


def test_carried_forward_is_the_same_radio_but_for_where_neighbours_are_believed_to_be():
    """Every packet in range arrives, at every decision, as late as before."""
    given = load("vasarhelyi_2018/4ms", {"radio.delay": 1.0, "radio.range": 500.0})
    ((_, (carried,), _),) = measures([given])
    for distance in (0.0, 1.0, 100.0, 499.0):
        assert received(distance, 0.0, carried.radio) == 1.0
    assert carried.radio.delay == 1.0 and carried.radio.range == 500.0
    assert carried.radio.fast_rate * carried.sensors.period >= 1.0  # something at every decision


def test_a_study_that_is_not_over_or_in_which_nothing_flies_is_not_hardened(tmp_path):
    with pytest.raises(ScenarioError, match=r"holds no best.toml: its search is not over, or nothing flies in it"):
        cli_harden._optima(str(tmp_path), {}, trust=False)


def test_what_does_not_fly_is_not_hardened(monkeypatch):
    flown_by(monkeypatch, lambda p, chance: {"fitness": 0.0, "r_min": 5.0, "n_coll": 0.0, "f_wall": 0.0})
    with pytest.raises(ScenarioError, match="does not fly, so it cannot be hardened: f_wall is zero in 100 %"):
        harden.harden(load("vasarhelyi_2018/6ms"), range(5))


def test_sensitivity_finds_the_share_of_each_parameter(tmp_path):
    """Sobol's indices of a + 2 b + 0 c over the unit cube are 1/5, 4/5, 0."""
    study = toys.study()
    axes = {axis.key: axis for axis in study.space.axes}

    def plane(parameters, seed):
        a, b, _ = (axes[key].coordinate(parameters[key]) for key in study.space.keys)
        return {"fitness": a + 2.0 * b}

    for method in ("sobol", "morris"):
        with FlightStore(tmp_path) as store:
            executor = ThreadExecutor(plane, 2)
            table = run_sensitivity(study, store, executor, method=method, samples=64)
            executor.close()
        if method == "sobol":
            assert table["ST"].to_numpy() == pytest.approx([0.2, 0.8, 0.0], abs=0.05)
        else:
            assert table["mu_star"].to_numpy() == pytest.approx([1.0, 2.0, 0.0], abs=1e-9)


def test_a_narrow_terminal_is_told_every_number(monkeypatch, capsys):
    named = "half of: v_shill down, r0_shill up again"
    steps = [
        StepResult(
            name, "", {}, 0.7123, 33.75, 0.125, (0.01234, -0.005, 0.0295), (1.625, 1.125, 2.125), {"f_wall": 0.987},
            1.0, -12.3, False, verdict,
        )
        for name, verdict in (("optimum", ""), (named, "undone: gains no distance and no room at walls"))
    ]  # fmt: skip
    monkeypatch.setenv("COLUMNS", "80")
    cli_harden._print_hardened("mine.toml", steps, 60)
    told = capsys.readouterr().out
    assert "…" not in told
    for text in ("0.7123", "33.8", "0.125", "0.987", "100 %", "-12.3", "0.0123 (-0.005 to 0.0295)", "1.62 m (1.12 to"):
        assert text in told, text
    assert f"{named}: undone: gains no distance and no room at walls; cost" in told
