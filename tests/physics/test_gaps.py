"""Recordings in which individuals come and go: an instant is scored as the flock of those who are there."""

import numpy as np
import pytest

import airflock
from airflock.recordings.dataset import make_dataset, recording_frames
from airflock.recordings.scores import measure_recording
from airflock.scenarios.files import load
from airflock.support.errors import RecordingError

NAMES = ("phi_corr", "n_clust", "n_disc", "r_min", "phi_vel", "phi_wall", "phi_coll")


@pytest.fixture(scope="module")
def recording():
    keys = {"agents": 8, "duration": 12.0, "start.kind": "ball"}
    return airflock.simulate(load("vasarhelyi_2018/4ms", keys), 3, device="python")


def without(recording, missing):
    """The recording in which (time, agent) marked as missing are nan."""
    gaps = recording.copy(deep=True)
    for name in ("position", "velocity"):
        gaps[name].values[np.broadcast_to(missing[:, None, None, :], gaps[name].shape)] = np.nan
    return gaps


@pytest.mark.parametrize("share", [0.007, 0.2, 0.6])
def test_each_instant_is_that_of_those_who_are_there(recording, share):
    missing = np.random.default_rng(5).random((len(recording.time), 8)) < share
    values, course = measure_recording(without(recording, missing))
    alone = []
    for number, gone in enumerate(missing):
        there = np.flatnonzero(~gone)
        if len(there) > 1:
            alone.append(measure_recording(recording.isel(time=[number], individual=there))[1].iloc[0])
            for name in set(course.columns) & set(NAMES):
                assert course[name].iloc[number] == pytest.approx(alone[-1][name], rel=1e-5, abs=1e-6), (number, name)
        else:
            assert np.isnan(course.iloc[number]).all()
    assert values["present"] == pytest.approx(1.0 - missing.mean())
    assert values["phi_vel"] == pytest.approx(np.mean([row["phi_vel"] for row in alone]), rel=1e-5)


@pytest.mark.parametrize("kind", ["vasarhelyi", "kidger", "order", "groups", "zapotecatl", "contacts"])
@pytest.mark.parametrize("share", [0.007, 0.2])
def test_every_order_parameter_of_an_instant_is_that_of_those_who_are_there(recording, kind, share):
    """With one who lands early; and what plain formulas say of them."""
    missing = np.random.default_rng(5).random((len(recording.time), 8)) < share
    missing[40:, 3] = True
    settings = {"metrics.kind": kind}
    course = measure_recording(without(recording, missing), settings)[1].drop(
        columns=["n_coll", "time_to_flock"], errors="ignore"
    )
    place, speed = (
        recording[name].transpose("time", "space", "keypoint", "individual").values[:, :, 0].astype(float)
        for name in ("position", "velocity")
    )
    for number, gone in enumerate(missing):
        there = np.flatnonzero(~gone)
        alone = measure_recording(recording.isel(time=[number], individual=there), settings)[1]
        np.testing.assert_allclose(course.iloc[number], alone[course.columns].iloc[0], rtol=1e-6, atol=1e-6)
        if not speed[number].any():  # before they start nobody has a heading
            continue
        p, v = place[number][:, there], speed[number][:, there]
        apart = np.linalg.norm(p[:, :, None] - p[:, None], axis=0) + np.diag(np.full(len(there), np.inf))
        plain = {
            "phi_vel": np.hypot(*v).mean(), "polarisation": np.hypot(*(v / np.hypot(*v)).mean(axis=1)),
            "r_min": apart.min(), "r_min_mean": apart.min(axis=1).mean(),
        }  # fmt: skip
        for name in set(plain) & set(course.columns):
            assert course[name].iloc[number] == pytest.approx(plain[name], rel=1e-5, abs=2e-6), name


def test_one_who_lands_early_leaves_the_others_their_scores(recording):
    missing = np.zeros((len(recording.time), 8), bool)
    missing[20:, 3] = True
    course = measure_recording(without(recording, missing))[1]
    others = measure_recording(recording.isel(individual=[0, 1, 2, 4, 5, 6, 7]))[1]
    both = [name for name in NAMES if name in course and name != "phi_coll"]
    assert np.allclose(course[both].iloc[20:], others[both].iloc[20:], rtol=1e-5, atol=1e-6)
    whole = measure_recording(recording)[1]
    assert np.array_equal(course[both].iloc[:20], whole[both].iloc[:20])


def test_a_contact_that_outlasts_a_gap_is_one_collision():
    times = np.arange(12) * 0.2
    x = np.stack([np.zeros(12), np.linspace(6.0, 1.0, 12), np.full(12, 50.0)], axis=1)
    frames = np.zeros((12, 6, 3))
    frames[:, 0], frames[:, 2] = x, np.gradient(x, times, axis=0)
    tracks = make_dataset(frames, 2, times, {}, "velocity")
    missing = np.zeros((12, 3), bool)
    missing[9, 1] = True
    settings = {"metrics.r_coll": 3.0, "metrics.period": 0.2}
    whole = measure_recording(tracks, settings)[0]["n_coll"]
    assert whole == 1.0 and measure_recording(without(tracks, missing), settings)[0]["n_coll"] == whole


def test_nobody_at_any_time_is_one_line(recording):
    with pytest.raises(RecordingError, match="no individual is present at any instant"):
        measure_recording(without(recording, np.ones((len(recording.time), 8), bool)))


def test_velocities_are_differentiated_within_a_stretch(recording):
    missing = np.zeros((len(recording.time), 8), bool)
    missing[10:14, 2] = True
    gaps = without(recording, missing).drop_vars("velocity")
    frames, _, present = recording_frames(gaps)
    whole, _, _ = recording_frames(recording.drop_vars("velocity"))
    assert np.array_equal(present, ~missing)
    inside = present.copy()
    inside[[9, 14], 2] = False  # one-sided at the ends of a stretch
    assert np.array_equal(frames.transpose(0, 2, 1)[inside], whole.transpose(0, 2, 1)[inside])
