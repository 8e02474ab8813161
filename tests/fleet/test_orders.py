"""Orders that come at a bad moment: a start that is called off or comes too late, a kill that nobody follows."""

import math

import pytest

from airflock.drones.mavlink.orders import OrderKind
from airflock.drones.onboard.mission import MissionPhase
from airflock.drones.onboard.node import STOP_SECONDS
from airflock.fleets.vehicle import GUIDED, PILOT_MODE
from fleets import fleet, scenario


def on_the_ground(**more):
    """Two drones that are cleared at 5 s."""
    made = fleet(scenario(2), **more)
    made.advance(5.0)
    return made


def in_the_air():
    """Two drones that flock."""
    made = on_the_ground()
    made.order(OrderKind.START, at=6.0)
    made.advance(22.0)
    assert made.phases() == [MissionPhase.FLOCK] * 2
    return made


def told(found, words):
    return [(now, who) for now, who, note in found.log if words in note]


@pytest.mark.parametrize("do", [OrderKind.HOLD, OrderKind.LAND, OrderKind.RETURN])
def test_who_is_arming_does_not_take_off_once_the_start_is_called_off(do):
    found = on_the_ground()
    found.order(OrderKind.START, at=6.0)
    found.advance(2.0)
    assert MissionPhase.ARMING in found.phases()
    found.order(do)
    found.advance(20.0)
    assert found.phases() == [MissionPhase.CLEARED] * 2 and not any(v.armed or v.flying for v in found.vehicles)
    found.order(OrderKind.START, at=found.now)
    found.advance(30.0)
    assert all(phase in (MissionPhase.GATHER, MissionPhase.FLOCK) for phase in found.phases()), (
        "a new start is followed"
    )


@pytest.mark.parametrize(("do", "ready"), [(OrderKind.HOLD, 4.0), (OrderKind.LAND, 4.0), (None, 15.0)])
def test_a_drone_that_gets_ready_after_its_turn_does_not_arm_by_an_old_start(do, ready):
    """Whoever changes its battery stands beside it."""
    found = fleet(scenario(2))
    found.vehicles[1].battery = 10.0
    found.advance(5.0)
    found.order(OrderKind.START, at=5.0)
    found.advance(1.0)
    if do is not None:
        found.order(do)
    found.advance(ready)
    found.vehicles[1].battery = 100.0
    found.advance(40.0)
    assert not found.vehicles[1].armed and found.phases()[1] == MissionPhase.CLEARED
    assert len(told(found, "not started: something was missing")) == (do is None)


def test_a_kill_of_a_drone_that_its_pilot_has_is_not_kept_for_later():
    found = in_the_air()
    found.vehicles[0].mode = PILOT_MODE
    found.advance(1.0)
    found.order(OrderKind.KILL, target=1)
    found.order(OrderKind.CONFIRM_KILL, target=1)
    found.advance(20.0)
    assert found.phases()[0] == MissionPhase.MANUAL and told(found, "not killed: in MANUAL")
    found.order(OrderKind.RESUME, target=1)
    found.advance(3.0)
    found.vehicles[0].mode = GUIDED
    found.advance(5.0)
    assert found.vehicles[0].armed and found.phases()[0] not in (MissionPhase.MANUAL, MissionPhase.DONE)


def test_a_kill_is_repeated_until_the_autopilot_follows_and_no_longer():
    found = in_the_air()
    vehicle, obeys = found.vehicles[0], found.vehicles[0].receive
    vehicle.receive = lambda data, now: b""  # the line is cut
    found.order(OrderKind.KILL)
    found.order(OrderKind.CONFIRM_KILL)
    found.advance(2.0)
    assert found.phases() == [MissionPhase.DONE] * 2 and [v.armed for v in found.vehicles] == [True, False]
    vehicle.receive = obeys
    found.advance(2.0)
    assert not vehicle.armed
    found.advance(2.0 * STOP_SECONDS)
    vehicle.armed, vehicle.mode = True, PILOT_MODE  # it fell; somebody else has another flight in mind
    found.advance(5.0)
    assert vehicle.armed


def test_drones_that_hold_beside_each_other_flock_on_and_part():
    """Else both would wait for ever until the other one is far."""
    found = in_the_air()
    found.order(OrderKind.HOLD)
    found.advance(5.0)
    for x, v in zip((0.0, 1.5), found.vehicles, strict=True):
        v.state = v.state._replace(x=x, y=0.0, vx=0.0, vy=0.0)
    found.advance(5.0)
    found.order(OrderKind.RESUME)  # their positions jumped by this; somebody has looked
    found.advance(8.0)
    assert found.phases() == [MissionPhase.FLOCK] * 2, found.log[-4:]
    one, other = (v.state for v in found.vehicles)
    assert math.dist(one[:2], other[:2]) > 4.0


def test_resume_that_cannot_be_followed_yet_names_the_reason():
    found = in_the_air()
    found.order(OrderKind.HOLD)
    found.advance(5.0)
    found.vehicles[0].accuracy = 9.0
    found.advance(1.0)
    found.order(OrderKind.RESUME)
    found.advance(1.0)
    assert told(found, "holds on: bad navigation") and found.phases()[0] == MissionPhase.HOLD


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
@pytest.mark.parametrize("lost", [0.0, 1.0, 3.0])
def test_drone_whose_start_is_called_off_is_disarmed_though_packets_are_lost(kind, lost):
    """At each moment from its arming to its take-off; its pilot's own arming is left alone."""
    for tick in range(6):
        found = on_the_ground(autopilot=kind)
        vehicle = found.vehicles[0]
        found.order(OrderKind.START, at=6.0)
        while not vehicle.armed:
            found.advance(0.05)
        found.advance(0.05 * tick)
        obeys = vehicle.receive
        vehicle.receive = lambda data, now: b""
        found.order(OrderKind.HOLD)
        found.advance(lost)
        vehicle.receive = obeys
        found.advance(2.0)  # ArduPilot would switch them off by itself after 10 s
        assert not vehicle.armed, (tick, found.log)
        found.advance(10.0)
        assert not any(v.armed for v in found.vehicles), (tick, found.log)
    vehicle.armed, vehicle.mode = True, PILOT_MODE
    vehicle._idle_since = found.now
    found.advance(5.0)
    assert vehicle.armed


@pytest.mark.parametrize("do", [OrderKind.LAND, OrderKind.RETURN])
def test_an_order_that_comes_with_another_event_is_not_lost(do):
    """At each of the ticks around the end of a climb, where the table has something else to do as well."""
    found = on_the_ground()
    found.order(OrderKind.START, at=6.0)
    while found.phases()[0] != MissionPhase.TAKEOFF or abs(found.vehicles[0].state.z - found.card.layer(1)) >= 0.5:
        found.advance(0.01)
    found.order(do, target=1)
    found.advance(1.0)
    assert [note for _, who, note in found.log if who == 1 and "ordered to" in note]
