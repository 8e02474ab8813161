"""Logs of PX4 and ArduPilot: a motion that was written is the motion that is read."""

import numpy as np
import pandas as pd
import pytest

import airflock
from airflock.support.errors import RecordingError
from autopilots import write_dataflash, write_tlog, write_ulog

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
    from airflock.recordings.imports import common_frame as geodesy

    ned, speed = motion()
    near, far = (47.0, 19.0, 100.0), (47.009, 19.001, 130.0)
    write_ulog(tmp_path / "a.ulg", TIME, ned, speed, speed, origin=near, utc=1.7e9)
    there = geodesy.points_to_origin(enu(ned), near, far)
    turned = geodesy.vectors_to_origin(enu(speed), near, far)
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
    both = airflock.load_tracks([tmp_path / "a.bin", tmp_path / "b.bin"])
    assert both["time"].values[-1] == pytest.approx(50.0 + TIME[-1] - TIME[0])


@pytest.mark.parametrize("unit", ["", "cm/s", "m/s"])
def test_command_of_ardupilot_is_the_requested_velocity_in_the_unit_of_its_log(tmp_path, unit):
    """GUIP is north-east-up in cm/s up to Copter 4.6, north-east-down in m/s later; TV* is no command in either."""
    pytest.importorskip("pymavlink")
    ned, speed = motion()
    wish = 1.2 * speed + (0.0, 0.0, -0.5)
    write_dataflash(tmp_path / "a.bin", TIME, ned, speed, wish, deep=True, inner=0.9 * speed, unit=unit)
    found = airflock.load_tracks(tmp_path / "a.bin", precision=64)
    np.testing.assert_allclose(values(found, "command"), enu(wish), atol=1e-5)
    np.testing.assert_allclose(values(found), enu(ned), atol=1e-5)


def test_no_command_is_in_force_where_a_position_is_controlled_or_the_requests_have_ended(tmp_path):
    pytest.importorskip("pymavlink")
    ned, speed = motion()
    kinds = np.full(len(TIME), 4)
    kinds[100:150], kinds[200:] = 2, -1  # a position; nothing more, as after a change to LAND
    notes = []
    write_dataflash(tmp_path / "a.bin", TIME, ned, speed, speed, kinds=kinds)
    found = values(airflock.load_tracks(tmp_path / "a.bin", say=notes.append), "command")
    there = np.isfinite(found).all(axis=1)
    assert there[:100].all() and not there[100:150].any() and there[150:200].all() and not there[206:].any()
    assert any("of the time without GUIP (velocities in GUIDED mode): no commands there" in note for note in notes)
    write_dataflash(tmp_path / "a.bin", TIME, ned, speed, None, inner=speed)
    assert "command" not in airflock.load_tracks(tmp_path / "a.bin")


def local_ned(dialect, boot, ned, speed):
    return dialect.MAVLink_local_position_ned_message(round(1e3 * boot), *ned, *speed)


def packer(dialect, system):
    source = dialect.MAVLink(None, srcSystem=system, srcComponent=1)
    return lambda message: bytes(message.pack(source))


def test_rows_of_telemetry_have_the_time_of_their_states_however_late_they_came(tmp_path, seed):
    """Two vehicles at 7 m/s with clocks of their own; arrivals are up to 0.1 s late, some messages come twice, one
    vehicle boots anew on the way: places at each instant are those of the motion to 0.1 m."""
    from pymavlink.dialects.v20 import common as dialect

    random = np.random.default_rng(seed)
    begin, fast, messages = 1.7e9, 0.7, []
    for system, early in ((1, 30.0), (2, 3000.0)):
        pack = packer(dialect, system)
        for k in range(900):
            t = 0.1 * k
            a = fast * t + system
            place, speed = (10 * np.sin(a), 10 * np.cos(a), -20.0), (7 * np.cos(a), -7 * np.sin(a), 0.0)
            boot = early + t if system == 1 or k < 500 else t - 45.0  # so that the second one boots at 45 s
            data = pack(local_ned(dialect, boot, place, speed))
            messages += [(begin + t + late, data) for late in random.uniform(0.0, 0.1, 2 if k % 7 == 0 else 1)]
            mask = 0x0DC7 if k < 600 else 0x0DF8  # a velocity; later a position
            wish = (*speed[:2], -0.5)
            target = dialect.MAVLink_position_target_local_ned_message(
                round(1e3 * boot), 1, mask, 0, 0, 0, *wish, 0, 0, 0, 0, 0
            )
            messages.append((begin + t + random.uniform(0.0, 0.1), pack(target)))
    write_tlog(tmp_path / "a.tlog", sorted(messages, key=lambda one: one[0]))
    found = airflock.load_tracks(tmp_path / "a.tlog", precision=64)
    time = found.time.values + found.attrs["airflock_begin"] - begin
    for who, system in enumerate((1, 2)):
        place, sure = values(found, who=who), found.confidence.values[:, 0, who] > 0
        a = fast * time + system
        off = np.linalg.norm(place - np.stack([10 * np.cos(a), 10 * np.sin(a), 20 + 0 * a], axis=1), axis=1)
        assert sure.mean() > 0.98 and off[sure].max() < 0.1
        command = values(found, "command", who)[:, 2]
        assert (command[time < 59.5][1:][sure[time < 59.5][1:]] == 0.5).mean() > 0.95
        assert np.isnan(command[time > 60.5]).all()


