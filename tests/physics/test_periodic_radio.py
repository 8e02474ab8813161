"""In a periodic box a radio reaches across a face as it does inside: shifting all agents shifts the flight."""

import numpy as np
import pytest

from flocks import interpreted, scenario

SIDE = 60.0
BOX = {"agents": 5, "duration": 3.0, "world__side": SIDE, "world__edges": "periodic", "start__separation": 0.0}
RADIOS = {
    "loss": {"radio__loss": 0.9, "radio__loss_at": 20.0},
    "links": {"radio__kind": "links", "radio__near": 5.0, "radio__far": 20.0},
    "lossy links": {"radio__kind": "links", "radio__near": 5.0, "radio__far": 20.0, "radio__loss": 0.5},
}


def crowd(seed):
    """Five agents within 20 m about the middle of the box, (component, agent)."""
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.uniform(-10.0, 10.0, (2, 5)), rng.normal(0.0, 3.0, (2, 5))])


@pytest.mark.parametrize("radio", RADIOS)
def test_a_flock_over_a_corner_hears_what_it_hears_in_the_middle(radio, seed):
    found, start = scenario(**BOX, **RADIOS[radio]), crowd(seed)
    corner = start.copy()
    corner[:2] = (corner[:2] + SIDE) % SIDE - 0.5 * SIDE  # half a box on along both axes
    middle, over = (interpreted(found, seed, places).frames for places in (start, corner))
    assert np.abs(np.diff(middle[:, 2:4], axis=0)).max() > 0.1  # they act on each other
    apart = (middle[:, :2] - over[:, :2]) % SIDE
    np.testing.assert_allclose(apart, 0.5 * SIDE, atol=1e-9)
    np.testing.assert_allclose(middle[:, 2:], over[:, 2:], atol=1e-9)
