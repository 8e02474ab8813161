"""Keys of groups: in settings and in flight they mean what the file would; wrong ones are one line; sliders."""

import numpy as np
import pytest

import airflock
from airflock.engine import fly_world
from airflock.scenarios.cost import estimated_seconds
from airflock.scenarios.files import load
from airflock.studio.flight_pane import scenario_controls, scenario_value, set_options
from airflock.support.errors import ScenarioError

PAPER = "vasarhelyi_2018/4ms"
SMALL = {"agents": 6, "duration": 1.0, "world.side": 60.0, "start.separation": 5.0}
GROUPS = [
    {"name": "heavy", "agents": 2, "body": {"tau": {"value": "2000 ms", "spread": 0.1}, "a_max": "3 m/s^2"}},
    {"name": "old.ones", "agents": [4], "model": {"kind": "viragh_2014", "p_rep": 0.5}},
    {"name": "light"},
]


def flock(settings=None, groups=GROUPS):
    return load(PAPER, SMALL | {"groups": groups} | (settings or {}))


def frames(scenario, seed):
    return fly_world(scenario, seed, record=True, device="python").frames


@pytest.mark.parametrize(
    ("key", "value", "place", "written"),
    [
        ("groups.heavy.body.tau", 3.0, (0, "body", "tau"), {"value": 3.0, "spread": 0.1}),
        ("groups.heavy.body.tau", "3000 ms", (0, "body", "tau"), {"value": "3000 ms", "spread": 0.1}),
        ("groups.light.model.p_rep", 0.1, (2, "model", "p_rep"), 0.1),
        ("groups.old.ones.model.v_flock", 2.0, (1, "model", "v_flock"), 2.0),
        ("groups.light.model.kind", "viragh_2014", (2, "model", "kind"), "viragh_2014"),
        ("groups.heavy.body.tau.spread", "20 %", (0, "body", "tau"), {"value": "2000 ms", "spread": "20 %"}),
        ("groups.heavy.body.tau.spread", "0.3 s", (0, "body", "tau"), {"value": "2000 ms", "spread": 0.3}),
        ("groups.old.ones.model.v_flock.spread", 0.2, (1, "model", "v_flock"), {"spread": 0.2}),
        ("groups.light.model.p_rep.spread", "40 %", (2, "model", "p_rep"), {"spread": "40 %"}),
    ],
)
def test_a_key_means_what_the_file_would(key, value, place, written, seed):
    number, section, name = place
    tables = [{**table} for table in GROUPS]
    tables[number][section] = {**tables[number].get(section, {}), name: written}
    known, found = flock(groups=tables), flock({key: value})
    assert [(g.numbers, g.spread, g.agents) for g in found.groups] == [
        (g.numbers, g.spread, g.agents) for g in known.groups
    ]
    assert np.array_equal(frames(found, seed), frames(known, seed))
    assert not np.array_equal(frames(found, seed), frames(flock(), seed))
    assert GROUPS[0]["body"]["tau"] == {"value": "2000 ms", "spread": 0.1}  # what was given is left as it was


def test_a_spread_keeps_its_unit_beside_a_value_that_is_set_anew():
    table = {"name": "heavy", "agents": 2, "body": {"tau": {"value": 1500.0, "spread": 100.0, "unit": "ms"}}}
    (found,) = flock({"groups.heavy.body.tau": 3.0}, [table]).groups
    assert found.numbers["b", "tau"] == 3.0 and found.spread["b", "tau"] == pytest.approx(0.1)

    (found,) = flock({"groups.heavy.body.tau.spread": "50 ms"}, [table]).groups
    assert found.numbers["b", "tau"] == 1.5 and found.spread["b", "tau"] == pytest.approx(0.05)


@pytest.mark.parametrize("share", ["10 %", "10%", "10 percent", {"value": 10, "unit": "%"}])
def test_a_spread_may_be_a_share_of_its_number_whatever_that_becomes(share, seed):
    """Each agent deviates by as many standard deviations as with the same spread in its unit."""
    groups = [
        {"name": "all", "body": {"tau": {"value": "2 s", "spread": share}}, "model": {"p_rep": {"spread": share}}}
    ]
    for keys, tau, p_rep in (({}, 2.0, 0.03), ({"groups.all.body.tau": 4.0, "model.p_rep": 0.6}, 4.0, 0.6)):
        plain = [{"name": "all", "body": {"tau": {"value": tau, "spread": 0.1 * tau}}, "model": {"p_rep": p_rep}}]
        found, known = flock(keys, groups), flock({}, plain)
        assert found.agent_values("b", "tau", seed) == pytest.approx(known.agent_values("b", "tau", seed))
        plain[0]["model"]["p_rep"] = {"value": found.parameters.p_rep, "spread": 0.1 * found.parameters.p_rep}
        known = flock({}, plain)
        assert found.agent_values("p", "p_rep", seed) == pytest.approx(known.agent_values("p", "p_rep", seed))


