"""Metrics of a recording with nobody, one agent or missing values only: a value or an error, never a silent NaN."""

import math

import numpy as np
import pytest

from airflock.recordings.dataset import make_dataset
from airflock.recordings.scores import measure_recording
from airflock.support.errors import RecordingError

pytestmark = pytest.mark.usefixtures("scored_plainly")

BY = {"metrics.kind": "zapotecatl", "metrics.max_e": 2.25, "metrics.r_b": 0.05}


def recording(times=3, agents=1, fill=0.3):
    frames = np.full((times, 9, agents), fill)
    return make_dataset(frames, 3, 0.1, {}, "acceleration")


def test_one_agent_is_in_nobody_s_way():
    found, course = measure_recording(recording(), BY)
    assert found["extension_cm"] == 0.0
    assert found["polarization_deg"] == pytest.approx(0.0, abs=1e-3)
    assert found["f_collision"] == 0.0
    assert found["quality"] == pytest.approx(1.0, abs=1e-6)
    assert all(math.isfinite(value) for value in found.values())
    assert np.isfinite(course.to_numpy()).all()


@pytest.mark.parametrize("settings", [{"agents": 0}, {"times": 0}])
def test_an_empty_recording_is_refused(settings):
    with pytest.raises(RecordingError, match="position is empty"):
        measure_recording(recording(**settings), BY)


def test_a_recording_of_nobody_is_refused():
    with pytest.raises(RecordingError, match="no individual is present at any instant"):
        measure_recording(recording(agents=4, fill=np.nan), BY)
    holed = recording(agents=4)
    holed["position"][2, 1, 0, 3] = np.inf
    with pytest.raises(RecordingError, match=r"the position of agent_3 at t = 0\.2 s is infinite"):
        measure_recording(holed, BY)
