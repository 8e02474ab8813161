"""The studio without a browser: pace, spans of sliders, moments, events, saving, and who may open the page."""

import math
import re
import shlex
import socket
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st

import airflock
from airflock.core.model import model
from airflock.core.parameters import Quantity, declarations, quantity
from airflock.engine import Flight
from airflock.parts.laws import vasarhelyi_2018
from airflock.recordings.recording_files import load_recording
from airflock.scenarios.files import presets
from airflock.search.study import load_study, shipped_study_axes
from airflock.studio import access_token, browser_view, page_measures as measures
from airflock.studio.browser_view import FRAMES_PER_PIECE, Trails
from airflock.studio.flight_pane import (
    FlightPane,
    FlightSource,
    fault_controls,
    scenario_controls,
    scenario_value,
    slider_span,
)
from airflock.studio.page_measures import difference_table_html, scenario_differences
from airflock.studio.page_panels import KEY_EXAMPLE, OpeningPanel, PerceptLines, _named_vectors, parse_setting
from airflock.studio.page_scene import (
    BOTH_PANES,
    AgentColouring,
    CollisionList,
    DrawnFlock,
    arrival_curve,
    available_colourings,
    joined_colours,
)
from airflock.studio.player import FlightRequest, KeptSnapshots, PageClock, Player
from airflock.support.errors import ParameterError, RuleError, ScenarioError, StudioError
from airflock.view import agent_colours
from airflock.view.agent_colours import AgentColours, cluster_labels
from airflock.view.scene import dart_mesh, scenario_geometry, velocity_quaternions

PRESET = "vasarhelyi_2018/4ms"
FEW = {"agents": 12}
LAW = """
from dataclasses import dataclass
import airflock
COMMAND = "velocity"
@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    pull: float = airflock.quantity(1.0, "m/s", low=0.0, high=9.0, meaning="how fast it flies")
def decide(own, p):
    return p.pull * own.hx, p.pull * own.hy, 0.0
"""


@pytest.fixture
def interpreted(monkeypatch):
    """Flights are interpreted: compiling them would add nothing to what is tested."""
    plainly = lambda *given, **named: Flight(*given, **{**named, "device": "python"})  # noqa: E731
    monkeypatch.setattr("airflock.studio.flight_pane.Flight", plainly)


@pytest.fixture
def player():
    made = Player(FlightRequest(PRESET, FEW, seed=3))
    made.faults = []
    made.fault = made.faults.append
    return made


def test_trails_are_taken_away_and_begin_where_agents_are_when_they_are_shown_again():
    pieces = []
    view = SimpleNamespace(
        trail=lambda begin, end, tone, done: pieces.append((begin[0, 0], end[0, 0], done)), no_trails=pieces.clear
    )
    trails = Trails(view)

    def fly(*places):
        for x in places:
            trails.draw(np.full((1, 3), float(x)), np.zeros((1, 3)))

    fly(*range(FRAMES_PER_PIECE + 2))
    assert pieces[:2] == [(0.0, 1.0, False), (0.0, 2.0, False)]
    assert pieces[-2:] == [(0.0, FRAMES_PER_PIECE, True), (FRAMES_PER_PIECE, FRAMES_PER_PIECE + 1.0, False)]
    trails.show(False)
    fly(50, 51)
    assert pieces == []
    trails.show(True)
    fly(100, 101)
    assert pieces == [(100.0, 101.0, False)]


@given(st.floats(1e-3, 1.0), st.floats(0.01, 50.0), st.lists(st.floats(0.0, 0.25), max_size=40))
def test_pace_flies_every_step_that_is_due_and_no_more(dt, speed, frames):
    pace = PageClock(dt, speed)
    flown = sum(pace.due(elapsed) for elapsed in frames) * dt
    assert flown <= sum(frames) * speed + 1e-6
    assert flown > sum(frames) * speed - dt - 1e-6


def test_a_page_that_was_held_up_does_not_leap():
    assert PageClock(0.01).due(100.0) == 25


@given(st.floats(-100.0, 0.0), st.floats(0.1, 1000.0), st.floats(0.0, 1.0))
def test_a_slider_stays_in_the_declared_range_and_holds_the_value(low, high, share):
    value = min(low + share * (high - low), high)
    begin, end = slider_span(low, high, value)
    assert low <= begin <= value <= end <= high
    assert end > begin


@pytest.mark.parametrize("name", sorted(presets()))
def test_every_number_of_the_law_has_a_slider_that_can_reach_its_value(name):
    scenario = airflock.load(name)
    found = scenario_controls(scenario, shipped_study_axes(scenario))
    keys = [control.key for controls in found.values() for control in controls]
    declared = [f"model.{name}" for name, kind, _ in declarations(scenario.parameters) if isinstance(kind, Quantity)]
    assert len(keys) == len(set(keys)) and set(declared) <= set(keys)
    for controls in found.values():
        for control in controls:
            assert control.value == scenario_value(scenario, control.key)
            if control.options:
                assert control.value in control.options
            else:
                assert control.low <= control.value <= control.high and 0.0 < control.step <= control.high - control.low


def test_sliders_span_what_a_study_searched_or_what_is_usual():
    scenario = airflock.load("vasarhelyi_2018/8ms")
    found = {
        c.key: c for controls in scenario_controls(scenario, shipped_study_axes(scenario)).values() for c in controls
    }
    axes = {axis.key: axis for axis in load_study("vasarhelyi_2018/8ms").space.axes}
    assert "model.p_rep" in axes
    for key, axis in axes.items():
        assert (found[key].low, found[key].high) == (axis.low, axis.high)
    assert (found["wind.east"].low, found["wind.east"].high) == (-10.0, 10.0)
    assert list(scenario_controls(scenario))[:4] == [f"model: {part}" for part in scenario.model.parts]
    with pytest.raises(ParameterError, match="no span inside"):
        quantity(1.0, "m", low=0.0, high=2.0, usual=(0.0, 3.0), meaning="too wide")