@pytest.mark.parametrize("still", [0.0, 60.0])
def test_estimates_of_a_drone_that_stands_are_no_second_individual_nor_another_unit(tmp_path, seed, still):
    """As measured on ArduCopter 4.6.0-dev in software in the loop: places alternate by 0.16 mm about a place, while the
    velocity reports 2 cm/s; still: how long the file goes on in flight."""
    from pymavlink.dialects.v20 import common as dialect

    random, pack, messages = np.random.default_rng(seed), packer(dialect, 1), []
    count, drift = 800, np.cumsum(random.normal(0.0, 2e-5, (800, 3)), axis=0)
    for k in range(count + round(10 * still)):
        t = 0.1 * k
        if k < count:
            turn = 0.8e-4 * (-1) ** k
            place = drift[k] * (1.0, 1.0, 0.3) + (turn - 0.014, turn + 0.013, -0.0075)
            speed = (-0.0174 + 0.6 * turn, 0.0162 + 0.6 * turn, float(np.gradient(drift[:, 2])[k]) / 0.1)
        else:
            a, turning = 3.0 - 3.0 * np.cos(0.2 * (t - 0.1 * count)), 0.6 * np.sin(0.2 * (t - 0.1 * count))
            place = drift[-1] + (9.986 - 10 * np.cos(a), 10 * np.sin(a) + 0.013, -0.0075)
            speed = 10 * turning * np.sin(a), 10 * turning * np.cos(a), 0.0
        messages.append((1.7e9 + t + random.uniform(0.0, 0.03), pack(local_ned(dialect, 160.0 + t, place, speed))))
    write_tlog(tmp_path / "a.tlog", messages)
    found = airflock.load_tracks(tmp_path / "a.tlog")
    assert found.sizes["individual"] == 1 and np.ptp(values(found)[:700, :2], axis=0).max() < 0.01


@pytest.mark.parametrize("ending", [".ulg", ".bin"])
def test_damaged_logs_end_with_one_line(tmp_path, ending):
    pytest.importorskip("pyulog")
    pytest.importorskip("pymavlink")
    path = tmp_path / f"broken{ending}"
    path.write_bytes(bytes(range(256)) * 4)
    with pytest.raises(RecordingError) as fault:
        airflock.load_tracks(path)
    assert len(str(fault.value).splitlines()) == 1 and str(path) in str(fault.value)


LATER = "ref_timestamp", "z_deriv", "xy_valid", "v_xy_valid"


def px4_table(ned, speed, **more):
    """The table that ulog2csv writes of vehicle_local_position; `more`: columns beside position and velocity."""
    places = dict(zip(("x", "y", "z", "vx", "vy", "vz"), np.hstack([ned, speed]).T, strict=True))
    return pd.DataFrame({"timestamp": np.round(1e6 * TIME).astype(int), **places, **more})


@pytest.mark.parametrize("height", [0.2, -20.0])  # near the ground nothing but the names tells that z is down
def test_a_table_of_px4_is_north_east_down_in_microseconds(tmp_path, height):
    ned, speed = motion()
    ned[:, 2] = height
    px4_table(ned, speed, **dict.fromkeys(LATER, 1)).to_csv(tmp_path / "a.csv", index=False)
    told = []
    found = airflock.load_tracks(tmp_path / "a.csv", say=told.append, precision=64)
    np.testing.assert_allclose(values(found), enu(ned), atol=1e-9)
    np.testing.assert_allclose(values(found, "velocity"), enu(speed), atol=1e-9)
    np.testing.assert_allclose(found.time - found.time[0], TIME - TIME[0], atol=1e-9)
    assert "fields of PX4's vehicle_local_position: x is north, y east, z down (otherwise --axes enu)" in told[0]
    as_said = airflock.load_tracks(tmp_path / "a.csv", axes="enu", accept=["down"], precision=64)
    np.testing.assert_allclose(values(as_said), ned, atol=1e-9)


