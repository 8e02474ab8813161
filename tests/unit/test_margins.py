"""Margins: how much worse a number may get is found where it is known, and hardening widens the one that is short."""

from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from airflock.cli.main import app
from airflock.errors import FlightError, ScenarioError
from airflock.evolve import harden
from airflock.evolve.held import WALLS, Broken, Constraints, broken
from airflock.evolve.margins import read_margins
from airflock.evolve.reach import FARTHEST, FINE, Reach, reach, shortest
from airflock.evolve.steps import flown, recipe
from airflock.evolve.trial import Trial
from airflock.limits.limit import read
from airflock.scenarios.files import load
from inside import simulate

pytestmark = pytest.mark.usefixtures("undrawn")
PAPER = load("vasarhelyi_2018/6ms", {"radio.delay": 0.5})
LATE = Broken("late")


def margin(name, scenario=PAPER):
    (found,), faults = read_margins(name, [scenario])
    assert not faults
    return found


def flights(monkeypatch, score):
    """Flights whose scores are a function of the scenario and of the seed."""

    def score_flights(scenarios, seeds, **_):
        usual = {"fitness": 0.9, "r_min": 5.0, "n_coll": 0.0}
        return [{**usual, **score(s, seed)} for s, seed in zip(scenarios, seeds, strict=True)]

    monkeypatch.setattr(simulate, "score_flights", score_flights)


@pytest.mark.parametrize("end", [0.51, 0.6, 0.77, 1.0, 1.9, 3.9])
def test_how_far_a_number_may_go_is_found_to_a_tenth(end):
    """All holds up to a delay that is known."""
    found = reach(margin("radio.delay"), lambda worse: LATE if worse[0].radio.delay > end else None)
    assert found.value <= end < found.margin.value(found.breaks) <= FINE * found.value and found.broken == LATE
    again = reach(found.margin, lambda worse: LATE if worse[0].radio.delay > 1.2 * end else None, found)
    assert again.value <= 1.2 * end < again.margin.value(again.breaks) and again.holds > found.holds
    back = reach(found.margin, lambda worse: LATE if worse[0].radio.delay > end / 1.2 else None, found)
    assert back.holds < found.holds or found.holds == 1.0  # no better than as the scenario is


def test_another_set_whose_margin_ends_in_the_same_place_flies_two_values():
    near, tried = Reach(margin("radio.delay"), 1.5, 1.6, LATE), []

    def test(worse):
        tried.append(worse[0].radio.delay)
        return LATE if worse[0].radio.delay > 0.77 else None

    assert reach(near.margin, test, near) == near and tried == pytest.approx([0.8, 0.75])


def test_where_nothing_breaks_a_margin_reaches_to_the_end_of_its_range_or_as_far_as_is_looked():
    found = reach(margin("radio.delay"), lambda worse: None)
    assert (
        found.holds == FARTHEST and not found.ends and found.told == ("radio.delay: what held holds up to 4 s at least")
    )
    lossy = reach(
        margin("radio.loss"), lambda worse: None if worse[0].radio.loss <= 1.0 else Broken("beyond its range")
    )
    assert lossy.value == pytest.approx(0.7) and not lossy.ends  # 0 has no factor: 0.1 counts as 2, 0.7 as 8


def test_less_range_is_worse_and_agents_are_whole():
    near = reach(margin("radio.range"), lambda worse: Broken("alone") if worse[0].radio.range < 31.0 else None)
    assert near.margin.value(near.breaks) < 31.0 <= near.value and "down to" in near.told
    tried = []

    def crowded(worse):
        tried.append(worse[0].agents)
        return Broken("crowded") if worse[0].agents > 103 else None

    found = reach(margin("agents"), crowded)
    assert found.value <= 103.0 < found.margin.value(found.breaks) and all(n == int(n) for n in tried)


def test_the_shortest_of_several_margins_is_found_and_of_the_others_that_they_are_longer():
    """Ends: noise four times as large, delay 1.6 times as long, the outer noise never."""
    tried = []

    def test(worse):
        s = worse[0]
        tried.append(s)
        late, noisy = s.radio.delay > 1.6 * PAPER.radio.delay, s.sensors.noise > 4.0 * PAPER.sensors.noise
        return LATE if late else Broken("noisy") if noisy else None

    names = ["sensors.noise", "radio.delay", "body.noise"]
    found = shortest([margin(name) for name in names], test)
    assert [each.margin.name for each in found] == ["radio.delay", "sensors.noise", "body.noise"]
    assert found[0].holds <= 1.6 < found[0].breaks and found[1].holds > found[0].holds
    assert found[2].holds == found[0].breaks and not found[2].ends
    assert sum(s.body.noise > PAPER.body.noise for s in tried) == 1  # one value tells that it is longer