def test_parts_of_a_law_name_its_parameters():
    law = dict(vars(vasarhelyi_2018))
    with pytest.raises(RuleError, match="PARTS"):
        model({**law, "PARTS": {"repulsion": ("p_rap",)}}, "mistyped")


def test_any_key_is_set_as_on_the_command_line(interpreted, player):
    scenario = player.scenario
    assert parse_setting("delay = 400 ms", scenario) == ("radio.delay", "400 ms")
    assert parse_setting("goals.points=[[0, 5]]", scenario) == ("goals.points", [[0, 5]])
    for wrong, word in (
        ("p_rap = 1", "p_rep"), ("p_rep", "KEY = VALUE"), ("", "KEY = VALUE"), ("= 3", "KEY = VALUE"),
        ("agents = 5", "under Play"), ("dt = 0.1", "motion step"), ("duration = 5", "scenario file"),
    ):  # fmt: skip
        with pytest.raises(ScenarioError, match=word):
            parse_setting(wrong, scenario)
    player.change(*parse_setting("delay = 400 ms", scenario))
    assert player.scenario.radio.delay == 0.4 and "--set 'radio.delay=400 ms'" in player.command


def test_the_example_in_the_hint_of_any_key_can_be_set(interpreted, player):
    for example in re.findall(r"[a-z.]+ = .*?(?=, or |$)", KEY_EXAMPLE):
        player.change(*parse_setting(example, player.scenario))
    assert player.scenario.radio.delay == 0.4 and player.scenario.goals.points == ((0.0, 50.0, 0.0),)


@pytest.mark.parametrize("name", ["my flock's $(x); é.toml", "-rf.toml", "-h"])
def test_the_command_that_opens_a_scenario_again_is_safe_to_paste(interpreted, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes(presets()[PRESET].read_bytes())
    law = tmp_path / "a law.py"
    law.write_text(LAW)
    made = Player(FlightRequest(name, {"agents": 3}, seed=5, law=str(law), trust=True))
    made.change("radio.delay", "400 ms")
    words = shlex.split(made.command)
    assert words[:2] == ["airflock", "watch"] and Path(words[2]) == Path(name) and not words[2].startswith("-")
    assert words[3:6] == ["--law", str(law), "--trust"]
    assert words[6:] == ["--set", "agents=3", "--set", "radio.delay=400 ms", "--seed", "5"]


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("photo.toml", b"\x89PNG\r\n\x1a\n\xff", "UTF-8"),
        ("story.toml", b"Once upon a time", "TOML"),
        ("flight.nc", b"agents = 3", "end with .toml"),
        ("empty.toml", b"agents = 3", "lacks|missing|model"),
        ("code.toml", b'[model]\nkind = "evil.py"\n', "evil.py"),
    ],
)
def test_an_upload_that_is_no_scenario_is_told_and_leaves_nothing(player, tmp_path, monkeypatch, name, content, word):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "evil.py").write_text("raise SystemExit\n")
    player.fly(20)
    flown, room = player.flight, object.__new__(OpeningPanel)
    room.player, room.page = player, None
    player.ask(lambda: room.take(name, content))
    player.tick(0.0)
    assert len(player.faults) == 1 and re.search(word, player.faults[0]) and name in player.faults[0]
    assert player.flight is flown and player.note == player.faults[0]
    assert [path.name for path in tmp_path.iterdir()] == ["evil.py"]


