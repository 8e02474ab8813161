"""A node takes any bytes, obeys only its operator, can be flown again from its log, and needs no array library."""

import json
import math
import subprocess
import sys
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from airflock.core.agent import State
from airflock.drones.mavlink import orders
from airflock.drones.mavlink.autopilots import AUTOPILOTS
from airflock.drones.mavlink.frames import FramePacker, common_dialect, frames_in
from airflock.drones.mavlink.messages import DroneStatus, status_message
from airflock.drones.mavlink.orders import OperatorOrder, OrderKind, new_operator_keys
from airflock.drones.mavlink.signing import PacketSigner
from airflock.drones.onboard.card import card_hash, parse_card, read_card, write_card
from airflock.drones.onboard.flight_log import LoggingNode, read_node_memory, replay
from airflock.drones.onboard.mission import MissionPhase
from airflock.drones.onboard.node import Node, NodeMemory, own_status
from airflock.fleets import compare
from airflock.fleets.drone_faults import InjectedFault
from airflock.fleets.lockstep import START_TIME
from airflock.fleets.radio_channel import SOFTWARE_KEY
from airflock.fleets.vehicle import SoftwareVehicle
from airflock.parts import BODIES
from airflock.support.coordinates import Geodetic
from airflock.support.errors import CardError, LinkError
from fleets import PRIVATE, card, document, fleet, scenario

common = common_dialect()
SCENARIO = scenario(3)
CARD = parse_card({**(d := document(SCENARIO)), "hash": card_hash(d)})


def node_with_vehicle(**more):
    node = Node(CARD, 1, SOFTWARE_KEY, now=0.0, utc=START_TIME)
    vehicle = SoftwareVehicle(
        "px4", 1, CARD.site, (0.0, 0.0, 0.0), SCENARIO.body.rule, SCENARIO.body.numbers, started=START_TIME, **more
    )
    return node, vehicle


def live(node, vehicle, begin, end):
    """Let both live from begin to end, s, without neighbours."""
    notes, t = [], begin
    while t < end:
        node.autopilot(vehicle.due_telemetry(t), t)
        out = node.tick(t)
        for data in out.autopilot:
            node.autopilot(vehicle.receive(data, t), t)
        notes += out.notes
        for k in range(20):
            vehicle.step(t + 0.01 * k, 0.01)
        t = round(t + 0.2, 6)
    return notes


def told(
    who=2, at=(10.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), utc=START_TIME, phase=MissionPhase.READY, flies=False, **more
):
    made = DroneStatus(utc, at, velocity, 1.0, int(phase), flies, CARD.mission, bytes.fromhex(CARD.hash)[:4], 90)
    return PacketSigner(SOFTWARE_KEY, who)(status_message(made._replace(**more), CARD.site), utc)


def state(node):
    """Everything that bytes could change."""
    wire = {
        k: v for k, v in vars(node.autopilot_link).items() if k not in ("refused", "_stream", "_site", "_kind", "_jump")
    }
    peers = {w: (p.status, p.at, p.heard_at) for w, p in node.peers.all.items()}
    return repr((node.phase, wire, peers, node.memory, {w: p.state for w, p in node.pilot.packets.items()}))


# --------------------------------------------------------------------------------------------- whatever comes in


@given(st.lists(st.one_of(st.binary(max_size=400), st.binary(max_size=40).map(lambda b: b"\xfd" + b)), max_size=12))
@settings(max_examples=200)
def test_any_bytes_change_nothing_and_raise_nothing(pieces):
    node, _ = node_with_vehicle()
    before = state(node)
    for k, data in enumerate(pieces):
        node.autopilot(data, 0.01 * k)
        node.radio(data, 0.01 * k)
    if not any(frames_in(data) for data in [*pieces, b"".join(pieces)]):
        assert state(node) == before
    node.tick(0.2)


odd = st.one_of(st.floats(width=32), st.sampled_from([math.nan, math.inf, -math.inf, 1e9, -1e9, 3e38]))


@given(st.tuples(*[odd] * 6))
def test_an_absurd_own_position_is_not_believed(numbers):
    node, vehicle = node_with_vehicle()
    live(node, vehicle, 0.0, 1.0)
    before = node.autopilot_link.state
    node.autopilot(FramePacker(1, 1)(common.MAVLink_local_position_ned_message(0, *numbers)), 1.0)
    sound = all(math.isfinite(v) and abs(v) < 1e5 for v in numbers)
    assert sound or node.autopilot_link.state == before
    assert all(map(math.isfinite, node.autopilot_link.state))
    node.tick(1.0)


@pytest.mark.parametrize("told_", [
    {"at": (1e6, 0.0, 0.0)}, {"velocity": (300.0, 0.0, 0.0)}, {"phase": 200}, {"mission": 8}, {"card": b"othe"},
    {"who": 1}, {"who": 9}, {"utc": START_TIME + 2_400_000_000_000_000}, {"at": (0.0, 0.0, -5000.0)},
])  # fmt: skip
def test_a_signed_but_absurd_status_is_not_believed(told_):
    node, _ = node_with_vehicle()
    before = state(node)
    node.radio(told(**({"utc": START_TIME + 100_000} | told_)), 0.1)
    assert [p.status for p in node.peers.all.values()] == [None, None] and not node.pilot.packets
    assert node.phase == MissionPhase.BOOT and state(node).split("Memory")[0] == before.split("Memory")[0]


def test_a_neighbour_that_jumps_is_not_believed():
    node, _ = node_with_vehicle()
    sign = PacketSigner(SOFTWARE_KEY, 2)
    for k, x in enumerate((10.0, 10.5, 90.0, 11.5)):
        utc = START_TIME + 100_000 * (k + 1)
        made = DroneStatus(utc, (x, 0.0, 20.0), (4.0, 0.0, 0.0), 1.0, 6, True, 7, bytes.fromhex(CARD.hash)[:4])
        node.radio(sign(status_message(made, CARD.site), utc), 0.1 * (k + 1))
    assert node.peers.refused["jump"] == 1 and node.peers.all[2].status.position[0] == pytest.approx(11.5, abs=0.02)


