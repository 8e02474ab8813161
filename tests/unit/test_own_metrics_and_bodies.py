"""Order parameters, metric sets and bodies of a user's own, from a file or given directly; no compiler needed."""

import json
import linecache
from pathlib import Path

import numpy as np
import pytest

import airflock
from airflock.engine import fly_world
from airflock.parts.metrics.metric_sets import SETS, metric_set, reported_values
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.recordings.recording_files import replay_recording
from airflock.recordings.simulation import bare_document
from airflock.scenarios.files import load
from airflock.support.errors import AirflockError, RuleError, ScenarioError

pytestmark = pytest.mark.usefixtures("scored_plainly")

SMALL = {"agents": 4, "duration": 2.0, "world.side": 60.0, "start.separation": 5.0}
METRIC = '''
"""How far agents are spread along the east."""
from dataclasses import dataclass
from typing import NamedTuple

import airflock

REPORTS = {"spread": ("m", "mean distance to the centre, east"), "fitness": ("", "narrow is good")}
METRICS = ["speed"]

@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One length."""
    width: float = airflock.quantity(10.0, "m", low=0.1, high=1e3, meaning="a narrow flock")

class Agent(NamedTuple):
    """Distance, m."""
    offset: float

class Sample(NamedTuple):
    """Mean, m."""
    spread: float

def agent(x, mean):
    """Distance of one agent, m."""
    return Agent(abs(x - mean.x))

def sample(agents, n):
    """Mean, m."""
    return Sample(agents.offset / n)

def fitness(values, agents, q):
    """Narrow is good."""
    return {"fitness": q.width / (q.width + values["spread"]) * (agents / 4.0)}
'''
BODY = '''
"""A body that does half of what it is told."""
from dataclasses import dataclass

import airflock

ACCEPTS = "velocity"
INTEGRATION = "new"

@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """Obedience."""
    share: float = airflock.quantity(0.5, "1", low=0.0, high=1.0, meaning="of the command that is flown")

def move(cx, cy, cz, b):
    """Velocity after one step, m/s."""
    return b.share * cx, b.share * cy, b.share * cz
'''


def namespace(text):
    """Names of a text, as a notebook cell defines them."""
    name = f"<cell {hash(text)}>"
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    space = {"__name__": "cell"}
    exec(compile(text, name, "exec"), space)
    return space


@pytest.fixture
def files(tmp_path):
    (tmp_path / "spread.py").write_text(METRIC)
    (tmp_path / "half.py").write_text(BODY)
    return tmp_path


def test_a_metric_of_ones_own_measures_what_its_rule_says(files):
    found = load("vasarhelyi_2018/4ms", SMALL, metrics=files / "spread.py")
    flown = fly_world(found, 1, record=True, device="python")
    x = flown.frames[:, 0]
    truth = np.abs(x - x.mean(axis=1, keepdims=True)).mean()
    values = found.judged(flown.values)
    assert values["spread"] == pytest.approx(truth, rel=1e-12)
    assert values["fitness"] == pytest.approx(10.0 / (10.0 + truth), rel=1e-12)
    assert found.metrics.rule.best == "fitness" and "phi_vel" in values  # METRICS: one of ours beside it
    narrow = load("vasarhelyi_2018/4ms", {**SMALL, "metrics.width": 1.0}, metrics=files / "spread.py")
    assert narrow.judged(flown.values)["fitness"] == pytest.approx(1.0 / (1.0 + truth), rel=1e-12)
    assert reported_values(found.metrics.rule)["spread"] == ("m", "mean distance to the centre, east")


def test_a_body_of_ones_own_flies_half_of_the_command(files):
    found = load("vasarhelyi_2018/4ms", SMALL, body=files / "half.py")
    frames = fly_world(found, 1, record=True, device="python").frames
    np.testing.assert_array_equal(frames[1:, 2:4], 0.5 * frames[:-1, 4:6])  # a decision at every sample
    still = load("vasarhelyi_2018/4ms", {**SMALL, "body.share": 0.0}, body=files / "half.py")
    assert np.ptp(fly_world(still, 1, record=True, device="python").frames[:, :2], axis=0).max() == 0.0


@pytest.mark.parametrize(("returned", "said"), [
    ("cx / 0.0, cy, cz", "plain.move fails on a probe: ZeroDivisionError"),
    ("cx, cy", "plain.move must return x, y, z"),
    ("1e308 * cx * cx, cy, cz", "plain.move returns inf on a probe"),
])  # fmt: skip
def test_a_fault_of_a_body_is_found_at_its_line_before_it_flies(tmp_path, returned, said):
    """As of every other rule; interpreted it was "unexpected, please report it", and compiled it flew."""
    path = tmp_path / "plain.py"
    path.write_text(f'ACCEPTS, INTEGRATION = "velocity", "new"\n\n\ndef move(cx, cy, cz):\n    return {returned}\n')
    for device in ("python", "cpu"):
        with pytest.raises(RuleError) as caught:
            airflock.simulate(load("vasarhelyi_2018/4ms", SMALL, body=path), 1, device=device)
        assert str(caught.value).startswith((f"{path}:4: ", f"{path}:5: ")) and said in str(caught.value)


