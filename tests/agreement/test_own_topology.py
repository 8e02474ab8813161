"""A topology of a user's own: by consent, as the reference does, through changes and recordings, by cells."""

import re
from pathlib import Path

import numpy as np
import pytest

import airflock
from airflock.engine import fly_world, plan_of
from airflock.fleets.card_document import make_card_document
from airflock.recordings.recording_files import replay_recording
from airflock.scenarios.files import load
from airflock.support.errors import AirflockError, CardError, RecordingError, RuleError, ScenarioError
from reference.flight import fly_plainly

PAPER = "vasarhelyi_2018/4ms"
SMALL = {"agents": 6, "duration": 2.0, "world.side": 60.0, "start.separation": 5.0}
TEXT = re.search(
    r"```python\n# beside.py\n(.*?)```",
    (Path(__file__).parents[2] / "docs" / "topology.md").read_text(encoding="utf-8"),
    re.S,
).group(1)


@pytest.fixture
def beside(tmp_path):
    """The file of the documentation, and a scenario that names it."""
    (tmp_path / "beside.py").write_text(TEXT, encoding="utf-8")
    text = f'extends = "{PAPER}"\nagents = 6\nduration = 2.0\n[topology]\nkind = "beside.py"\ntimes = 1.5\n'
    (tmp_path / "mine.toml").write_text(text + '[world]\nside = 60.0\n[start]\nseparation = "5 m"\n', encoding="utf-8")
    return tmp_path


def test_it_is_one_file_outside_the_package(beside, seed):
    with pytest.raises(ScenarioError, match="if you trust it, add --trust"):
        load(beside / "mine.toml")
    scenario = load(beside / "mine.toml", trust=True)
    assert scenario.topology.rule.name == "beside" and scenario.topology.times == 1.5
    found = fly_world(scenario, seed, record=True, device="python").frames
    np.testing.assert_allclose(found, fly_plainly(scenario, seed).frames, atol=1e-9)
    lean = load(beside / "mine.toml", {"metrics.kind": "order"}, trust=True)  # which compiles sooner
    compiled = fly_world(lean, seed, record=True, device="cpu", precision=64).frames
    np.testing.assert_allclose(compiled, found, atol=1e-9)
    given = load(PAPER, SMALL | {"topology.times": 1.5}, topology=beside / "beside.py")
    assert np.array_equal(fly_world(given, seed, record=True, device="python").frames, found)
    airflock.check_topology(str(beside / "beside.py"))


def test_met_are_those_at_most_so_many_times_as_far_as_the_nearest(beside, seed):
    flight = airflock.open(load(beside / "mine.toml", trust=True), seed, device="python").advance(1.0)
    view = flight.look(1)
    far = np.array([np.hypot(h.state.x - view.own.x, h.state.y - view.own.y) for h in view.heard])
    assert list(view.met) == (far <= 1.5 * far.min()).tolist() and any(view.met)
    flight.change({"topology.times": 100.0}).advance(0.2)
    assert all(flight.look(1).met)
    flight.change({"topology.kind": "nearest", "topology.k": 1}).advance(0.2)
    assert sum(flight.look(1).met) == 1


def test_large_flocks_fly_by_cells_where_it_says_near(beside):
    keys = {"agents": 1500, "start.separation": 0.0}
    assert plan_of(load("vicsek_1995/ordered", keys, topology=beside / "beside.py")).grid
    (beside / "beside.py").write_text(TEXT.replace("NEAR = True", ""), encoding="utf-8")
    assert not plan_of(load("vicsek_1995/ordered", keys, topology=beside / "beside.py")).grid


def test_another_file_means_other_numbers_and_ours_share_theirs(beside):
    (beside / "ours.toml").write_text(
        f'extends = "{PAPER}"\n[topology]\nkind = "nearest"\nk = 3\nradius = 0.4\n', encoding="utf-8"
    )
    (beside / "next.toml").write_text('extends = "ours.toml"\n[topology]\nkind = "visible"\n', encoding="utf-8")
    (beside / "last.toml").write_text('extends = "next.toml"\n[topology]\nkind = "beside.py"\n', encoding="utf-8")
    assert load(beside / "next.toml").topology.radius == 0.4
    assert load(beside / "last.toml", trust=True).topology.times == 2.0
    assert load(beside / "mine.toml", {"topology.kind": "nearest"}, trust=True).topology.k == 7.0


def test_a_recording_is_scored_and_is_not_flown_again_without_it(beside, seed):
    recording = airflock.simulate(load(beside / "mine.toml", trust=True), seed, device="python")
    assert np.isfinite(float(airflock.score(recording)["phi_corr"].iloc[0]))
    with pytest.raises(RecordingError, match="topology.kind"):
        replay_recording(recording)


def empty():
    return None


def answering(n, met):
    for j in range(n):
        met[j] = 1.0
    return 1.0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, r"has no rule; give meet\(n, r2, met\)"),
        ({"meet": empty}, "meet does not ask for met"),
        ({"meet": lambda n, met, heading: None}, "asks for 'heading'"),
        ({"meet": answering}, "must return nothing"),
        ("nearst", "unknown topology; did you mean nearest"),
        ("none.py", "no such file"),
    ],
)
def test_what_is_no_topology_is_said_in_one_line(given, said):
    with pytest.raises(AirflockError, match=said) as caught:
        plan_of(load(PAPER, SMALL, topology=given))
    assert isinstance(caught.value, (RuleError, ScenarioError)) and len(str(caught.value).splitlines()) == 1


def test_a_wrong_number_of_it_is_said_in_one_line(beside):
    with pytest.raises(ScenarioError, match=r"topology.times = 0.5 lies outside \[1, 100\]"):
        load(beside / "mine.toml", {"topology.times": 0.5}, trust=True)
    with pytest.raises(ScenarioError, match="topology.k: unknown key"):
        load(beside / "mine.toml", {"topology.k": 3}, trust=True)


def test_a_card_names_ours_only(beside):
    scenario = load(beside / "mine.toml", trust=True)
    with pytest.raises(CardError, match="the topology beside is not in the package"):
        make_card_document(scenario, site=(47.0, 19.0, 100.0), members=range(1, 7), mission=1, expires=2_000_000_000)


def above(n, dz, r2, met):
    for j in range(n):
        met[j] = 1.0 if r2[j] < 1e29 and dz[j] > 0.0 else 0.0


def test_a_rule_that_asks_for_the_height_alone_is_given_it(seed):
    """Found by a draw: offsets were kept only where a rule asked for dx."""
    scenario = load(PAPER, SMALL | {"world.dimensions": "3", "duration": 1.0}, topology={"meet": above})
    found = fly_world(scenario, seed, record=True, device="python").frames
    np.testing.assert_allclose(found, fly_plainly(scenario, seed).frames, atol=1e-9)
    everybody = load(PAPER, SMALL | {"world.dimensions": "3", "duration": 1.0})
    assert np.abs(found - fly_world(everybody, seed, record=True, device="python").frames).max() > 1e-3