def test_an_uploaded_scenario_flies(interpreted, player, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (presets()["vasarhelyi_2018/6ms"]).read_bytes()
    (tmp_path / "mine.toml").write_text("")  # a name that is taken
    shown = []
    room = object.__new__(OpeningPanel)
    room.player = player
    room._opened = lambda where: shown.append(player.open(where))
    room.take("C:\\flocks\\mine.toml", text)
    assert shown and player.scenario.parameters.v_flock == 6.0 and player.side.origin.where == "mine-2.toml"
    assert (tmp_path / "mine-2.toml").read_bytes() == text


def test_a_flight_that_was_tuned_is_saved_and_flown_again_with_the_same_bits(player, tmp_path):
    player.fly(150)
    player.change("model.p_rep", 0.2)
    player.fly(77)
    player.push(3, 5.0)
    player.fly(200)
    saved = player.save_recording(tmp_path / "tuned.nc")
    recording = load_recording(saved)
    again = airflock.simulate(airflock.load(PRESET, {**FEW, "duration": 4.27}), 3, events=player.flight.events)
    np.testing.assert_array_equal(recording["position"], again["position"])
    last = round(float(recording["time"][-1]) / 0.01)
    live = airflock.open(player.preset, 3, events=player.flight.events).advance(steps=last)
    np.testing.assert_array_equal(recording["position"].values[-1, :, 0], live.state[:2])
    assert [event.kind for event in player.flight.events] == ["change", "push"]


def test_going_back_gives_up_what_came_after(player):
    for _ in range(50):
        player.fly(20)
    before = player.flight.time
    player.change("model.p_rep", 0.3)
    player.fly(20)
    player.go_back(4.1)
    assert player.flight.time == pytest.approx(4.1) and before > 4.1
    assert player.is_paused and not player.flight.events and not player.changed
    other = airflock.open(player.preset, 3).advance(steps=player.flight.step)
    np.testing.assert_array_equal(player.flight.state, other.state)


def test_undo_takes_back_one_change_and_the_preset_all(player):
    player.fly(10)
    for value in (0.2, 0.3):
        player.change("model.p_rep", value)
    player.change("body.tau", 0.5)
    preset = scenario_value(player.preset, "model.p_rep")
    assert player.side.undo() == {"body.tau": scenario_value(player.preset, "body.tau")}
    assert player.side.undo() == {"model.p_rep": 0.2}
    assert scenario_value(player.scenario, "model.p_rep") == 0.2
    assert player.side.undo_all() == {"model.p_rep": preset} and player.changed == {}
    assert scenario_value(player.scenario, "model.p_rep") == preset


def test_a_tuned_scenario_is_a_file_that_loads_to_the_same_scenario(player, tmp_path):
    player.change("model.p_rep", 0.2)
    player.change("body.tau", 0.5)
    path = player.save_toml(tmp_path / "tuned.toml")
    found = airflock.load(path)
    assert found.parameters == player.scenario.parameters and found.body.numbers == player.scenario.body.numbers
    assert found.agents == 12 and "tuned by hand" in path.read_text()
    assert (
        player.command == f"airflock watch {PRESET} --set agents=12 --set model.p_rep=0.2 --set body.tau=0.5 --seed 3"
    )


def test_a_refused_change_is_told_and_changes_nothing(player):
    player.ask(lambda: player.change("model.p_rep", -7.0))
    player.tick(0.0)
    assert "model.p_rep" in player.note and player.faults == [player.note]
    assert not player.changed and not player.flight.events


def test_a_law_that_stops_flying_stops_the_flight_and_the_moment_before_is_there(tmp_path):
    law = tmp_path / "wild.py"
    law.write_text(
        "from dataclasses import dataclass\nfrom airflock import Parameters as Record\n"
        "from airflock import quantity\n\n"
        "COMMAND = 'velocity'\n\n"
        "@dataclass(frozen=True, kw_only=True)\nclass Parameters(Record):\n"
        "    push: float = "
        "quantity(1.0, 'm/s', low=0.0, high=3e38, meaning='push')\n\n"
        "def decide(own, p):\n    return p.push * (own.hx + 1.0), own.hy, own.hz\n"
    )
    text = "agents = 3\nduration = 10.0\n[model]\nkind = 'wild.py'\n[world]\nside = 100.0\n"
    text += "[metrics]\nkind = 'order'\n"
    (tmp_path / "wild.toml").write_text(text)
    player = Player(FlightRequest(str(tmp_path / "wild.toml"), trust=True))
    player.fly(500)
    flock = DrawnFlock(player.side, np.zeros(3))
    shown = flock.position.copy()
    player.change("model.push", 3e38)
    player.fly(500)
    assert "agent" in player.failure_message and "finite" in player.failure_message
    assert not np.isfinite(player.motion[0]).all()
    flock.look()
    np.testing.assert_array_equal(flock.position, shown)  # a page goes on showing what it can
    noted = measures.PaneChartData(10.0, 10.0)
    noted.note(player.flight, flock.velocity, flock.pairs)
    assert np.isfinite(np.array(noted.instants)[:, 1:]).all()
    player.go_back(player.flight.time)
    assert not player.failure_message and np.isfinite(player.flight.state).all()


def test_moments_are_thinned_and_the_last_before_a_time_is_found():
    class Kept:
        def __init__(self, time):
            self.time, self.bytes = time, np.zeros(1)

    moments = KeptSnapshots(1.0)
    for second in range(2000):
        if moments.due(float(second)):
            moments.keep(float(second), (Kept(second),))
    assert len(moments) <= 400 and moments.interval > 1.0
    for when in (0.0, 17.0, 999.5, 1999.0):
        assert when - moments.interval <= moments.at(when)[0].time <= when


def test_darts_point_where_agents_fly():
    rng = np.random.default_rng(5)
    velocity = rng.normal(size=(50, 3))
    w, x, y, z = velocity_quaternions(velocity).T.astype(float)
    nose = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], 1)
    np.testing.assert_allclose(nose, velocity / np.linalg.norm(velocity, axis=1)[:, None], atol=1e-6)
    assert dart_mesh(2.0)[0][:, 0].max() == pytest.approx(1.2)


def test_near_pairs_of_a_periodic_world_are_those_of_the_nearest_image():
    rng = np.random.default_rng(7)
    side = 10.0
    where = np.column_stack([rng.uniform(-5.0, 5.0, (60, 2)), np.zeros(60)])
    off = where[:, None] - where[None]
    off -= side * np.round(off / side) * (1.0, 1.0, 0.0)
    far = np.linalg.norm(off, axis=2) + 1e9 * np.eye(60)
    pairs = measures.AgentPairs(where, (side, side, 0.0))
    assert pairs.nearest() == pytest.approx(far.min())
    assert len(pairs.within(1.0)) == (far < 1.0).sum() // 2
    shown = pairs.neighbours()
    assert (np.abs(shown[:, 1] - shown[:, 0]) <= 0.5 * side).all()


@pytest.mark.parametrize(
    "name", ["vasarhelyi_2018/obstacles", "kidger/city", "couzin_2002/torus", "vicsek_1995/ordered"]
)
def test_a_stage_holds_the_flock_and_what_stands_in_its_world(interpreted, name):
    player = Player(FlightRequest(name, {"agents": 5}))
    position, _ = player.motion
    stage = scenario_geometry(player.scenario, position)
    assert stage.span > 0.0 and math.isfinite(stage.span)
    away = np.abs(position - stage.centre)[:, :2].max()
    assert away <= 2.0 * stage.span
    for solid in stage.solids:
        assert np.isfinite(solid.vertices).all() and solid.faces.max() < len(solid.vertices)
    assert bool(stage.solids) == (name in ("vasarhelyi_2018/obstacles", "kidger/city"))


@pytest.mark.parametrize("way", agent_colours.MOTION_COLOURINGS)
def test_colours_of_different_motions_differ(way):
    velocity = np.array([[1.0, 0.0, 0.0], [0.0, 4.0, 0.0], [-2.0, 0.0, 0.0]])
    position = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.0, 0.0, 9.0]])
    found = agent_colours.motion_colours(way, position, velocity, 4.0, (0.0, 10.0))
    assert len({tuple(c) for c in found.colours.tolist()}) == 3
    assert way in found.key


@given(st.integers(1, 60), st.floats(0.0, 3.0), st.booleans(), st.integers(0, 2**32 - 1))
def test_clusters_are_what_links_between_agents_join(count, distance, periodic, seed):
    rng = np.random.default_rng(seed)
    where = np.column_stack([rng.uniform(-5.0, 5.0, (count, 2)), np.zeros(count)])
    off = where[:, None] - where[None]
    if periodic:
        off -= 10.0 * np.round(off / 10.0) * (1.0, 1.0, 0.0)
    linked = np.linalg.norm(off, axis=2) < distance
    for middle in range(count):  # Warshall's closure
        linked |= linked[:, middle : middle + 1] & linked[middle]
    linked[np.diag_indices(count)] = distance > 0.0
    alone = linked.sum(axis=1) < 2
    expected = np.where(alone, -1, linked.argmax(axis=1))
    box = np.array([10.0, 10.0, 1e9]) if periodic else None
    np.testing.assert_array_equal(cluster_labels(where, distance, box), expected)