# --------------------------------------------------------------------------------------- what the autopilot says

# Messages as measured on ArduCopter 4.6.0-dev in software in the loop.
WELL, PREARM_FAILS = 0x57719C2F, 0x47719C2F  # health in SYS_STATUS; the latter before the fence has a position
ENABLED, PRESENT, BATTERY = 0x52719C2F, 0x5371FC2F, 1 << 25
THROTTLE = b"Arm: Throttle (RC3) is not neutral"


def sys_status(health=WELL, millivolts=12600):
    return common.MAVLink_sys_status_message(PRESENT, ENABLED, health, 0, millivolts, 0, 100, 0, 0, 0, 0, 0, 0)


def arducopter(members=(1,), **more):
    """The node of a lone drone and its ArduCopter, with nothing missing."""
    found = scenario(len(members))
    made = document(found, autopilot="ardupilot", members=members, **more)
    flown = parse_card({**made, "hash": card_hash(made)})
    node = Node(flown, 1, SOFTWARE_KEY, now=0.0, utc=START_TIME)
    vehicle = SoftwareVehicle(
        "ardupilot", 1, flown.site, (0.0, 0.0, 0.0), found.body.rule, found.body.numbers, started=START_TIME
    )
    return node, vehicle


def notes_of(node, *messages, now, system=1):
    """Notes of the tick after these messages of the autopilot."""
    pack = FramePacker(system, 1)
    for message in messages:
        node.autopilot(pack(message), now)
    return node.tick(now).notes


def test_a_refusal_to_arm_is_reported_once_at_each_start_with_its_reason_within_two_seconds():
    node, vehicle = arducopter()
    live(node, vehicle, 0.0, 4.0)
    for begin in (10.0, 40.0):
        node.phase, vehicle.mode = MissionPhase.CLEARED, "PILOT"
        node.operator.start_at = START_TIME + round(1e6 * begin)
        notes, t = [], begin
        while t < begin + 8.0:
            node.autopilot(vehicle.due_telemetry(t), t)
            for data in node.tick(t).autopilot:
                arms = [f for f in frames_in(data) if f.message == 76 and f.values()["command"] == 400]
                if arms:
                    ack = common.MAVLink_command_ack_message(400, 4, 0, 0, 1, 191)
                    text = common.MAVLink_statustext_message(2, THROTTLE)
                    notes.append([(t, note) for note in notes_of(node, ack, text, now=t)])
                else:
                    node.autopilot(vehicle.receive(data, t), t)
            t = round(t + 0.2, 6)
        (first, first_note), *others = [row for each in notes for row in each]
        assert len(notes) > 3 and first < begin + 1.5 + 2.0
        assert [first_note] + [note for _, note in others] == [
            "the autopilot refuses to arm or disarm: failed", f"autopilot: {THROTTLE.decode()}",
        ]  # fmt: skip


def test_a_refusal_to_land_is_reported_though_one_of_the_same_mode_was_reported_before_the_flight():
    node, vehicle = arducopter()
    live(node, vehicle, 0.0, 4.0)
    refused = common.MAVLink_command_ack_message(176, 4, 0, 0, 1, 191)
    node.operator.start_at = START_TIME + 4_000_000
    live(node, vehicle, 4.0, 5.0)
    assert node.phase == MissionPhase.ARMING
    assert notes_of(node, refused, now=5.0) == ["the autopilot refuses the mode: failed"]
    live(node, vehicle, 5.2, 30.0)
    assert node.phase == MissionPhase.FLOCK
    node._enter(MissionPhase.LAND, "ordered to land", 30.0, node.tick(30.0))
    assert "the autopilot refuses the mode: failed" in notes_of(node, refused, now=30.2)


def test_an_ordinary_take_off_reports_no_refusal():
    """By its source ArduPilot refuses TAKEOFF once its motors have spooled up."""
    node, vehicle = arducopter()
    live(node, vehicle, 0.0, 4.0)
    node.operator.start_at = START_TIME + 4_000_000
    notes = live(node, vehicle, 4.0, 30.0)
    assert node.phase == MissionPhase.FLOCK and not [note for note in notes if "refuses" in note], notes


@pytest.mark.parametrize(("message", "notes"), [
    (common.MAVLink_command_ack_message(400, 4, 0, 0, 1, 190), []),  # of a ground station
    (common.MAVLink_command_ack_message(400, 5, 0, 0, 1, 191), []),  # in progress
    (common.MAVLink_command_ack_message(511, 3, 0, 0, 1, 191), []),  # streams have lines of their own
    (common.MAVLink_command_ack_message(176, 2, 0, 0, 1, 191), ["the autopilot refuses the mode: denied"]),
    (common.MAVLink_command_ack_message(22, 99, 0, 0, 1, 191), ["the autopilot refuses to take off: 99"]),
    (common.MAVLink_statustext_message(6, b"EKF3 IMU0 is using GPS"), []),
    (common.MAVLink_statustext_message(4, b"Battery 1 is low"), ["autopilot: Battery 1 is low"]),
    (common.MAVLink_statustext_message(2, b"a\x1b[2Jb\nc"), ["autopilot: a\\x1b[2Jb\\nc"]),
])  # fmt: skip
def test_what_concerns_the_flight_is_one_printable_line(message, notes):
    node, _ = arducopter()
    node.tick(0.0)
    assert notes_of(node, message, now=0.2) == notes and notes_of(node, message, now=0.4) == []


