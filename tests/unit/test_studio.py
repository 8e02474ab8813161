"""The studio without a browser: pace, spans of sliders, moments, events, saving, and who may open the page."""

import math
import socket

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import airflock
from airflock.errors import ScenarioError, StudioError
from airflock.recordings.files import load_recording
from airflock.scenarios.files import presets
from airflock.stage import colours
from airflock.stage.scene import dart, stage_of, turned
from airflock.studio import door, measures
from airflock.studio.controls import controls_of, span
from airflock.studio.moments import Moments
from airflock.studio.pace import Pace
from airflock.studio.player import Player, value_of

PRESET = "vasarhelyi_2018/4ms"
FEW = {"agents": 12}


@pytest.fixture
def player():
    made = Player(PRESET, FEW, seed=3)
    made.faults = []
    made.fault = made.faults.append
    return made


@given(st.floats(1e-3, 1.0), st.floats(0.01, 50.0), st.lists(st.floats(0.0, 0.25), max_size=40))
def test_pace_flies_every_step_that_is_due_and_no_more(dt, speed, frames):
    pace = Pace(dt, speed)
    flown = sum(pace.due(elapsed) for elapsed in frames) * dt
    assert flown <= sum(frames) * speed + 1e-6
    assert flown > sum(frames) * speed - dt - 1e-6


def test_a_page_that_was_held_up_does_not_leap():
    assert Pace(0.01).due(100.0) == 25


@given(st.floats(-100.0, 0.0), st.floats(0.1, 1000.0), st.floats(0.0, 1.0))
def test_a_slider_stays_in_the_declared_range_and_holds_the_value(low, high, share):
    value = low + share * (high - low)
    begin, end = span(low, high, value)
    assert low <= begin <= value <= end <= high
    assert end > begin


@pytest.mark.parametrize("name", sorted(presets()))
def test_every_number_of_the_law_has_a_slider_that_can_reach_its_value(name):
    scenario = airflock.load(name)
    for controls in controls_of(scenario).values():
        for control in controls:
            assert control.value == value_of(scenario, control.key)
            if control.is_choice:
                assert control.value in control.options
            else:
                assert control.low <= control.value <= control.high and 0.0 < control.step <= control.high - control.low


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
    early = player.moments.at(4.0)
    player.change("model.p_rep", 0.3)
    player.fly(20)
    player.back(4.1)
    assert player.flight.time == pytest.approx(early.step * 0.01) and player.flight.time <= 4.1 < before
    assert player.paused and not player.flight.events and not player.changed
    other = airflock.open(player.preset, 3).advance(steps=player.flight.step)
    np.testing.assert_array_equal(player.flight.state, other.state)


def test_undo_takes_back_one_change_and_the_preset_all(player):
    player.fly(10)
    for value in (0.2, 0.3):
        player.change("model.p_rep", value)
    player.change("body.tau", 0.5)
    preset = value_of(player.preset, "model.p_rep")
    assert player.undo() == {"body.tau": value_of(player.preset, "body.tau")}
    assert player.undo() == {"model.p_rep": 0.2}
    assert value_of(player.scenario, "model.p_rep") == 0.2
    assert player.to_preset() == {"model.p_rep": preset} and player.changed == {}
    assert value_of(player.scenario, "model.p_rep") == preset


def test_a_tuned_scenario_is_a_file_that_loads_to_the_same_scenario(player, tmp_path):
    player.change("model.p_rep", 0.2)
    player.change("body.tau", 0.5)
    path = player.save_toml(tmp_path / "tuned.toml")
    found = airflock.load(path)
    assert found.parameters == player.scenario.parameters and found.body == player.scenario.body
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
    (tmp_path / "wild.toml").write_text(text)
    player = Player(str(tmp_path / "wild.toml"), trust=True)
    player.fly(500)
    player.change("model.push", 3e38)
    player.fly(500)
    assert "agent" in player.failure and "finite" in player.failure
    player.back(player.flight.time)
    assert not player.failure and np.isfinite(player.flight.state).all()


def test_moments_are_thinned_and_the_last_before_a_time_is_found():
    class Kept:
        def __init__(self, time):
            self.time, self.bytes = time, np.zeros(1)

    moments = Moments(1.0)
    for second in range(2000):
        if moments.due(float(second)):
            moments.keep(float(second), Kept(second))
    assert len(moments) <= 400 and moments.every > 1.0
    for time in (0.0, 17.0, 999.5, 1999.0):
        assert time - moments.every <= moments.at(time).time <= time


