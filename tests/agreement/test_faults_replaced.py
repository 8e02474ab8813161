"""A fault that replaces one of its own kind: what is on its way was sent by the one before, in all that flies."""

import numpy as np
import pytest

import airflock
from airflock.engine import fly_world
from airflock.parts import FAULTS as KINDS
from airflock.scenarios.files import load
from reference.flight import fly_plainly

PAPER = "vasarhelyi_2018/4ms"
SMALL = {"agents": 5, "duration": 5.0, "world.side": 60.0, "start.separation": 5.0, "radio.range": 1e4}
SURE = {"radio.kind": "links", "radio.near": 500.0, "radio.received_near": 1.0}  # keeps stamps, loses nothing
QUIET = {"sensors.noise": 0.0, "body.noise": 0.0}
OTHER = {  # numbers of the second one
    "motor": {"share": 0.9}, "gnss_offset": {"east": -8.0}, "gnss_drift": {"north": -4.0}, "gnss_spoofed": {"up": 1.0},
    "radio_range": {"share": 1e-4}, "pretender": {"east": -9.0}, "clock": {"ahead": -2.0},
    "battery": {"endurance": 9.0},
}  # fmt: skip


def flight(faults, **more):
    """An open flight whose agents are hit."""
    return airflock.open(load(PAPER, {**SMALL, **QUIET, **more, "faults": faults}), 1, device="python")


def told(flown, seconds, who=2):
    """What agent 0 has heard of another one and how old it is, and where that one truly is, at each decision."""
    rows = []
    for _ in range(round(seconds / 0.2)):
        flown.sense()
        (heard,) = [other for other in flown.look(0).heard if other.who == who]
        rows.append((heard.state.x, heard.age, flown.look(who).true.x))
        flown.advance(0.2)
    return np.array(rows).T


def pretends(at, east, **more):
    return {"kind": "pretender", "at": at, "agents": [2], "east": east, **more}


def test_what_was_sent_before_is_heard_as_it_was_sent():
    """Three in a second, the delay: none of their packets was heard as the truth, nor as those of a later one."""
    faults = [pretends(0.4, 20.0), pretends(2.0, -20.0), pretends(2.4, 5.0), pretends(2.8, 9.0, lasts=0.6)]
    x, _, true = told(flight(faults), 5.0)
    sent = 0.2 * np.arange(5, 25) - 1.0  # s, of what is heard from 1 s on
    expected = np.select([sent < 0.39, sent < 1.99, sent < 2.39, sent < 2.79, sent < 3.39], [0, 20, -20, 5, 9], 0)
    np.testing.assert_allclose(x[5:] - true[:-5], expected, atol=1e-5)


def test_a_radio_that_is_frozen_anew_repeats_the_same_packet():
    hit = {"kind": "radio_frozen", "agents": [2]}
    x, _, true = told(flight([hit | {"at": 1.0}, hit | {"at": 2.0, "lasts": 1.0}]), 5.0)
    last = true[4]  # sent at 0.8 s
    np.testing.assert_allclose(x[10:20], last, atol=1e-5)
    np.testing.assert_allclose(x[20:], true[15:-5], atol=1e-5)


def test_a_packet_is_stamped_by_the_clock_of_its_sending():
    """It was stamped by the clock of its arrival, a delay later. An own clock tells all ages from its fault on."""
    hit = {"kind": "clock", "agents": [2]}
    faults = [hit | {"at": 2.0, "ahead": 1.5}, hit | {"at": 2.4, "ahead": 0.5, "lasts": 1.0}]
    of_two = told(flight(faults, **SURE), 5.0)[1]
    sent = 0.2 * np.arange(25) - 1.0
    stamped = np.select([sent < 1.99, sent < 2.39, sent < 3.39], [0.0, 1.5, 0.5], 0.0)
    np.testing.assert_allclose(of_two, 1.0 - stamped, atol=1e-5)
    flown, by_two = flight(faults, **SURE), []
    for _ in range(25):
        by_two.append([other.age for other in flown.sense().look(2).heard])
        flown.advance(0.2)
    now = 0.2 * np.arange(25)
    ahead = np.select([now < 1.99, now < 2.39, now < 3.39], [0.0, 1.5, 0.5], 0.0)
    np.testing.assert_allclose(by_two, np.repeat(1.0 + ahead[:, None], 4, axis=1), atol=1e-5)


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("radio", [{}, {"radio.kind": "links"}, {"radio.kind": "jitter", "radio.jitter": 0.2}], ids=str)
@pytest.mark.parametrize("kind", sorted({*KINDS} - {"fails"}))
def test_every_kind_that_is_replaced_flies_as_the_reference_does(kind, radio, delay, seed):
    hit = {"kind": kind, "agents": [2], **({"endurance": 1.0} if kind == "battery" else {})}
    faults = [hit | {"at": 0.4}, hit | {"at": 0.83} | OTHER.get(kind, {}), hit | {"at": 1.1, "lasts": 0.3}]
    scenario = load(PAPER, {**SMALL, "duration": 2.5, "radio.delay": delay, **radio, "faults": faults})
    found = fly_world(scenario, seed, record=True, device="python")
    np.testing.assert_allclose(found.frames, fly_plainly(scenario, seed).frames, rtol=0.0, atol=1e-9)


