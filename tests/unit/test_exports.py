"""Round trips: what is written for other tools reads back as it was."""

import numpy as np
import pytest
import xarray as xr

import airflock
from airflock.recordings.exports import movement, tables


@pytest.fixture(scope="module")
def recording():
    """Five agents with the layout of a flight; one is absent for a while."""
    generator = np.random.default_rng(7)
    from airflock.recordings.layout import dataset

    time = np.arange(200) * 0.1
    phase = generator.uniform(0, 6, 5)[None, :] + 0.4 * time[:, None]
    place, speed = 12 * np.stack([np.sin(phase), np.cos(phase)], 1), 4.8 * np.stack([np.cos(phase), -np.sin(phase)], 1)
    found = dataset(np.concatenate([place, speed, 1.1 * speed], 1).astype(np.float32), 2, 0.1, {}, "velocity")
    for name in ("position", "velocity", "command"):
        found[name][{"time": slice(50, 90), "individual": 2}] = np.nan
    return found


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_tables_come_back_with_the_same_bits(recording, tmp_path, ending):
    if ending == ".parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path / f"tracks{ending}"
    (tables.write_csv if ending == ".csv" else tables.write_parquet)(recording, path)
    back = airflock.load_tracks(path)
    for name in ("position", "velocity", "command"):
        own = recording[name].transpose("time", "space", "keypoint", "individual").values
        np.testing.assert_array_equal(back[name].values, own)
    assert list(back["individual"].values) == list(recording["individual"].values)
    assert back["confidence"].values[60, 0, 2] == 0.0


@pytest.mark.parametrize("old", [False, True])
def test_both_layouts_of_movement_come_back(recording, tmp_path, old):
    path = movement.write_movement(recording, tmp_path / "tracks.nc", old=old)
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        assert ("individuals" in opened.dims) == old and opened.attrs["ds_type"] == "poses"
    back = airflock.load_tracks(path)
    np.testing.assert_array_equal(back["position"].values, recording["position"].values)


def test_a_saved_import_is_a_recording(recording, tmp_path):
    found = airflock.load_tracks(tables.to_table(recording))
    airflock.save(found, tmp_path / "tracks.nc")
    xr.testing.assert_equal(airflock.load_recording(tmp_path / "tracks.nc"), found)