def test_of_a_number_that_is_a_share_itself_a_percentage_is_a_hundredth():
    (found,) = flock({}, [{"name": "all", "model": {"c_frict": {"spread": "10 %"}}}]).groups
    assert found.spread["p", "c_frict"] == 0.1 and flock({}, [{"body": {"tau": {"spread": "0 %"}}}]).groups


@pytest.mark.parametrize(
    ("spread", "said"),
    [
        (
            "10 furlongs",
            "= 10 furlongs: the unit is s, or one of us, ms, min, h, or a share of the number such as '10 %'",
        ),
        ("-5 %", "= '-5 %' is not a standard deviation of 0 s or more, or a share of the number such as '10 %'"),
        ("wide", "= 'wide' is not a standard deviation of 0 s or more, or a share of the number such as '10 %'"),
        ("10", "has no unit; give 10 without quotes, or '10 s' .*, or a share of the number such as '10 %'"),
    ],
)
def test_a_wrong_spread_is_one_line_with_all_that_is_possible(spread, said):
    with pytest.raises(ScenarioError, match=said) as found:
        flock({"groups.heavy.body.tau.spread": spread})
    (line,) = str(found.value).splitlines()
    assert line.startswith(f"{PAPER}: groups[0].body.tau.spread")


def test_an_open_flight_takes_a_key_of_a_group(seed):
    flight = airflock.open(flock(), seed, device="python")
    flight.change({"groups.light.model.p_rep": 0.1, "groups.old.ones.model.p_rep": 0.1}).advance(1.0)
    known = frames(flock({"groups.light.model.p_rep": 0.1, "groups.old.ones.model.p_rep": 0.1}), seed)
    np.testing.assert_allclose(flight.state, known[-1, :4], atol=1e-9)


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("groups.hevy.body.tau", "unknown group 'hevy'; did you mean heavy"),
        ("groups.heavy.bdy.tau", "unknown key; did you mean groups.heavy.body.tau"),
        ("groups.hevy.tua", "unknown key; did you mean groups.heavy.body.tau"),
        ("groups.old.one.p_rep", "unknown key; did you mean groups.old.ones.model.p_rep"),
        ("groups.light.damping", "unknown key; did you mean groups.light.sensors.damping"),
        ("groups.light.zz", "did you mean groups.light.SECTION.zz; sections: model, body, sensors"),
        (
            "groups.heavy.agents",
            r"agents: a setting changes only model, body, sensors of a group; write it in the file's",
        ),
        ("groups.old.ones.name", r"a setting changes only model, body, sensors of a group; write it in the file's"),
        ("groups.nobody.tau", "unknown key; write groups.NAME.SECTION.KEY"),
        ("groups.heavy", "unknown key; write groups.NAME.SECTION.KEY"),
        ("groups.heavy.body.tua", r"groups\[0\].body.tua: unknown key; did you mean groups.0..body.tau"),
        ("groups.heavy.sensors.period", "all measure and decide at the same times"),
    ],
)
def test_a_wrong_key_is_said_in_one_line(key, said):
    with pytest.raises(ScenarioError, match=said) as caught:
        flock({key: 1.0})
    assert len(str(caught.value).splitlines()) == 1
    with pytest.raises(
        ScenarioError, match=r"groups.heavy.body.tau: the scenario has no \[\[groups\]\]; write them in"
    ):
        load(PAPER, {"groups.heavy.body.tau": 1.0})


def test_each_group_has_sliders_of_its_own_numbers():
    scenario = flock()
    found = scenario_controls(scenario)
    assert [control.key for control in found["group heavy: body"]] == [
        "groups.heavy.body.tau",
        "groups.heavy.body.a_max",
    ]
    own = {control.key: control for control in found["group old.ones: model"]}
    assert own["groups.old.ones.model.p_rep"].value == 0.5 and len(own) > 3  # all of a law that only they have
    assert not any(section.startswith("group light") for section in found)
    for section in found:
        for control in found[section] if section.startswith("group") else ():
            assert (
                control.value == scenario_value(scenario, control.key) and control.low <= control.value <= control.high
            )
    assert own["groups.old.ones.model.p_rep"].label.startswith("p_rep")
    assert set_options({"groups.old.ones.model.p_rep": 0.2}) == "--set groups.old.ones.model.p_rep=0.2"


@pytest.mark.parametrize("model", [{"kind": "couzin_2005"}, {"dr_o": 3.0}, {}])
def test_the_groups_of_a_large_flock_cost_no_square_of_its_number(model):
    large = {"agents": 5000, "start.radius": 60.0, "groups": [{"name": "a", "agents": 9, "model": model}]}
    found, plain = load("couzin_2002/torus", large), load("couzin_2002/torus", {**large, "groups": []})
    assert not any(note.startswith("groups: ") for note in found.notes)
    assert estimated_seconds(found) < 2.0 * estimated_seconds(plain)