def test_pictures_are_stamped_by_the_own_clock_of_their_moment(seed):
    keys = {"radio.kind": "vision", "radio.field": 4.0, "radio.hold": 1.0, "radio.delay": 0.3}
    faults = [{"kind": "clock", "at": 0.5, "agents": [1, 2], "ahead": 0.4}, {"kind": "clock", "at": 0.9, "agents": [2]}]
    scenario = load(PAPER, {**SMALL, **keys, "duration": 2.0, "faults": faults})
    found = fly_world(scenario, seed, record=True, device="python")
    np.testing.assert_allclose(found.frames, fly_plainly(scenario, seed).frames, rtol=0.0, atol=1e-9)


def test_a_battery_that_is_warned_of_again_lands_by_the_later_warning():
    """It landed by the first, though that one had been replaced."""
    hit = {"kind": "battery", "agents": [2]}
    faults = [hit | {"at": 1.0, "endurance": 2.0}, hit | {"at": 2.5, "endurance": 1.5}]
    gone = np.isnan(
        fly_world(load(PAPER, {**SMALL, "faults": faults}), 1, record=True, device="python").frames[:, 0, 2]
    )
    assert np.flatnonzero(gone)[0] == round(4.0 / 0.2)
    never = [hit | {"at": 1.0, "endurance": 2.0}, hit | {"at": 2.5, "endurance": 9.0, "lasts": 1.0}]
    frames = fly_world(load(PAPER, {**SMALL, "faults": never}), 1, record=True, device="python").frames
    assert np.isfinite(frames).all()


# ------------------------------------------------------------------------------------------------- in open flights


def test_numbers_that_change_are_those_of_packets_sent_from_then_on():
    flown = flight([pretends(0.0, 20.0)]).advance(2.0)
    flown.change({"faults.pretender.east": -20.0})
    x, _, true = told(flown, 3.0)
    np.testing.assert_allclose(x[5:] + 20.0, true[:-5], atol=1e-5)
    assert np.flatnonzero(np.diff(x) < -30.0).tolist() == [4]


def test_who_joins_again_has_sent_nothing_false():
    flown = flight([pretends(0.0, 20.0)]).advance(2.0)
    flown.remove(2).advance(0.2).add(2, [5.0, -4.0], [0.0, 0.0])
    x, _, true = told(flown, 2.0)
    np.testing.assert_allclose(x[:5], 5.0, atol=1e-5)
    np.testing.assert_allclose(x[5:], true[:-5], atol=1e-5)


def test_who_joins_again_does_not_land_by_the_battery_of_before():
    flown = flight([{"kind": "battery", "at": 1.0, "agents": [1, 2], "endurance": 2.0}]).advance(1.5)
    flown.remove(2).advance(0.5).add(2, [0.0, 0.0]).advance(2.0)
    assert flown.present.tolist() == [True, False, True, True, True]


@pytest.mark.parametrize("delay", [0.2, 2.0])
def test_with_another_delay_faults_go_on(delay):
    flown = flight([pretends(0.0, 20.0)]).advance(2.0).change({"radio.delay": delay})
    x, _, true = told(flown, 3.0)
    late = round(delay / 0.2)
    np.testing.assert_allclose(x[late:] - 20.0, true[:-late], atol=1e-5)
    assert (x - true > 10.0).all(), "meanwhile, too"


def test_a_flight_that_is_cut_while_faults_are_on_their_way_has_the_same_bits():
    faults = [pretends(0.4, 20.0), pretends(0.83, -20.0), {"kind": "clock", "at": 0.9}]
    faults += [{"kind": "gnss_frozen", "at": 1.0}]
    scenario = load(PAPER, {**SMALL, "duration": 2.5, "radio.kind": "links", "faults": faults})
    whole = airflock.open(scenario, 3, device="python")
    scores = whole.finish()
    parts = airflock.open(scenario, 3, device="python").advance(0.85)
    moment = parts.snapshot()
    parts.advance(0.4).restore(moment)
    while not parts.over:
        parts.advance(steps=7)
    assert repr(parts.finish()) == repr(scores) and parts.state.tobytes() == whole.state.tobytes()
