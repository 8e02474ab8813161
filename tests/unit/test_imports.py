"""Tracks of others: what a known motion reads as in every format, and one line for everything that is wrong."""

import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given, settings, strategies as st

import airflock
from airflock.recordings.imports import common_frame as geodesy, table_columns as expressions, track_checks as motion
from airflock.recordings.imports.track import ImportedTrack
from airflock.support.errors import RecordingError

RATE = 20.0


def circle(individual=0, seconds=20.0, rate=RATE):
    """Exact motion on a circle: table with headers in SI units."""
    t = np.arange(round(seconds * rate)) / rate
    a, radius = 0.5 * t + individual, 10.0 + individual
    x, y = radius * np.sin(a), radius * np.cos(a) + 3.0 * individual
    vx, vy = 0.5 * radius * np.cos(a), -0.5 * radius * np.sin(a)
    return pd.DataFrame({"t": t, "x": x, "y": y, "vx": vx, "vy": vy, "cx": 1.1 * vx, "cy": 1.1 * vy})


def flock(count=3, **options):
    return pd.concat([circle(i, **options).assign(id=f"bird_{i}") for i in range(count)], ignore_index=True)


def values(recording, name="position"):
    """(time, axis, individual)"""
    return recording[name].transpose("time", "space", "keypoint", "individual").values[:, :, 0]


def refused(what, **options):
    with pytest.raises(RecordingError) as fault:
        airflock.load_tracks(what, **options)
    return str(fault.value)


def test_a_long_table_is_read_to_the_last_bit():
    table = flock()
    found = airflock.load_tracks(table, precision=64)
    assert list(found["individual"].values) == ["bird_0", "bird_1", "bird_2"]
    for i in range(3):
        own = circle(i)
        assert np.array_equal(values(found)[:, :, i], own[["x", "y"]].to_numpy())
        assert np.array_equal(values(found, "velocity")[:, :, i], own[["vx", "vy"]].to_numpy())
        assert np.array_equal(values(found, "command")[:, :, i], own[["cx", "cy"]].to_numpy())
    assert (found["confidence"] == 1.0).all() and found.attrs["fps"] == RATE


def test_a_column_named_for_the_animal_holds_the_individuals():
    for name in ("fish", "animal_id", "Bird"):
        found = airflock.load_tracks(flock().rename(columns={"id": name}))
        assert list(found["individual"].values) == ["bird_0", "bird_1", "bird_2"], name


def test_units_of_headers_and_expressions_say_the_same(tmp_path):
    own = circle()
    plain = airflock.load_tracks(own)
    odd = pd.DataFrame(
        {
            "time_us": (own["t"] * 1e6).round().astype(int), "pos_e [mm]": own["x"] * 1e3, "pos_n_cm": own["y"] * 100.0,
            "vel_e (km/h)": own["vx"] * 3.6, "vel_n": own["vy"], "cmd_e": own["cx"], "cmd_n": own["cy"],
        }
    )  # fmt: skip
    odd.to_csv(tmp_path / "drone.csv", index=False)
    by_header = airflock.load_tracks(tmp_path / "drone.csv")
    by_map = airflock.load_tracks(
        tmp_path / "drone.csv",
        map={
            "t": "time_us*1e-6",
            "x": "'pos_e [mm]'/1000",
            "y": "0.01 * pos_n_cm",
            "vx": "'vel_e (km/h)'/3.6",
            "id": "file",
        },
    )
    assert list(by_map["individual"].values) == ["drone"]
    for found in (by_header, by_map):
        for name in ("position", "velocity", "command"):
            np.testing.assert_allclose(values(found, name), values(plain, name), rtol=1e-6, atol=1e-5)


def test_north_east_down_becomes_east_north_up():
    own = circle().assign(z=5.0 + 0.0 * circle()["t"], vz=0.0)
    ned = pd.DataFrame(
        {"t": own["t"], "x": own["y"], "y": own["x"], "z": -own["z"], "vx": own["vy"], "vy": own["vx"], "vz": 0.0}
    )
    np.testing.assert_array_equal(values(airflock.load_tracks(ned, axes="ned")), values(airflock.load_tracks(own)))


def test_files_of_one_individual_and_wide_and_long_tables_agree(tmp_path):
    long = airflock.load_tracks(flock())
    for i in range(3):
        circle(i).to_csv(tmp_path / f"bird_{i}.csv", index=False)
    files = airflock.load_tracks([tmp_path / f"bird_{i}.csv" for i in range(3)], same_clock=True)
    xr.testing.assert_equal(files["position"], long["position"])
    wide = pd.DataFrame({"time": circle()["t"]})
    for i in range(3):
        wide = wide.assign(**{f"x{i + 1}": circle(i)["x"], f"y{i + 1}": circle(i)["y"]})
    np.testing.assert_array_equal(values(airflock.load_tracks(wide)), values(long))