def test_a_table_that_may_be_of_px4_is_asked_about_its_axes(tmp_path):
    ned, speed = motion()
    ned[:, 2] = 0.0
    bare = px4_table(ned, speed)
    bare.to_csv(tmp_path / "a.csv", index=False)
    for how in ({"time_unit": "us"}, {"map": {"t": "timestamp*1e-6"}}):
        with pytest.raises(
            RecordingError, match=r"whose x is north and z down: write --axes ned, or --axes enu"
        ) as line:
            airflock.load_tracks(tmp_path / "a.csv", **how)
        assert "\n" not in str(line.value)
        for axes, place in (("ned", enu(ned)), ("enu", ned)):
            found = airflock.load_tracks(tmp_path / "a.csv", axes=axes, precision=64, **how)
            np.testing.assert_allclose(values(found), place, atol=1e-9)
    seconds = bare.assign(timestamp=TIME)  # of anybody: nothing but PX4 counts microseconds under these names
    np.testing.assert_allclose(values(airflock.load_tracks(seconds, precision=64)), ned, atol=1e-9)


def test_tables_of_px4_with_origins_of_their_own_meet_and_invalid_rows_are_left_out(tmp_path):
    from airflock.recordings.imports import common_frame as geodesy

    ned, speed = motion()
    near, far = (47.0, 19.0, 100.0), (47.009, 19.001, 130.0)
    there, turned = geodesy.points_to_origin(enu(ned), near, far), geodesy.vectors_to_origin(enu(speed), near, far)
    rows = {"a": (ned, speed, near), "b": (enu(there), enu(turned), far)}
    for name, (place, fast, origin) in rows.items():
        place, valid = place.copy(), (np.arange(300) >= 40).astype(int)
        place[:40] += 500.0  # of an estimator that calls them invalid
        refs = dict(zip(("ref_lat", "ref_lon", "ref_alt"), origin, strict=True))
        px4_table(place, fast, xy_valid=valid, **refs).to_csv(tmp_path / f"{name}.csv", index=False)
    found = airflock.load_tracks([tmp_path / "a.csv", tmp_path / "b.csv"], same_clock=True, accept=["down"])
    np.testing.assert_allclose(values(found, who=0), values(found, who=1), atol=1e-3)
    assert found.sizes["time"] == 260


def test_estimates_and_fixes_of_ardupilot_as_tables_are_read_by_their_own_names():
    """The columns of mavlogdump.py --format csv --types XKF1, and of GPS, whose U (used) is no height."""
    ned, speed = motion()
    fields = dict(zip(("VN", "VE", "VD", "PN", "PE", "PD"), np.hstack([speed, ned]).T, strict=True))
    for time in ({"timestamp": 1.7e9 + TIME}, {"TimeUS": 1e6 * TIME}):
        found = airflock.load_tracks(pd.DataFrame({**time, "C": 0, "Roll": 0.0, **fields, "GX": 0.0}), precision=64)
        np.testing.assert_allclose(values(found), enu(ned), atol=1e-6)
        np.testing.assert_allclose(values(found, "velocity"), enu(speed), atol=1e-6)
    told = []
    fix = {"Lat": 47.5 + ned[:, 0] / 111_200.0, "Lng": 19.0 + 0.0 * TIME, "Alt": 120.0, "Spd": 5.0, "U": 1}
    found = airflock.load_tracks(pd.DataFrame({"TimeUS": 1e6 * TIME, **fix}), say=told.append)
    assert np.ptp(values(found)[:, 1]) == pytest.approx(20.0, rel=1e-2) and np.ptp(values(found)[:, 2]) < 1e-3
    assert not [note for note in told if "without a unit" in note]


def test_a_log_of_ardupilot_without_positions_says_what_to_do(tmp_path):
    pytest.importorskip("pymavlink")
    (tmp_path / "noise.bin").write_bytes(b"no log at all" * 100)
    (tmp_path / "old.log").write_text("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n")
    ned, speed = motion()
    write_dataflash(tmp_path / "whole.bin", TIME, ned, speed, speed)
    whole = (tmp_path / "whole.bin").read_bytes()
    (tmp_path / "plane.bin").write_bytes(whole[:89] if whole[:2] == b"\xa3\x95" else whole)
    for name, said in (
        ("noise.bin", "is no DataFlash log of ArduPilot"),
        ("old.log", "of ArduPilot give the .bin that it was made from"),
        ("plane.bin", "nor XKF1, NKF1, POS, GPS; it has FMT; log one of those (LOG_BITMASK)"),
    ):
        with pytest.raises(RecordingError) as fault:
            airflock.load_tracks(tmp_path / name)
        assert said in str(fault.value) and "\n" not in str(fault.value)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_drone_that_flies_along_one_axis_does_not_jump(axis, seed):
    """Half of its steps are nothing, which says nothing of the other half."""
    place = np.random.default_rng(seed).normal(0.0, 1e-5, (300, 2))
    place[:, axis] += 10.0 * np.sin(0.5 * TIME)
    table = {"t": TIME, "Lat": 47.5 + place[:, 0] / 111_200.0, "Lng": 19.0 + place[:, 1] / 75_000.0}
    assert airflock.load_tracks(pd.DataFrame(table)).sizes["time"] == 300