def test_a_step_that_widens_the_short_margin_is_kept_and_one_that_shortens_it_undone(monkeypatch):
    """More repulsion widens distances and bears less delay; more alignment does nothing but bear more."""

    def score(s, seed):
        p = s.parameters
        most = 0.8 * (0.07 / p.p_rep) * (p.c_frict / 0.05) ** 0.3  # s: longer delays end in collisions
        return {"r_min": 5.0 + p.p_rep, "n_coll": 1.0 * (s.radio.delay > most)}

    flights(monkeypatch, score)
    plain = {step.name: step for step in harden.harden(PAPER, range(10))}
    assert plain["p_rep up"].kept and not plain["c_frict up"].kept and not plain["optimum"].verdict
    found = harden.harden(PAPER, range(10), margin="radio.delay")
    along = {step.name: step for step in found}
    assert 0.8 / FINE <= along["optimum"].margins["radio.delay"] <= 0.8
    assert along["optimum"].verdict.startswith("short is radio.delay: what held holds up to 0.7")
    assert "100 % of flights have collisions, before 0 %" in along["optimum"].verdict
    assert along["p_rep up"].verdict.startswith("undone: radio.delay: what held holds up to 0.5")
    assert along["c_frict up"].kept and "; before up to 0.7" in along["c_frict up"].verdict
    assert along["c_frict up"].gain[0] == 0.0
    truth = 0.8 * 9.0**0.3
    assert truth / FINE <= found[-1].margins["radio.delay"] <= truth  # both steps of alignment
    assert found[-1].kept and found[-1].parameters["model.p_rep"] == PAPER.parameters.p_rep
    assert found[-1].verdict.startswith("kept: c_frict up, c_frict up again; radio.delay: what held holds up to 1.")


def test_a_margin_that_grew_by_luck_is_given_up_on_fresh_seeds(monkeypatch):
    """On the seeds of the steps more alignment bears any delay; on those after them less than the optimum."""

    def score(s, seed):
        more = s.parameters.c_frict > 0.05
        return {"n_coll": 1.0 * (s.radio.delay > ((0.6 if seed >= 10 else 9.0) if more else 0.8))}

    flights(monkeypatch, score)
    found = harden.harden(PAPER, range(10), margin="radio.delay")
    assert found[2].kept and found[2].name == "c_frict up"
    assert not found[-1].kept and found[-1].parameters == found[0].parameters
    assert found[-1].margins["radio.delay"] <= 0.8


def test_where_the_short_margin_is_widened_past_another_that_one_is_next(monkeypatch):
    """More repulsion bears three times the delay; then noise is short, which more alignment bears."""

    def score(s, seed):
        p = s.parameters
        late = s.radio.delay > 0.6 * (3.0 if p.p_rep > 0.08 else 1.0)
        return {"n_coll": 1.0 * (late or s.sensors.noise > (6.0 if p.c_frict > 0.06 else 1.5) * PAPER.sensors.noise)}

    flights(monkeypatch, score)
    found = {step.name: step for step in harden.harden(PAPER, range(10), margin=["sensors.noise", "radio.delay"])}
    assert (
        found["optimum"].verdict.startswith("short is radio.delay: ")
        and "sensors.noise up to" in found["optimum"].verdict
    )
    assert found["p_rep up"].kept and 1.8 / FINE <= found["p_rep up"].margins["radio.delay"] <= 1.8
    assert found["c_frict up"].kept and list(found["c_frict up"].margins) == ["sensors.noise"]
    assert found["on fresh seeds"].verdict.startswith("kept: p_rep up, c_frict up; radio.delay")


def test_a_few_more_contacts_by_chance_end_no_margin():
    """Three flights of sixty more are 5 %, but no sure difference; where they are fifteen it is one."""
    before = {"n_coll": np.zeros(60)}
    for count, ends in ((3, False), (15, True)):
        after = {"n_coll": 1.0 * (np.arange(60) < count)}
        assert broken(before, after) and bool(broken(before, after, surely=True)) == ends