@pytest.mark.parametrize(("health", "millivolts", "line"), [
    (PREARM_FAILS, 12600, "missing: the autopilot's own checks before arming fail"),
    (WELL & ~BATTERY, 9500, "missing: battery: the autopilot reports it low or bad at 9.5 V"),
    (WELL & ~BATTERY, 65535, "missing: battery: the autopilot reports it low or bad"),
])  # fmt: skip
def test_nothing_is_cleared_while_the_autopilot_itself_reports_a_reason(health, millivolts, line):
    node, vehicle = arducopter()
    live(node, vehicle, 0.0, 4.0)
    assert node.phase == MissionPhase.CLEARED
    vehicle.rates["sys_status"] = 0.0
    notes = notes_of(node, sys_status(health, millivolts), now=4.0)
    assert [note.startswith(line) for note in notes if note.startswith("missing")] == [True], notes
    if millivolts == 9500:  # a voltage is never quite still
        assert [notes_of(node, sys_status(health, v), now=4.0) for v in (9400, 9500, 9600)] == [[]] * 3
    assert live(node, vehicle, 4.2, 5.0) == [] and node.phase == MissionPhase.READY
    assert notes_of(node, sys_status(), now=5.0) == ["READY → CLEARED: nothing is missing"]


def test_a_battery_low_by_voltage_sends_a_drone_home_at_full_per_cent():
    f = fleet(scenario(3, duration=300.0), autopilot="ardupilot")
    f.advance(12.0)
    f.order(OrderKind.START, at=12.0)
    f.advance(25.0)
    assert f.nodes[0].phase == MissionPhase.FLOCK
    f.vehicles[0].rates["sys_status"] = 0.0
    for millivolts in (9500, 9490):
        f.nodes[0].autopilot(FramePacker(1, 1)(sys_status(WELL & ~BATTERY, millivolts)), f.now)
    f.advance(0.4)
    lines = [note for at, who, note in f.log if who == 1 and at >= 25.0 and "battery" in note]
    assert lines[0] == "battery: the autopilot reports it low or bad at 9.5 V" and "RETURN" in lines[1], lines
    assert f.nodes[0].phase == MissionPhase.RETURN and f.nodes[0].autopilot_link.battery == 100.0


def test_a_landing_by_a_failsafe_of_the_autopilot_is_no_pilot():
    """Without satellites ArduCopter landed by itself 8 s later, before the 10 s of the node's own rule."""
    for failsafe, phase in ((True, MissionPhase.LAND), (False, MissionPhase.MANUAL)):
        f = fleet(scenario(3, duration=300.0), autopilot="ardupilot")
        f.advance(12.0)
        f.order(OrderKind.START, at=12.0)
        f.advance(25.0)
        node, vehicle = f.nodes[1], f.vehicles[1]
        vehicle.mode, vehicle.rates["heartbeat"] = "LAND", 0.0
        state = 5 if failsafe else 4  # MAV_STATE_CRITICAL, MAV_STATE_ACTIVE
        node.autopilot(FramePacker(2, 1)(common.MAVLink_heartbeat_message(2, 3, 128 | 1, 9, state, 3)), f.now)
        f.advance(0.4)
        last = [note for _, who, note in f.log if who == 2][-1]
        assert node.phase == phase and ("by a failsafe of its own" in last) == failsafe, last


def test_a_jump_behind_a_silence_is_a_jump():
    for seconds, step, jumps in ((0.2, 6.0, True), (3.0, 22.0, True), (3.0, 4.0, False), (12.0, 40.0, False)):
        node, vehicle = node_with_vehicle()
        live(node, vehicle, 0.0, 2.0)
        node.autopilot_link._moved(State(step, 0.0, 0.0, 0.0, 0.0, 0.0), 1.8 + seconds)
        assert node.autopilot_link.is_position_doubtful(1.8 + seconds) == jumps, (seconds, step)


@pytest.mark.parametrize(("speed", "apart"), [(12.0, 0.0), (-12.0, 0.0), (12.0, 4.0), (12.0, 6.0)])
@pytest.mark.parametrize("gap", [-0.45, 0.0, 0.45])
def test_two_positions_are_compared_at_one_time(speed, apart, gap):
    """A fast drone is elsewhere when the next message comes; that is no jump, which only an operator ends."""
    link = node_with_vehicle()[0].autopilot_link
    at, later = State(3.0, 2.0, 20.0, speed, 0.0, 0.0), State(3.0 + speed * gap + apart, 2.0, 20.0, speed, 0.0, 0.0)
    link.state, link.state_at, link.global_state, link.global_at = at, 9.5, later, 9.5 + gap
    now = max(9.5, 9.5 + gap)
    assert link.position_disagreement(now) == pytest.approx(apart) and link.is_position_doubtful(now) == (apart > 5.0)


