"""Round trips: what is written for other tools reads back as it was."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import airflock
from airflock.recordings import exports as tables


@pytest.fixture(scope="module")
def recording():
    """Five agents with the layout of a flight; one is absent for a while."""
    generator = np.random.default_rng(7)
    from airflock.recordings.dataset import make_dataset

    time = np.arange(200) * 0.1
    phase = generator.uniform(0, 6, 5)[None, :] + 0.4 * time[:, None]
    place, speed = 12 * np.stack([np.sin(phase), np.cos(phase)], 1), 4.8 * np.stack([np.cos(phase), -np.sin(phase)], 1)
    found = make_dataset(np.concatenate([place, speed, 1.1 * speed], 1).astype(np.float32), 2, 0.1, {}, "velocity")
    for name in ("position", "velocity", "command"):
        found[name][{"time": slice(50, 90), "individual": 2}] = np.nan
    return found


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_tables_come_back_with_the_same_bits(recording, tmp_path, ending):
    if ending == ".parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path / f"tracks{ending}"
    airflock.export(recording, path)
    back = airflock.load_tracks(path)
    for name in ("position", "velocity", "command"):
        own = recording[name].transpose("time", "space", "keypoint", "individual").values
        np.testing.assert_array_equal(back[name].values, own)
    assert list(back["individual"].values) == list(recording["individual"].values)
    assert back["confidence"].values[60, 0, 2] == 0.0


@pytest.mark.parametrize(("command", "unit"), [("heading", "1"), ("acceleration", "m/s^2")])
@pytest.mark.parametrize("layout", ["movement", "px4"])
def test_what_is_commanded_is_no_velocity_because_it_was_a_table(recording, tmp_path, command, unit, layout):
    """A heading came back as 1 m/s, which identify took for the largest speed; an acceleration was refused."""
    given = recording.copy()
    given["command"] = given["command"].assign_attrs(units=unit)
    path = airflock.export(given, tmp_path / "tracks.csv", layout=layout)
    assert f"cx [{unit}]" in pd.read_csv(path, nrows=1)
    back = airflock.load_tracks(path, axes="ned" if layout == "px4" else "")
    assert "command" not in back and "no commanded velocity: left out" in back.attrs["airflock_import"]
    np.testing.assert_allclose(back["position"].values[:, :2], recording["position"].values, atol=1e-5)


@pytest.mark.parametrize("space", [2, 3])
def test_a_table_like_a_log_of_px4_comes_back_by_its_axes(recording, tmp_path, space):
    from airflock.recordings.dataset import make_dataset

    flat = np.concatenate([recording[name].values[:, :, 0] for name in ("position", "velocity", "command")], axis=1)
    climb = np.linspace(20.0, 30.0, 200)[:, None, None] + 0.0 * flat[:, :1]
    rise = np.full_like(climb, 10.0 / 19.9)
    tall = np.concatenate([flat[:, :2], climb, flat[:, 2:4], rise, flat[:, 4:], 0.0 * rise], axis=1)
    tall[50:90, :, 2] = np.nan
    given = make_dataset(tall if space == 3 else flat, space, 0.1, {}, "velocity")
    path = airflock.export(given, tmp_path / "log.csv", layout="px4")
    table = pd.read_csv(path)
    first = given["position"].values[0, :, 0, 0]
    assert table["timestamp [us]"].dtype == int and table.loc[0, ["x [m]", "y [m]"]].tolist() == [first[1], first[0]]
    assert (table["z [m]"] == 0.0).all() if space == 2 else table["z [m]"].iloc[0] == -20.0
    back = airflock.load_tracks(path, axes="ned")
    own = given.transpose("time", "space", "keypoint", "individual")
    for name in ("position", "velocity", "command"):
        np.testing.assert_allclose(back[name].values[:, :space], own[name].values, atol=1e-5)
    with pytest.raises(airflock.AirflockError, match="write .csv"):
        airflock.export(given, tmp_path / "log.parquet", layout="px4")


@pytest.mark.parametrize("old", [False, True])
def test_both_layouts_of_movement_come_back(recording, tmp_path, old):
    path = airflock.export(recording, tmp_path / "tracks.nc", layout="movement-0.16" if old else "movement")
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        assert ("individuals" in opened.dims) == old and opened.attrs["ds_type"] == "poses"
    back = airflock.load_tracks(path)
    for name in ("position", "velocity", "command"):  # the last two were left out: velocities came back differentiated
        np.testing.assert_array_equal(back[name].values, recording[name].values)


def test_a_saved_import_is_a_recording(recording, tmp_path):
    found = airflock.load_tracks(tables.to_table(recording))
    airflock.save(found, tmp_path / "tracks.nc")
    xr.testing.assert_equal(airflock.load_recording(tmp_path / "tracks.nc"), found)