@pytest.mark.parametrize(
    ("scores", "walls"),
    [({"f_wall": 0.5}, True), ({"phi_wall": 1.0}, True), ({"n_coll": 1.0}, False), ({"f_coll": 0.5}, False)],
)
@pytest.mark.parametrize("names", [("half_wall", "clearance"), ("a", "b")])
def test_what_is_broken_is_of_walls_by_what_it_is_and_not_by_what_scenarios_are_called(scores, walls, names):
    """A scenario called half_wall had its collisions taken for contacts: its name has f_wall in it."""
    scenarios = [replace(PAPER, name=name) for name in names]
    before = {"f_wall": np.ones(9), "f_coll": np.ones(9), "phi_wall": np.zeros(9), "n_coll": np.zeros(9)}
    after = before | {name: np.full(9, value) for name, value in scores.items()}
    found = Constraints([], 0.0).broken(scenarios, [before, before], [before, after])
    assert found is not None and found.at_walls == walls and found.why.endswith(f", in {names[1]}")


@pytest.mark.parametrize(("score", "walls"), [("r_min", False), ("clearance", True)])
def test_what_a_limit_breaks_is_of_walls_where_its_score_is(score, walls):
    constraints, spread = Constraints([read(f"{score}<1 at 1%", PAPER)], 0.0), np.linspace(0.0, 0.1, 9)
    usual = {"fitness": np.ones(9), "r_min": 9.0 + spread, "clearance": 9.0 + spread}
    found = constraints.broken([PAPER], [usual], [usual | {score: spread}])
    assert found is not None and found.at_walls == (score in WALLS) == walls


def test_what_cannot_be_flown_is_not_of_walls_whatever_its_words_are(monkeypatch):
    """Its reason may name start.wall_clearance, a key; then room at walls was tried first."""

    def score(s, seed):
        if s.agents > 150:
            raise FlightError("agent 151 finds no room; start.wall_clearance = 20 m leaves none; f_wall")
        return {}

    flights(monkeypatch, score)
    trial = Trial([PAPER], recipe(PAPER)[0], range(2), Constraints([], 0.05), read_margins("agents", [PAPER])[0])
    assert trial.along is not None and "wall_clearance" in trial.along.told
    assert not trial.touches() and not trial.short_at_walls()


def test_no_other_margin_becomes_shorter_than_the_shortest_was(monkeypatch):
    """More alignment bears more delay, and hardly any noise."""

    def score(s, seed):
        more = s.parameters.c_frict > 0.05
        late = s.radio.delay > (2.0 if more else 0.8)
        return {"n_coll": 1.0 * (late or s.sensors.noise > (1.1 if more else 3.0) * PAPER.sensors.noise)}

    flights(monkeypatch, score)
    alone = harden.harden(PAPER, range(10), margin="radio.delay")
    assert alone[-1].kept
    both = harden.harden(PAPER, range(10), margin=["radio.delay", "sensors.noise"])
    assert any(step.kept and step.name == "c_frict up" for step in both) and not both[-1].kept


def test_of_faults_that_a_scenario_does_not_have_each_kind_strikes_from_once_an_hour_on(monkeypatch):
    """Agents that get stuck more than three times an hour end in collisions; no other kind of fault does harm."""
    tried = set()

    def score(s, seed):
        often = {entry.fault.name: entry.per_hour for entry in s.faults if entry.per_hour > 1e-6}
        tried.update(often)
        assert len(often) <= 1  # one kind at a time
        return {"n_coll": 1.0 * (often.get("stuck", 0.0) > 3.0)}

    flights(monkeypatch, score)
    found = harden.harden(PAPER, range(4), margin="faults")
    assert tried == {entry["kind"] for entry in load("vasarhelyi_2018/faulty").document["faults"]}
    assert found[0].verdict.startswith("short is stuck: what held holds up to ")
    assert 3.0 / FINE <= found[0].margins["stuck"] <= 3.0 and "an hour, not at" in found[0].verdict
    assert found[-1].margins["stuck"] <= 3.0 and not found[-1].kept


