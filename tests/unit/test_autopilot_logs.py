"""Logs of PX4 and ArduPilot: a motion that was written is the motion that is read."""

import numpy as np
import pytest

import airflock
from airflock.errors import RecordingError
from autopilots import write_dataflash, write_ulog

TIME = 12.0 + 0.1 * np.arange(300)


def motion(shift=0.0):
    """Position, velocity (row, 3) north-east-down on a circle at 20 m."""
    a = 0.5 * TIME + shift
    ned = np.stack([10 * np.sin(a), 10 * np.cos(a), np.full_like(a, -20.0)], axis=1)
    return ned, np.stack([5 * np.cos(a), -5 * np.sin(a), 0.0 * a], axis=1)


def values(recording, name="position", who=0):
    return recording[name].transpose("time", "space", "keypoint", "individual").values[:, :, 0, who]


def enu(ned):
    return np.stack([ned[:, 1], ned[:, 0], -ned[:, 2]], axis=1)


def test_ulog_is_read_as_it_was_written(tmp_path):
    pytest.importorskip("pyulog")
    ned, speed = motion()
    write_ulog(tmp_path / "a.ulg", TIME, ned, speed, 1.2 * speed)
    found = airflock.load_tracks(tmp_path / "a.ulg")
    np.testing.assert_allclose(values(found), enu(ned), atol=1e-5)
    np.testing.assert_allclose(values(found, "velocity"), enu(speed), atol=1e-6)
    np.testing.assert_allclose(values(found, "command"), enu(1.2 * speed), atol=1e-6)


def test_drones_with_boot_clocks_and_origins_of_their_own_meet(tmp_path):
    """Two logs of one motion: another boot, another origin 1 km away; read together they coincide."""
    pytest.importorskip("pyulog")
    from airflock.recordings.imports import geodesy

    ned, speed = motion()
    near, far = (47.0, 19.0, 100.0), (47.009, 19.001, 130.0)
    write_ulog(tmp_path / "a.ulg", TIME, ned, speed, speed, origin=near, utc=1.7e9)
    there = geodesy.moved(enu(ned), near, far)
    turned = geodesy.turned(enu(speed), near, far)
    write_ulog(tmp_path / "b.ulg", TIME + 300.0, enu(there), enu(turned), enu(turned), origin=far, utc=1.7e9 - 300.0)
    found = airflock.load_tracks([tmp_path / "a.ulg", tmp_path / "b.ulg"], accept=["down"])
    np.testing.assert_allclose(values(found, who=0), values(found, who=1), atol=1e-3)
    assert found.attrs["airflock_comparable"] == 1
    write_ulog(tmp_path / "b.ulg", TIME, ned, speed, speed)
    with pytest.raises(RecordingError, match="nothing says that the clocks"):
        airflock.load_tracks([tmp_path / "a.ulg", tmp_path / "b.ulg"])


def test_a_counted_reset_splits_and_time_on_the_ground_is_absent(tmp_path):
    pytest.importorskip("pyulog")
    ned, speed = motion()
    ned[150:, 0] += 3.0
    resets = (np.arange(300) >= 150).astype(int)
    landed = [(TIME[0], True), (TIME[50] - 0.01, False)]
    write_ulog(tmp_path / "a.ulg", TIME, ned, speed, speed, resets=resets, landed=landed)
    found = airflock.load_tracks(tmp_path / "a.ulg", rate=20.0)
    x = values(found)[:, 0]
    assert np.isnan(x[:99]).all() and np.isfinite(x[101:299]).all() and np.isnan(x[299]) and np.isfinite(x[300:]).all()


def test_dataflash_is_read_as_it_was_written(tmp_path):
    pytest.importorskip("pymavlink")
    ned, speed = motion()
    write_dataflash(tmp_path / "a.bin", TIME, ned, speed, 1.2 * speed, week=2300)
    write_dataflash(tmp_path / "b.bin", TIME + 50.0, ned, speed, 1.2 * speed, week=2300)
    found = airflock.load_tracks(tmp_path / "a.bin")
    np.testing.assert_allclose(values(found), enu(ned)[:, :2], atol=1e-5)
    np.testing.assert_allclose(values(found, "command"), enu(1.2 * speed)[:, :2], atol=1e-6)
    both = airflock.load_tracks([tmp_path / "a.bin", tmp_path / "b.bin"])
    assert both["time"].values[-1] == pytest.approx(50.0 + TIME[-1] - TIME[0])


@pytest.mark.parametrize("ending", [".ulg", ".bin"])
def test_damaged_logs_end_with_one_line(tmp_path, ending):
    pytest.importorskip("pyulog")
    pytest.importorskip("pymavlink")
    path = tmp_path / f"broken{ending}"
    path.write_bytes(bytes(range(256)) * 4)
    with pytest.raises(RecordingError) as fault:
        airflock.load_tracks(path)
    assert len(str(fault.value).splitlines()) == 1 and str(path) in str(fault.value)