def test_a_body_without_numbers_needs_no_parameters(tmp_path, seed):
    path = tmp_path / "plain.py"
    path.write_text('ACCEPTS, INTEGRATION = "velocity", "new"\n\n\ndef move(cx, cy, cz):\n    return cx, cy, cz\n')
    ours = load("vasarhelyi_2018/4ms", SMALL | {"body.kind": "direct"})
    theirs = load("vasarhelyi_2018/4ms", SMALL, body=path)
    one, other = (fly_world(found, seed, record=True, device="python").frames for found in (ours, theirs))
    assert np.array_equal(one, other)
    assert airflock.check_body(path)
    theirs = load("vasarhelyi_2018/4ms", SMALL | {"groups": [{"name": "a", "agents": 1}]}, body=path)
    assert airflock.simulate(theirs, seed, device="python").position.notnull().all()


def test_a_file_and_the_same_names_given_directly_are_one(files):
    keys = {"metrics.width": 3.0, "body.share": 0.25}
    from_file = load("vasarhelyi_2018/4ms", {**SMALL, **keys}, metrics=files / "spread.py", body=files / "half.py")
    direct = load(
        "vasarhelyi_2018/4ms", {**SMALL, **keys}, metrics=namespace(METRIC), body=airflock.body(namespace(BODY))
    )
    a, b = (found.judged(fly_world(found, 2, record=True, device="python").values) for found in (from_file, direct))
    assert a == b


def test_numbers_of_a_metric_are_keys_of_every_list_that_names_it():
    spread = airflock.metric(namespace(METRIC), "spread")
    listed = load("vasarhelyi_2018/4ms", {**SMALL, "metrics.width": 2.0}, metrics=["speed", spread])
    assert set(listed.numbers["q"]) == {"width", *load("vasarhelyi_2018/4ms").numbers["q"]}
    assert listed.metrics.width == 2.0


def test_two_metrics_that_declare_one_number_otherwise_are_refused():
    one, other = (METRIC.replace("airflock.quantity(10.0", f"airflock.quantity({width}") for width in (10.0, 20.0))
    other = other.replace("spread", "stretch")
    metrics = [airflock.metric(namespace(text), name) for text, name in ((one, "spread"), (other, "stretch"))]
    with pytest.raises(RuleError, match="two of its metrics declare metrics.width otherwise"):
        load("vasarhelyi_2018/4ms", SMALL, metrics=metrics)


def test_a_recording_is_scored_without_the_code_that_it_was_flown_with(files):
    named = load("vasarhelyi_2018/4ms", {**SMALL, "metrics.kind": str(files / "spread.py")}, trust=True)
    recording = airflock.simulate(named, 1, precision=64, device="python")
    assert scenario_of_recording(recording).metrics.rule.name == "vasarhelyi"  # a recording runs no code that it names
    direct = load("vasarhelyi_2018/4ms", SMALL, metrics=namespace(METRIC), body=namespace(BODY))
    recording = airflock.simulate(direct, 1, precision=64, device="python")
    again = scenario_of_recording(recording)
    assert again.metrics.rule.name == "vasarhelyi" and again.body.rule.name == "multirotor"


def test_code_in_the_current_folder_is_found_and_only_its_name_is_kept(files, monkeypatch):
    monkeypatch.chdir(files)
    keys = {**SMALL, "metrics.kind": "spread.py", "body.kind": "half.py"}
    document = load("kidger/final_2d", {"agents": 3, "metrics.kind": "spread.py"}, trust=True).document
    assert document["metrics"]["kind"] == "spread.py"
    kept = bare_document(load("vasarhelyi_2018/4ms", {"metrics.kind": "spread.py"}, trust=True))
    assert kept["metrics"]["kind"] == "spread"  # no place of a file
    other = load("vasarhelyi_2018/4ms", keys, trust=True)  # the preset's numbers are another body's
    assert other.body.rule.name == "half" and any("multirotor are left out" in note for note in other.notes)
    with pytest.raises(ScenarioError, match="body.tau: unknown key"):
        load("vasarhelyi_2018/4ms", keys | {"body.tau": 1.0}, trust=True)


BAD = {
    "sample": (METRIC.replace("def sample(", "def simple("), "metric spread has"),
    "asks": (METRIC.replace("agent(x, mean)", "agent(xx, mean)"), "did you mean"),
    "twice": (METRIC.replace('["speed"]', '["speed", "speed"]'), "the metric speed comes twice"),
    "unknown": (METRIC.replace('["speed"]', '["spede"]'), "'spede' is not a metric"),
    "clock": (METRIC + "\nCLOCK = 'often'\n", "CLOCK = 'often'"),
    "over": (METRIC + "\nOVER_TIME = {'spread': 'median'}\n", "OVER_TIME['spread'] = 'median'"),
    "fitness": (METRIC.replace("fitness(values, agents, q)", "fitness(values, seeds)"), "asks for 'seeds'"),
    "record": (METRIC.replace("(airflock.Parameters)", ""), "Parameters is not a frozen dataclass"),
}


