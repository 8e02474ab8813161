"""The power of a recorded formation is that of the same wings standing still, whichever way they fly."""

import math

import numpy as np
import pytest

from airflock.recordings.dataset import make_dataset
from airflock.recordings.flown_scenario import power_settings
from airflock.recordings.scores import measure_recording
from formations import FOOT, drags, vee, wing_of

pytestmark = pytest.mark.usefixtures("scored_plainly")

WING = {
    "wing.segments": "5",
    "wing.span": 2.0,
    "wing.chord": 0.4,
    "wing.speed": 12.0,
    "metrics.r_coll": 0.2,
    "metrics.t_settle": 1.0,
}


def flown(places, heading, speed=12.0, dimensions=3):
    """Recording of a formation (n, 3) that flies straight for two seconds, ten frames a second."""
    c, s = math.cos(heading), math.sin(heading)
    turned = places @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    velocity = speed * np.array([c, s, 0.0])
    times = np.arange(21) * 0.1
    position = turned.T[None] + velocity[None, :, None] * times[:, None, None]
    frames = np.zeros((21, 3 * dimensions, len(places)))
    frames[:, :dimensions] = position[:, :dimensions]
    frames[:, dimensions : 2 * dimensions] = velocity[None, :dimensions, None]
    return make_dataset(frames, dimensions, 0.1, {}, "velocity")


def test_a_formation_saves_the_same_in_any_direction(seed):
    rng = np.random.default_rng(seed)
    w = wing_of(segments=5, span=2.0, chord=0.4, speed=12.0, core=0.05, weight=44.4822)
    places = vee(5, 5.0 * FOOT, 0.95 * 2.0) + rng.normal(0.0, 0.05, (5, 3))
    expected = float(drags(places, w).mean()) * 12.0
    alone = float(drags(np.zeros((1, 3)), w)[0]) * 12.0
    for heading in (0.0, rng.uniform(0.0, 2.0 * math.pi)):
        recording = flown(places, heading)
        values, course = measure_recording(recording, power_settings(recording, WING))
        assert values["power"] == pytest.approx(expected, rel=1e-5)
        assert values["saving"] == pytest.approx(1.0 - expected / alone, rel=1e-5)
        assert np.ptp(course["power"]) < 1e-4 * expected
        assert values["n_coll"] == 0.0 and values["unrest"] < 1e-6