def test_darts_point_where_agents_fly():
    rng = np.random.default_rng(5)
    velocity = rng.normal(size=(50, 3))
    w, x, y, z = turned(velocity).T.astype(float)
    nose = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], 1)
    np.testing.assert_allclose(nose, velocity / np.linalg.norm(velocity, axis=1)[:, None], atol=1e-6)
    assert dart(2.0)[0][:, 0].max() == pytest.approx(1.2)


def test_near_pairs_of_a_periodic_world_are_those_of_the_nearest_image():
    rng = np.random.default_rng(7)
    side = 10.0
    where = np.column_stack([rng.uniform(-5.0, 5.0, (60, 2)), np.zeros(60)])
    off = where[:, None] - where[None]
    off -= side * np.round(off / side) * (1.0, 1.0, 0.0)
    far = np.linalg.norm(off, axis=2) + 1e9 * np.eye(60)
    pairs = measures.Pairs(where, (side, side, 0.0))
    assert pairs.nearest() == pytest.approx(far.min())
    assert len(pairs.within(1.0)) == (far < 1.0).sum() // 2
    shown = pairs.neighbours()
    assert (np.abs(shown[:, 1] - shown[:, 0]) <= 0.5 * side).all()


@pytest.mark.parametrize(
    "name", ["vasarhelyi_2018/obstacles", "kidger/city", "couzin_2002/torus", "vicsek_1995/ordered"]
)
def test_a_stage_holds_the_flock_and_what_stands_in_its_world(name):
    player = Player(name, {"agents": 5})
    position, _ = player.motion
    stage = stage_of(player.scenario, position)
    assert stage.span > 0.0 and math.isfinite(stage.span)
    away = np.abs(position - stage.centre)[:, :2].max()
    assert away <= 2.0 * stage.span
    for solid in stage.solids:
        assert np.isfinite(solid.vertices).all() and solid.faces.max() < len(solid.vertices)
    assert bool(stage.solids) == (name in ("vasarhelyi_2018/obstacles", "kidger/city"))


@pytest.mark.parametrize("way", colours.WAYS)
def test_colours_of_different_agents_differ(way):
    velocity = np.array([[1.0, 0.0, 0.0], [0.0, 4.0, 0.0], [-2.0, 0.0, 0.0]])
    position = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.0, 0.0, 9.0]])
    found = colours.colours(way, position, velocity, 4.0, (0.0, 10.0))
    assert len({tuple(c) for c in found.tolist()}) == 3
    assert way in colours.key(way, 4.0, (0.0, 10.0)) or way == "agent"


def test_only_the_token_or_its_cookie_opens_the_page():
    name, token = "airflock_8080", "abc"
    assert door.admitted("/?token=abc", "", name, token) == (True, True)
    assert door.admitted("/x.js", "airflock_8080=abc", name, token) == (True, False)
    for path, cookie in (("/", ""), ("/?token=", ""), ("/?token=ab", "airflock_8081=abc"), ("/", "airflock_8080=abd")):
        assert door.admitted(path, cookie, name, token)[0] is False


def test_a_port_in_use_is_one_line():
    from airflock.studio.view import View

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(StudioError, match="port"):
            View("127.0.0.1", taken.getsockname()[1], "page")


def test_another_number_of_agents_that_cannot_be_leaves_the_flight_as_it_was(player):
    player.fly(10)
    with pytest.raises(ScenarioError):
        player.reset(settings={"agents": 10**8})
    assert player.flight.step == 10 and player.given == FEW


def test_a_recording_is_flown_again_with_its_events(player, tmp_path):
    player.fly(150)
    player.change("model.p_rep", 0.2)
    player.fly(150)
    again = Player(str(player.save_recording(tmp_path / "tuned.nc")))
    again.fly(300)
    np.testing.assert_array_equal(again.flight.state, player.flight.state)
    assert again.seed == 3 and value_of(again.scenario, "model.p_rep") == 0.2
    assert airflock.load(again.save_toml(tmp_path / "again.toml")).agents == 12


def test_a_flight_log_is_refused_in_one_line(tmp_path):
    log = airflock.simulate(airflock.load(PRESET, {**FEW, "duration": 1.0}), 1)
    log.attrs = {}
    airflock.save(log, tmp_path / "log.nc")
    with pytest.raises(airflock.AirflockError, match="airflock replay"):
        Player(str(tmp_path / "log.nc"))