def test_arrays_and_movement_of_both_generations_agree(tmp_path):
    array = np.stack([circle(i)[["x", "y"]].to_numpy() for i in range(3)], axis=1)
    array[40:80, 1] = np.nan
    found = airflock.load_tracks(array * 1e3, unit="mm", fps=RATE)
    np.save(tmp_path / "tracks.npy", array * 1e3)
    np.testing.assert_array_equal(
        values(airflock.load_tracks(tmp_path / "tracks.npy", unit="mm", fps=RATE)), values(found)
    )
    assert np.isnan(values(found)[41:79, :, 1]).all() and not np.isnan(values(found)[:, :, 0]).any()
    position = array.transpose(0, 2, 1)[:, :, None, :]
    for dims in (("time", "space", "keypoint", "individual"), ("time", "space", "keypoints", "individuals")):
        coords = {dims[0]: np.arange(len(array)), dims[1]: ["x", "y"], dims[2]: ["centroid"], dims[3]: ["a", "b", "c"]}
        given = xr.Dataset({"position": (dims, position / 0.02)}, coords, {"fps": RATE, "time_unit": "frames"})
        np.testing.assert_allclose(
            values(airflock.load_tracks(given, unit="px", scale=0.02)), values(found), rtol=1e-5, atol=1e-6
        )
        flat = given.isel({dims[2]: 0}, drop=True)  # bounding boxes have no keypoints
        np.testing.assert_allclose(
            values(airflock.load_tracks(flat, unit="px", scale=0.02)), values(found), rtol=1e-5, atol=1e-6
        )
        assert "position has no unit" in refused(given)
        assert "counts frames" in refused(given.assign_attrs(fps=None), unit="m")
        both = refused(given.assign_attrs(fps=None))
        assert "counts frames" in both and "position has no unit" in both
    both = refused(array)
    assert "counts frames" in both and "has no unit" in both
    both = refused(pd.DataFrame({"id": [1, 1], "frame": [0, 1], "x_px": [0.0, 1.0], "y_px": [0.0, 1.0]}))
    assert "counts frames" in both and "--scale" in both
    fish = pd.DataFrame({"frame": [0, 1, 2], "fish": 0, "x": [500.0, 504.0, 508.0], "y": [80.0, 80.0, 80.0]})
    both = refused(fish)
    assert "counts frames" in both and "has no unit, and frame comes from a camera; write --unit px" in both
    assert values(airflock.load_tracks(fish, fps=25.0, unit="px", scale=0.001))[-1, 0, 0] == pytest.approx(0.508)
    assert "without a unit" not in str(airflock.load_tracks(fish, fps=25.0, unit="m").attrs)
    two = xr.concat([given, given.assign_coords(keypoints=["nose"])], "keypoints")
    assert "choose one: --keypoint" in refused(two, unit="m")
    assert "no keypoint tail; it has centroid, nose" in refused(two, unit="m", keypoint="tail")
    assert airflock.load_tracks(two, unit="m", keypoint="nose").sizes["keypoint"] == 1


def test_trajectories_of_idtracker_are_read_with_their_frame_rate(tmp_path):
    import h5py

    array = np.stack([circle(i)[["x", "y"]].to_numpy() for i in range(2)], axis=1) / 1e-3
    with h5py.File(tmp_path / "trajectories.h5", "w") as file:
        file["trajectories"] = array
        file.attrs["frames_per_second"] = RATE
        file.attrs["body_length"] = 42.0
    found = airflock.load_tracks(tmp_path / "trajectories.h5", unit="px", scale=1e-3)
    np.testing.assert_allclose(values(found)[:, :, 1], circle(1)[["x", "y"]].to_numpy(), rtol=1e-6)
    assert "body length of 42 px" in found.attrs["airflock_import"]


def test_movebank_rows_become_local_metres():
    lat0, lon0 = 47.48, 19.06
    times = pd.date_range("2026-05-01 12:00", periods=60, freq="15min")
    rows = [
        {"event-id": k, "timestamp": str(when), "location-long": lon0 + 1e-4 * k,
         "location-lat": lat0 + 2e-4 * k + 1e-3 * i, "individual-local-identifier": f"stork {i}"}
        for i in range(2)
        for k, when in enumerate(times)
    ]  # fmt: skip
    found = airflock.load_tracks(pd.DataFrame(rows))
    assert list(found["individual"].values) == ["stork 0", "stork 1"] and found.attrs["fps"] == pytest.approx(1 / 900.0)
    expected = geodesy.to_enu(lat0 + 2e-4 * np.arange(60), lon0 + 1e-4 * np.arange(60), 0.0, (lat0, lon0, 0.0))
    np.testing.assert_allclose(values(found)[:, :, 0], expected[:, :2], rtol=1e-5, atol=1e-3)


def test_columns_by_name_are_a_table():
    t = np.repeat(np.arange(30) / 10.0, 2)
    columns = {"t": t, "id": ["a", "b"] * 30, "x": (2.0 * t).tolist(), "y": range(60), "z": 0.0}
    found, same = (airflock.load_tracks(each, unit="m") for each in (columns, pd.DataFrame(columns)))
    xr.testing.assert_identical(found, same)
    for wrong, told in (({"t": [0, 1], "x": [1.0]}, "t has 2, x has 1"), ({}, "there are none"), ({"t": 0}, "none")):
        with pytest.raises(RecordingError, match=told):
            airflock.load_tracks(wrong)


@settings(deadline=None, max_examples=60)
@given(st.floats(-85, 85), st.floats(-179, 179), st.floats(-100, 5000), st.floats(-1, 1), st.floats(-1, 1))
def test_local_metres_keep_distances_and_directions(lat, lon, height, north, east):
    """A rigid motion: distances are those through the earth; up is the direction of height; north is due north."""
    origin = (lat, lon, height)
    a, b = (lat + 0.02 * north, lon + 0.02 * east, height), (lat, lon + 0.01, height + 30.0)
    local = geodesy.to_enu(*np.array([a, b]).T, origin)
    through = np.linalg.norm(geodesy.to_ecef(*a) - geodesy.to_ecef(*b))
    assert np.linalg.norm(local[0] - local[1]) == pytest.approx(through, abs=1e-6)
    np.testing.assert_allclose(geodesy.to_enu(lat, lon, height + 7.0, origin), [0.0, 0.0, 7.0], atol=1e-6)
    step = geodesy.to_enu(lat + 1e-5, lon, height, origin)
    assert step[1] > 0.0 and abs(step[0]) < 1e-6
    other = (lat + 0.01, lon - 0.01, 12.0)
    np.testing.assert_allclose(
        geodesy.points_to_origin(geodesy.to_enu(*a, other)[None], other, origin)[0], local[0], atol=1e-6
    )


def test_gaps_are_bridged_up_to_a_stated_length_and_else_absent():
    own = circle(seconds=30.0)
    short, long = slice(100, 110), slice(300, 400)  # 0.55 s and 5.05 s
    cut = own.drop(index=[*range(*short.indices(600)), *range(*long.indices(600))])
    found = airflock.load_tracks(cut, precision=64)
    sure = found["confidence"].values[:, 0, 0]
    assert (sure[short] == 0.5).all() and (sure[long] == 0.0).all() and (sure == 1.0).sum() == 490
    assert np.isnan(values(found)[long]).all()
    # cubic Hermite: the error of a circle (fourth derivative r w^4) over h is at most h^4 r w^4 / 384
    bound = 0.55**4 * 10.0 * 0.5**4 / 384.0
    assert np.abs(values(found)[short, :, 0] - own[["x", "y"]].to_numpy()[short]).max() < 1.5 * bound
    strict = airflock.load_tracks(cut, bridge=0.1)
    assert (strict["confidence"].values[short] == 0.0).all()