@pytest.mark.parametrize("name", [name for name in BAD if name != "sample"])
def test_a_faulty_metric_file_is_one_line(name, tmp_path):
    text, line = BAD[name]
    (tmp_path / "spread.py").write_text(text)
    with pytest.raises(ScenarioError) as fault:
        load("vasarhelyi_2018/4ms", SMALL, metrics=tmp_path / "spread.py")
    assert line in str(fault.value) and len(str(fault.value).splitlines()) == 1


@pytest.mark.parametrize("key", ["metrics.kind", "body.kind", "model.kind"])
def test_a_file_that_is_not_there_is_one_line(key):
    with pytest.raises(ScenarioError, match=f"{key} = 'nowhere.py': no such file"):
        load("vasarhelyi_2018/4ms", {key: "nowhere.py"})


def test_a_set_of_nothing_is_refused():
    with pytest.raises(RuleError, match="measures nothing"):
        metric_set({}, "empty")


def test_every_set_says_what_is_best_or_that_nothing_is():
    for found in SETS.values():
        assert found.best in ("", *found.numbers(found.Parameters(kind=found.name)))


def test_a_recording_of_ones_own_metrics_and_body_says_what_flies_and_scores_it_again(files, monkeypatch):
    monkeypatch.chdir(files)
    keys = {**SMALL, "metrics.kind": "spread.py", "metrics.width": 3.0, "body.kind": "half.py", "body.share": 0.7}
    flown = airflock.simulate(load("vasarhelyi_2018/4ms", keys, trust=True), 1, precision=64, device="python")
    airflock.save(flown, "mine.nc")
    with pytest.raises(AirflockError) as fault:
        airflock.validate("mine.nc")
    remedy = "give their files with --set metrics.kind=spread.py --set body.kind=half.py --trust (in Python: settings="
    assert remedy in str(fault.value) and "\n" not in str(fault.value)
    given = {"metrics.kind": "spread.py", "body.kind": "half.py"}
    assert airflock.validate("mine.nc", given, trust=True).verdict == "flown again with the same bits"
    with pytest.raises(AirflockError, match="half.py: would run the code|would run the code in .*half.py"):
        airflock.validate("mine.nc", given)
    with pytest.raises(AirflockError, match="radio.delay: it can only be flown again as it was"):
        airflock.validate("mine.nc", given | {"radio.delay": 2.0}, trust=True)
    x = flown.position.sel(space="x").values[:, 0]
    spread = np.abs(x - x.mean(axis=1, keepdims=True)).mean()
    scores = airflock.score(flown, settings={"metrics.kind": "spread.py"}, trust=True).iloc[0]
    assert scores["spread"] == pytest.approx(spread, rel=1e-12)
    assert scores["fitness"] == pytest.approx(3.0 / (3.0 + spread), rel=1e-12)  # by the width that was flown
    assert "spread" in airflock.over_time(flown, {"metrics.kind": "spread.py"}, trust=True)
    with pytest.raises(AirflockError, match="if you trust it, add --trust"):
        airflock.score(flown, settings={"metrics.kind": "spread.py"})


def test_code_that_a_recording_names_does_not_run_with_trust_in_another_file(files, monkeypatch):
    monkeypatch.chdir(files)
    (files / "evil.py").write_text("raise SystemExit('it ran')\n")
    direct = load("vasarhelyi_2018/4ms", SMALL, metrics=namespace(METRIC), body=namespace(BODY))
    recording = airflock.simulate(direct, 1, precision=64, device="python")
    document = json.loads(recording.attrs["airflock_scenario"])
    document["body"]["kind"] = "evil.py"
    crafted = recording.assign_attrs(airflock_scenario=json.dumps(document))
    assert scenario_of_recording(crafted, {"metrics.kind": "spread.py"}, trust=True).body.rule.name == "multirotor"
    with pytest.raises(AirflockError, match=r"body.kind = 'evil.py', which is not in the file"):
        replay_recording(crafted, settings={"metrics.kind": "spread.py"}, trust=True)


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("metrics_of_ones_own", "metrics.kind"),
        ("body_of_velocities", "body.kind"),
        ("sensor_of_headings", "sensors.kind"),
        ("radio_in_the_rain", "radio.kind"),
        ("topology_of_ones_own", "topology.kind"),
    ],
)
def test_advice_of_a_recording_with_a_part_of_ones_own_flies_it_again(name, key):
    """A radio and a topology were recorded with their file, so that the advice named rain.py.py."""
    section, users = key.partition(".")[0], Path(__file__).parents[1] / "users"
    scenario = airflock.load(users / f"{name}.toml", {"duration": 1.0}, trust=True)
    recording = airflock.simulate(scenario, seed=2)
    kind = json.loads(recording.attrs["airflock_scenario"])[section]["kind"]
    assert kind == Path(scenario.document[section]["kind"]).stem
    with pytest.raises(AirflockError, match=f"--set {key}={kind}.py --trust"):
        replay_recording(recording)
    assert replay_recording(recording, settings={key: str(users / f"{kind}.py")}, trust=True)[0]