def test_after_a_jump_a_drone_holds_until_the_operator_resumes_though_both_positions_agree_again():
    f = fleet(scenario(3, duration=300.0))
    f.advance(12.0)
    f.order(OrderKind.START, at=12.0)
    f.advance(25.0)
    node, vehicle = f.nodes[2], f.vehicles[2]
    vehicle.error = (22.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    f.advance(30.0)
    assert node.phase == MissionPhase.HOLD and node.autopilot_link.position_disagreement(f.now) < 0.1
    assert [note for _, who, note in f.log if who == 3 and "the position jumped" in note]
    f.order(OrderKind.RESUME, target=3)
    f.advance(5.0)
    assert node.phase == MissionPhase.FLOCK


@pytest.mark.parametrize(("value", "is_safe"), [(1, True), (255, False)])
def test_the_later_name_of_a_parameter_counts_as_the_parameter(value, is_safe):
    node, vehicle = arducopter()
    del vehicle.parameters["SYSID_MYGCS"]
    vehicle.parameters["MAV_GCS_SYSID"] = value
    notes = live(node, vehicle, 0.0, 4.0)
    assert (node.phase == MissionPhase.CLEARED) == is_safe
    line = "missing: MAV_GCS_SYSID = 255 is not within [1, 1]"
    assert any(note.startswith(line) for note in notes) != is_safe, notes


LATER_UNITS = {"WP_ACC": 0.01, "WP_SPD": 0.01}  # m, where Copter 4.6 has cm
LATER_NAMES = [(check.name, name) for check in AUTOPILOTS["ardupilot"].parameter_checks for name in check.later_names]


@pytest.mark.parametrize("share", [1.0, 0.5])
@pytest.mark.parametrize(("name", "later"), [names for names in LATER_NAMES if names[0] != "SYSID_MYGCS"])
def test_a_limit_under_its_later_name_and_unit_counts_as_the_limit(name, later, share):
    """Copter 4.7 has renamed them, some from one patch release to the next; under one name alone it never arms."""
    node, vehicle = arducopter()
    vehicle.parameters[later] = share * vehicle.parameters.pop(name) * LATER_UNITS.get(later, 1.0)
    vehicle.parameters = {key: vehicle.parameters[key] for key in sorted(vehicle.parameters)}
    notes = live(node, vehicle, 0.0, 4.0)
    needed = {check.name: check.low for check in node.card.parameter_checks}[name]
    slow = vehicle.parameters[later] / LATER_UNITS.get(later, 1.0) < needed
    assert (node.phase == MissionPhase.CLEARED) != slow, notes
    assert any(note.startswith(f"missing: {later} = ") and "is not at least" in note for note in notes) == slow, notes


def test_what_is_to_be_set_is_written_in_the_unit_of_each_name():
    lines = [check.instruction() for check in arducopter()[0].card.parameter_checks if check.later_names]
    assert lines == [
        "SYSID_MYGCS or MAV_GCS_SYSID to the own system id",
        "WPNAV_ACCEL at least 480 (Copter 4.7: WP_ACC at least 4.8)",
        "PSC_JERK_XY or PSC_JERK_NE or PSC_NE_JERK at least 16",
        "WPNAV_SPEED at least 480 (Copter 4.7: WP_SPD at least 4.8)",
    ]


def test_the_numbers_that_the_per_cent_of_a_battery_rest_on_are_reported():
    node, vehicle = arducopter()
    vehicle.parameters["BATT_CAPACITY"] = 3300.0
    notes = live(node, vehicle, 0.0, 4.0)
    assert [note for note in notes if note.startswith("BATT_CAPACITY = 3300: capacity in mAh")], notes


# --------------------------------------------------------------------------------------------------- whose clock


def test_the_clock_of_an_autopilot_in_the_loop_keeps_nobody_from_flying():
    """It began 0.92 s before the computer's clock; each of five was off by another 0.1 to 1.1 s."""
    node, vehicle = arducopter()
    vehicle.start_time = START_TIME - 920_000
    notes = live(node, vehicle, 0.0, 2.0)
    assert any("the autopilot's clock is -0.92 s off this computer's" in note for note in notes), notes
    live(node, vehicle, 2.0, 4.0)
    assert node.phase == MissionPhase.CLEARED
    f = fleet(scenario(3, duration=300.0), autopilot="ardupilot")
    for vehicle, off in zip(f.vehicles, (-0.1, -0.92, -1.1), strict=True):
        vehicle.start_time = START_TIME + round(1e6 * off)
    f.advance(12.0)
    f.order(OrderKind.START, at=12.0)
    f.advance(40.0)
    assert set(f.phases()) == {MissionPhase.FLOCK}, f.log


@pytest.mark.parametrize("off", [-0.6, 0.6, 3.0])
@pytest.mark.parametrize("drifting", [False, True])
def test_a_computer_whose_clock_is_off_does_not_start_whatever_the_autopilots_say(off, drifting):
    f = fleet(scenario(3, duration=300.0), autopilot="ardupilot", faults=[InjectedFault("clock", (2,), amount=off)])
    for vehicle in f.vehicles if drifting else ():
        vehicle.start_time = START_TIME - 300_000
    f.advance(12.0)
    f.order(OrderKind.START, at=12.0)
    f.advance(20.0)
    assert f.nodes[1].phase == MissionPhase.READY
    assert any(note.startswith("missing: clock: ") for _, who, note in f.log if who == 2), f.log


def test_in_the_air_a_drift_is_explained_and_a_step_is_not():
    """100 ppm reach 0.2 s after 33 min; a step of 0.5 s is no drift, whatever the other drones say."""
    f = fleet(scenario(3, duration=300.0), autopilot="ardupilot")
    f.advance(12.0)
    f.order(OrderKind.START, at=12.0)
    f.advance(25.0)
    node, vehicle = f.nodes[0], f.vehicles[0]
    for _ in range(40):
        vehicle.start_time -= 20_000  # 40 times 0.02 s within 40 s: 200 times as quick as a crystal
        f.advance(1.0)
    assert node.phase == MissionPhase.FLOCK and node.autopilot_link.clock_offset() < -0.5
    vehicle.start_time += 500_000
    f.advance(3.0)
    assert node.phase == MissionPhase.HOLD
    assert any("HOLD: a suspicious clock" in note for _, who, note in f.log if who == 1)


# -------------------------------------------------------------------------------------------------- who is obeyed


@pytest.mark.parametrize(
    "phase",
    [
        MissionPhase.FLOCK,
        MissionPhase.GOTO,
        MissionPhase.MANUAL,
        MissionPhase.LAND,
        MissionPhase.HOLD,
        MissionPhase.RETURN,
    ],
)
def test_whom_it_lost_is_feared_less_if_its_last_packet_said_that_it_does_not_fly_with_the_flock(phase):
    """60 m away, 8 s ago: at twice the flock's 4 m/s it could be near by now, at half of that it could not."""
    found = scenario(3, **{"silence.rule": "stop"})
    made = document(found)
    card = parse_card({**made, "hash": card_hash(made)})
    node = Node(card, 1, SOFTWARE_KEY, now=0.0, utc=START_TIME)
    sent, told_hash = START_TIME + 1000, bytes.fromhex(card.hash)[:4]
    said = DroneStatus(sent, (60.0, 0.0, 20.0), (0.0, 0.0, 0.0), 1.0, int(phase), True, card.mission, told_hash)
    node.radio(PacketSigner(SOFTWARE_KEY, 2)(status_message(said, card.site), sent), 0.01)
    assert 1 in node.pilot.packets
    assert node.pilot.lost_near(State(*(0.0,) * 6), 8.0) is (
        phase in (MissionPhase.FLOCK, MissionPhase.GOTO, MissionPhase.LAND)
    )


def order(do, private=PRIVATE, given=START_TIME + 100_000, mission=7, sender=orders.OPERATOR_SYSTEM, **more):
    made = orders.order_message(OperatorOrder(do, more.get("target", 0), mission, given, more.get("at", 0)), private)
    return PacketSigner(SOFTWARE_KEY, sender)(made, given)


def test_only_a_fresh_order_of_the_operator_counts_and_only_once():
    node, _ = node_with_vehicle()
    other, _ = new_operator_keys()
    node.radio(order(OrderKind.HOLD, private=other), 0.1)
    node.radio(order(OrderKind.HOLD, sender=2, given=START_TIME + 110_000), 0.2)
    node.radio(order(OrderKind.HOLD, mission=8, given=START_TIME + 120_000), 0.2)
    assert not node.operator.held and node.operator.refused["seal"] == node.operator.refused["mission"] == 1
    genuine = order(OrderKind.HOLD, given=START_TIME + 130_000)
    node.radio(genuine, 0.2)
    assert node.operator.held
    again = Node(CARD, 1, SOFTWARE_KEY, now=0.0, utc=START_TIME, memory=node.memory)
    again.radio(genuine, 0.2)
    assert not again.operator.held, "the same order after a restart"


@pytest.mark.parametrize(("off", "line"), [
    (3_000_000, "packets of the operator are refused: they are from 3.0 s in the future"),
    (-8_000_000, "packets of the operator are refused: they are from 8.0 s in the past"),
    (100_000, None),
])  # fmt: skip
def test_an_order_by_a_clock_that_is_off_is_refused_with_one_line(off, line):
    node, _ = node_with_vehicle()
    for k in range(3):
        node.radio(order(OrderKind.HOLD, given=START_TIME + off + 1000 * k), 0.0)
    notes = node.tick(0.2).notes
    assert node.operator.held == (line is None)
    assert len(notes) == (line is not None) and all(note.startswith(line) for note in notes), notes


def test_an_order_of_another_operator_is_refused_with_one_line_and_a_repeated_one_with_none():
    node, _ = node_with_vehicle()
    for _ in range(2):
        node.radio(order(OrderKind.HOLD, given=START_TIME + 100_000), 0.0)
    assert node.tick(0.2).notes == []
    for k in range(3):
        node.radio(order(OrderKind.LAND, private=new_operator_keys()[0], given=START_TIME + 200_000 + k), 0.2)
    (note,) = node.tick(0.4).notes
    assert note.startswith("an order is refused: the operator of this card has not signed it")


def test_a_kill_takes_two_steps():
    node, _ = node_with_vehicle()
    node.radio(order(OrderKind.CONFIRM_KILL, given=START_TIME + 100_000), 0.1)
    assert not node.operator.kill_confirmed
    node.radio(order(OrderKind.KILL, given=START_TIME + 200_000), 0.2)
    node.radio(order(OrderKind.CONFIRM_KILL, given=START_TIME + 300_000, target=2), 0.3)
    assert not node.operator.kill_confirmed
    node.radio(order(OrderKind.CONFIRM_KILL, given=START_TIME + 400_000, target=1), 0.4)
    assert node.operator.kill_confirmed


def test_nothing_arms_without_a_start_and_nothing_starts_with_something_missing():
    node, vehicle = node_with_vehicle()
    notes = live(node, vehicle, 0.0, 3.0)
    assert node.phase == MissionPhase.READY and not vehicle.armed
    assert {n for n in notes if n.startswith("missing")} == {
        "missing: drone 2 is not heard", "missing: drone 3 is not heard",
    } | {n for n in notes if "autopilot has not reported" in n}  # fmt: skip
    node.radio(order(OrderKind.START, given=START_TIME + 3_000_000, at=START_TIME + 3_000_000), 3.0)
    live(node, vehicle, 3.2, 10.0)
    assert node.phase == MissionPhase.READY and not vehicle.armed


def test_an_autopilot_that_is_not_heard_is_told_until_it_is():
    node, vehicle = node_with_vehicle()
    early, late = ([note for k in range(*span) for note in node.tick(0.2 * k).notes] for span in ((0, 15), (15, 30)))
    assert early == [] and [note.startswith("missing: no heartbeat from the autopilot") for note in late] == [True]
    live(node, vehicle, 6.0, 8.0)
    assert node.phase == MissionPhase.READY


@pytest.mark.parametrize(("change", "line"), [
    (lambda v: setattr(v, "armed", True), "is armed already; disarm it"),
    (lambda v: v.parameters.update(COM_OF_LOSS_T=3.0), r"COM_OF_LOSS_T = 3 is not within \[0, 1\]"),
    (lambda v: v.parameters.update(GF_ACTION=0), "GF_ACTION = 0 is not within"),
    (lambda v: v.parameters.update(GF_ACTION=4), "GF_ACTION = 4 is not .* not 4: .* 4 cuts the motors"),
    (lambda v: setattr(v, "state", v.state._replace(z=-40.0)), "stands 40.0 m below the card's site"),
    (lambda v: setattr(v, "state", v.state._replace(y=2e6)), r"is 2000 km away from the card's site"),
    (lambda v: setattr(v, "battery", 20.0), "battery: 20 %"),
    (lambda v: setattr(v, "accuracy", 9.0), "accuracy 9.0 m"),
    (lambda v: setattr(v, "start_time", START_TIME + 700_000), r"clock: \+0.70 s .* restart the node"),
    (lambda v: setattr(v, "state", v.state._replace(x=500.0)), "outside the fence: is the card's site right"),
])  # fmt: skip
def test_each_miss_is_told_in_a_line(change, line):
    import re

    node, vehicle = node_with_vehicle()
    change(vehicle)
    vehicle.origin = CARD.site.to_geodetic(*vehicle.state[:2], 0.0)
    notes = live(node, vehicle, 0.0, 2.0)
    assert [n for n in notes if re.search(line, n)], notes


LIMITS = [(kind, c.name) for kind, autopilot in AUTOPILOTS.items() for c in autopilot.parameter_checks if c.limits]


@pytest.mark.parametrize(("kind", "name"), LIMITS)
@pytest.mark.parametrize("body", ["multirotor", "autopilot"])
def test_an_autopilot_that_is_not_as_quick_as_its_card_says_is_not_cleared(kind, name, body):
    """A fifth less is let pass; the card of a body relies on what that body can do, and its imitation can."""
    found = scenario(3, **{"body.kind": body})
    made = card(found, autopilot=kind)
    (check,) = (check for check in made.parameter_checks if check.name == name)
    relied_on = {
        "accel": 2.5 if body == "autopilot" else 6.0, "speed": 6.0, "jerk": 5.0 if body == "autopilot" else 20.0,
        "gain": 1.0 / 1.2 if body == "autopilot" else 1.0, "tilt": 14.3 if body == "autopilot" else 31.46,
    }[check.limits]  # fmt: skip
    for share, missed in ((1.0, False), (0.81, False), (0.79, True)):
        vehicle = SoftwareVehicle(
            kind, 1, made.site, (0.0, 0.0, 0.0), found.body.rule, found.body.numbers, started=START_TIME
        )
        vehicle.parameters[name] = share * relied_on * check.scale
        node = Node(made, 1, SOFTWARE_KEY, now=0.0, utc=START_TIME)
        notes = live(node, vehicle, 0.0, 4.0)
        lines = [note for note in notes if note.startswith(f"missing: {name} =")]
        assert len(lines) == missed and all("is not at least" in line for line in lines), notes


def test_arducopter_at_its_defaults_is_refused_by_the_card_of_a_paper_and_not_by_its_own():
    """WPNAV_ACCEL 250 cm/s², PSC_JERK_XY 5 m/s³: its parameters are those of the body that was measured of it."""
    kinds = ("autopilot", "multirotor")
    slow, paper = (card(scenario(3, **{"body.kind": kind}), autopilot="ardupilot") for kind in kinds)
    measured = BODIES["autopilot"]
    b = measured.Parameters()
    vehicle = SoftwareVehicle("ardupilot", 1, slow.site, (0.0, 0.0, 0.0), measured, b, started=START_TIME)
    assert (vehicle.parameters["WPNAV_ACCEL"], vehicle.parameters["PSC_JERK_XY"]) == (250.0, 5.0)
    refused = [
        {c.name for c in each.parameter_checks if not c.safe(vehicle.parameters[c.name], 1)} for each in (slow, paper)
    ]
    assert refused == [set(), {"WPNAV_ACCEL", "PSC_JERK_XY"}]


def test_the_card_of_a_body_tells_its_dead_time_and_half_of_its_ramp():
    """ArduCopter as measured: 0.40 s, and 2.5 m/s² by 5 m/s³ take 0.5 s; no later than its acceleration it brakes."""
    safety = card(scenario(3, **{"body.kind": "autopilot", "body.a_max": 2.0, "body.jerk": 4.0})).safety
    assert (safety.delay, safety.response, safety.accel, safety.brake) == pytest.approx((0.65, 1.2, 2.0, 2.0))
    usual = card(SCENARIO)
    assert usual.safety.delay == 0.0 and "delay" not in usual.document["safety"] | usual.document["body"]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("said", "true", "told"), [
    ("multirotor", "multirotor", False), ("autopilot", "autopilot", False), ("multirotor", "autopilot", True),
])  # fmt: skip
def test_a_drone_that_answers_later_than_its_card_says_is_told_in_flight(said, true, told, seed):
    """By its own commands and velocities, in 40 s of flocking; one as quick as its card says is never suspected."""
    flown = compare.with_metric_period(scenario(4, 40.0, noisy=True, **{"body.kind": true}), 0.2)
    promised = compare.default_safety(scenario(4, **{"body.kind": said}))
    made = compare.software_card(flown)
    limits = {name: getattr(promised, name) for name in ("response", "delay", "accel", "brake")}
    made = replace(made, safety=replace(made.safety, **limits))
    notes = [str(line) for line in compare.fly_in_lockstep(flown, made, seed).log]
    late = [line for line in notes if "answers later than the card says" in line]
    assert len(late) == (4 if told else 0), notes


