"""Colours of live pages and replays under full colour blindness of each kind, simulated (Machado et al. 2009)."""

from itertools import combinations

import numpy as np
import pytest

from airflock.view import agent_colours

SEEN = {
    "all cones": np.eye(3),
    "no red cones": np.array([
        [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998],
    ]),
    "no green cones": np.array([
        [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881],
    ]),
    "no blue cones": np.array([
        [1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900],
    ]),
}  # fmt: skip
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
WHITE = np.array([0.9505, 1.0, 1.089])
AT_A_GLANCE = 10.0  # CIE 1976; 2.3 is just noticeable


def lab(rgb, seen):
    """CIE L*a*b* (n, 3) of colours of 0 to 255, as somebody sees them."""
    share = np.asarray(rgb, float) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    ratio = (np.clip(linear @ seen.T, 0.0, 1.0) @ XYZ.T) / WHITE
    f = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16.0 / 116.0)
    return np.stack([116.0 * f[:, 1] - 16.0, 500.0 * (f[:, 0] - f[:, 1]), 200.0 * (f[:, 1] - f[:, 2])], 1)


@pytest.mark.parametrize("who", SEEN)
def test_names_have_colours_that_anybody_tells_apart(who):
    found = lab([*agent_colours.CATEGORY_COLOURS, agent_colours.COLLISION_COLOUR], SEEN[who])
    assert min(np.linalg.norm(a - b) for a, b in combinations(found, 2)) > AT_A_GLANCE


@pytest.mark.parametrize("who", SEEN)
def test_a_scale_becomes_lighter_all_along(who):
    lightness = lab(agent_colours.ramp_colours(np.linspace(0.0, 1.0, 30)), SEEN[who])[:, 0]
    assert (np.diff(lightness) > 0.0).all()


@pytest.mark.parametrize("who", SEEN)
def test_opposite_headings_look_different(who):
    turn = np.linspace(0.0, 0.5, 12, endpoint=False)
    one, other = (lab(agent_colours.wheel_colours(turn + half), SEEN[who]) for half in (0.0, 0.5))
    assert np.linalg.norm(one - other, axis=1).min() > AT_A_GLANCE


@pytest.mark.parametrize("kind", ["scale", "turn", "names", "marks"])
@pytest.mark.parametrize("count", [0, 5])
def test_agents_without_a_value_are_grey_whatever_they_are_coloured_by(kind, count):
    """A flock without faults has no names of faults, and colouring it by them must not end the page."""
    missing = np.full(count, np.nan if kind in ("scale", "turn") else -1.0)
    shown = agent_colours.AgentColours("fault", kind, missing)
    assert (shown.colours == agent_colours.NO_VALUE_COLOUR).all() and shown.colours.shape == (count, 3)
