"""Faults of a scenario befall a fleet as they befall a simulated flock: in lock-step, and by the time of a real clock.

In lock-step without noise a fleet is within 0.1 mm of the simulation, which the reference flies to 1e-9
(`tests/agreement/test_faults_replaced.py`); what packets say is resolved to 0.04 mm.
"""

import math

import numpy as np
import pytest

from airflock.core.pilot import EARLY
from airflock.drones.onboard.card import card_hash, parse_card
from airflock.drones.onboard.mission import MissionPhase
from airflock.fleets import compare, realtime
from airflock.fleets.drone_faults import DroneFaults
from airflock.fleets.lockstep import LockstepFleet, is_clear_between
from airflock.fleets.radio_channel import FaultyNode
from airflock.fleets.realtime import fly_in_realtime, lockstep_only_errors
from airflock.parts import FAULTS as KINDS
from airflock.recordings.simulation import simulate
from airflock.support.errors import CardError
from fleets import card, document, scenario
from flocks import ISLANDS

CROWD = {"world.side": 60.0, "start.separation": 6.0}
LINKS = {"radio.kind": "links"}  # neighbours are carried forward by the age of their packets
SURE = LINKS | {"radio.near": 500.0, "radio.received_near": 1.0}  # and nothing is lost
OPEN_MINDED = {"clock_error": 5.0, "clock_spread": 10.0}  # a node that minds no clock


def hit(kind, *whens, who=1, **more):
    """Faults of one kind, one after another, of one drone."""
    return [{"kind": kind, "agents": [who], **when, **more} for when in whens]


BEFALLEN = {
    "clock ahead": (LINKS, hit("clock", {"at": 1.0, "ahead": 0.8})),
    "clock behind": (LINKS, hit("clock", {"at": 1.0, "ahead": -0.7})),
    "clock beyond the delay": (SURE | {"radio.delay": 0.4}, hit("clock", {"at": 1.0, "ahead": 0.9})),
    "clock set back": (LINKS, hit("clock", {"at": 0.6, "ahead": 1.5, "lasts": 1.5})),
    "clock replaced": (LINKS, hit("clock", {"at": 0.4, "ahead": 0.9}, {"at": 1.2, "ahead": -0.9}, who=0)),
    "pretender replaced": ({}, hit("pretender", {"at": 0.4, "east": -6.0}, {"at": 1.2, "east": 3.0, "lasts": 2.0})),
    "frozen radio replaced": ({}, hit("radio_frozen", {"at": 1.0}, {"at": 1.6, "lasts": 2.0})),
    "drift replaced": ({}, hit("gnss_drift", {"at": 1.0}, {"at": 1.4, "east": -0.5})),
    "stuck replaced": ({}, hit("stuck", {"at": 1.5}, {"at": 2.9, "lasts": 1.0})),
    "deaf replaced": ({}, hit("radio_deaf", {"at": 0.5}, {"at": 1.1, "lasts": 1.5})),
    "offset": ({}, hit("gnss_offset", {"at": 1.13, "east": 4.0})),
    "spoofed": ({}, hit("gnss_spoofed", {"at": 1.13})),
    "silent": ({}, hit("radio_silent", {"at": 0.5})),
    "range": ({}, hit("radio_range", {"at": 0.5, "share": 0.2})),
    "battery": ({}, hit("battery", {"at": 0.5, "endurance": 3.0, "share": 0.0}, {"at": 1.13, "endurance": 4.2})),
    "motor replaced": ({}, hit("motor", {"at": 0.5, "share": 0.0}, {"at": 1.3, "share": 0.5})),
}


def flown(settings, faults, seed=1, duration=5.2, **limits):
    """A fleet in lock-step and its scenario, from where the simulated drones start."""
    found = scenario(3, duration, **CROWD, **settings, **({"faults": faults} if faults else {}))
    found = compare.with_metric_period(found, 0.2)
    made = card(found, as_simulated=True, stop_for_lost=False, safety=OPEN_MINDED | limits)
    fleet = LockstepFleet(found, made, seed, start=compare.simulated_start(found, seed))
    fleet.advance(duration + found.flight.dt)
    return fleet


def simulated(found, seed=1):
    """Positions of the simulation from the same start, (time, agent, axis)."""
    start = np.array([[*s[:2], *s[3:5]] for s in compare.simulated_start(found, seed)]).T
    made = simulate(found, seed, precision=64, start=start, device="python")
    return made.position.transpose("time", "individual", "space", "keypoint").values.reshape(-1, 3, 2)