def test_no_site_is_doubted_before_there_are_satellites():
    """An autopilot without a fix may say that it is where the equator meets Greenwich."""
    node, vehicle = node_with_vehicle()
    vehicle.origin = CARD.site.to_geodetic(0.0, 0.0, 0.0)
    vehicle.state = vehicle.state._replace(y=-5e6)
    heard = node.autopilot
    node.autopilot = lambda data, now: (heard(data, now), setattr(node.autopilot_link, "fix_type", 1))[0]
    notes = live(node, vehicle, 0.0, 2.0)
    assert any("no own position" in note for note in notes) and not any("away from the card" in note for note in notes)


def test_an_autopilot_that_is_started_anew_on_the_ground_is_asked_once_more():
    """By hand its parameters and its streams may have changed meanwhile, and its origin has."""
    node, vehicle = node_with_vehicle()
    live(node, vehicle, 0.0, 5.0)
    assert node.autopilot_link.parameters["GF_ACTION"] == 3.0 and node.autopilot_link.origin is not None
    usual, vehicle.booted_at = dict(vehicle.rates), 8.0
    vehicle.rates = usual | dict.fromkeys(("local", "global", "gps", "landed"), 0.0)  # what was asked for is forgotten
    vehicle.parameters["GF_ACTION"] = 0
    notes = live(node, vehicle, 8.0, 14.0)
    assert any("GF_ACTION = 0 is not within" in note for note in notes), notes
    assert (
        node.autopilot_link.state is not None
        and node.autopilot_link.state_at > 13.0
        and node.autopilot_link.origin is not None
    )


