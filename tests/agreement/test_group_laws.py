"""Groups with laws of their own: in the driver each agent flies as the pilot of its law would."""

from pathlib import Path

import numpy as np
import pytest

import airflock
import wary as wary_law
from against_reference import compared
from airflock.engine import driver_text, fly_world, plan_of
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.scenarios.files import load
from airflock.scenarios.named_code import find_law
from airflock.support.errors import ScenarioError
from scenarios_drawn import Draw

PAPER = "vasarhelyi_2018/4ms"
DENSE = {"agents": 7, "duration": 3.0, "dt": 0.05, "metrics.period": 0.25, "world.side": 40.0, "radio.range": 25.0}
FISH = {"agents": 7, "duration": 3.0, "metrics.period": 0.25, "start.kind": "ball", "start.radius": 4.0}


def beside(kind, name=PAPER, base=DENSE, **more):
    """A flock of which two agents fly by another law, three share numbers, and two are in no group."""
    groups = [{"name": "a", "agents": [1, 4], "model": {"kind": kind}}, {"name": "b", "agents": 3, "model": {}}]
    return load(name, {**base, "groups": groups, **more})


@pytest.mark.parametrize(
    ("kind", "name", "more"),
    [
        ("viragh_2014", PAPER, {"world.dimensions": "3"}),
        ("formation", PAPER, {"radio.loss": 0.3, "radio.loss_at": 30.0}),
        ("kidger", PAPER, {"radio.kind": "links"}),
        ("viragh_2014", PAPER, {"topology.kind": "nearest", "topology.k": 2}),
        ("viragh_2014", PAPER, {"silence.rule": "stop"}),
        ("formation", PAPER, {"faults": [{"kind": "fails", "at": 1.0, "agents": [1, 5]}]}),
        ("vicsek_1995", "couzin_2002/torus", FISH),
        ("viragh_2014", PAPER, {"update": "sequential", "sensors.noise": 0.0, "sensors.period": 0.0, "radio.delay": 0}),
    ],
    ids=["space", "lossy", "rays and links", "nearest", "silence", "absence", "headings", "in turn"],
)
def test_laws_beside_each_other_fly_as_their_pilots_do(kind, name, more, seed):
    scenario = beside(kind, name, FISH if name != PAPER else DENSE, **more)
    assert [law.agents for law in scenario.laws] == [(0, 2, 3, 5, 6), (1, 4)]
    verdict = compared(Draw(scenario, seed, None, {}))
    assert verdict.agrees and not verdict.fault, verdict


def test_who_hears_nobody_flies_as_in_a_flock_of_its_law():
    """Without neighbours an agent of each law flies as if all flew by it: no law reads what is another's."""
    alone = {"radio.range": 0.0, "world.side": 60.0}
    start = np.random.default_rng(3).normal(0.0, 12.0, (4, 7))
    mixed = fly_world(beside("viragh_2014", **alone), 5, record=True, start=start, device="python").frames
    for law, who in ((None, [0, 2, 3, 5, 6]), ("viragh_2014", [1, 4])):
        whole = {key: value for key, value in {**DENSE, **alone}.items() if law is None or not key.startswith("model.")}
        known = fly_world(load(PAPER, whole, law), 5, record=True, start=start, device="python").frames
        assert np.array_equal(mixed[:, :, who], known[:, :, who])


def test_a_group_that_names_the_law_of_the_flock_changes_no_text():
    same = load(PAPER, {**DENSE, "groups": [{"name": "a", "agents": 3, "model": {"kind": "vasarhelyi_2018"}}]})
    assert len(same.laws) == 1 and driver_text(same) == driver_text(load(PAPER, DENSE))
    twice = [{"name": f"by_{p}", "agents": 2, "model": {"kind": "viragh_2014", "p_rep": p}} for p in (1, 2)]
    found = load(PAPER, {**DENSE, "groups": twice})
    assert [law.varied for law in found.laws] == [(), (("p", "p_rep"),)]  # one text, two numbers
    assert plan_of(found).columns == (("p", "p_rep"), ("", "law"))
    assert found.agent_values("p", "p_rep", 0)[:4] == [1.0, 1.0, 2.0, 2.0]


def test_any_cuts_branches_and_snapshots_give_the_bits_of_the_whole():
    scenario = beside("formation")
    whole = airflock.open(scenario, 2, device="python", record=True)
    whole.finish()
    cut = airflock.open(scenario, 2, device="python", record=True).advance(0.7)
    kept, twin = cut.snapshot(), cut.branch()
    cut.advance(0.93).finish()
    assert np.array_equal(cut.frames, whole.frames)
    twin.finish()
    assert np.array_equal(twin.frames, whole.frames)
    twin.restore(kept).finish()
    assert np.array_equal(twin.frames, whole.frames)


def test_an_agent_may_change_its_law_in_flight():
    """From then on it flies as the other law would from there; those who keep theirs keep their memory."""
    alone = {**DENSE, "radio.range": 0.0, "sensors.noise": 0.0, "body.noise": 0.0, "radio.delay": 0.0}
    first = [{"name": "a", "agents": [1], "model": {"kind": "viragh_2014"}}]
    then = [{"name": "a", "agents": [2], "model": {"kind": "viragh_2014"}}]
    flight = airflock.open(load(PAPER, {**alone, "groups": first}), 4, device="python", record=True)
    flight.advance(1.0).change({"groups": then}).finish()
    plain = airflock.open(load(PAPER, alone), 4, device="python", record=True)
    plain.finish()
    assert np.array_equal(flight.frames[:, :, 0], plain.frames[:, :, 0])
    assert not np.array_equal(flight.frames[:, :, 1], plain.frames[:, :, 1])
    assert np.array_equal(flight.frames[:4, :, 2], plain.frames[:4, :, 2])
    assert not np.array_equal(flight.frames[-1, :, 2], plain.frames[-1, :, 2])


