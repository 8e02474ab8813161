"""Measures of tracks: known motions have known values, and those who are not there do not count."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings, strategies as st

from airflock.recordings.dataset import make_dataset, recording_frames
from airflock.recordings.imports.load_tracks import load_tracks
from airflock.recordings.measures import bursts, correlation, delays, milling, neighbours, shape, surroundings, turning
from airflock.recordings.measures.states import track_arrays
from airflock.recordings.scores import score
from airflock.recordings.simulation import simulate
from airflock.scenarios.files import load
from airflock.support.errors import ParameterError

pytestmark = pytest.mark.usefixtures("scored_plainly")


def recording(place, speed, period=0.1):
    """From position and velocity (time, axis, individual)."""
    frames = np.concatenate([place, speed, speed], axis=1)
    return make_dataset(frames, place.shape[1], period, {}, "velocity")


def crowd(seed, frames=5, n=12, axes=2):
    g = np.random.default_rng(seed)
    return g.normal(0.0, 5.0, (frames, axes, n)), g.normal(0.0, 1.0, (frames, axes, n))


def without(found, who, frames=slice(None)):
    """The same, but one is absent in some frames."""
    gone = found.copy(deep=True)
    for name in ("position", "velocity"):
        gone[name][{"time": frames, "individual": who}] = np.nan
    return gone


def turned(found, angle, shift=(3.0, -7.0)):
    """The same, turned and shifted as a whole."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, -s], [s, c]])
    place = np.einsum("ab,tbi->tai", matrix, found["position"].values[:, :, 0]) + np.array(shift)[None, :, None]
    return recording(place, np.einsum("ab,tbi->tai", matrix, found["velocity"].values[:, :, 0]))


def wandering(frames=600, period=0.1, seed=3):
    angle = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.3, frames))
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def test_a_follower_is_found_with_its_delay():
    heading, late = wandering(), 7
    followed = np.roll(heading, late, axis=0)
    speed = np.stack([heading, followed, wandering(seed=9)], axis=2)[late:]
    found = recording(np.cumsum(speed, axis=0) * 0.1, speed)
    table = delays.leadership(found, longest=2.0, least=0.5)
    row = table[(table["leader"] == "agent_0") & (table["follower"] == "agent_1")].iloc[0]
    assert row["delay"] == pytest.approx(0.7) and row["correlation"] == pytest.approx(1.0)
    back = table[(table["leader"] == "agent_1") & (table["follower"] == "agent_0")].iloc[0]
    assert back["delay"] == pytest.approx(-0.7) and len(table) == 2  # the third wanders alone
    gap = delays.leadership(without(found, 1, slice(100, 300)), 2.0, 0.5)
    assert gap[gap["leader"] == "agent_0"].iloc[0]["delay"] == pytest.approx(0.7)


def test_delay_correlation_is_brute_force():
    place, speed = crowd(1, frames=30, n=4)
    found = without(recording(place, speed), 2, slice(5, 12))
    table = delays.delay_correlation(found, 0.5)
    h = speed / np.linalg.norm(speed, axis=1, keepdims=True)
    there = np.ones((30, 4), bool)
    there[5:12, 2] = False
    for i, j, shift in [(0, 1, 3), (2, 0, -4), (2, 3, 5), (1, 2, 0)]:
        own = [h[t, :, i] @ h[t + shift, :, j] for t in range(30)
               if 0 <= t + shift < 30 and there[t, i] and there[t + shift, j]]  # fmt: skip
        assert table.sel(delay=shift * 0.1, method="nearest").values[i, j] == pytest.approx(np.mean(own))


def test_two_halves_that_part_are_correlated_within_and_anticorrelated_across():
    g = np.random.default_rng(4)
    place = np.concatenate([g.uniform(-0.4, 0.4, (3, 2, 8)), g.uniform(-0.4, 0.4, (3, 2, 8)) + [[10.0], [0.0]]], axis=2)
    speed = np.concatenate([np.full((3, 2, 8), 1.0), np.full((3, 2, 8), 3.0)], axis=2)
    course = correlation.velocity_correlation(recording(place, speed), 1.0)
    assert course[0.5] == pytest.approx(1.0) and course[9.5:10.5].to_numpy() == pytest.approx(-1.0)
    assert 1.0 < correlation.correlation_length(recording(place, speed), 1.0) < 10.0