def test_another_autopilot_is_a_fault():
    node, _ = node_with_vehicle()
    other = SoftwareVehicle(
        "ardupilot", 1, CARD.site, (0.0, 0.0, 0.0), SCENARIO.body.rule, SCENARIO.body.numbers, started=START_TIME
    )
    assert any("the card is for px4" in n for n in live(node, other, 0.0, 1.0)) and node.phase == MissionPhase.FAULT
    node, _ = node_with_vehicle()
    other = SoftwareVehicle(
        "px4", 4, CARD.site, (0.0, 0.0, 0.0), SCENARIO.body.rule, SCENARIO.body.numbers, started=START_TIME
    )
    assert any("calls itself system 4" in n for n in live(node, other, 0.0, 4.0)) and node.phase == MissionPhase.FAULT


def test_another_vehicle_on_the_wire_that_is_heard_first_is_no_fault():
    """Its heartbeat may come before that of the own autopilot, as that of an antenna tracker."""
    node, vehicle = node_with_vehicle()
    heartbeat = common.MAVLink_heartbeat_message(5, 3, 1, 0, 4, 3)
    assert notes_of(node, heartbeat, now=0.0, system=4) == [] and node.phase == MissionPhase.BOOT
    live(node, vehicle, 0.2, 4.0)
    assert node.phase == MissionPhase.READY


