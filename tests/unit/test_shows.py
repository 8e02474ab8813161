"""A show is one flight: its seams lose nothing, its events fly it again, and its recording can be scored."""

import numpy as np
import pytest

import airflock
from airflock.displays import fly_show, shape_points, show_control as master
from airflock.displays.show_control import (
    BESIDE,
    CLEARANCE,
    assign_points,
    detour_lengths,
    detour_point,
    hulls_in_the_way,
)
from airflock.displays.shows import display_scenario, recording_of, waiting_points
from airflock.engine import Flight
from airflock.parts.bodies.falling import GRAVITY, fall
from airflock.recordings.scores import measure_recording
from airflock.world.goals import glide

pytestmark = pytest.mark.usefixtures("scored_plainly")


@pytest.fixture
def interpreted(monkeypatch):
    monkeypatch.setattr(master, "Flight", lambda *given, **more: Flight(*given, **more, device="python"))


def opened(drones, seed, **keys):
    start = np.zeros((6, drones))
    start[:3] = waiting_points(drones).T
    keys = {"duration": 6.0, "goals.points": (waiting_points(drones) + (9.0, 4.0, 2.0)).tolist()} | keys
    return airflock.open(display_scenario(drones, keys), seed, precision=64, record=True, start=start, device="python")


@pytest.mark.parametrize("failure", ["fall", "hover"])
def test_a_show_is_one_flight_and_its_recording_is_scored(interpreted, failure, seed):
    shapes = [shape_points(text, 6, seed=number) for number, text in enumerate("AO")]
    found = fly_show(shapes, 6, 0.34, failure, seed)
    assert [formed.drones for formed in found.shape_reports] == [5, 4]
    assert all(formed.worst <= 1.0 for formed in found.shape_reports)
    again = found.flight.again()
    again.finish()
    assert again.frames.tobytes() == found.flight.frames.tobytes()
    frames, there = found.frames, np.isfinite(found.frames[:, 0])
    assert len(frames) == found.ends[-1] + 1 and there.sum(axis=1)[[0, found.ends[0], -1]].tolist() == [6, 5, 4]
    steps = np.linalg.norm(np.diff(frames[:, :3], axis=0), axis=1)
    assert np.nanmax(steps) < 2.0 * np.nanmax(np.linalg.norm(frames[:, 3:], axis=1)) * found.period
    recording = recording_of(found)
    values, course = measure_recording(recording)
    assert values["present"] == pytest.approx(there.mean()) and len(course) == len(frames)
    assert values["n_coll"] == sum(formed.collisions for formed in found.shape_reports)


def test_one_driver_flies_a_whole_show(interpreted, seed):
    """It was compiled for those who stay, and once more when the first one fell."""
    points = shape_points("A", 6, seed=0)
    show = master.ShowControl(display_scenario(6), waiting_points(6), points, seed, failing=True)
    driver = show.flight._state.driver
    show.form(points, [(2, "fall", 0.3)])
    assert show.flight.present.sum() == 5 and show.flight._state.driver is driver


def test_a_show_that_does_not_know_who_will_fail_is_the_same_flight(interpreted, monkeypatch, seed):
    """By a driver of those who stay, and from the first failure on by one that knows who is there."""
    shapes = [shape_points(text, 6, seed=number) for number, text in enumerate("AO")]
    told = fly_show(shapes, 6, 0.34, "both", seed)
    known = master.Flight
    monkeypatch.setattr(master, "Flight", lambda *given, **more: known(*given, **more | {"absence": False}))
    untold = fly_show(shapes, 6, 0.34, "both", seed)
    assert untold.flight.frames.tobytes() == told.flight.frames.tobytes() and repr(untold.shape_reports) == repr(
        told.shape_reports
    )
    assert "faults" not in told.flight.scenario.document and not told.flight.scenario.faults


def test_faults_of_the_scenario_fly_in_a_show(interpreted, seed):
    """Once, at their time, and one who drops out by itself is missed like the others."""
    entries = [
        {"kind": "pretender", "at": 1.0, "lasts": 1.0, "agents": [2], "east": 9.0},
        {"kind": "fails", "at": 2.0, "agents": [4]},
    ]
    shapes = [shape_points(text, 6, seed=number) for number, text in enumerate("AO")]
    found = fly_show(shapes, 6, 0.17, "fall", seed, {"faults": entries})
    begun = [(fault["kind"], fault["agent"]) for fault in found.flight.faults]
    assert begun == [("pretender", 2), ("fails", 4)]
    assert [formed.drones for formed in found.shape_reports] == [4, 4] and not found.flight.present[4]


def test_what_a_change_leaves_alone_goes_on_on_its_way(seed):
    """Goals that are under way, and packets: a number that nothing reads changes no bit."""
    plain, changed = opened(4, seed), opened(4, seed)
    changed.advance(2.0).change({"goals.radius": 7.0}).advance(2.0)  # of goals of a flock, which there are none
    assert changed.state.tobytes() == plain.advance(4.0).state.tobytes()