GROUPS = [{"name": "slow", "agents": [0, 3], "model": {"v_flock": 3.0}}, {"name": "rest"}]


def test_agents_are_coloured_by_group_fault_cluster_and_their_own_numbers(interpreted):
    player = Player(FlightRequest(PRESET, {**FEW, "groups": GROUPS}, 3))
    player.flight.fault("motor", 5)
    player.fly(30)
    flock, shading = DrawnFlock(player.side, np.zeros(3)), AgentColouring()
    assert {"group", "fault", "cluster", "model.v_flock", "nearest agent"} <= set(available_colourings([flock]))

    def seen(way):
        shading.name = way
        return shading.of([flock], flock.velocity, 6.0, (0.0, 0.0))

    assert seen("group").values.tolist() == [0, 1, 1, 0, *[1] * 8] and "slow" in seen("group").key
    assert [k for k, v in enumerate(seen("fault").values) if v == 0] == [5] and "motor" in seen("fault").key
    assert seen("model.v_flock").values.tolist() == [3.0, 4.0, 4.0, 3.0, *[4.0] * 8]
    tones = seen("model.v_flock").colours
    assert (tones[0] == tones[3]).all() and (tones[0] != tones[1]).any()
    assert "3" in seen("model.v_flock").key and "m/s" in seen("model.v_flock").key
    where = flock.position.astype(float)
    apart = np.linalg.norm(where[:, None] - where, axis=2) + 1e9 * np.eye(12)
    np.testing.assert_allclose(seen("nearest agent").values, apart.min(axis=0), rtol=1e-6)
    assert (seen("cluster").values == cluster_labels(where, player.scenario.resolved_metrics().r_cluster)).all()


def test_two_flocks_have_one_scale_and_one_list_of_names():
    first = AgentColours("fault", "names", np.array([0, -1]), names=("motor",), note="sound")
    second = AgentColours("fault", "names", np.array([1, 0]), names=("stuck", "motor"), note="sound")
    both = joined_colours([first, second])
    assert both.names == ("motor", "stuck") and both.values.tolist() == [0, -1, 0, 1]


def test_only_the_token_or_its_cookie_opens_the_page():
    name, token = "airflock_8080", "abc"
    assert access_token.check_access("/?token=abc", "", name, token) == (True, True)
    assert access_token.check_access("/x.js", "airflock_8080=abc", name, token) == (True, False)
    for path, cookie in (("/", ""), ("/?token=", ""), ("/?token=ab", "airflock_8081=abc"), ("/", "airflock_8080=abd")):
        assert access_token.check_access(path, cookie, name, token)[0] is False


@pytest.mark.parametrize("path", ["//[", "//[v1.x]:1]/?token=abd", "/?token=%ff", "", "?", "//a:b:c/?token"])
def test_what_is_no_address_is_turned_away(path):
    assert access_token.check_access(path, "airflock_8080=abd", "airflock_8080", "abc") == (False, False)
    assert (
        access_token.check_access("/", "airflock_8080=abc", "airflock_8080", "abc", "http://[", "localhost:8080")[0]
        is False
    )


def test_a_page_of_another_port_cannot_use_the_cookie():
    given = "/", "airflock_8080=abc", "airflock_8080", "abc"
    assert access_token.check_access(*given, "http://localhost:8080", "localhost:8080") == (True, False)
    for origin in ("http://localhost:9999", "http://evil.example", "null"):
        assert access_token.check_access(*given, origin, "localhost:8080")[0] is False


@pytest.mark.parametrize("host", ["256.1.1.1", "::1", "192.0.2.1"])
def test_a_host_that_is_not_this_machine_is_named_in_one_line(host):
    from airflock.studio.browser_view import BrowserView

    for port in (0, 8080):
        with pytest.raises(StudioError, match=f"host = {re.escape(host)}: .*; give"):
            BrowserView(host, port, "page")


def test_a_port_in_use_is_one_line():
    from airflock.studio.browser_view import BrowserView

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(StudioError, match="port"):
            BrowserView("127.0.0.1", taken.getsockname()[1], "page")


def test_another_number_of_agents_that_cannot_be_leaves_the_flight_as_it_was(player):
    player.fly(10)
    with pytest.raises(ScenarioError):
        player.reset(settings={"agents": 10**8})
    assert player.flight.step == 10 and player.side.settings == FEW


def test_a_recording_is_flown_again_with_its_events(player, tmp_path):
    player.fly(150)
    player.change("model.p_rep", 0.2)
    player.fly(150)
    again = Player(FlightRequest(str(player.save_recording(tmp_path / "tuned.nc"))))
    again.fly(300)
    np.testing.assert_array_equal(again.flight.state, player.flight.state)
    assert again.seed == 3 and scenario_value(again.scenario, "model.p_rep") == 0.2
    assert airflock.load(again.save_toml(tmp_path / "again.toml")).agents == 12


def test_a_flight_log_is_refused_in_one_line(tmp_path):
    log = airflock.simulate(airflock.load(PRESET, {**FEW, "duration": 1.0}), 1)
    log.attrs = {}
    airflock.save(log, tmp_path / "log.nc")
    with pytest.raises(airflock.AirflockError, match="airflock replay"):
        Player(FlightRequest(str(tmp_path / "log.nc")))