@pytest.mark.parametrize("length", [1.0, 40.0])
def test_a_line_that_is_sheared_is_correlated_over_a_known_length(length):
    """Where velocity grows along a line of length L, the correlation is ((L - r)² - 3 r²)/L²: 0 at L/(1 + √3)."""
    along = np.linspace(0.0, length, 997)
    place = np.stack([along, 0.0 * along])[None].repeat(2, axis=0)
    speed = np.stack([0.0 * along, 5.0 + 0.3 * along])[None].repeat(2, axis=0)
    course = correlation.velocity_correlation(recording(place, speed), length / 50.3, 0.9 * length)
    r = course.index.to_numpy()
    np.testing.assert_allclose(course, ((length - r) ** 2 - 3.0 * r**2) / length**2, atol=0.02)
    found = correlation.correlation_length(recording(place, speed), length / 50.3)
    assert found == pytest.approx(length / (1.0 + np.sqrt(3.0)), rel=0.01)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.floats(-3.0, 3.0))
def test_turning_and_shifting_the_world_changes_nothing(seed, angle):
    place, speed = crowd(seed)
    one = recording(place, speed)
    other = turned(one, angle)
    np.testing.assert_allclose(neighbours.nearest_distances(one), neighbours.nearest_distances(other), rtol=1e-9)
    np.testing.assert_allclose(shape.group_shape(one), shape.group_shape(other), rtol=1e-7)
    np.testing.assert_allclose(milling.milling(one), milling.milling(other), atol=1e-9)
    np.testing.assert_allclose(turning.turning_speed(one), turning.turning_speed(other), atol=1e-6)
    assert surroundings.anisotropy(one, 50.0) == pytest.approx(surroundings.anisotropy(other, 50.0), abs=1e-9)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 1000))
def test_one_who_is_absent_is_as_one_who_never_was(seed):
    place, speed = crowd(seed)
    gone = without(recording(place, speed), 4)
    never = recording(np.delete(place, 4, axis=2), np.delete(speed, 4, axis=2))
    np.testing.assert_array_equal(
        np.delete(neighbours.nearest_distances(gone).values, 4, axis=1), neighbours.nearest_distances(never).values
    )
    np.testing.assert_array_equal(neighbours.pair_distances(gone, 1.0, 9.0), neighbours.pair_distances(never, 1.0, 9.0))
    np.testing.assert_allclose(milling.milling(gone), milling.milling(never))
    np.testing.assert_allclose(shape.group_shape(gone), shape.group_shape(never))
    xr.testing.assert_allclose(surroundings.density_map(gone, 8.0), surroundings.density_map(never, 8.0))
    np.testing.assert_allclose(
        correlation.velocity_correlation(gone, 2.0), correlation.velocity_correlation(never, 2.0)
    )
    assert np.isnan(neighbours.nearest_distances(gone).values[:, 4]).all()


def test_a_lattice_has_its_distances():
    x, y = np.meshgrid(np.arange(5) * 2.0, np.arange(4) * 2.0)
    place = np.stack([x.ravel(), y.ravel()])[None].repeat(2, axis=0)
    found = recording(place, np.ones_like(place))
    assert (neighbours.nearest_distances(found) == 2.0).all()
    share = neighbours.pair_distances(found, 0.5, 20.0)
    straight = 4 * 4 + 5 * 3  # pairs one step apart
    assert share[2.25] * 0.5 == pytest.approx(straight / 190) and share[:1.9].sum() == 0.0
    assert share.sum() * 0.5 == pytest.approx(1.0)
    assert shape.group_shape(found)["hull"].to_numpy() == pytest.approx(8.0 * 6.0)


@given(st.floats(0.05, 4.0), st.floats(4.1, 30.0))
def test_bins_of_distances_end_where_they_are_said_to_and_count_who_is_exactly_there(width, farthest):
    place = np.array([[[0.0, 0.0, farthest], [0.0, 0.0, 0.0]]])
    place[:, 0, 1] = np.nextafter(farthest, 2.0 * farthest)  # one pair of three is 0 apart, one beyond, one at the end
    share = neighbours.pair_distances(recording(place, np.ones_like(place)), width, farthest)
    own = share.attrs["width"]
    assert own * len(share) == pytest.approx(farthest, rel=1e-14) and share.index[-1] + 0.5 * own == pytest.approx(
        farthest
    )
    assert 2.0 / 3.0 < own / width < 1.5 or len(share) == 1
    one = 1.0 / 3.0 if len(share) > 1 else 2.0 / 3.0
    assert share.iloc[-1] * own == pytest.approx(one) and share.iloc[0] * own == pytest.approx(one)