def test_faults_of_a_scenario_strike_more_often_and_all_entries_of_a_kind_together():
    faults = [
        {"kind": "motor", "per_hour": 2.0, "agents": [0]},
        {"kind": "motor", "per_hour": 3.0, "agents": [1]},
        {"kind": "stuck", "at": 5.0, "number": 2},
        {"kind": "fails", "at": 5.0, "agents": [3]},  # neither a rate nor a number that could grow
    ]
    scenario = load("vasarhelyi_2018/real_6ms", {"faults": faults})
    margins, wrong = read_margins("faults", [PAPER, scenario])
    assert not wrong and [each.name for each in margins] == ["motor", "stuck"]
    plain, worse = margins[0].worse(4.0)
    assert plain.faults == () and [entry.per_hour for entry in worse.faults[:2]] == [8.0, 12.0]
    assert worse.faults[2:] == scenario.faults[2:] and margins[0].told(4.0) == "8 an hour"
    assert margins[1].worse(4.0)[1].faults[2].number == 8 and margins[1].told(4.0) == "8 agents"


def test_what_cannot_be_flown_ends_a_margin(monkeypatch):
    def score(s, seed):
        if s.agents > 150:
            raise FlightError("agent 151 finds no room")
        return {}

    flights(monkeypatch, score)
    found = harden.harden(PAPER, range(2), margin="agents")
    assert 150 / FINE <= found[0].margins["agents"] <= 150 and "cannot be flown: agent 151" in found[0].verdict


def test_in_each_of_several_scenarios_a_number_gets_worse_by_the_same_factor(monkeypatch):
    late = load("vasarhelyi_2018/6ms", {"radio.delay": 1.0})
    (both,), _ = read_margins("radio.delay", [PAPER, late])
    assert [s.radio.delay for s in both.worse(1.5)] == [0.75, 1.5]
    flights(monkeypatch, lambda s, seed: {"n_coll": 1.0 * (s.radio.delay > 1.3)})
    assert 0.65 / FINE <= harden.harden([PAPER, late], range(2), margin="radio.delay")[0].margins["radio.delay"] <= 0.65


def test_what_is_found_by_halving_is_what_brute_force_finds():
    """Real flights at all delays of a grid: the first that breaks something lies where the margin ends."""
    small = {"agents": 6, "duration": 30.0, "dt": 0.1, "world.side": 100.0, "radio.delay": 0.5}
    scenario, seeds = load("vasarhelyi_2018/6ms", small), range(8)
    before = flown(scenario, [{}], seeds, 1, None)[0]

    def test(worse):
        return broken(before, flown(worse[0], [{}], seeds, 1, None)[0])

    found = reach(margin("radio.delay", scenario), test)
    assert found.ends
    grid = [
        found.margin.worse(factor) for factor in (1.0, found.holds, found.breaks, min(FARTHEST, 2.0 * found.breaks))
    ]
    assert [bool(test(worse)) for worse in grid] == [False, False, True, True]


@pytest.mark.parametrize(
    ("names", "line"),
    [
        ("radio.dely", "margin: radio.dely is not a number of the environment; did you mean radio.delay?"),
        ("model.p_rep", "margin: model.p_rep is not a number of the environment; known: radio.delay"),
        (["radio.delay", "fault"], "margin: fault is not a number of the environment; did you mean faults?"),
        ("sensors.sd", "margin: sensors.sd is not a number of this scenario; known: radio.delay"),
    ],
)
def test_a_margin_that_no_scenario_has_is_one_line(names, line):
    with pytest.raises(ScenarioError) as fault:
        harden.harden(PAPER, range(2), margin=names)
    assert str(fault.value).startswith(line) and len(fault.value.faults) == 1


def test_a_delay_of_nothing_has_no_factor():
    with pytest.raises(ScenarioError, match=r"margin: radio.delay = 0 in .*; give it a value that a factor can change"):
        harden.harden(load("vasarhelyi_2018/6ms", {"radio.delay": 0.0}), range(2), margin="radio.delay")


def test_the_command_refuses_a_margin_where_it_evolves_again(tmp_path):
    given = ["harden", "vasarhelyi_2018/6ms", "--out", str(tmp_path / "a.toml"), "--delay", "1.5", "--margin", "faults"]
    found = CliRunner().invoke(app, given)
    assert isinstance(found.exception, ScenarioError) and not (tmp_path / "a.toml").exists()
    assert str(found.exception) == "--margin is for the recipe; leave it out with --r-coll and --delay"