def test_two_drones_with_one_number_do_not_start():
    node, vehicle = node_with_vehicle()
    live(node, vehicle, 0.0, 1.0)
    for datagram in node.tick(1.0).radios[0] + node.tick(1.2).radios[0]:
        node.radio(datagram, 1.2)  # a radio that hears itself
    node.radio(
        PacketSigner(bytes(32), 1)(
            status_message(
                own_status(CARD, node.autopilot_link, node.autopilot_link.state, START_TIME, node.phase, peers=0),
                CARD.site,
            ),
            START_TIME + 10**6,
        ),
        1.2,
    )
    live(node, vehicle, 1.4, 2.0)
    assert node.phase == MissionPhase.READY, "neither an echo nor a forgery is a twin"
    node.radio(told(who=1, utc=START_TIME + 2_050_123), 2.1)
    assert (
        any("two drones with one number" in n for n in live(node, vehicle, 2.2, 3.0))
        and node.phase == MissionPhase.FAULT
    )


def test_a_node_that_starts_in_the_air_leaves_it_to_the_pilot():
    node, vehicle = node_with_vehicle()
    vehicle.state, vehicle.armed, vehicle.mode = vehicle.state._replace(z=20.0), True, "HOLD"
    live(node, vehicle, 0.0, 2.0)
    assert node.phase == MissionPhase.MANUAL and node.command == (0.0, 0.0, 0.0) and vehicle.setpoint_at < 0.0


def test_a_law_that_fails_in_flight_holds_and_then_returns(monkeypatch):
    f = fleet(SCENARIO)
    f.advance(1.0)
    node, vehicle = f.nodes[0], f.vehicles[0]
    node.phase, node.home, vehicle.armed, vehicle.mode = MissionPhase.FLOCK, (0.0, 0.0, 10.0), True, "OURS"
    vehicle.state, vehicle.setpoint_at = vehicle.state._replace(z=20.0), 1.0
    node.autopilot_link.state = None  # it is put there by hand, which is no jump
    monkeypatch.setattr(node.pilot, "decide", lambda *a, **k: 1 / 0)
    f.advance(20.0)
    notes = [note for _, who, note in f.log if who == 1]
    assert any("ZeroDivisionError" in n for n in notes)
    assert sum("HOLD: overloaded" in n for n in notes) == 3 and any("RETURN: overloaded too often" in n for n in notes)


# ------------------------------------------------------------------------------------------------ cards and logs


def test_a_card_is_written_and_read_and_its_change_is_seen(tmp_path):
    path = tmp_path / "mission.json"
    written = write_card(path, document(SCENARIO))
    assert read_card(path).hash == written.hash == CARD.hash
    changed = json.loads(path.read_text()) | {"height": 25.0}
    path.write_text(json.dumps(changed))
    with pytest.raises(CardError, match="changed after it was written"):
        read_card(path)
    for text, line in (("{", "is not JSON"), ("[]", "not a flight card"), ("[" * 10_000, "nested more than 32 deep")):
        path.write_text(text)
        with pytest.raises(CardError, match=line):
            read_card(path)
    with pytest.raises(CardError, match="no such file"):
        read_card(tmp_path / "absent")


@pytest.mark.parametrize(("change", "line"), [
    ({"members": [1, 1]}, "occurs twice"),
    ({"members": [0, 300]}, "system ids from 1 to 250"),
    ({"members": [True]}, "system ids"),
    ({"height": 90.0}, "height = 90 m"),
    ({"height": math.nan}, "height = nan is not a number"),
    ({"autopilot": "betaflight"}, "none of px4, ardupilot"),
    ({"period": 0.0}, "period = 0 lies outside"),
    ({"heigth": 1.0}, "heigth is not known; did you mean height"),
    ({"operator": "abc"}, "operator: is not a public key"),
    ({"law": {"kind": "os"}}, "not a law of this version"),
    ({"law": {"kind": "dimock_2003"}}, "no single drone can fly it"),
    ({"safety": {"speed_max": 900.0, "breake": 2.0}}, "safety.speed_max = 900 m/s lies outside"),
    ({"safety": {"breake": 2.0}}, "safety.breake is not known; did you mean safety.brake"),
    ({"fence": {"corners": [[0, 0], [1, 0], [0, 1]], "low": 2.0, "high": 60.0}}, "does not enclose the law's walls"),
    ({"fence": {"corners": [[0, 0], [9, 0], [0, 9], [9, 9.5]], "low": 2.0, "high": 60.0}}, "crosses or touches itself"),
    ({"site": {"latitude": 95.0, "longitude": 0.0, "altitude": 0.0}}, "site.latitude = 95 lies outside"),
    ({"world": {"arena": "square", "side": 120.0, "edges": "periodic"}}, "real space has no such edges"),
])  # fmt: skip
def test_what_is_wrong_with_a_card_is_one_line(change, line):
    made = {**document(SCENARIO), **change}
    with pytest.raises(CardError, match=line) as fault:
        parse_card({**made, "hash": card_hash(made)})
    assert all(text.startswith("card: ") for text in fault.value.errors)


