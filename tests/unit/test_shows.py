"""A show is one flight: its seams lose nothing, its events fly it again, and its recording can be scored."""

import numpy as np
import pytest

import airflock
from airflock.display import fly_show, points_of, show
from airflock.display.show import ranks, recording_of, scenario_of
from airflock.engine import Flight
from airflock.recordings.scores import measure
from airflock.world.goals import glide


@pytest.fixture
def interpreted(monkeypatch):
    monkeypatch.setattr(show, "Flight", lambda *given, **more: Flight(*given, **more, device="python"))


def opened(drones, seed, **keys):
    start = np.zeros((6, drones))
    start[:3] = ranks(drones).T
    keys = {"duration": 6.0, "goals.points": (ranks(drones) + (9.0, 4.0, 2.0)).tolist()} | keys
    return airflock.open(scenario_of(drones, keys), seed, precision=64, record=True, start=start, device="python")


@pytest.mark.parametrize("failure", ["fall", "hover"])
def test_a_show_is_one_flight_and_its_recording_is_scored(interpreted, failure, seed):
    shapes = [points_of(text, 6, seed=number) for number, text in enumerate("AO")]
    found = fly_show(shapes, 6, 0.34, failure, seed)
    assert [formed.drones for formed in found.formed] == [5, 4]
    assert all(formed.worst <= 1.0 for formed in found.formed)
    again = found.flight.again()
    again.finish()
    assert again.frames.tobytes() == found.flight.frames.tobytes()
    frames, there = found.frames, np.isfinite(found.frames[:, 0])
    assert len(frames) == found.ends[-1] + 1 and there.sum(axis=1)[[0, found.ends[0], -1]].tolist() == [6, 5, 4]
    steps = np.linalg.norm(np.diff(frames[:, :3], axis=0), axis=1)
    assert np.nanmax(steps) < 2.0 * np.nanmax(np.linalg.norm(frames[:, 3:], axis=1)) * found.period
    recording = recording_of(found)
    values, course = measure(recording)
    assert values["present"] == pytest.approx(there.mean()) and len(course) == len(frames)
    assert values["n_coll"] == sum(formed.collisions for formed in found.formed)


def test_faults_of_the_scenario_fly_in_a_show(interpreted, seed):
    """Once, at their time, and one who drops out by itself is missed like the others."""
    entries = [
        {"kind": "pretender", "at": 1.0, "lasts": 1.0, "agents": [2], "east": 9.0},
        {"kind": "fails", "at": 2.0, "agents": [4]},
    ]
    shapes = [points_of(text, 6, seed=number) for number, text in enumerate("AO")]
    found = fly_show(shapes, 6, 0.17, "fall", seed, {"faults": entries})
    begun = [(fault["kind"], fault["agent"]) for fault in found.flight.faults]
    assert begun == [("pretender", 2), ("fails", 4)]
    assert [formed.drones for formed in found.formed] == [4, 4] and not found.flight.present[4]


def test_what_a_change_leaves_alone_goes_on_on_its_way(seed):
    """Goals that are under way, and packets: a number that nothing reads changes no bit."""
    plain, changed = opened(4, seed), opened(4, seed)
    changed.advance(2.0).change({"goals.radius": 7.0}).advance(2.0)  # of goals of a flock, which there are none
    assert changed.state.tobytes() == plain.advance(4.0).state.tobytes()


def test_to_new_points_all_set_out_from_where_they_are(seed):
    flight = opened(4, seed).advance(2.0)
    begun, there = flight.state[:3], ranks(4) + (-8.0, 0.0, 5.0)
    flight.remove(2)
    flight.change({"goals.points": there.tolist()}).advance(1.5)
    stay = [0, 1, 3]
    far = np.linalg.norm(there[stay] - begun[:, stay].T, axis=1).max()
    lasts = 1.5 * far / flight.scenario.goals.speed
    at = 1.5 - flight.scenario.flight.dt  # goals are sent on their way before a step
    known = [[glide(begun[a, k], there[k, a], at, lasts) for k in stay] for a in range(3)]
    goals = flight._state.rows(["goal_x", "goal_y", "goal_z"])[:, stay]
    np.testing.assert_allclose(goals, known, rtol=1e-12)