def test_what_is_shown_of_an_agent_is_of_its_law():
    scenario = beside("kidger", **{"sensors.noise": 0.0, "radio.delay": 0.0})
    flight = airflock.open(scenario, 2, device="python").advance(1.0).sense()
    for agent, law in ((0, "vasarhelyi_2018"), (1, "kidger")):
        view = flight.look(agent)
        assert type(view.sums).__module__ == f"airflock.parts.laws.{law}.law"
        live = [k for k, value in enumerate(view.sums) if value]
        summed = np.sum([term for term in view.terms], axis=0)
        assert live and np.allclose(np.array(view.sums)[live], summed[live])


KINDS = [
    {"name": "wary", "agents": [0, 3, 5], "model": {"k": {"value": 2.0, "spread": 0.3}}},
    {"name": "bold", "agents": [1, 6], "model": {"style": "chase", "k": 3.0}},
    {"name": "slow", "agents": [2], "model": {"k": 0.5}},
]


@pytest.fixture
def wary(tmp_path):
    """A file with a law that asks for groups, remembers, draws and chooses."""
    (tmp_path / "wary.py").write_text(Path(wary_law.__file__).read_text(encoding="utf-8"), encoding="utf-8")
    return tmp_path / "wary.py"


def test_a_law_of_ones_own_asks_for_groups_compiled_and_in_plain_python(wary):
    """Three groups, two texts of one law with a memory and a choice; one agent is in no group."""
    keys = {**DENSE, "radio.delay": 0.1, "metrics.kind": "order"}
    scenario = load(PAPER, {**keys, "groups": KINDS}, law=wary)
    assert [law.agents for law in scenario.laws] == [(0, 2, 3, 4, 5), (1, 6)]
    verdict = compared(Draw(scenario, 3, None, {}))
    assert verdict.agrees and not verdict.fault, verdict
    plain = fly_world(scenario, 3, record=True, device="python").frames
    np.testing.assert_allclose(fly_world(scenario, 3, precision=64, record=True).frames, plain, atol=1e-9)
    alike = load(PAPER, keys, law=wary)  # without groups all are kin
    assert not np.array_equal(fly_world(alike, 3, record=True, device="python").frames, plain)


def test_the_law_of_a_group_may_lie_in_a_file_or_be_given(wary, tmp_path):
    group = 'agents = 2\nmodel = { kind = "wary.py", style = "chase" }\n'
    text = f'extends = "{PAPER}"\nagents = 7\n[[groups]]\n{group}'
    (tmp_path / "mine.toml").write_text(text)
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "more.toml").write_text('extends = "../mine.toml"\nduration = 1.0\n')
    for name in ("mine.toml", "folder/more.toml"):
        with pytest.raises(ScenarioError, match="would run the code in"):
            load(tmp_path / name)
        assert load(tmp_path / name, trust=True).laws[1].parameters.style == "chase"
    given = find_law("wary.py", tmp_path, trust=True)
    group = [{"agents": 2, "model": {"kind": "wary", "k": 2.0}}]
    scenario = load(PAPER, {**DENSE, "groups": group}, laws=given)
    assert scenario.laws[1].model is given
    flight = (
        airflock.open(scenario, 1, device="python", record=True).advance(0.5).change({"radio.range": 20.0}).advance(0.2)
    )
    recording = airflock.recording_of(flight)
    # though nobody knows how they fly
    assert [list(group.agents) for group in scenario_of_recording(recording).groups] == [[0, 1]]


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ({"kind": "viragh"}, r"groups\[0\].model.kind = 'viragh': unknown model; did you mean viragh_2014"),
        ({"kind": "viragh_2014", "p_repp": 1.0}, r"groups\[0\].model.p_repp: unknown key"),
        ({"kind": "viragh_2014", "p_rep": -1.0}, r"groups\[0\].model.p_rep = -1 .* lies outside"),
        ({"kind": "hawk.py"}, r"groups\[0\].model.kind = 'hawk.py': no such file"),
        ({"kind": 3}, r"groups\[0\].model.kind = 3 is not a name"),
    ],
)
def test_bad_laws_of_groups_are_one_line_each(model, said):
    with pytest.raises(ScenarioError, match=said) as found:
        load(PAPER, {"groups": [{"agents": 3, "model": model}]})
    assert len(str(found.value).splitlines()) == 1


def test_faults_of_several_groups_come_at_once():
    groups = [
        {"agents": 200, "model": {"kind": "couzin_2002"}},
        {"agents": [3], "model": {"kind": "kidgr"}},
        {"agents": [4], "body": {"kind": "direct"}},
    ]
    with pytest.raises(ScenarioError) as found:
        load(PAPER, {"groups": groups})
    assert [line.partition("groups[")[2][0] for line in str(found.value).splitlines()] == ["0", "1", "2"]


def test_laws_that_do_not_fit_the_world_or_the_flock_are_refused():
    rays = {"world.obstacles": [[[5.0, 5.0], [9.0, 5.0], [9.0, 9.0]]]}
    with pytest.raises(ScenarioError, match="casts rays at polygons and model vasarhelyi_2018 feels them as surfaces"):
        beside("kidger", **rays)
    with pytest.raises(ScenarioError, match="dimock_2003 solves for the whole flock, so all fly by it"):
        load("dimock_2003/published", {"groups": [{"agents": 1, "model": {"kind": "viragh_2014"}}]})
