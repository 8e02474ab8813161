"""Tools of others, where they are installed: `movement` takes what we write, we what it makes; and real fish.

Neither is a dependency: `pip install movement trajectorytools` in a job of its own. Nothing of theirs is kept here.
"""

import numpy as np
import pytest
import xarray as xr

import airflock
from airflock.recordings.dataset import make_dataset


def straight(frames=50, n=3):
    """Straight flights at constant velocity, in the layout of recordings."""
    t = np.arange(frames)[:, None, None] * 0.1
    speed = np.random.default_rng(2).normal(0.0, 2.0, (1, 2, n)) + 0.0 * t
    return make_dataset(np.concatenate([t * speed, speed, speed], axis=1), 2, 0.1, {}, "velocity")


def test_movement_computes_the_velocities_of_what_we_write(tmp_path):
    movement = pytest.importorskip("movement")
    kinematics = pytest.importorskip("movement.kinematics")
    found = straight()
    old = tuple(int(part) for part in movement.__version__.split(".")[:2]) < (0, 17)
    path = airflock.export(found, tmp_path / "tracks.nc", layout="movement-0.16" if old else "movement")
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        theirs = kinematics.compute_velocity(opened.load()["position"])
    names = {"keypoints": "keypoint", "individuals": "individual"}
    theirs = theirs.rename({k: v for k, v in names.items() if k in theirs.dims})
    np.testing.assert_allclose(theirs.transpose(*found["velocity"].dims), found["velocity"], atol=1e-9)


def test_datasets_that_movement_makes_are_read():
    load_poses = pytest.importorskip("movement.io.load_poses")
    place = straight()["position"].values
    theirs = load_poses.from_numpy(place / 0.002, individual_names=["a", "b", "c"], keypoint_names=["body"], fps=10.0)
    found = airflock.load_tracks(theirs, unit="px", scale=0.002, precision=64)
    np.testing.assert_allclose(found["position"].values, place, atol=1e-12)
    assert found.attrs["fps"] == pytest.approx(10.0)


def test_fish_of_a_real_tracker_swim_at_the_speed_of_fish():
    """Zebrafish of idtracker.ai in the wheel of trajectorytools; its own loader opens its pickle, not ours."""
    tools = pytest.importorskip("trajectorytools")
    from trajectorytools.constants import test_trajectories_path

    with pytest.raises(airflock.AirflockError, match="pickled"):
        airflock.load_tracks(test_trajectories_path, unit="px", scale=1.0, fps=32.0)
    fish = tools.Trajectories.from_idtrackerai(test_trajectories_path, interpolate_nans=False)
    rate, body = float(fish.params["frame_rate"]), float(fish.params["body_length_px"])
    pixels = fish.s * fish.params["length_unit"] if "length_unit" in fish.params else fish.s
    found = airflock.load_tracks(np.asarray(pixels), unit="px", scale=1.0 / body, fps=rate, accept=["jumps", "absent"])
    from airflock.recordings.measures.neighbours import nearest_distances

    speed = np.linalg.norm(found["velocity"].values, axis=1)  # in body lengths per second
    assert found.sizes["individual"] == fish.number_of_individuals > 2
    assert 0.05 < np.nanmedian(speed) < 10.0
    assert 0.2 < float(np.nanmedian(nearest_distances(found))) < 50.0