@pytest.mark.parametrize("name", BEFALLEN)
def test_a_clock_and_what_is_replaced_act_on_a_fleet_as_in_the_simulator(name):
    """Each changes the flight by more than 20 cm in 5 s, and the fleet is within 0.1 mm of the changed simulation."""
    settings, faults = BEFALLEN[name]
    fleet, plain = flown(settings, faults), flown(settings, ())
    ours = fleet.array()[:, :, :2]
    assert np.abs(ours - plain.array()[:, :, :2]).max() > 0.2
    known = simulated(fleet.scenario)
    assert np.abs(ours[: len(known)] - known).max() < 1e-4
    assert set(fleet.phases()) == {MissionPhase.FLOCK} and not any(any(n.refused.values()) for n in fleet.nodes)


def test_over_a_radio_that_asks_for_no_age_a_clock_changes_nothing():
    """The bits of the flight without, as in a simulation. The drone was deaf: all that it heard seemed old to it."""
    fault = hit("clock", {"at": 1.0, "ahead": 0.8})
    assert flown({}, fault).digest() == flown({}, ()).digest()


def test_a_vehicle_whose_motors_are_off_falls_whatever_its_autopilot_keeps_following():
    """A command that sticks held it up."""
    fleet = flown({}, hit("stuck", {"at": 0.5}) + hit("fails", {"at": 1.0}), duration=8.0)
    assert fleet.vehicles[1].state.z == 0.0 and fleet.vehicles[0].state.z > 5.0


def test_real_drones_believe_stamps_and_simulated_ones_do_not_ask():
    real, software = card(scenario(2)), compare.software_card(scenario(2))
    assert (real.hearing.early, real.hearing.drop_reordered, real.hearing.once) == (EARLY, True, False)
    assert not {"once", "any_stamp"} & real.document["radio"].keys()
    assert software.hearing.early > 1e9 and not software.hearing.drop_reordered and software.hearing.once
    assert not compare.software_card(scenario(2, **LINKS)).hearing.once, "the newest packet counts until the next comes"
    assert compare.software_card(scenario(2), realtime=True).hearing == real.hearing
    made = document(scenario(2))
    for wrong in (1, "yes", None):
        odd = {**made, "radio": {**made["radio"], "once": wrong}}
        with pytest.raises(CardError, match=f"radio.once = {wrong!r}: give true or false"):
            parse_card({**odd, "hash": card_hash(odd)})


def test_ages_are_told_by_both_clocks():
    """The delay, less by how far the sender's clock was ahead when it sent, more by how far the own one is."""
    fleet = flown(SURE, hit("clock", {"at": 2.0, "ahead": 0.8}))
    ages, now = fleet.packet_ages(), 0.2 * np.arange(len(fleet.state_times))
    np.testing.assert_allclose(ages[:, 0, 1], np.where(now < 2.99, 1.0, 0.2), atol=2e-6)
    np.testing.assert_allclose(ages[:, 1, 0], np.where(now < 1.99, 1.0, 1.8), atol=2e-6)


def test_a_node_minds_a_clock_by_the_limits_of_its_card():
    """Ahead of the autopilot's, the least delayed of ten samples tells it; behind it, the first one does."""
    phases = {}
    for ahead in (0.8, -0.8):
        fleet = flown(LINKS, hit("clock", {"at": 1.0, "ahead": ahead}), duration=4.0, clock_error=0.2, clock_spread=1.0)
        phases[ahead] = fleet.nodes[1].phase
        assert fleet.nodes[0].phase == fleet.nodes[2].phase == MissionPhase.FLOCK
    assert phases == {0.8: MissionPhase.FLOCK, -0.8: MissionPhase.HOLD}


@pytest.mark.parametrize(
    ("ahead", "limits", "phase", "suspects"),
    [
        (0.9, {}, MissionPhase.FLOCK, False),
        (1.5, {}, MissionPhase.HOLD, True),
        (1.5, {"clock_spread": 1.0}, MissionPhase.FLOCK, False),
    ],
)
def test_a_clock_that_is_more_than_a_second_ahead_is_told_by_the_ages_of_packets(ahead, limits, phase, suspects):
    """By its own node, if it lets such old packets in: by default it refuses them all. The others suspect nobody."""
    fleet = flown(LINKS, hit("clock", {"at": 1.0, "ahead": ahead}), duration=6.0, **limits)
    assert [node.phase for node in fleet.nodes] == [MissionPhase.FLOCK, phase, MissionPhase.FLOCK]
    assert [node.peers.is_own_clock_suspect() for node in fleet.nodes] == [False, suspects, False]
    own = fleet.nodes[1]
    assert (own.refused["clock"] > 0) == ("clock_spread" in limits)
    assert own.autopilot_link.clock_offset() == 0.0, (
        "of ten samples of the autopilot's clock the least delayed is an old one"
    )


def test_a_delay_between_two_decisions_leaves_nobody_deaf():
    """Packets wait for the next decision, and are 0.4 s old then, which seemed too old to count."""
    fleet, alone = (flown({"radio.delay": 0.25, "radio.range": far}, ()) for far in (80.0, 0.0))
    known = simulated(fleet.scenario)
    apart = [np.abs(one.array()[: len(known), :, :2] - known).max() for one in (fleet, alone)]
    assert apart[0] < 0.25 * apart[1], apart