@settings(deadline=None, max_examples=20)
@given(st.floats(-3.0, 3.0))
def test_a_neighbour_ahead_is_seen_ahead_whatever_the_direction(angle):
    ahead = np.array([np.cos(angle), np.sin(angle)])
    place = np.stack([np.zeros(2), 2.0 * ahead], axis=1)[None]
    speed = np.stack([ahead, ahead], axis=1)[None]
    table = surroundings.density_map(recording(place, speed), 3.0, 9)
    assert float(table.sum()) * (6.0 / 9.0) ** 2 == pytest.approx(1.0)
    seen = table.where(table > 0, drop=True)
    assert sorted(np.round(seen["front"].values, 9)) == [-2.0, 2.0] and np.abs(seen["left"].values).max() < 0.4
    assert surroundings.anisotropy(recording(place, speed), 3.0) == pytest.approx(1.0)
    beside = np.stack([np.zeros(2), 2.0 * np.array([-ahead[1], ahead[0]])], axis=1)[None]
    assert surroundings.anisotropy(recording(beside, speed), 3.0) == pytest.approx(-1.0)
    left = surroundings.density_map(recording(beside, speed), 3.0, 9)
    assert float(left.sel(left=2.0, front=0.0, method="nearest")) > 0.0


def test_neighbours_anywhere_are_evenly_spread():
    g = np.random.default_rng(8)
    found = recording(g.uniform(-20, 20, (40, 2, 60)), g.normal(0, 1, (40, 2, 60)))
    assert abs(surroundings.anisotropy(found, 100.0)) < 4.0 / np.sqrt(2.0 * 40 * 60)
    table = surroundings.density_map(found, 2.0, 4)  # 60 per 1600 m², but for the edges
    assert float(table.mean()) == pytest.approx(59 / 1600, rel=0.15)


def test_a_group_that_moves_along_its_length_is_long():
    g = np.random.default_rng(2)
    place = np.stack([g.uniform(0, 30.0, 4000), g.uniform(0, 10.0, 4000)])[None]
    speed = np.zeros_like(place)
    speed[:, 0] = 1.0
    row = shape.group_shape(recording(place, speed)).iloc[0]
    assert row["length"] == pytest.approx(30.0, rel=0.03) and row["width"] == pytest.approx(10.0, rel=0.03)
    assert row["hull"] == pytest.approx(300.0, rel=0.02) and row["elongation"] == pytest.approx(3.0, rel=0.04)
    speed[:, 0], speed[:, 1] = 0.0, 1.0
    assert shape.group_shape(recording(place, speed)).iloc[0]["elongation"] == pytest.approx(1 / 3, rel=0.04)
    cube = np.array(np.meshgrid([0, 2.0], [0, 2.0], [0, 2.0])).reshape(3, -1)[None]
    assert shape.group_shape(recording(cube, np.ones_like(cube))).iloc[0]["hull"] == pytest.approx(8.0)


