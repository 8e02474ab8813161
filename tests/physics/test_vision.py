"""Vision: who is in view, what errors do to bearings and distances, and how fast a velocity is known."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

import airflock
from airflock.engine import fly_world, plan_of
from airflock.parts.radios import vision
from airflock.parts.radios.vision import Packet, Parameters, gains, lasts, receive, see
from airflock.scenarios.files import load

PAPER = "vasarhelyi_2018/4ms"
SEEN = {"radio.kind": "vision", "agents": 4, "duration": 4.0, "radio.range": 1e4}
CLEAR = {"radio.range_sd": 0.0, "radio.bearing_sd": 0.0, "radio.missed": 0.0, "radio.smoothing": 0.001}
LONG = st.floats(-50.0, 50.0)


@given(LONG, LONG, LONG, st.floats(-3.1, 3.1), st.floats(0.1, 6.2), st.floats(0.1, 3.1))
def test_who_is_in_view_lies_within_both_angles(dx, dy, dz, heading, field, field_up):
    k = Parameters(missed=0.0, field=field, field_up=field_up)
    found, looks = receive(dx, dy, dz, 4.0 * math.cos(heading), 4.0 * math.sin(heading), 1.0, 0.5, Packet(), k)
    turned = (math.atan2(dy, dx) - heading + math.pi) % (2.0 * math.pi) - math.pi
    above = math.atan2(dz, math.hypot(dx, dy))
    margin = min(abs(abs(turned) - 0.5 * field), abs(abs(above) - 0.5 * field_up))
    if margin > 1e-6 and math.hypot(dx, dy) > 1e-6:
        assert found == (1.0 if abs(turned) < 0.5 * field and abs(above) < 0.5 * field_up else 0.0)
    assert math.hypot(*looks) == pytest.approx(1.0)


def test_who_hovers_looks_where_it_looked_and_cameras_on_all_sides_see_everywhere():
    narrow = Parameters(missed=0.0, field=1.0)
    _, kept = receive(0.0, 9.0, 0.0, 0.0, 4.0, 1.0, 0.5, Packet(), narrow)
    assert receive(0.0, 9.0, 0.0, 0.05, 0.0, 1.0, 0.5, kept, narrow)[0] == 1.0
    assert receive(9.0, 0.0, 0.0, 0.05, 0.0, 1.0, 0.5, kept, narrow)[0] == 0.0
    whole = Parameters(missed=0.0)
    for angle in np.linspace(-math.pi, math.pi, 9):
        assert receive(math.cos(angle), math.sin(angle), 0.0, 3.0, 0.0, 1.0, 0.5, Packet(), whole)[0] == 1.0
    assert receive(9.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.5, Packet(), whole)[0] == 0.0  # behind a house


def looks(k, offset, count=4000, seed=1):
    """Offsets at which a neighbour is seen for the first time, many times over."""
    rng = np.random.default_rng(seed)
    rows = [see(*offset, *(0.0,) * 6, 1.0, 2.0, 0.0, 1e9, *rng.normal(size=3), k) for _ in range(count)]
    return np.array(rows)


@pytest.mark.parametrize("offset", [(30.0, 40.0, 0.0), (3.0, -4.0, 12.0), (0.0, 0.0, 20.0)])
def test_directions_and_distances_have_their_standard_deviations(offset):
    k, true = Parameters(bearing_sd=0.02, range_sd=0.15), np.array(offset)
    found = looks(k, offset)[:, :3]
    far, r = np.linalg.norm(found, axis=1), np.linalg.norm(true)
    assert far.mean() == pytest.approx(r, rel=0.01) and far.std() == pytest.approx(0.15 * r, rel=0.06)
    across = found / far[:, None] - true / r
    assert np.sqrt((across**2).sum(axis=1).mean() / 2.0) == pytest.approx(0.02, rel=0.05)
    assert np.abs(across.mean(axis=0)).max() < 0.002
    assert (looks(k, offset, 3)[:, 3:] == (1.0, 2.0, 0.0)).all()  # who is new is believed to fly as the observer does


def test_the_filter_has_the_variances_of_a_fading_memory():
    """Zarchan and Musoff, Fundamentals of Kalman Filtering: first order, pictures at one interval."""
    k, period, rng = Parameters(range_sd=0.0, bearing_sd=0.01, smoothing=1.0), 0.2, np.random.default_rng(3)
    kept, sd, rows = math.exp(-period / k.smoothing), 0.01 * 50.0, []
    x, y, z, vx, vy, vz = 50.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(40_000):
        ex, ey, ez = x + vx * period, y + vy * period, z + vz * period
        x, y, z, vx, vy, vz = see(50.0, 0.0, 0.0, ex, ey, ez, vx, vy, vz, 0.0, 0.0, 0.0, period, *rng.normal(size=3), k)
        rows.append((y, z, vy, vz))
    places, speeds = np.split(np.array(rows[100:]).var(axis=0), 2)
    cube = (1.0 + kept) ** 3
    known = sd**2 * (1.0 - kept) * (1.0 + 4.0 * kept + 5.0 * kept**2) / cube
    assert places == pytest.approx([known] * 2, rel=0.08)
    assert speeds == pytest.approx([2.0 * sd**2 * (1.0 - kept) ** 3 / cube / period**2] * 2, rel=0.08)


@given(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0), st.floats(0.05, 0.5), st.floats(0.1, 1.0))
def test_without_errors_straight_flight_is_known_after_some_pictures(wx, wy, period, smoothing):
    k = Parameters(range_sd=0.0, bearing_sd=0.0, smoothing=smoothing)
    at, since, state = (40.0, -30.0, 0.0), 1e9, (0.0,) * 6
    for number in range(1 + int(30.0 * smoothing / period)):
        true = (at[0] + wx * number * period, at[1] + wy * number * period, 0.0)
        ahead = tuple(c + v * period for c, v in zip(state[:3], state[3:], strict=True))
        state, since = see(*true, *ahead, *state[3:], 1.0, 1.0, 0.0, since, 0.0, 0.0, 0.0, k), period
    assert state == pytest.approx((*true, wx, wy, 0.0), abs=1e-5)


def test_gains_of_a_long_silence_believe_the_picture_alone():
    assert gains(1e3, 0.5) == (1.0, pytest.approx(1e-3)) and gains(1e-3, 1e3)[0] < 1e-5
    k = Parameters(delay=0.1, hold=2.0)
    assert (lasts(2.1, k), lasts(2.11, k)) == (1.0, 0.0)


def test_after_a_clock_was_put_back_everybody_is_seen_anew():
    """Found by a draw: the gains of a picture from before the last one grew without bound."""
    k = Parameters(bearing_sd=0.0, range_sd=0.0, smoothing=0.001)
    found = see(3.0, 4.0, 0.0, 50.0, 50.0, 0.0, 9.0, 9.0, 0.0, 1.0, 2.0, 0.0, -0.5, 0.0, 0.0, 0.0, k)
    assert found == (3.0, 4.0, 0.0, 1.0, 2.0, 0.0)


def test_errors_of_the_own_position_do_not_come_between_two_who_see_each_other(seed):
    """A receiver that is 40 m off; what it makes of the others stays where they are, seen from it."""
    gnss = {"sensors.kind": "gnss", "sensors.bias": 40.0, "sensors.sd": 3.0}
    flight = airflock.open(load(PAPER, SEEN | CLEAR | gnss | {"radio.delay": 0.0}), seed, device="python").advance(2.0)
    places = flight.state[:2]
    view = flight.look(1)
    assert math.dist(view.own[:2], view.true[:2]) > 1.0 and len(view.heard) == 3
    for heard in view.heard:
        offset = np.array(heard.state[:2]) - view.own[:2]
        assert offset == pytest.approx(places[:, heard.who] - places[:, 1], abs=1e-4)


@pytest.mark.parametrize("fault", ["pretender", "radio_frozen", "radio_silent"])
def test_what_an_agent_tells_does_not_matter_to_those_who_see_it(fault, seed):
    plain = load(PAPER, SEEN)
    ill = load(PAPER, SEEN | {"faults": [{"kind": fault, "at": 0.0, "agents": [2]}]})
    assert np.array_equal(
        fly_world(ill, seed, record=True, device="python").frames,
        fly_world(plain, seed, record=True, device="python").frames,
    )
    assert any(note.endswith(f"have no effect: {fault}") for note in ill.notes)


def test_a_neighbour_out_of_view_is_believed_in_for_so_long_and_then_forgotten():
    keys = SEEN | CLEAR | {"radio.delay": 0.0, "radio.hold": 1.0, "agents": 2}
    flight = airflock.open(load(PAPER, keys), 3, device="python").advance(1.0)
    flight.change({"radio.missed": 1.0})
    ages = []
    for _ in range(8):
        flight.advance(0.2)
        ages.append([heard.age for heard in flight.look(0).heard])
    flat = [age for found in ages for age in found]
    assert len(ages[-1]) == 0 and max(flat) == pytest.approx(1.0, abs=0.01) and len(flat) in (4, 5)


def test_vision_flies_compiled_as_it_is_written(seed):
    scenario = load(PAPER, SEEN | {"radio.field": 4.0, "radio.hold": 0.5, "metrics.kind": "order"})
    plain = fly_world(scenario, seed, record=True, device="python").frames
    np.testing.assert_allclose(
        fly_world(scenario, seed, record=True, device="cpu", precision=64).frames, plain, atol=1e-9
    )
    assert plan_of(scenario).sees and vision.carry is not None
