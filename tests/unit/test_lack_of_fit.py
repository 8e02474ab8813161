"""What a law leaves over: nothing where nobody heeds anybody, much where they do, and the same in a mirror."""

import numpy as np
import pytest
from test_infer import PERIOD, SPEED, dataset

from airflock.estimate.inference.fit_checks import SHELLS, lack_of_fit
from airflock.estimate.inference.innovation_filter import FitModel
from airflock.estimate.inference.observed_tracks import tracks_from_recording, tracks_scale

AGENTS, FRAMES, TURN = 10, 400, 0.15


def turning(answer, seed):
    """Places (frame, individual, axis) of individuals that turn by an answer to where all others are, and at random."""
    g = np.random.default_rng(seed)
    x, angle = g.uniform(-2.0, 2.0, (AGENTS, 2)), g.uniform(-np.pi, np.pi, AGENTS)
    rows = []
    for _ in range(FRAMES):
        rows.append(x)
        d = x[None] - x[:, None]
        bearing = np.arctan2(d[..., 1], d[..., 0]) - angle[:, None]
        apart = np.where(np.eye(AGENTS, dtype=bool), np.inf, np.linalg.norm(d, axis=2))
        angle = angle + answer(np.angle(np.exp(1j * bearing)), apart) + g.normal(0.0, 0.1, AGENTS)
        x = x + SPEED * PERIOD * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.array(rows) + g.normal(0.0, 0.01, (FRAMES, AGENTS, 2))


def left_by_nobodys_law(place):
    """What is left over of going straight on."""
    tracks = [tracks_from_recording(dataset(place))]
    model = FitModel(None, tracks, tracks_scale(tracks))
    return lack_of_fit(model, model.first(), range(len(model.spans)))


def nobody(bearing, apart):
    return np.zeros(AGENTS)


def nearest(bearing, apart):
    """As far as they can towards the nearest, or away from it where it is near."""
    row = np.arange(AGENTS), apart.argmin(axis=1)
    return TURN * np.sign(bearing[row]) * np.where(apart[row] > 0.5, 1.0, -1.0)


def centre(bearing, apart):
    """A little towards the middle of all others."""
    return 0.1 * np.where(np.isfinite(apart), np.sin(bearing), 0.0).mean(axis=1)


def test_an_answer_that_the_law_lacks_is_left_and_hardly_anything_where_nobody_heeds_anybody(seed):
    """The gains are not fitted here, so that a little of the tracks' own noise can be foreseen."""
    none, blunt, smooth = (left_by_nobodys_law(turning(answer, seed)) for answer in (nobody, nearest, centre))
    assert 10.0 * none < smooth < blunt


def test_a_mirror_changes_nothing(seed):
    place = turning(nearest, seed)
    assert left_by_nobodys_law(place * (1.0, -1.0)) == pytest.approx(left_by_nobodys_law(place), rel=1e-6)


def test_shells_lie_around_the_nearest_distance():
    assert SHELLS[0] < 1.0 < SHELLS[-1] and sorted(SHELLS) == list(SHELLS)