@given(st.data())
@settings(max_examples=80, suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_a_card_of_anything_is_refused_or_sound(data):
    made = document(SCENARIO)
    key = data.draw(st.sampled_from(sorted(made)))
    leaf = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
    row = leaf | st.lists(leaf, max_size=3)
    anything = row | st.lists(row, max_size=3) | st.dictionaries(st.text(max_size=5), row, max_size=3)
    made[key] = data.draw(anything)
    try:
        parse_card({**made, "hash": card_hash(made)})
    except CardError as fault:
        assert fault.errors


class Watched(LoggingNode):
    """A logged node that a fleet can ask for its state."""

    def __getattr__(self, name):
        return getattr(self.node, name)


def test_a_log_is_flown_again_to_the_bit():
    f = fleet(replace(SCENARIO), autopilot="px4")
    lines = []
    f.nodes[0] = Watched(f.nodes[0], lines.append, now=0.0, memory=NodeMemory(), radios=(0.2,))
    f.advance(12.0)
    f.order(OrderKind.START, at=12.2)
    f.advance(25.0)
    assert f.nodes[0].phase == MissionPhase.FLOCK
    ticks = list(replay(lines, f.card, SOFTWARE_KEY))
    assert len(ticks) == 185 and all(tick.same for tick in ticks)
    bent = [line.replace('"a":"fd', '"a":"fe') if k == 900 else line for k, line in enumerate(lines)]
    assert not all(tick.same for tick in replay([bent[0], *bent[40:]], f.card, SOFTWARE_KEY)), (
        "inputs that are missing are seen"
    )
    with pytest.raises(LinkError, match="another card"):
        next(replay(lines, replace(f.card, hash="0" * 64), SOFTWARE_KEY))
    with pytest.raises(LinkError, match="not a log"):
        next(replay(["{}"], f.card, SOFTWARE_KEY))


def test_the_memory_of_a_node_is_read_or_refused(tmp_path):
    path = tmp_path / "memory"
    assert read_node_memory(path) == NodeMemory()
    for text in ("", "[]", '{"sent": "x"}'):
        path.write_text(text)
        with pytest.raises(LinkError, match="cannot be read"):
            read_node_memory(path)


# ---------------------------------------------------------------------------------------------------- packaging

REFUSED = (
    "numpy", "numba", "scipy", "pydantic", "typer", "rich", "xarray", "pandas", "shapely", "matplotlib", "lxml",
    "fastcrc",
)  # fmt: skip
ALONE = f"""
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {REFUSED}:
            raise ImportError(name + " is not installed on board")
sys.meta_path.insert(0, Refuse())
import airflock.drones.onboard, airflock.drones.onboard.node_program
from airflock.drones.onboard.node_program import main
assert "cryptography" not in sys.modules, "seals are checked rarely"
for kind in ("couzin_2002", "kidger", "vasarhelyi_2018", "viragh_2014", "reynolds_1987", "vicsek_1995"):
    __import__("airflock.parts.laws." + kind)
import resource
peak = [int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmRSS")]
sys.stdout.write(str(peak[0]) + "\\n")
sys.exit(main(sys.argv[1:]))
"""


def test_a_node_needs_neither_numpy_nor_numba_nor_pydantic_nor_typer(tmp_path):
    from airflock.drones.mavlink.signing import write_key

    write_card(tmp_path / "m.json", document(SCENARIO, expires=2**39))
    write_key(tmp_path / "m.key", SOFTWARE_KEY)
    given = [
        "m.json",
        "--member",
        "2",
        "--autopilot",
        "udp:127.0.0.1:39411",
        "--radio",
        "udp:127.0.0.1:39412>127.0.0.1:39413",
        "--check",
    ]
    done = subprocess.run([sys.executable, "-c", ALONE, *given], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    memory, told = done.stdout.splitlines()
    assert int(memory) < 40_000 and "3 members" in told  # kB; with pymavlink's dialect


def test_the_command_tells_all_that_is_wrong_at_once(tmp_path, capsys):
    from airflock.drones.onboard.node_program import main

    write_card(tmp_path / "m.json", document(SCENARIO))
    code = main([str(tmp_path / "m.json"), "--member", "9", "--autopilot", "tcp:1", "--radio", "udp:127.0.0.1:99999"])
    lines = capsys.readouterr().err.splitlines()
    assert code == 2 and all(line.startswith("airflock: ") for line in lines)
    for part in (
        "members are 1, 2, 3",
        "the key cannot be read",
        "--i-am-the-pilot is missing",
        "tcp:1: give",
        "1 to 65535",
    ):
        assert any(part in line for line in lines), part


def test_a_goal_outside_the_fence_is_not_followed():
    f = fleet(scenario(3, duration=300.0))
    f.advance(12.0)
    f.order(OrderKind.START, at=12.0)
    f.advance(25.0)
    far = CARD.site.to_geodetic(900.0, 0.0, 20.0)
    f.order(OrderKind.GOTO, point=Geodetic(*far))
    f.advance(1.0)
    assert set(f.phases()) == {MissionPhase.FLOCK} and any("outside the fence; not followed" in n for _, _, n in f.log)
    f.order(OrderKind.GOTO, point=CARD.site.to_geodetic(25.0, 25.0, 20.0))
    f.advance(40.0)
    centre = [sum(v.state[c] for v in f.vehicles) / 3 for c in (0, 1)]
    assert set(f.phases()) == {MissionPhase.GOTO} and math.dist(centre, (25.0, 25.0)) < 12.0
    f.order(OrderKind.GOTO, point=Geodetic(*far))
    f.order(OrderKind.HOLD)
    f.advance(6.0)
    assert set(f.phases()) == {MissionPhase.HOLD}, "ordered to hold, they hold"
    f.order(OrderKind.GOTO, point=CARD.site.to_geodetic(-25.0, 0.0, 20.0))
    f.advance(20.0)
    moved = [sum(v.state[c] for v in f.vehicles) / 3 for c in (0, 1)]
    assert set(f.phases()) == {MissionPhase.GOTO} and moved[0] < centre[0] - 10.0