def test_commands_are_held_and_never_interpolated():
    own = circle()
    own["cx"] = np.where(own["t"] < 5.02, 1.0, 2.0)
    found = airflock.load_tracks(own, rate=80.0)
    assert set(np.unique(values(found, "command")[:, 0, 0])) == {1.0, 2.0}


REFUSED = """__import__('os')
x.y
x[0]
x if y else z
(lambda: 1)()
x ** 9
x @ y
f(x)
x; y
1 +
[x]
x := 2"""


@pytest.mark.parametrize("text", REFUSED.splitlines())
def test_expressions_hold_arithmetic_only(text):
    with pytest.raises(RecordingError, match="may hold column names"):
        expressions.parse_expression(text, "x")


@given(st.floats(-1e3, 1e3), st.floats(0.1, 1e3))
def test_expressions_are_the_arithmetic_they_show(a, b):
    tree = expressions.parse_expression("-(a - 2.5) * 'b b' / 4 + a", "x")
    found = expressions.evaluate(tree, {"a": np.array([a]), "b b": np.array([b])})
    assert found[0] == -(a - 2.5) * b / 4 + a
    assert expressions.column_names(tree).count("a") == 2


def written(tmp_path, table, name="log.csv", **options):
    table.to_csv(tmp_path / name, index=False, **options)
    return tmp_path / name


def test_each_fault_is_one_line_that_says_what_to_write(tmp_path):
    own = circle()
    swapped = own.rename(columns={"x": "y", "y": "x"})
    line = refused(written(tmp_path, swapped))
    assert line.count("\n") == 0 and "column x (x), row 2 on: moves like vy" in line
    assert 'write --map "x:=y" --map "y:=x"' in line
    # positions north-east, velocities east-north: what --axes exchanges both ways is told for the positions alone
    line = refused(written(tmp_path, swapped), axes="ned")
    assert 'write, without --axes, --map "x:=y" --map "y:=x"' in line
    airflock.load_tracks(written(tmp_path, swapped), map={"x": "y", "y": "x"})
    ned = own.rename(columns={"x": "y", "y": "x"}).assign(vx=own["vx"], vy=own["vy"], z=-20.0)
    assert "--axes ned" in refused(written(tmp_path, ned))
    assert "vx:=-vx" in refused(written(tmp_path, own.assign(vx=-own["vx"])))
    assert "positions are in mm" in refused(written(tmp_path, own.assign(x=1e3 * own["x"], y=1e3 * own["y"])))
    micro = own.assign(**{"t [ms]": own["t"] * 1e6}).drop(columns="t")
    assert "microseconds are named ms" in refused(written(tmp_path, micro))
    doubled = pd.concat([own, own.iloc[10:20]])
    line = refused(written(tmp_path, doubled))
    assert "10 rows of log repeat a time" in line and "first row 402" in line and "--accept duplicates" in line
    assert airflock.load_tracks(written(tmp_path, doubled), accept=["duplicates"]).sizes["time"] == len(own)
    both = pd.concat([own, circle(5)]).assign(id="one")
    assert "two individuals under one id" in refused(written(tmp_path, both))
    turns = pd.concat([own.iloc[::2], circle(5).iloc[1::2]]).sort_values("t").assign(id="one")
    assert "two individuals under one id" in refused(written(tmp_path, turns))
    below = own.assign(z=-20.0)
    assert 'write --map "z:=-z"' in refused(written(tmp_path, below))
    line = refused(written(tmp_path, own.assign(z=20.0)), axes="ned")  # what is given already is not told again
    assert 'it points up, where --axes ned has it down; leave --axes ned out, or add --map "z:=-z"' in line


def test_a_reset_of_the_estimator_splits_and_an_outlier_is_left_out(tmp_path):
    own = circle()
    reset = own.copy()
    reset.loc[200:, "x"] += 4.0
    line = refused(written(tmp_path, reset))
    assert "row 202" in line and "jumps 4 m more than its velocity explains" in line
    found = airflock.load_tracks(written(tmp_path, reset), accept=["jumps"], rate=40.0)
    x = values(found)[:, 0, 0]
    assert np.isnan(x[399]) and np.isfinite(x[398]) and np.isfinite(x[400])  # nothing between the two halves
    spike = own.copy()
    spike.loc[200, "y"] += 9.0
    found = airflock.load_tracks(written(tmp_path, spike))
    assert abs(values(found)[200, 1, 0] - own["y"][200]) < 1e-3
    assert "1 outliers left out, first row 202" in found.attrs["airflock_import"]


def test_files_that_are_no_tables_end_with_one_line(tmp_path):
    own = circle()
    (tmp_path / "a.zip").write_bytes(b"PK\x03\x04")
    assert "unpack it first" in refused(tmp_path / "a.zip")
    (tmp_path / "zip.csv").write_bytes(b"PK\x03\x04 and more")
    assert "is a zip archive" in refused(tmp_path / "zip.csv")
    comma = written(tmp_path, own, sep=";", decimal=",")
    assert "has a decimal comma; write --decimal ," in refused(comma)
    np.testing.assert_array_equal(values(airflock.load_tracks(comma, decimal=",")), values(airflock.load_tracks(own)))
    (tmp_path / "odd.csv").write_text("t,x,y\n0,1,5,2,5\n")
    assert "row 2 has 5 cells, the header 3" in refused(tmp_path / "odd.csv")
    (tmp_path / "wide.csv").write_text(",".join(f"c{i}" for i in range(100_000)) + "\n")
    assert "100000 columns are more than 2000" in refused(tmp_path / "wide.csv")
    (tmp_path / "numbers.csv").write_text("1,2,3\n4,5,6\n")
    assert "the first row holds numbers" in refused(tmp_path / "numbers.csv")
    (tmp_path / "text.csv").write_text("t,x,y\n0,1,2\n1,one,2\n")
    assert "column x, row 3: 'one' is not a number" in refused(tmp_path / "text.csv")
    np.save(tmp_path / "objects.npy", np.array({"trajectories": np.zeros(3)}, object), allow_pickle=True)
    line = refused(tmp_path / "objects.npy", fps=25.0, unit="m")
    assert "pickled" in line and "idtrackerai_format" in line
    assert ": unknown format" in refused(written(tmp_path, own, "a.xlsx"))
    assert "no such file" in refused(tmp_path / "nothing.csv")