def test_to_new_points_all_set_out_from_where_they_are(seed):
    flight = opened(4, seed).advance(2.0)
    begun, there = flight.state[:3], waiting_points(4) + (-8.0, 0.0, 5.0)
    flight.remove(2)
    flight.change({"goals.points": there.tolist()}).advance(1.5)
    stay = [0, 1, 3]
    far = np.linalg.norm(there[stay] - begun[:, stay].T, axis=1).max()
    lasts = 1.5 * far / flight.scenario.goals.speed
    at = 1.5 - flight.scenario.flight.dt  # goals are sent on their way before a step
    known = [[glide(begun[a, k], there[k, a], at, lasts) for k in stay] for a in range(3)]
    goals = flight._state.rows(["goal_x", "goal_y", "goal_z"])[:, stay]
    np.testing.assert_allclose(goals, known, rtol=1e-12)


def held_up(monkeypatch, length, seed, minded=True):
    """Figures of one drone before the flat side of one that hovers, where pull and push of its law balance."""
    start, towards = waiting_points(1), np.array([-0.7, 1.0, 0.0]) / np.hypot(0.7, 1.0)
    point = start + length * towards
    flown = master.ShowControl(display_scenario(1, {"model.p_wall": 4.0}), start, point, seed, failing=False)
    flown.hulls.append(start[0] + (0.0, 1.35, 0.0))
    if not minded:
        monkeypatch.setattr(flown, "_mind", lambda: None)
    flown._tell()
    flown.form(point, [])
    return flown.finish()[0]


@pytest.mark.parametrize("length", [5.0, 7.0, 9.0])
def test_a_drone_that_is_held_up_behind_a_hovering_one_gets_there(interpreted, monkeypatch, seed, length):
    """Left to its law it stays before it for good."""
    left, sent = held_up(monkeypatch, length, seed, minded=False), held_up(monkeypatch, length, seed)
    assert np.isnan(left.time) and left.worst > 0.9 * length and left.detour_count == 0
    assert sent.time < 20.0 and sent.worst < 1.0 and 1 <= sent.detour_count <= 2 and sent.hulls == 0


def test_no_two_drones_have_the_same_point_while_some_are_sent_around(interpreted, seed):
    rng = np.random.default_rng(seed)
    points = waiting_points(9) + (0.0, 12.0, 3.0)
    flown = master.ShowControl(display_scenario(9), waiting_points(9), points, seed, failing=False)
    flown.hulls = [waiting_points(9)[4] + (0.0, 6.0, 1.0), points[4] + (0.0, -4.0, 0.0)]
    for _ in range(20):
        places = flown.flight.state[:3].T + rng.normal(0.0, 2.0, (9, 3))
        flown.progress.look(places, points)
        flown._send_out(rng.choice(9, 3, replace=False), places)
        assert sorted(flown.target) == list(range(9))
        assert len(np.unique(np.round(flown._aims(), 6), axis=0)) == 9  # nor the same place to fly to first


def test_ways_around_a_hovering_drone_are_free_of_it_and_level_with_it_or_above(seed):
    rng = np.random.default_rng(seed)
    for _ in range(200):
        hull, towards = rng.uniform(-9.0, 9.0, 3), rng.normal(0.0, 1.0, 3)
        towards /= np.linalg.norm(towards)
        place, point = hull - rng.uniform(CLEARANCE, 9.0) * towards, hull + rng.uniform(3.0, 40.0) * towards
        assert hulls_in_the_way(place[None], point[None], hull[None]).all()
        first = detour_point(place, point, hull[None], np.zeros((0, 3)), np.zeros((0, 3)))
        assert np.linalg.norm(first - hull) == pytest.approx(BESIDE)
        ways = hulls_in_the_way(np.array([place, first]), np.array([first, point]), hull[None])
        assert not ways[0] or np.linalg.norm(place - hull) < 2.0
        assert not ways[1]
        assert first[2] >= hull[2] - BESIDE * abs(towards[2]) - 1e-9


def test_points_are_given_in_a_chain_of_ways_where_one_hovers_before_the_shorter_one():
    """36 m² of straight ways against 50 m² around; through whom hovers the first are 144 m²."""
    drones, points = np.array([[-3.0, 0.0, 9.0], [0.0, 4.0, 9.0]]), np.array([[0.0, 4.0, 9.0], [3.0, 0.0, 9.0]])
    more, free = detour_lengths(drones, points, np.array([[0.0, 0.0, 9.0]])), np.zeros(2, bool)
    assert more.tolist() == [[0.0, 2.0 * BESIDE], [0.0, 0.0]]
    assert assign_points(drones, points, free).tolist() == [1, 0]
    assert assign_points(drones, points, free, more).tolist() == [0, 1]


def test_a_fall_is_that_of_closed_form_in_steps_of_any_length(seed):
    rng = np.random.default_rng(seed)
    start, time = rng.normal(0.0, 5.0, 6), 3.0
    for count in (1, 7, 300):
        state = tuple(start)
        for _ in range(count):
            state = fall(*state, time / count)
        np.testing.assert_allclose(state[:3], start[:3] + time * start[3:] - (0, 0, 0.5 * GRAVITY * time**2), rtol=1e-9)
        np.testing.assert_allclose(state[3:], start[3:] - (0, 0, GRAVITY * time), rtol=1e-9)
