"""`recording.flock` gives what the public functions give, of recordings and of datasets of `movement`."""

import numpy as np
import pytest
import xarray as xr

import airflock
from airflock.recordings.accessor import measures


@pytest.fixture(scope="module")
def ring():
    """Twelve individuals that mill about their centre."""
    angle = 0.1 * np.arange(20)[:, None] + np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    return airflock.load_tracks(np.stack([np.cos(angle), np.sin(angle)], axis=-1), unit="m", fps=10.0)


def test_the_accessor_gives_what_the_functions_give(ring):
    xr.testing.assert_equal(ring.flock.nearest_distances(), airflock.measures.neighbours.nearest_distances(ring))
    assert ring.flock.milling().iloc[10] == pytest.approx(1.0, abs=1e-3)
    assert ring.flock.score().equals(airflock.score(ring))
    assert ring.flock.plot().axes[0].get_aspect() == airflock.plot(ring).axes[0].get_aspect()
    assert set(measures()) <= set(dir(ring.flock))
    assert {"milling", "leadership", "density_map", "bursts"} <= set(measures())


@pytest.mark.parametrize("plural", [False, True])
def test_a_dataset_of_movement_is_measured_in_one_line(ring, plural):
    """Its layout, in pixels and frames, with the dimensions of both of its generations."""
    position = (ring.position * 100.0).drop_vars("time").assign_attrs(units="px")
    foreign = xr.Dataset(
        {"position": position}, attrs={"source_software": "DeepLabCut", "fps": 10.0, "time_unit": "frames"}
    )
    foreign = foreign.assign_coords(time=np.arange(20))
    foreign = foreign.rename({"keypoint": "keypoints", "individual": "individuals"}) if plural else foreign
    assert foreign.flock(unit="px", scale=0.01).milling().iloc[10] == pytest.approx(1.0, abs=1e-3)


def test_a_name_that_is_none_is_refused_with_the_nearest(ring):
    with pytest.raises(AttributeError, match="flock has no miling; .*milling"):
        ring.flock.miling()
    with pytest.raises(AttributeError, match="flock has no zzz; known: score, .*milling"):
        ring.flock.zzz()


def test_each_name_of_the_accessor_has_the_text_of_its_function(ring):
    for name, function in measures().items():
        assert getattr(ring.flock, name).__doc__ == function.__doc__