def test_a_fork_without_a_change_flies_the_same_and_its_change_is_all_that_differs(player):
    player.fly(130)
    player.fork()
    player.fly(150)
    a, b = player.sides
    np.testing.assert_array_equal(a.flight.state, b.flight.state)
    player.change("model.p_rep", 0.3)
    player.fly(200)
    assert scenario_differences(a.scenario, b.scenario) == [
        ("model.p_rep", scenario_value(a.preset, "model.p_rep"), 0.3)
    ]
    assert not a.flight.events and [event.kind for event in b.flight.events] == ["change"]
    assert a.flight.time == b.flight.time and (a.flight.state != b.flight.state).any()
    alone = airflock.open(a.preset, 3).advance(steps=a.flight.step)
    np.testing.assert_array_equal(a.flight.state, alone.state)
    player.go_back(1.0)
    assert player.sides == [a] and a.flight.time == 1.0


def test_two_parameter_sets_side_by_side_meet_the_same_noise():
    player = Player(FlightRequest(PRESET, FEW, 3, compared_with={"radio.delay": 2.0}))
    player.fly(300)
    for side, delay in zip(player.sides, (1.0, 2.0), strict=True):
        alone = airflock.open(airflock.load(PRESET, {**FEW, "radio.delay": delay}), 3).advance(steps=300)
        np.testing.assert_array_equal(side.flight.state, alone.state)
    assert player.where == f"{PRESET} | radio.delay = 2.0"


def test_what_differs_stands_with_its_unit():
    a, b = (
        airflock.load(PRESET, {**FEW, "radio.delay": delay, "agents": count}) for delay, count in ((1, 12), (2, 13))
    )
    told = difference_table_html(a, b)
    assert "<td>radio.delay (s)</td>" in told and "<td>agents</td>" in told


def test_flights_of_other_dimensions_are_not_compared():
    with pytest.raises(StudioError, match="share one scene"):
        Player(FlightRequest(PRESET, {"agents": 3}, compared_with="couzin_2002/torus"))


def test_going_back_twice_never_meets_a_past_that_was_given_up(player):
    for _ in range(50):
        player.fly(20)
    player.go_back(3.0)
    player.change("model.p_rep", 0.3)
    player.fly(100)
    player.go_back(9.0)
    assert player.flight.time <= 4.0 and [event.kind for event in player.flight.events] == ["change"]


def test_back_flies_again_what_was_done_meanwhile(player):
    for step in range(12):
        player.fly(25)
        if step == 5:
            player.push(2, 4.0)
        if step == 7:
            player.change("model.p_rep", 0.3)
    live = airflock.open(player.preset, 3, events=player.flight.events).advance(steps=230)
    player.go_back(2.3)
    np.testing.assert_array_equal(player.flight.state, live.state)
    assert player.changed == {"model.p_rep": 0.3}


def test_a_gust_blows_for_its_time_and_is_an_event(interpreted, player):
    player.fly(20)
    player.gust(6.0, 0.0, 0.5)
    for _ in range(1000):  # until the thread that makes the windy flight is done
        player.fly(1)
        if player.scenario.wind.east:
            break
        time.sleep(0.005)
    began = player.flight.step - 1
    assert player.scenario.wind.east == 6.0
    player.fly(100)
    assert player.scenario.wind.east == 0.0
    last = player.flight.events[-1]
    assert last.kind == "change" and last.step == began + 50 and last.data == {"wind.east": 0.0, "wind.north": 0.0}


def test_an_obstacle_stands_where_it_was_thrown_and_nobody_is_walled_in(interpreted):
    player = Player(FlightRequest("vasarhelyi_2018/obstacles", FEW, 3))
    position, _ = player.motion
    with pytest.raises(StudioError, match="agent 4 is where"):
        player.throw_obstacle(*map(float, position[4, :2]), 6.0)
    gaps = [(x, y) for x in range(-100, 101, 10) for y in range(-100, 101, 10)
            if np.abs(position[:, :2] - (x, y)).max(axis=1).min() > 20.0]  # fmt: skip
    before = len(player.scenario.world.obstacles)
    player.throw_obstacle(*map(float, gaps[0]), 6.0)
    corners = np.array(player.scenario.world.obstacles[-1])
    assert len(player.scenario.world.obstacles) == before + 1
    np.testing.assert_allclose(corners.mean(axis=0), gaps[0])
    player.side.undo()
    assert len(player.scenario.world.obstacles) == before


def test_a_goal_of_a_flat_world_is_moved(interpreted):
    goals = {"goals.kind": "points", "goals.points": [[40.0, 0.0, 0.0], [-60.0, 50.0, 0.0]]}
    player = Player(FlightRequest(PRESET, {**FEW, **goals}, 1))
    player.move_goal(0, [10.0, -20.0, 0.0])
    np.testing.assert_allclose(player.scenario.waypoints(), [[10.0, -20.0, 0.0], [-60.0, 50.0, 0.0]])


def test_a_goal_is_moved_and_the_others_stay(interpreted):
    player = Player(FlightRequest("kidger/city", {"agents": 4}, 1))
    before = player.scenario.waypoints()
    player.move_goal(1, [10.0, -20.0, 80.0])
    after = player.scenario.waypoints()
    np.testing.assert_allclose(after[1], [10.0, -20.0, 80.0])
    np.testing.assert_allclose(np.delete(after, 1, 0), np.delete(before, 1, 0), atol=1e-4)


def test_what_an_agent_perceives_is_drawn_where_it_is(interpreted):
    player = Player(FlightRequest("vasarhelyi_2018/real_4ms", {**FEW, "model.r0_rep": 50.0}, 3))
    player.fly(400)
    seen = next(seen for seen in map(player.flight.look, range(12)) if len({any(term) for term in seen.terms}) == 2)
    drawn = PerceptLines().of(player.side, seen.agent, 1.0, 6.0)
    heard, _ = drawn.lines["heard"]
    near = [other for other, term in zip(seen.heard, seen.terms, strict=True) if any(term)]
    assert 0 < len(near) < len(seen.heard) and f"notices {len(near)}" in drawn.html
    np.testing.assert_allclose(heard[:, 0], np.broadcast_to(seen.true[:3], heard[:, 0].shape))
    np.testing.assert_allclose(heard[:, 1], [other.state[:3] for other in near])
    crossed = drawn.lines["ghosts"][0].reshape(-1, 4, 3).mean(axis=1)
    np.testing.assert_allclose(crossed, [other.state[:3] for other in seen.heard], atol=1e-6)
    believed = drawn.lines["measured"][0].reshape(-1, 4, 3).mean(axis=1)  # itself, then each that it hears
    np.testing.assert_allclose(believed[0], seen.own[:3])
    others = player.flight.measured[:2, [other.who for other in seen.heard]].T
    np.testing.assert_allclose(believed[1:, :2], others, atol=1e-5)
    shaft = drawn.lines["command"][0][0]
    np.testing.assert_allclose((shaft[1] - shaft[0])[:2], np.array(seen.command) * 5.0 / 6.0)
    assert f"hears {len(seen.heard)} others" in drawn.html


