"""Fleets whose autopilots reboot, are slow or have clocks of their own: each drone flies, or reports why it does not.

A hundred flights are a part of `.ci/nightly`.
"""

import numpy as np
import pytest

from airflock.drones.mavlink.orders import OrderKind
from airflock.drones.onboard.mission import MissionPhase
from airflock.fleets.drone_faults import InjectedFault
from autopilot_faults import SEED, TOUCH, drawn, result
from fleets import fleet, scenario

TIGHT = {"tick": 0.05, "status_period": 0.1}
FEW = (2, 4)  # of the nightly flights: reboots on the ground and in the air; streams of 4 Hz in the air


def on_the_ground(faults):
    return fleet(scenario(2, 300.0, **{"radio.delay": 0.2}), faults=faults, autopilot="ardupilot", safety=TIGHT)


@pytest.mark.parametrize("number", FEW)
def test_each_drone_of_a_disturbed_fleet_flies_or_reports_the_cause(number):
    row = result(number)
    assert not row["errors"], (SEED, number, drawn(number))
    assert row["least_m"] > TOUCH


@pytest.mark.parametrize("lost_for", [0.02, 1.5, 4.0])
def test_requests_that_are_lost_are_repeated_until_nothing_is_missing(lost_for):
    made = on_the_ground([InjectedFault("uplink", (), 0.0, lost_for)])
    made.advance(lost_for + 8.0)
    assert set(made.phases()) == {MissionPhase.CLEARED}, made.log[-5:]


@pytest.mark.parametrize("moment", [1.0, 12.0])
def test_a_drone_whose_autopilot_rebooted_on_the_ground_is_cleared_once_more(moment):
    """Its streams and parameters are requested anew; the estimator of a real one needs 41 s."""
    made = on_the_ground([InjectedFault("reboot", (2,), moment)])
    made.vehicles[1].parameters["GUID_TIMEOUT"] = 0.5
    made.advance(moment + 10.0)
    assert made.phases()[1] == MissionPhase.READY
    made.vehicles[1].parameters["GUID_TIMEOUT"] = 0.7
    made.advance(45.0)
    assert set(made.phases()) == {MissionPhase.CLEARED}, made.log[-5:]
    assert made.nodes[1].autopilot_link.parameters["GUID_TIMEOUT"] == pytest.approx(0.5)


def test_drones_whose_autopilots_have_clocks_of_their_own_keep_one_time():
    """Ages of packets are those of the computers' clocks, whatever the autopilots say."""
    faults = [InjectedFault("autopilot_clock", (who,), amount=off) for who, off in ((1, 1.1), (2, -1.9))]
    made = on_the_ground([*faults, InjectedFault("clock_drift", amount=100.0)])
    made.advance(15.0)
    made.order(OrderKind.START, at=made.now)
    made.advance(35.0)
    assert set(made.phases()) == {MissionPhase.FLOCK}, made.log[-5:]
    ages = made.packet_ages()[round(10.0 / made.card.period) : round(30.0 / made.card.period)]  # then they fly apart
    assert ages[np.isfinite(ages)].max() < made.scenario.radio.delay + 0.3
