"""Time since the last packet by distance, of flights and of tables of packets."""

import numpy as np
import pandas as pd
import pytest

import airflock
from airflock.core.radio import lost
from airflock.recordings.packet_ages import packet_age
from airflock.support.errors import RecordingError
from airflock.view.result_plots import received

FLIGHT = {"agents": 10, "duration": 20.0, "sensors.period": 0.2, "radio.delay": 0.6, "metrics.period": 0.2}


def flown(**more):
    return airflock.simulate(airflock.load("vasarhelyi_2018/4ms", {**FLIGHT, **more}), 3, keep=("heard",))


def test_without_loss_every_packet_in_range_is_as_old_as_the_delay():
    table = packet_age(flown(**{"radio.range": 1000.0}))
    seen = table[table["count"] > 0]
    assert (seen["heard"] == 1.0).all()
    for level in ("q05", "median", "q95"):
        np.testing.assert_allclose(seen[level], 0.6, atol=1e-5)


def test_beyond_the_range_nobody_is_heard_again():
    recording = flown(**{"radio.range": 60.0, "duration": 60.0})
    table = packet_age(recording)
    near, far = table[table["distance"] < 50.0], table[(table["distance"] > 90.0) & (table["count"] > 50)]
    np.testing.assert_allclose(near["median"], 0.6, atol=1e-5)
    assert (far["heard"] < 1.0).any() and far["q95"].max() > 2.0


def test_packets_are_missed_as_often_as_the_radio_says_for_the_distance():
    lossy = {"radio.loss": 0.5, "radio.loss_at": 80.0, "radio.range": 1000.0, "metrics.kind": "order"}
    recording = flown(**lossy, duration=60.0)
    k = airflock.load("vasarhelyi_2018/4ms", lossy).radio
    place = recording["position"].values[:, :, 0].astype(float)
    apart = np.linalg.norm(place[:, :, None, :] - place[:, :, :, None], axis=1)
    off = np.broadcast_to(~np.eye(10, dtype=bool), apart.shape)
    got = np.abs(recording["age"].values - 0.6)[off] < 1e-3
    expected = 1.0 - np.array([lost(d, k) for d in apart[off]])
    error = np.sqrt((expected * (1.0 - expected)).sum()) / off.sum()
    assert abs(got.mean() - expected.mean()) < 4.0 * error
    table = packet_age(recording)
    seen = table[table["count"] > 500]
    assert seen["q95"].is_monotonic_increasing or seen["q95"].iloc[-1] > seen["q95"].iloc[0]


def test_a_table_of_packets_says_the_same_as_the_recording_it_was_made_from():
    recording = flown(**{"radio.range": 60.0})
    place, age = recording["position"].values[:, :, 0], recording["age"].values.astype(float)
    rows = []
    for k, time in enumerate(recording["time"].values):
        for i in range(10):
            for j in range(10):
                if i != j:
                    far = float(np.linalg.norm(place[k, :, i].astype(float) - place[k, :, j].astype(float)))
                    got = abs(age[k, i, j] - 0.6) < 1e-3
                    rows.append((i, j, time, time - 0.6, far, int(got)))
    table = pd.DataFrame(rows, columns=["receiver", "sender", "t", "stamp", "distance", "got"])
    one, other = packet_age(recording), packet_age(table)
    np.testing.assert_allclose(one["distance"], other["distance"], rtol=1e-5)
    both = (one["count"] == other["count"]).to_numpy()  # a pair may stand on the border of two bins
    assert both.mean() > 0.8
    np.testing.assert_allclose(one.loc[both, "median"], other.loc[both, "median"], atol=1e-3)


def test_the_picture_shows_the_table_and_what_knows_no_packets_is_refused():
    recording = flown(**{"radio.range": 60.0})
    upper = received(recording).axes[0]
    line = next(line for line in upper.lines if line.get_label() == "median")
    table = packet_age(recording)
    np.testing.assert_allclose(line.get_ydata(), table.loc[table["count"] >= 10, "median"])
    with pytest.raises(
        RecordingError, match="does not hold the age of received data; plot the scenario itself, fly it with"
    ):
        airflock.plot(recording.drop_vars("age"), "reception")
    with pytest.raises(RecordingError, match="no column stamp"):
        packet_age(pd.DataFrame({"receiver": [1], "sender": [2], "t": [0.0], "distance": [1.0], "got": [1]}))