@pytest.mark.parametrize(("agents", "said"), [(1, "hears nobody<br>"), (2, "hears 1 other, at most ")])
def test_whom_few_agents_hear_is_told_in_words(interpreted, agents, said):
    player = Player(FlightRequest(PRESET, {"agents": agents, "radio.range": 1000.0}, 3))
    player.fly(300)
    assert said in PerceptLines().of(player.side, 0, 1.0, 6.0).html


def test_repulsion_and_alignment_of_a_selected_agent_are_those_of_the_paper(interpreted):
    """Arrows of a law whose neighbours act through one vector: Eqs 2-3, and Eqs 4-7 (Vásárhelyi et al. 2018)."""
    player = Player(FlightRequest(PRESET, {"agents": 30, "start.separation": 9.0}, seed=2))
    player.fly(100)
    seen, p = player.flight.look(4), player.scenario.parameters
    push, align = np.zeros(2), np.zeros(2)
    for other in seen.heard:
        apart = np.array(other.state[:2]) - seen.own[:2]
        r, dv = np.hypot(*apart), np.array(other.state[3:5]) - seen.own[3:5]
        push -= p.p_rep * max(p.r0_rep - r, 0.0) * apart / r
        far = r - p.r0_frict
        brake = (
            0.0
            if far <= 0.0
            else min(far * p.p_frict, np.sqrt(max(2 * p.a_frict * far - (p.a_frict / p.p_frict) ** 2, 0)))
        )
        align += p.c_frict * max(1.0 - max(p.v_frict, brake) / np.hypot(*dv), 0.0) * dv
    vectors = {word: vector for word, vector, _ in _named_vectors(seen, player.scenario.model)}
    assert np.hypot(*push) > 0.1 and np.hypot(*align) > 0.01
    np.testing.assert_allclose(vectors["repulsion"][:2], push, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(vectors["alignment"][:2], align, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(vectors["repulsion"] + vectors["alignment"], [seen.sums.x, seen.sums.y, 0.0], atol=1e-5)


def test_rays_of_a_selected_boid_end_where_the_world_begins():
    side = FlightPane(FlightSource.of("kidger/city", {"agents": 6}), 1)
    side.flight = airflock.open(side.preset, 1, device="python").advance(steps=30)
    points, tones = PerceptLines().of(side, 0, 1.0, 60.0).lines["rays"]
    length = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
    free = (tones == agent_colours.GREEN).all(axis=1)
    assert len(points) >= 1 and (length <= side.scenario.parameters.r_ray + 1e-4).all()
    np.testing.assert_allclose(length[free], length.max(), rtol=1e-4)
    assert (length[~free] < length[free].max(initial=np.inf)).all()


def test_a_bird_tells_what_the_wakes_of_others_save_it():
    side = FlightPane(FlightSource.of("dimock_2003/physical", {"agents": 3, "wing.segments": "5"}), 1)
    side.flight = airflock.open(side.preset, 1, device="python").advance(steps=2)
    drawn = PerceptLines().of(side, 1, 1.0, 13.0)
    legs, _ = drawn.lines["wake"]
    slider_span = side.scenario.wing.span
    assert len(legs) == 6  # two legs a bird
    np.testing.assert_allclose(np.abs(legs[:, 0, 1] - np.repeat(side.motion[0][:, 1], 2)), 0.5 * slider_span, rtol=1e-5)
    assert (legs[:, 1, 0] < legs[:, 0, 0]).all() and "of a lone bird" in drawn.html


@given(st.floats(-1e3, 1e5), st.floats(0.0, 1e5), st.integers(0, 600))
def test_an_axis_ends_at_round_numbers_just_beyond_what_is_shown(first, span, count):
    values = first + span * np.linspace(0.0, 1.0, count)
    low, high = browser_view.round_ends(values)
    assert low < high
    if count:
        slack = 1e-6 * (high - low)
        assert low - slack <= values[0] and values[-1] <= high + slack
    if count > 1 and span > 1e-3:
        part = (values[-1] - values[0]) / browser_view.PARTS_PER_SPAN * 2.5  # at most: the next of 1, 2, 5
        assert values[0] - low <= part * 1.001 and high - values[-1] <= part * 1.001


def test_an_axis_is_told_only_where_a_round_end_is_passed():
    class Handle:
        told = 0

        def __setattr__(self, name, value):
            object.__setattr__(self, name, value)
            Handle.told += name == "scales"

    handle = Handle()
    made = browser_view.Chart(handle)
    for count in range(2, 500):  # 100 s, five moments a second
        time = 0.2 * np.arange(count)
        made.data = time, time**2
        low, high = handle.scales["x"]["range"]
        assert low <= time[0] and time[-1] <= high
    assert handle.told < 30


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=50), st.integers(1, 50))
def test_a_chart_with_missing_values_is_told_ends_that_hold_the_others(values, missing):
    """B has no value of its own before it was changed: nan ends the axis of the page nowhere, and nothing is drawn."""
    time = np.arange(float(len(values) + missing))
    first, second = np.array([*values, *values[:1] * missing]), np.array([math.nan] * missing + values)
    low, high = browser_view.axis_ranges((time, first, second))["y"]
    assert low < high and low <= min(values) + 1e-6 * (high - low) and max(values) <= high + 1e-6 * (high - low)
    low, high = browser_view.axis_ranges((time, np.full(len(time), math.nan)))["y"]
    assert low < high