@pytest.mark.parametrize("axes", [2, 3])
def test_a_mill_mills_and_a_column_does_not(axes):
    angle = np.arange(10) * 2.0 * np.pi / 10
    ring = [5.0 * np.cos(angle), 5.0 * np.sin(angle), 0.0 * angle][:axes]
    around = [-np.sin(angle), np.cos(angle), 0.0 * angle][:axes]
    place, speed = np.array(ring)[None], np.array(around)[None]
    assert milling.milling(recording(place, speed)).iloc[0] == pytest.approx(1.0)
    assert milling.milling(recording(place, np.ones_like(speed))).iloc[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("rate", [0.7, -1.9])
def test_a_circle_turns_at_its_rate(rate):
    t = np.arange(50) * 0.1
    speed = np.stack([np.cos(rate * t), np.sin(rate * t)], axis=1)[:, :, None]
    found = recording(speed, speed)
    assert turning.turning_speed(found).values == pytest.approx(rate)
    gone = turning.turning_speed(without(found, 0, slice(20, 22))).values[:, 0]
    assert np.isnan(gone[19:23]).all() and np.isfinite(np.delete(gone, range(19, 23))).all()


def test_bursts_of_a_saw_come_back():
    """A rise in 0.2 s every 1.5 s, then an exponential glide; noise of the tracker below the threshold."""
    t = np.arange(0.0, 30.0, 0.02)
    phase = t % 1.5
    speed = np.where(phase < 0.2, 0.1 + 4.5 * phase, 1.0 * np.exp(-(phase - 0.2) / 0.5645))
    noisy = speed + np.random.default_rng(1).normal(0.0, 0.01, len(t))
    found = recording(np.zeros((len(t), 2, 1)), np.stack([noisy, 0 * t], axis=1)[:, :, None], period=0.02)
    table = bursts.bursts(found, 0.2)
    assert len(table) == 20
    assert np.diff(table["begin"])[1:].mean() == pytest.approx(1.5, abs=0.01)
    assert table["burst"].median() == pytest.approx(0.2, abs=0.03)
    assert table["speed_top"].median() == pytest.approx(1.0, abs=0.05)
    whole = table.iloc[:-1]
    assert (whole["burst"] + whole["coast"]).to_numpy()[1:] == pytest.approx(np.diff(table["begin"])[1:])


def test_widths_that_cannot_be_meant_are_refused():
    place, speed = crowd(0)
    found = recording(place, speed)
    wrongs = [
        lambda: correlation.velocity_correlation(found, 0.0),
        lambda: neighbours.pair_distances(found, 2.0, 1.0),
        lambda: surroundings.density_map(found, -1.0),
        lambda: bursts.bursts(found, 0.0),
    ]
    for wrong in wrongs:
        with pytest.raises(ParameterError, match="must"):
            wrong()


def tracks(place, period=0.1):
    """A recording of positions (time, axis, individual) alone."""
    return recording(place, np.zeros_like(place), period).drop_vars(["velocity", "command"], errors="ignore")


def test_the_same_speed_for_ever_has_no_burst():
    place = np.arange(50)[:, None, None] * np.array([[0.1], [0.0]]) + np.zeros((50, 2, 3))
    assert len(bursts.bursts(tracks(place), 0.05)) == 0


def test_those_who_fly_straight_lead_nobody():
    place = np.arange(60)[:, None, None] * np.array([[0.1], [0.02]]) + np.arange(4.0)
    table = delays.leadership(tracks(place), longest=2.0)
    assert len(table) == 12 and (table["delay"] == 0.0).all()


def test_of_a_pair_one_leads_and_the_other_follows_in_a_periodic_flight():
    angle = np.arange(200)[:, None] * 2.0 * np.pi / 20 + np.array([0.0, np.pi])  # half a turn apart: before is behind
    table = delays.leadership(tracks(np.stack([np.cos(angle), np.sin(angle)], axis=1)), 1.5)
    assert table["delay"].abs().to_list() == pytest.approx([1.0, 1.0]) and table["delay"].sum() == 0.0


@pytest.mark.parametrize("shift", [(1.7, -2.2), (2.5, 2.5), (-0.4, 4.9)])
def test_in_a_periodic_world_neighbours_are_near_across_its_border(shift):
    """Wherever the border is drawn, the flock is the same; and the scores say the same of it."""
    found = simulate(load("vicsek_1995/ordered", {"agents": 40, "duration": 3.0}), 1, precision=64)
    moved = found.copy(deep=True)
    place = moved["position"].values + np.array(shift)[None, :, None, None]
    moved["position"].values[:] = (place + 2.5) % 5.0 - 2.5
    for measure in (
        neighbours.nearest_distances,
        lambda r: neighbours.pair_distances(r, 0.25, 2.5),
        lambda r: correlation.velocity_correlation(r, 0.5),
        lambda r: surroundings.density_map(r, 2.0, 5),
        lambda r: surroundings.anisotropy(r, 1.0),
    ):
        np.testing.assert_allclose(measure(moved), measure(found), rtol=1e-9, atol=1e-9)
    told = score(found, settings={"metrics.kind": "vasarhelyi"})["r_min_mean"][0]
    assert float(neighbours.nearest_distances(found).mean()) == pytest.approx(told, rel=1e-9)


def test_velocities_of_all_who_move_alike_have_no_correlation():
    place = crowd(11, frames=1)[0] + np.arange(50)[:, None, None] * np.array([[0.1], [0.02]])
    rounded = np.float32(0.7) * (1.0 + np.random.default_rng(1).integers(-1, 2, place.shape) * np.float32(6e-8))
    for found in (tracks(place), recording(place, rounded.astype(np.float32))):
        assert np.isnan(correlation.velocity_correlation(found, 1.0)).all()
        assert np.isnan(correlation.correlation_length(found, 1.0))


def test_one_who_stands_has_no_heading():
    """Differences of equal positions are 0, not the rounding error of their weights."""
    place = np.broadcast_to(np.random.default_rng(3).normal(0.0, 5.0, (1, 2, 6)), (300, 2, 6))
    found = tracks(place)
    assert (track_arrays(found).velocity == 0.0).all() and np.isnan(milling.milling(found)).all()
    imported = load_tracks(place.transpose(0, 2, 1), unit="m", fps=10.0)
    assert (imported["velocity"] == 0.0).all() and len(delays.leadership(imported)) == 0


def test_a_milling_is_of_those_who_move_and_the_centre_of_all():
    place, speed = crowd(12)
    speed[:, :, 0] *= 1e-3
    there = milling.milling(recording(place, speed), slowest=0.01)
    h = speed[:, :, 1:] / np.linalg.norm(speed[:, :, 1:], axis=1, keepdims=True)
    out = place[:, :, 1:] - place.mean(axis=2, keepdims=True)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    assert there.to_numpy() == pytest.approx(np.abs((out[:, 0] * h[:, 1] - out[:, 1] * h[:, 0]).mean(axis=1)))


def test_one_frame_has_distances_and_no_motion():
    place = crowd(13, frames=1)[0]
    apart = np.linalg.norm(place[0][:, :, None] - place[0][:, None, :], axis=0) + np.diag([np.inf] * 12)
    for found in (tracks(place), load_tracks(place.transpose(0, 2, 1), unit="m", fps=10.0)):
        assert neighbours.nearest_distances(found).values[0] == pytest.approx(apart.min(axis=1), rel=1e-5)
        assert float(neighbours.pair_distances(found, 1.0, 100.0).sum()) == pytest.approx(1.0)
        assert shape.group_shape(found)["present"].to_list() == [12] and shape.group_shape(found)["hull"].iloc[0] > 0.0
        assert len(delays.leadership(found)) == len(bursts.bursts(found, 0.1)) == 0
        assert np.isnan(turning.turning_speed(found)).all() and np.isnan(milling.milling(found)).all()


def test_beside_a_gap_one_is_near_before_its_velocity_is_known():
    """A fish that is seen in one frame is the nearest neighbour of the other in that frame."""
    place = np.zeros((5, 2, 3)) + np.array([0.0, 1.0, 10.0])
    place[[0, 1, 3, 4], :, 1] = np.nan
    place[:, 1] *= 0.0
    near = neighbours.nearest_distances(tracks(place)).values
    assert near[:, 0].tolist() == [10.0, 10.0, 1.0, 10.0, 10.0]


def test_velocities_beside_a_gap_are_those_of_the_scores():
    g = np.random.default_rng(5)
    place = np.cumsum(g.normal(0.0, 0.1, (40, 2, 3)), axis=0)
    place[10:15, :, 1] = np.nan
    frames, _, present = recording_frames(tracks(place))
    found = track_arrays(tracks(place))
    assert (found.present == present).all() and np.array_equal(found.velocity, frames[:, 2:], equal_nan=True)


def test_each_measure_says_its_units():
    """Turned into centimetres, each value grows as its unit says."""
    place, speed = crowd(5, frames=30)
    speed[:, 0] += 4.0 * np.sin(np.arange(30))[:, None]
    metres, centimetres = recording(place, speed), recording(100.0 * place, 100.0 * speed)
    measures = {
        bursts.bursts: (0.5,), correlation.velocity_correlation: (2.0,), delays.delay_correlation: (),
        delays.leadership: (1.0, -1.0), milling.milling: (), neighbours.nearest_distances: (),
        neighbours.pair_distances: (2.0, 40.0), shape.group_shape: (), surroundings.density_map: (10.0, 4),
        turning.turning_speed: (),
    }  # fmt: skip
    lengths = {bursts.bursts, correlation.velocity_correlation, neighbours.pair_distances, surroundings.density_map}
    factors = {"1": 1.0, "s": 1.0, "rad/s": 1.0, "m": 100.0, "m/s": 100.0, "m^2": 1e4, "1/m": 0.01, "1/m^2": 1e-4}
    for measure, numbers in measures.items():
        scale = [100.0 if measure in lengths and isinstance(number, float) else 1 for number in numbers]
        larger = [by * number for by, number in zip(scale, numbers, strict=True)]
        one, other = measure(metres, *numbers), measure(centimetres, *larger)
        units = one.attrs["units"]
        if isinstance(units, dict):
            assert set(units) == set(one.select_dtypes("number").columns), measure
            for name, unit in units.items():
                np.testing.assert_allclose(other[name], factors[unit] * one[name], rtol=1e-9, err_msg=name)
        else:
            np.testing.assert_allclose(other, factors[units] * one, rtol=1e-9, atol=1e-12)