def test_archives_and_pickles_are_told_whatever_they_are_called(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("log.csv", "t,x,y")
    for name in ("a.csv", "a.nc", "a.parquet", "a.ulg", "a.h5"):
        path = tmp_path / name
        path.write_bytes((tmp_path / "a.zip").read_bytes())
        assert refused(path) == f"{path}: is a zip archive; unpack it first: unzip {name}"
    with pytest.raises(RecordingError, match=r"a\.nc: is a zip archive; unpack it first"):
        airflock.load_recording(tmp_path / "a.nc")
    (tmp_path / "a.npz").write_bytes((tmp_path / "a.zip").read_bytes())
    assert "is an archive of log.csv, which is no array" in refused(tmp_path / "a.npz", fps=1.0, unit="m")
    circle().to_pickle(tmp_path / "log.pkl")
    for open_it in (airflock.load_tracks, airflock.load_recording):
        with pytest.raises(RecordingError, match="pickled Python objects.*to_csv"):
            open_it(tmp_path / "log.pkl")


def test_faults_of_many_individuals_are_one_line_for_the_file(tmp_path):
    table = flock(5)
    path = written(tmp_path, pd.concat([table, table.iloc[::100]], ignore_index=True))
    line = refused(path)
    assert line == (
        f"{path}: column t: 20 rows of 5 individuals repeat a time, first row 2002; remove the duplicates; "
        "or keep the first of each: --accept duplicates"
    )
    assert airflock.load_tracks(path, accept="duplicates").equals(airflock.load_tracks(written(tmp_path, table)))
    short = pd.concat([circle().assign(id="a"), *(circle(i).iloc[: 10 + i].assign(id=f"b{i}") for i in range(9))])
    line = refused(written(tmp_path, short))
    assert line.count("\n") == 0 and "b0 is there for 3% of" in line and "8 more for less than 20%" in line


def test_a_unit_of_time_that_is_wrong_is_told_without_a_velocity(tmp_path):
    """Microseconds named milliseconds were taken for one row in 50 seconds."""
    own = circle()[["t", "x", "y"]]
    path = written(tmp_path, own.assign(t=(own["t"] * 1e6).round().astype(int)).rename(columns={"t": "t [ms]"}))
    line = refused(path)
    assert line == (
        f"{path}: column t [ms]: rows of log are 50 s apart, first row 2: us named ms? "
        "Write --map \"t:='t [ms]'*1e-06\"; or keep it so: --accept time"
    )
    assert airflock.load_tracks(path, map={"t": "'t [ms]'*1e-06"}).attrs["fps"] == RATE
    slow = own.assign(t=own["t"] * 1e6 / RATE)
    assert "if times are no seconds, for instance --time-unit ms or us" in refused(slow)
    assert "ms? Write --time-unit ms; if they are seconds, --time-unit s" in refused(slow, unit="m")
    assert airflock.load_tracks(slow, unit="m", time_unit="s").attrs["fps"] == pytest.approx(1e-6 * RATE**2, rel=1e-3)
    dates = own.assign(t=1.7e12 + own["t"] * 1e6).rename(columns={"t": "t [ms]"})  # a fix a minute, since 1970
    assert airflock.load_tracks(dates).sizes["time"] == len(own)


def test_what_is_said_of_a_reset_helps(tmp_path):
    """The window was cut after the check, so that the advice to cut was refused, too."""
    own = circle()
    own.loc[200:, "x"] += 4.0
    assert "cut before or after it with --end or --begin" in refused(written(tmp_path, own))
    for window in ({"end": 9.95}, {"begin": 10.0}):
        found = airflock.load_tracks(own, **window)
        assert found.sizes["time"] == 200 and (found["confidence"] == 1.0).all()


def test_axes_of_headers_with_units_are_told_apart(tmp_path):
    table = circle()[["t", "vx", "vy"]].assign(**{"x [m]": circle()["y"], "y [m]": circle()["x"]})
    line = refused(written(tmp_path, table), axes="ned")
    assert "write, without --axes, --map \"x:='y [m]'\" --map \"y:='x [m]'\"" in line
    airflock.load_tracks(written(tmp_path, table), map={"x": "'y [m]'", "y": "'x [m]'"})


def test_all_faults_are_told_at_once(tmp_path):
    table = written(tmp_path, circle().rename(columns={"t": "clock"}))
    text = refused([table, tmp_path / "none.csv"], map={"q": "x", "x": "east"})
    assert len(text.splitlines()) == 3 and "no target q" in text and "no column east" in text and "no such file" in text


def test_clocks_of_several_files_need_a_reason(tmp_path):
    files = [written(tmp_path, circle(i), f"{i}.csv") for i in range(2)]
    assert "--same-clock" in refused(files)
    late = circle(1)
    late = late.assign(utc=1.7e9 + late["t"], t=late["t"] * (1 + 2e-5) + 77.0)
    files = [written(tmp_path, circle().assign(utc=1.7e9 + circle()["t"]), "0.csv"), written(tmp_path, late, "1.csv")]
    found = airflock.load_tracks(files)
    np.testing.assert_allclose(
        values(found)[:, :, 1], circle(1)[["x", "y"]].to_numpy(), atol=5e-3
    )  # 20 s are too few for a drift


def test_a_flock_around_the_origin_is_not_taken_for_one_that_points_down(tmp_path):
    """One fish below the others was enough to refuse what `airflock export` had written."""
    table = pd.concat([circle(i).assign(id=f"fish_{i}", z=2.0 * i - 3.0) for i in range(4)])
    assert airflock.load_tracks(written(tmp_path, table)).sizes["space"] == 3
    line = refused(written(tmp_path, table.assign(z=table["z"] - 8.0)))
    assert "z of fish_0 lies below -1 m, first row 2: it points down" in line and line.count("\n") == 0


def test_one_that_is_hardly_there_is_told(tmp_path):
    table = pd.concat([circle().assign(id="a"), circle(1).iloc[:30].assign(id="b")])
    assert "b is there for 8% of 19.95 s" in refused(written(tmp_path, table))
    found = airflock.load_tracks(table, accept=["absent"])
    assert np.isnan(values(found)[60:, :, 1]).all()


def test_notes_tell_what_was_done():
    own = circle().drop(columns=["vx", "vy", "cx", "cy"]).round({"x": 0, "y": 0})
    notes = json.loads(airflock.load_tracks(own).attrs["airflock_import"])["notes"]
    assert any("no velocity" in note for note in notes) and any("steps of 1 m" in note for note in notes)


def test_tracks_that_are_scored_before_they_are_imported_are_told_how(tmp_path):
    path = written(tmp_path, circle())
    with pytest.raises(RecordingError, match="airflock import log.csv --save"):
        airflock.load_recording(path)


@pytest.mark.parametrize(("header", "times"), [("time_ms", 1e6), ("t", 1e3), ("time_us", 1e9), ("time [ms]", 1e6)])
def test_what_a_wrong_unit_of_time_says_to_write_is_right(tmp_path, header, times):
    t = np.arange(0.0, 30.0, 0.1)
    table = pd.DataFrame({"id": "a", header: t * times, "x [m]": 9.0 * np.sin(t / 3.0), "y [m]": 9.0 * np.cos(t / 3.0)})
    table["vx [m/s]"], table["vy [m/s]"] = 3.0 * np.cos(t / 3.0), -3.0 * np.sin(t / 3.0)
    table.to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(RecordingError, match="the time counts") as fault:
        airflock.load_tracks(tmp_path / "a.csv")
    advice = re.search(r"write --map \"t:=(.+?)\"; or keep", str(fault.value))[1]
    found = airflock.load_tracks(tmp_path / "a.csv", map={"t": advice})
    assert float(found["time"][-1] - found["time"][0]) == pytest.approx(29.9, rel=1e-3)


@pytest.mark.parametrize("rate", [30.0, 60.0, 30000.0 / 1001.0, 24.0])
def test_frames_of_a_video_are_the_frames_of_the_recording(rate):
    frames = np.arange(4000)
    jitter = np.random.default_rng(5).normal(0.0, 1.0, (len(frames), 2))
    table = pd.DataFrame({"frame": frames, "id": 0, "x": jitter[:, 0], "y": jitter[:, 1]})
    found = airflock.load_tracks(table, fps=rate, unit="m", precision=64, accept=["jumps"])
    assert found.sizes["time"] == len(frames)
    assert found.attrs["fps"] == pytest.approx(rate, rel=1e-12)
    assert np.array_equal(values(found)[:, :, 0], jitter)


def test_times_in_whole_microseconds_keep_the_rate_of_the_camera():
    t = np.round(np.arange(300) / 30.0, 6)
    found = airflock.load_tracks(pd.DataFrame({"t": t, "id": 0, "x": t, "y": 0.0 * t}), unit="m")
    assert found.attrs["fps"] == pytest.approx(30.0, rel=1e-12)


@pytest.mark.parametrize("rate", [10.0, 30.0, 25.0, 4.0])
@pytest.mark.parametrize("how", ["date", "zone", "text", "duration"])
def test_the_same_frames_whatever_kind_of_time_tells_them(how, rate):
    """Dates are seconds since 1970, which doubles tell to 2.4e-7 s: no frame is lost for that, nor after a gap."""
    t = np.arange(100) / rate
    begin = pd.Timestamp("2020-01-01 12:34:56", tz="CET" if how == "zone" else None)
    when = pd.Series(pd.to_timedelta(t, unit="s") if how == "duration" else begin + pd.to_timedelta(t, unit="s"))
    table = pd.DataFrame({"id": "a", "t": when.astype(str) if how == "text" else when, "x": t, "y": np.sin(t)})
    table.loc[40, "t"] = pd.NaT if how != "text" else ""  # a row without a time is left out
    table = table.drop(index=range(50, 70))
    plain = pd.DataFrame({"id": "a", "t": t, "x": t, "y": np.sin(t)}).drop(index=[40, *range(50, 70)])
    found = airflock.load_tracks(table, unit="m", bridge=0.0)
    same = airflock.load_tracks(plain, unit="m", bridge=0.0)
    assert found.sizes == same.sizes and found["time"].values == pytest.approx(t, abs=1e-12)
    for name in ("position", "velocity", "confidence"):
        assert found[name].values == pytest.approx(same[name].values, abs=1e-4, nan_ok=True)


def test_far_from_the_origin_distances_are_those_of_the_file():
    t = np.repeat(0.1 * np.arange(30), 2)
    who = np.tile([0, 1], 30)
    east, north = 5e5 + 0.3 * t + 1.1 * who, 5e6 + 0.4 * t  # metres of a map, where single precision steps by 0.5 m
    notes = []
    recording = airflock.load_tracks(
        {"t": t, "id": who, "x": east, "y": north}, unit="m", time_unit="s", say=notes.append
    )  # fmt: skip
    place = recording["position"].values[:, :, 0]
    assert np.abs(np.linalg.norm(place[:, :, 1] - place[:, :, 0], axis=1) - 1.1).max() < 1e-6
    assert any("64 bits" in note for note in notes)
    near = airflock.load_tracks({"t": t, "id": who, "x": east - 5e5, "y": north - 5e6}, unit="m", time_unit="s")
    assert near["position"].dtype == np.float32


@pytest.mark.parametrize("far", [2e9, 1e39, 1e308])
def test_places_that_nobody_flies_at_are_refused_in_one_line(far):
    table = flock(2)
    table["x"] += far
    line = refused(table.drop(columns=["vx", "vy", "cx", "cy"]))
    assert "\n" not in line and "m from the origin" in line and "bird_" in line


def plane(count=40, **columns):
    """One bird of Movebank that goes north, a row each second."""
    return pd.DataFrame({
        "timestamp": pd.date_range("2024-01-01", periods=count, freq="1s"),
        "location-long": 19.04,
        "location-lat": 47.5 + 1e-5 * np.arange(count),
        "individual-local-identifier": "stork",
        **columns,
    })  # fmt: skip


@pytest.mark.parametrize("lacking", [slice(0, 5), slice(10, 12), slice(35, 40)])
def test_a_row_without_a_height_does_not_take_the_others_along(lacking):
    """The first fix is the origin; where its height was missing nobody was anywhere, and nobody was told."""
    heights = np.full(40, 300.0)
    whole = airflock.load_tracks(plane(**{"height-above-ellipsoid": heights}), origin=(47.5, 19.04, 300.0))
    heights[lacking] = np.nan
    found = airflock.load_tracks(plane(**{"height-above-ellipsoid": heights}), origin=(47.5, 19.04, 300.0), bridge=0.0)
    there = found["confidence"].values[:, 0, 0] == 1.0
    kept = np.delete(values(whole), lacking, axis=0)
    np.testing.assert_allclose(values(found)[there], kept, atol=1e-4)
    assert np.isnan(values(found)[~there]).all() and there.sum() == np.isfinite(heights).sum()
    assert "rows of stork without a height left out" in found.attrs["airflock_import"]
    assert np.isfinite(values(airflock.load_tracks(plane(**{"height-above-ellipsoid": heights})))[-8:-6]).all()


def test_a_column_of_heights_without_one_is_none():
    flat = airflock.load_tracks(plane())
    found = airflock.load_tracks(plane(**{"height-above-ellipsoid": np.nan}))
    assert np.array_equal(values(found), values(flat)) and "holds no height" in found.attrs["airflock_import"]
    assert values(airflock.load_tracks(circle().assign(z=np.nan))).shape == (400, 2, 1)
    table = pd.concat([circle().assign(id="a", z=5.0), circle(1).assign(id="b", z=np.nan)])
    assert 'column z holds no height of b, but of others; leave it out, or put all at one height: --map "z:=0"' in (
        refused(table)
    )


def test_differentiated_velocities_are_one_sided_at_the_ends_and_a_note_says_so():
    """Of x = t²/2 central differences are exact; at both ends they are half a frame off."""
    t = 0.1 * np.arange(20)
    found = airflock.load_tracks({"t": t, "id": ["a"] * 20, "x": 0.5 * t**2, "y": t}, unit="m", time_unit="s")
    east = values(found, "velocity")[:, 0].ravel()
    np.testing.assert_allclose(east[1:-1], t[1:-1], atol=1e-5)
    np.testing.assert_allclose(east[[0, -1]], [0.05, t[-1] - 0.05], atol=1e-5)
    assert (
        "differentiated from positions, one-sided at both ends of a track and of gaps" in found.attrs["airflock_import"]
    )


def test_velocities_that_are_not_there_are_differentiated():
    table = circle()
    bare = values(airflock.load_tracks(table[["t", "x", "y"]]), "velocity")
    empty = airflock.load_tracks(table.assign(vx=np.nan, vy=np.nan))
    assert np.array_equal(values(empty, "velocity"), bare) and "no velocity" in empty.attrs["airflock_import"]
    table.loc[5:8, "vx"] = np.nan
    found = values(airflock.load_tracks(table), "velocity")
    assert np.array_equal(found[5:9, 0], bare[5:9, 0])
    np.testing.assert_array_equal(found[20:, 0, 0], circle()["vx"].to_numpy(np.float32)[20:])


def test_rows_that_cannot_be_placed_are_told():
    table = flock()
    table.loc[0:4, "id"] = None
    table.loc[10, "t"] = np.nan
    table.loc[table["id"] == "bird_2", "x"] = np.nan
    found = airflock.load_tracks(table)
    notes = json.loads(found.attrs["airflock_import"])["notes"]
    assert "DataFrame: 5 rows without an id left out, first row 0" in notes
    assert "DataFrame: 1 rows without a time left out, first row 10" in notes
    assert "DataFrame: bird_2: has no position at any time: left out" in notes
    assert list(found["individual"].values) == ["bird_0", "bird_1"]
    assert refused(table.assign(x=np.nan)) == "DataFrame: no row has both a time and a position"


def test_rows_without_satellite_time_are_kept():
    """A receiver tells the time once a second, the estimator its position twenty times."""
    table = circle()
    second = np.arange(len(table)) % 20 == 0
    table["utc"] = np.where(second, 1.7e9 + table["t"], np.nan)
    found = airflock.load_tracks(table)
    np.testing.assert_allclose(values(found)[:, :, 0], circle()[["x", "y"]].to_numpy(), atol=1e-5)


def test_a_masked_place_is_missing_and_an_object_that_is_a_number_is_one():
    array = np.stack([circle(i)[["x", "y"]].to_numpy() for i in range(2)], axis=1)
    hidden = np.ma.array(array, mask=False)
    hidden[100:200, 0] = np.ma.masked
    found = values(airflock.load_tracks(hidden, fps=RATE, unit="m"))
    assert np.isnan(found[100:200, :, 0]).all() and np.isfinite(found[:, :, 1]).all()
    whole = values(airflock.load_tracks(array, fps=RATE, unit="m"))
    assert np.array_equal(values(airflock.load_tracks(array.astype(object), fps=RATE, unit="m")), whole)
    assert "holds what is not a number" in refused(np.full((5, 2, 2), "x", object), fps=1.0, unit="m")
    assert "holds complex128, not numbers" in refused(array + 1j, fps=1.0, unit="m")


def test_a_dataset_whose_time_is_dates_or_durations_needs_no_unit():
    plain = airflock.load_tracks(flock(), precision=64)
    seconds = plain["time"].values
    for times in (
        pd.to_timedelta(seconds, unit="s"),
        pd.Timestamp("2024-03-31T00:59:50") + pd.to_timedelta(seconds, "s"),
    ):
        found = airflock.load_tracks(plain.assign_coords(time=times), precision=64)
        assert found.attrs["fps"] == RATE
        np.testing.assert_allclose(values(found), values(plain), atol=1e-5)


@pytest.mark.parametrize(("begin", "end"), [(3.02, None), (3.02, 7.01), (3.05, 7.05), (-1.01, None), (0.0, 25.0)])
def test_a_window_holds_the_frames_that_lie_in_it(begin, end):
    """One that began between two frames held none of them: places halfway between, and an absent one in front."""
    own = circle()
    found = airflock.load_tracks(own, begin=begin, end=end, precision=64)
    times = found["time"].values + found.attrs["airflock_begin"]
    assert begin <= times[0] + 1e-9 < begin + 1.0 / RATE + 1e-9
    there = found["confidence"].values[:, 0, 0] == 1.0
    inside = own[(own["t"] >= begin - 1e-9) & (own["t"] <= (end or 1e9) + 1e-9)]
    np.testing.assert_array_equal(values(found)[there, :, 0], inside[["x", "y"]].to_numpy())
    np.testing.assert_allclose(times[there], inside["t"], atol=1e-9)


def test_the_comparison_of_axes_keeps_no_long_log_in_memory():
    """Of an hour of thirty drones it kept 0.28 GB: each twentieth row as a view of all."""
    table = circle(seconds=10_000.0)
    columns = {name: table[name].to_numpy() for name in ("x", "y", "vx", "vy")}
    long = ImportedTrack("drone", "log", table["t"].to_numpy(), columns, np.arange(len(table)))
    for found in motion._displacements(long, 2):
        assert found.base is None and 20_000 <= len(found) < 30_000


GIVEN_BACK = """
import numpy as np
from airflock.recordings.imports import resampling
from airflock.recordings.imports.track import COMMAND_TARGETS, POSITION_TARGETS, VELOCITY_TARGETS, ImportedTrack

def told(word):
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith(word))

def one(number, rows):
    columns = {name: np.linspace(0.0, 100.0, rows) for name in (*POSITION_TARGETS, *VELOCITY_TARGETS, *COMMAND_TARGETS)}
    return ImportedTrack(str(number), "log", np.linspace(0.0, 0.02 * (rows - 1), rows), columns, np.arange(rows))

resampling.resample([one(0, 100)], np.arange(10) * 0.02, 0.02, 1.0, 32)
tracks = [one(number, 60_000) for number in range(30)]
times, period = resampling.time_grid(tracks, None, None, None)
before = told("VmRSS")
found, _ = resampling.resample(tracks, times, period, 1.0, 32)
print((told("VmHWM") - before) * 1024 / found.nbytes)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not tell how much memory is used")
def test_rows_are_given_back_as_the_recording_fills():
    """Rows and recording were in memory together: 1.17 GB of an hour of thirty drones with commands."""
    ran = subprocess.run([sys.executable, "-c", GIVEN_BACK], capture_output=True, text=True, check=True, timeout=120)
    assert float(ran.stdout) < 0.5


def test_two_individuals_of_one_name_in_a_dataset_are_told():
    found = airflock.load_tracks(flock(1))
    assert "bird_0 is also in dataset" in refused(xr.concat([found, found], "individual"))


@pytest.mark.parametrize("kind", ["frame", "csv", "wide", "array", "dataset"])
def test_rows_without_a_number_are_told_with_file_column_and_first_row(tmp_path, kind):
    """They were dropped in silence: a log half of nan looked like a short one."""
    table = flock(2, seconds=10.0)
    table.loc[10:14, ["x", "y"]] = np.nan
    table.loc[30:32, "x"] = np.inf
    x = table["x"].to_numpy().reshape(2, -1)
    y = table["y"].to_numpy().reshape(2, -1)
    places = np.stack([x, y], axis=-1).swapaxes(0, 1)
    options, first, where = {}, 10, "DataFrame"
    if kind == "csv":
        table = written(tmp_path, table)
        first, where = 12, str(table)
    if kind == "wide":
        table = pd.DataFrame({"t": np.arange(len(places)) / RATE, "x1": x[0], "y1": y[0], "x2": x[1], "y2": y[1]})
    if kind == "array":
        table, options, where = places, {"fps": RATE, "unit": "m"}, "array"
    if kind == "dataset":
        plain = airflock.load_tracks(flock(2, seconds=10.0), precision=64)
        table, where = plain.assign(position=(plain["position"].dims, places.swapaxes(1, 2)[:, :, None])), "dataset"
        options = {"unit": "m"}
    found = airflock.load_tracks(table, bridge=0.0, **options)
    notes = json.loads(found.attrs["airflock_import"])["notes"]
    told = [note for note in notes if "taken as absent" in note]
    assert told == [
        f"{where}: column x: 8 rows without a number taken as absent (3 of them inf), first row {first}",
        f"{where}: column y: 5 rows without a number taken as absent, first row {first}",
    ]
    assert (~np.isfinite(values(found)[:, 0])).sum() == 8


def test_speeds_and_commands_without_a_number_are_told_and_infinite_ones_are_none():
    table = circle()
    table.loc[5:8, ["vx", "vy"]] = np.nan
    table.loc[20:21, "cx"] = -np.inf
    found = airflock.load_tracks(table)
    notes = json.loads(found.attrs["airflock_import"])["notes"]
    assert (
        "DataFrame: column vx, vy: 4 rows without a number: differentiated from positions there, first row 5" in notes
    )
    assert "DataFrame: column cx: 2 rows without a number: no command there (2 of them inf), first row 20" in notes
    assert not np.isinf(values(found, "command")).any()


def test_rows_that_a_px4_estimator_calls_invalid_are_told():
    table = circle().rename(columns={"t": "timestamp"}).drop(columns=["cx", "cy"])
    table = table.assign(timestamp=table["timestamp"] * 1e6, z=-5.0, vz=0.0, xy_valid=1, v_xy_valid=1)
    table.loc[100:109, "xy_valid"] = 0
    notes = json.loads(airflock.load_tracks(table).attrs["airflock_import"])["notes"]
    line = "DataFrame: column xy_valid: 10 rows that the estimator calls invalid left out, first row 100"
    assert any(note.startswith(line) for note in notes)


def on_own_clocks(seed, count=4, utc="utc_us", written=1e-6, late=0.0):
    """Drones in line, 10 m apart at 5 m/s, in one table; each counts its time since it was switched on."""
    random, step, parts = np.random.default_rng(seed), 0.2, []
    for k, early in enumerate(random.uniform(3.0, 200.0, count)):
        t = step * np.arange(150)
        held = np.floor((1_764_000_000.0 + t + random.uniform(0.0, late, 150)) / written) * written
        place = {"x": 5.0 * t, "y": 10.0 * k, "z": 20.0}
        clock = np.round(held / written).astype(np.int64) if utc.endswith("_us") else held
        parts.append(pd.DataFrame({"id": k, "t": early * (1.0 + 1e-5 * k) + t, **place, utc: clock}))
    return pd.concat(parts, ignore_index=True)


@pytest.mark.parametrize(("column", "map"), [("utc_us", {}), ("odd_us", {"utc": "odd_us*1e-6"}), ("unix_time", {})])
def test_individuals_of_one_table_whose_clocks_differ_meet_by_its_column_of_utc(seed, column, map):
    notes = []
    found = airflock.load_tracks(on_own_clocks(seed, utc=column, late=0.02), map=map, say=notes.append, unit="m")
    scores = airflock.score(found).iloc[0]
    assert found.time.values[-1] == pytest.approx(29.8, abs=0.3)
    assert scores["phi_vel"] == pytest.approx(5.0, abs=0.05) and scores["r_min"] == pytest.approx(10.0, abs=0.05)
    assert any("each individual has a clock of its own" in note and "column t" in note for note in notes)


def test_one_clock_beside_utc_to_the_second_stays_one_clock(seed):
    table = flock(3)
    random = np.random.default_rng(seed)
    table["utc"] = np.floor(1_764_000_000.0 + table["t"] + random.uniform(0.0, 0.02, len(table)))
    with_utc, without = airflock.load_tracks(table), airflock.load_tracks(table.drop(columns="utc"))
    np.testing.assert_array_equal(values(with_utc), values(without))


def test_clocks_of_some_individuals_alone_are_a_question_and_readings_before_a_fix_are_one(seed):
    table = on_own_clocks(seed).astype({"utc_us": float})
    table.loc[table["id"] == 1, "utc_us"] = np.nan
    assert "1: nothing says that the clocks of 4 individuals agree" in refused(table, unit="m")
    table = on_own_clocks(seed)
    table.loc[table.index % 150 < 5, "utc_us"] = 0
    assert "leave out the rows without a fix" in refused(table, unit="m")


def test_what_nobody_was_there_together_for_is_missing_and_not_zero(seed):
    table = on_own_clocks(seed).drop(columns="utc_us")
    table["t"] += 1000.0 * table["id"]
    notes = []
    found = airflock.load_tracks(table, unit="m", say=notes.append, accept=["absent"])
    scores = airflock.score(found, body_length=1.0).iloc[0].drop("present")
    assert scores.isna().all() and len(scores) > 5
    assert any("no two individuals are there at a time" in note and "--map utc:=COLUMN" in note for note in notes)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_files_of_one_name_have_the_ids_of_the_nearest_folders_that_differ(tmp_path, ending):
    """Every ArduPilot calls its first log 00000001.BIN, and folders of logs are called logs."""
    files, notes = [tmp_path / f"drone {k}" / "logs" / f"00000001.{ending}" for k in (1, 2, 3)], []
    for k, file in enumerate(files):
        file.parent.mkdir(parents=True)
        table = circle(k)
        table.to_csv(file, index=False) if ending == "csv" else table.to_parquet(file)
    for how in ({}, {"map": {"id": "file"}}):
        found = airflock.load_tracks(files, same_clock=True, say=notes.append, **how)
        assert list(found["individual"].values) == ["drone 1", "drone 2", "drone 3"]
        np.testing.assert_allclose(
            values(found)[0, :, 2], [10 * 0 + 12 * np.sin(2.0), 12 * np.cos(2.0) + 6.0], atol=1e-5
        )
    assert any(f"named by their folders: drone 1 ({files[0]})" in note for note in notes)


def test_folders_that_do_not_part_files_of_one_name_are_a_question(tmp_path):
    files = [tmp_path / drone / f"{flight}.csv" for drone in ("a", "b") for flight in (1, 2)]
    for k, file in enumerate(files):
        file.parent.mkdir(exist_ok=True)
        circle(k).to_csv(file, index=False)
    assert "1 is also in" in refused(files, same_clock=True) and "give each a folder" in refused(files, same_clock=True)
    circle(5).to_csv(tmp_path / "a.csv", index=False)  # whose name is that of a folder
    assert "give each a folder" in refused([files[0], files[2], tmp_path / "a.csv"], same_clock=True)


@pytest.mark.parametrize("mistake", ["none", "units", "direction", "zero", "still"])
def test_one_velocity_of_all_is_compared_with_where_they_go(seed, mistake):
    """Drones that all fly straight have no correlation to look at; it was said that nothing moves."""
    rng = np.random.default_rng(seed)
    for _ in range(10):
        vx, vy = rng.uniform(0.5, 5.0, 2) * rng.choice([-1.0, 1.0], 2)
        t = np.arange(200) / RATE
        said = {"units": (100.0 * vx, 100.0 * vy), "direction": (-vx, vy), "zero": (0.0, 0.0)}.get(mistake, (vx, vy))
        went = (0.0, 0.0) if mistake == "still" else (vx, vy)
        said = (0.0, 0.0) if mistake == "still" else said
        table = pd.concat(
            pd.DataFrame(
                {"t": t, "id": f"d{k}", "x": 5.0 * k + went[0] * t, "y": went[1] * t, "vx": said[0], "vy": said[1]}
            )
            for k in range(3)
        )
        if mistake in ("none", "still"):
            found = airflock.load_tracks(table)
            assert ("nothing moves" in found.attrs["airflock_import"]) is (mistake == "still")
            assert np.allclose(values(found)[-1, :, 0] - values(found)[0, :, 0], (t[-1] * went[0], t[-1] * went[1]))
        else:
            line = refused(table)
            assert "column x, row" in line and "say [" in line and "--accept axes" in line
            assert airflock.load_tracks(table, accept=["axes"]).sizes["individual"] == 3