@given(st.floats(-1e6, 1e6), st.floats(0.0, 1e-6), st.integers(1, 50))
def test_a_chart_of_equal_values_is_told_ends_apart_from_each_other(value, share, count):
    """Fish fly at 3 m/s but for rounding; ends that the page found itself were the same number, and it hung."""
    time = np.arange(float(count))
    values = value * (1.0 + share * np.linspace(-1.0, 1.0, count))
    low, high = browser_view.axis_ranges((time, values, values[::-1]))["y"]
    assert low - 1e-12 <= values.min() and values.max() <= high + 1e-12 and high - low >= max(abs(value), 1e-12)


def test_a_page_scales_the_values_of_a_chart_itself_where_it_can():
    time = np.arange(30.0)
    assert browser_view.axis_ranges((time, time**2, np.sqrt(time))) == {"x": browser_view.round_ends(time)}


@given(st.lists(st.floats(0.0, 30.0), min_size=1, max_size=200))
def test_shares_of_a_histogram_add_up_to_one(values):
    made = measures.Histogram(10.0)
    made.add(np.array(values))
    edges, shares = made.steps
    assert shares[::2].sum() == pytest.approx(1.0)
    inside = np.array(values) < 2.5  # ten bins of a quarter
    assert shares[::2][:10].sum() == pytest.approx(inside.mean())
    assert len(edges) == len(shares) and edges[0] == 0.0 and edges[-1] == 10.0


def test_links_by_radio_join_the_pairs_in_range_and_pale_with_the_loss():
    rng = np.random.default_rng(4)
    where = np.column_stack([rng.uniform(-60.0, 60.0, (40, 2)), np.zeros(40)])
    pairs, length = measures.AgentPairs(where).nearest_pairs_within(30.0)
    far = np.linalg.norm(where[:, None] - where[None], axis=2)
    assert {tuple(sorted(p)) for p in pairs.tolist()} == {
        tuple(p) for p in np.argwhere(np.triu(far < 30.0, 1)).tolist()
    }
    np.testing.assert_allclose(length, far[pairs[:, 0], pairs[:, 1]])
    lossy = airflock.load(PRESET, {"radio.loss": 0.5})
    at, share = arrival_curve(lossy.radio.rule, lossy.radio.numbers)
    np.testing.assert_allclose(np.interp([0.0, 40.0, 80.0], at, share), [1.0, 0.875, 0.5], atol=1e-4)


def test_an_agent_that_left_is_nowhere_and_the_others_fly_on(interpreted, player):
    player.fly(50)
    before = player.motion[0].copy()
    player.flight.remove(3)
    position, velocity = player.motion
    assert np.isfinite(position).all() and position[3, 2] < -1e6 and not velocity[3].any()
    np.testing.assert_array_equal(np.delete(position, 3, 0), np.delete(before, 3, 0))
    player.fly(50)
    assert not player.failure_message
    assert measures.AgentPairs(player.motion[0]).nearest() < 300.0


def test_a_fault_is_an_event_and_back_takes_it_away(interpreted, player):
    player.fly(100)
    player.flight.fault("radio_silent", 2)
    player.fly(150)
    assert [event.kind for event in player.flight.events] == ["fault"] and len(player.flight.faults) == 1
    live = player.flight.state
    player.fly(50)
    player.go_back(2.5)
    np.testing.assert_array_equal(player.flight.state, live)
    player.go_back(0.5)
    assert not player.flight.events and not player.flight.faults


MOTOR = {"kind": "motor", "at": 0.5, "agents": [2], "share": 0.5}


def test_every_number_of_a_fault_has_a_slider_inside_its_range():
    faulty = airflock.load("vasarhelyi_2018/faulty")
    found = [control for part in fault_controls(faulty.faults).values() for control in part]
    names = [(k, name) for k, entry in enumerate(faulty.faults) for name in entry.fault.fields]
    assert [control.key for control in found] == [f"faults.{k}.{name}" for k, name in names]
    for control, (k, name) in zip(found, names, strict=True):
        declared = {key: d for key, d, _ in declarations(faulty.faults[k].numbers)}[name]
        assert declared.low <= control.low <= control.value <= control.high <= declared.high
        assert control.high - control.low > 100.0 * control.step and control.value == scenario_value(
            faulty, control.key
        )


def test_a_number_of_a_fault_is_tuned_and_undone_as_any_other(interpreted):
    player = Player(FlightRequest(PRESET, FEW | {"faults": [MOTOR]}, seed=3))
    player.side.fly_to(1.0)
    player.change("faults.0.share", 0.0)
    player.side.fly_to(2.0)
    assert scenario_value(player.scenario, "faults.0.share") == 0.0
    before = player.side.flight.state[2:, 2].copy()
    player.side.fly_to(2.5)
    assert np.array_equal(player.side.flight.state[2:, 2], before), "without a motor it keeps its velocity"
    assert "--set faults.0.share=0" in player.command
    assert player.side.undo() == {"faults.0.share": 0.5} and player.scenario.faults[0].numbers.share == 0.5
    player.change("faults.motor.share", 0.1)
    assert player.side.undo_all() == {"faults.motor.share": 0.5} and not player.changed


def test_a_fault_that_was_set_off_by_hand_has_sliders_but_is_no_part_of_the_scenario(interpreted, player):
    """Its numbers can be undone; the command that opens the scenario again does not name a fault that is not there."""
    player.side.fly_to(1.0)
    start = player.side.flight.snapshot()
    player.side.flight.fault("pretender", [3]).advance(0.5)
    keys = [control.key for part in fault_controls(player.scenario.faults).values() for control in part]
    assert keys == ["faults.0.east", "faults.0.north", "faults.0.up"]
    player.change("faults.0.east", -7.0)
    player.change("faults.0.east", 9.0)
    assert scenario_value(player.scenario, "faults.0.east") == 9.0 and "faults" not in player.command
    assert player.side.undo() == {"faults.0.east": -7.0} and player.side.undo() == {"faults.0.east": 20.0}
    player.change("faults.0.up", 3.0)
    assert player.side.undo_all() == {"faults.0.up": 0.0}
    player.change("faults.0.lasts", 2.0)
    assert player.side.undo() == {"faults.0.lasts": None} and not np.isfinite(player.scenario.faults[0].lasts)
    player.side.restore(start)
    assert not player.scenario.faults and not player.changed