# ------------------------------------------------------------------------------------------------ on the real clock


def live(faults, duration=2.0, mode="tasks", agents=2, **more):
    """A fleet on the real clock, from where the simulated drones start."""
    keys = {"radio.delay": 0.1, "world.side": 120.0} | more
    found = compare.with_metric_period(scenario(agents, duration, **keys, faults=faults), 0.2)
    made = compare.software_card(found, stop_for_lost=True, realtime=True)
    return fly_in_realtime(found, made, 1, mode, start=compare.simulated_start(found, 1))


@pytest.mark.parametrize("mode", ["tasks", "processes"])
def test_on_the_real_clock_each_drone_suffers_by_its_own_time(mode):
    """A motor that is off keeps its velocity to the bit; the other drone, whose navigation drifts, flies on."""
    faults = hit("motor", {"at": 0.6}, who=0, share=0.0) + hit("gnss_drift", {"at": 0.4}, east=3.0)
    found = live(faults, mode=mode)
    rows = found.array()
    after = rows[4:, 0, 3:5]
    assert len(after) >= 5 and np.array_equal(after, np.repeat(after[:1], len(after), axis=0))
    assert not np.array_equal(rows[1, 0, 3:5], rows[3, 0, 3:5]) and not np.array_equal(rows[4, 1, 3:5], rows[8, 1, 3:5])
    off = rows[:, 1, 9] - rows[:, 1, 0]
    assert off[-1] > 2.0 and abs(off[:2]).max() < 1.5, "it believes itself 3 m/s times 1.6 s further east, less a lag"


def test_on_the_real_clock_who_is_silent_is_heard_no_more_and_a_clock_stamps():
    found = live(hit("radio_silent", {"at": 0.8}, who=0) + hit("clock", {"at": 0.8, "ahead": 0.6}))
    ages = found.packet_ages()
    assert ages[-1, 1, 0] > 0.6 + 1.0, "nothing since 0.8 s, by a clock that is ahead"
    assert ages[-1, 0, 1] < 0.0 < ages[2, 0, 1], "sent 0.1 s ago, it seems to come from the future"


def test_on_the_real_clock_who_drops_out_is_absent():
    found = live(hit("fails", {"at": 0.8}))
    rows = found.array()
    assert np.isnan(rows[5:, 1]).all() and np.isfinite(rows[:4, 1]).all() and np.isfinite(rows[:, 0]).all()
    assert found.packet_ages()[-1, 0, 1] > 0.8 and np.isnan(found.packet_ages()[-1, 1]).all()
    assert [who for _, who, note in found.log if "drops out" in note] == [2]
    assert compare.fleet_recording(found).position.isnull().any()


def test_on_the_real_clock_packets_say_what_a_fault_tells():
    """The wrapper of both modes: what a node sends, retold and signed; nothing before the fault and after it."""
    found = scenario(2, 3.0, faults=hit("pretender", {"at": 1.0, "lasts": 1.0, "east": 7.0}))
    made, zero = compare.software_card(found, realtime=True), 100.0
    fleet = LockstepFleet(found, compare.software_card(found), 1, start=compare.simulated_start(found, 1))
    fleet.advance(0.4)
    node = fleet.nodes[1]
    faults = DroneFaults(found, 1, only=1)
    ailing = FaultyNode(lambda: node, faults, 1, made.site, lambda own: own - zero)
    said = []
    for time in (0.5, 1.5, 2.5):
        faults.until(time)
        (datagram,) = node.status_datagrams(zero + time)
        said.append(ailing.falsified(datagram, time) == datagram)
    assert said == [True, False, True]


def test_on_the_real_clock_buildings_shade_the_radio(monkeypatch):
    """The ether asks the map of the card between where two vehicles are; it took all ways for clear."""
    asked = []
    monkeypatch.setattr(realtime, "is_clear_between", lambda card, here, there: bool(asked.append((here, there))))
    keys = {"radio.kind": "shadow", "radio.near": 5.0, "radio.far": 25.0, "world.obstacles": ISLANDS}
    live((), duration=0.4, **keys)
    assert asked and all(0.0 < math.dist(*pair) < 120.0 for pair in asked)
    with_buildings = card(scenario(2, **keys))
    monkeypatch.undo()
    assert not is_clear_between(with_buildings, (-30.0, -5.0, 20.0), (30.0, -5.0, 20.0)), "through an island"
    assert is_clear_between(with_buildings, (-30.0, -30.0, 20.0), (30.0, -30.0, 20.0)), "south of it"


def test_no_kind_is_refused_on_any_clock():
    for kind in KINDS:
        found = scenario(2, 1.0, faults=hit(kind, {"at": 0.5}))
        assert DroneFaults(found, 0) and not lockstep_only_errors(())
        assert math.isfinite(DroneFaults(found, 0).ahead(1, 0.7))