FILE = """
extends = "base.toml"

[radio]
delay = { value = 400, unit = "ms", source = "data sheet" }
"""
BASE = """
extends = "vasarhelyi_2018/4ms"
agents = 6

[[groups]]
name = "heavy"
agents = 2
body = { tau = { value = 2000, spread = 100, unit = "ms" }, a_max = "3 m/s^2" }

[[groups]]
name = "light"

[[faults]]       # weak
kind = "motor"
at = 1.0
share = 0.5
"""


@pytest.mark.parametrize("name", ["base.toml", "mine.toml"])
def test_groups_faults_and_units_are_saved_as_they_were_tuned(interpreted, tmp_path, name):
    """A number of a group could not be saved, and one in its own unit was saved as if it were in that unit."""
    (tmp_path / "mine.toml").write_text(FILE)
    (tmp_path / "base.toml").write_text(BASE)
    player = Player(FlightRequest(str(tmp_path / name), seed=3))
    tuned = {
        "groups.heavy.body.tau": 3.0, "groups.heavy.body.a_max": 4.0, "groups.light.model.p_rep": 0.2,
        "faults.0.share": 0.25, "radio.delay": 0.5,
    }  # fmt: skip
    for key, value in tuned.items():
        player.change(key, value)
    found = airflock.load(player.save_toml(tmp_path / "tuned.toml"))
    assert {key: scenario_value(found, key) for key in tuned} == tuned
    assert found.groups[0].spread == {("b", "tau"): 0.1} and found.faults[0].at == 1.0


def test_a_flight_begins_before_it_is_compiled_and_goes_on_as_if_it_had_been(tmp_path, monkeypatch):
    monkeypatch.setattr("airflock.engine.Flight.ready", property(lambda flight: flight.device == "python"))
    compiled, go = Flight.compile, threading.Event()
    monkeypatch.setattr("airflock.engine.Flight.compile", lambda flight, **how: go.wait() and compiled(flight, **how))
    player = Player(FlightRequest(PRESET, FEW, 3, interpret_first=True))
    player.start()
    assert player.is_compiling and "compiling" in player.status and player.flight.device == "python"
    player.fly(60)
    player.change("model.p_rep", 0.2)
    player.push(3, 2.0)
    player.fly(30)
    seen = player.flight.state
    go.set()
    player.is_paused = True
    while player.is_compiling:
        player.tick(0.01)
    assert player.flight.device == "cpu" and player.flight.step == 90 and not player.failure_message
    np.testing.assert_allclose(player.flight.state, seen, atol=1e-3)  # double against single precision
    whole = airflock.open(player.preset, 3, events=player.flight.events).advance(steps=90)
    np.testing.assert_array_equal(player.flight.state, whole.state)
    player.fly(20)
    again = load_recording(player.save_recording(tmp_path / "begun.nc"))
    np.testing.assert_array_equal(again["position"].values[-1, :, 0], whole.advance(steps=10).state[:2])
    player.go_back(0.4)
    assert player.flight.step == 40
    np.testing.assert_array_equal(player.flight.state, airflock.open(player.preset, 3).advance(steps=40).state)


def test_what_the_compiler_refuses_stops_a_flight_that_has_begun(monkeypatch):
    def refuse(flight, *, aside):
        raise RuleError("model m: a rule does not compile")

    monkeypatch.setattr("airflock.engine.Flight.ready", property(lambda flight: False))
    monkeypatch.setattr("airflock.engine.Flight.compile", refuse)
    player = Player(FlightRequest(PRESET, {"agents": 3}, 3, interpret_first=True))
    player.start()
    while not player.failure_message:
        player.tick(0.01)
    assert player.status == "stopped: model m: a rule does not compile"


def test_a_collision_is_listed_once_while_it_lasts_and_again_when_the_pair_touches_again():
    found = CollisionList()
    for at in (1.0, 1.1, 1.2, 2.0):
        found.add_frame(at, 0, [(3, 5)] if at != 1.2 else [])
    assert found.listed == [(2.0, 0, 3, 5), (1.0, 0, 3, 5)]


def test_going_back_forgets_collisions_that_lie_ahead_and_lists_them_again_when_they_come():
    found = CollisionList()
    for at in (1.0, 1.5, 2.0, 2.5):  # 1 and 2 touch all the time, 3 and 5 from 2 s on
        found.add_frame(at, 0, [(1, 2)] + [(3, 5)] * (at >= 2.0))
    found.go_back(1.5, 1)
    assert found.listed == [(1.0, 0, 1, 2)]
    found.add_frame(1.5, 0, [(1, 2)])
    assert len(found.listed) == 1, "a collision that went on is a new one"
    found.add_frame(2.0, 0, [(3, 5)])
    assert found.listed == [(2.0, 0, 3, 5), (1.0, 0, 1, 2)]
    found.go_back(0.0, 1)
    found.add_frame(0.0, 0, [(3, 5)])
    assert found.listed == [(0.0, 0, 3, 5)]


def test_the_past_of_a_fork_is_that_of_both_sides_and_each_has_its_own_future():
    found = CollisionList()
    found.add_frame(1.0, 0, [(0, 1)])
    found.fork()
    for side, pairs in enumerate(([(0, 1)], [(0, 1), (2, 3)])):
        found.add_frame(2.0, side, pairs)
    assert found.listed == [(2.0, 1, 2, 3), (1.0, BOTH_PANES, 0, 1)]
    found.join(1)
    assert found.listed == [(2.0, 0, 2, 3), (1.0, 0, 0, 1)]
    found.add_frame(2.1, 0, [(0, 1), (2, 3)])
    assert len(found.listed) == 2
