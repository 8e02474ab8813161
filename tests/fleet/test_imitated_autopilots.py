"""Vehicles in software behave as the autopilot that was measured: ArduCopter 4.6.0-dev in software in the loop.

Each number was taken from its logs; PX4 was not flown, and keeps what its documentation says.
"""

import math
from collections import Counter
from random import Random

import pytest

from airflock.core.contract import State
from airflock.drones.mavlink.autopilots import AUTOPILOTS, STREAM_RATES, AutopilotCommands
from airflock.drones.mavlink.frames import frames_in
from airflock.fleets import compare
from airflock.fleets.drone_faults import (
    AMOUNT_RANGES,
    INJECTED_KINDS,
    WHOLE_FLIGHT_KINDS,
    InjectedFault,
    read_injected_faults,
)
from airflock.fleets.vehicle import DEFAULT_PARAMETERS, GUIDED, LAND_MODE, SoftwareVehicle
from airflock.support.coordinates import FlightSite
from airflock.support.errors import ScenarioError
from fleets import scenario

STEP = 0.01  # s
HEARTBEAT, SYS_STATUS, SYSTEM_TIME, PARAMETER, GPS, LOCAL, GLOBAL, ORIGIN, ACK, TEXT = (
    0,
    1,
    2,
    22,
    24,
    32,
    33,
    49,
    77,
    253,
)
PREARM_BIT = 1 << 28
REBOOT_MOMENTS = [Random(f"reboot {k}").uniform(0.0, 60.0) for k in range(3)]


class Craft:
    """An imitated autopilot with a clock, and all frames that it has sent, with their times."""

    def __init__(self, kind="ardupilot", faults=()):
        body, site = scenario(1).body, FlightSite(47.5, 19.0, 120.0)
        self.vehicle = SoftwareVehicle(kind, 1, site, (0.0, 0.0, 0.0), body.rule, body.numbers, faults=faults)
        self.say, self.steps, self.sent = AutopilotCommands(AUTOPILOTS[kind], 1), 0, []

    @property
    def now(self):
        return self.steps * STEP

    def hear(self, data):
        """Bring bytes to the autopilot, and keep its answers."""
        self.sent += [(self.now, frame) for frame in frames_in(self.vehicle.receive(data, self.now))]

    def request_streams(self):
        for number, rate in STREAM_RATES.items():
            self.hear(self.say.command(511, float(number), 1e6 / rate))

    def fly(self, seconds, each=lambda: None):
        """Let time pass; `each` is called at each step."""
        for _ in range(round(seconds / STEP)):
            self.sent += [(self.now, frame) for frame in frames_in(self.vehicle.due_telemetry(self.now))]
            each()
            self.vehicle.apply_faults(self.now, STEP)
            self.vehicle.step(self.now, STEP)
            self.steps += 1

    def put_in_air(self, height=20.0):
        self.vehicle.state, self.vehicle.armed = State(0.0, 0.0, height, 0.0, 0.0, 0.0), True
        self.vehicle.mode, self.vehicle.setpoint_at, self.vehicle.heartbeat_at = GUIDED, self.now, self.now
        return self

    def hover(self):
        """Send heartbeats and setpoints as a node that flies: velocity 0."""
        if self.steps % 5 == 0:
            self.hear(self.say.velocity((0.0, 0.0, 0.0), 0))
        if self.steps % 100 == 0:
            self.hear(self.say.heartbeat())

    def rates(self, since):
        """Frames of each message per second since a time, s."""
        counts = Counter(frame.message for at, frame in self.sent if at >= since)
        return {number: count / (self.now - since) for number, count in counts.items()}

    def first(self, message, since=0.0, holds=lambda values: True):
        """Time after `since` at which a message with such values was first sent, s; inf: never."""
        times = [at - since for at, f in self.sent if at >= since and f.message == message and holds(f.values())]
        return min(times, default=math.inf)

    def values(self, message):
        return [frame.values() for _, frame in self.sent if frame.message == message]


# ---------------------------------------------------------------------------------------------------------- streams


def test_ardupilot_sends_its_heartbeat_alone_until_streams_are_requested():
    craft = Craft()
    craft.fly(20.0)
    assert craft.rates(0.0) == {HEARTBEAT: 1.0}
    craft.request_streams()
    craft.fly(20.0)
    rates = craft.rates(20.0 + STEP)
    assert {number: rates[number] for number in STREAM_RATES} == pytest.approx(STREAM_RATES, rel=0.03)


def test_px4_streams_by_itself():
    craft = Craft("px4")
    craft.fly(10.0)
    assert set(STREAM_RATES) <= craft.rates(0.0).keys()


@pytest.mark.parametrize("kind", AUTOPILOTS)
def test_an_interval_of_minus_one_ends_a_stream_and_zero_gives_the_rate_of_its_boot(kind):
    craft = Craft(kind)
    for interval, rate in ((5e4, 20.0), (-1.0, 0.0), (1e6, 1.0), (0.0, 20.0 if kind == "px4" else 0.0)):
        craft.hear(craft.say.command(511, float(LOCAL), interval))
        began = craft.now + 2.0 * STEP
        craft.fly(10.0)
        assert craft.rates(began).get(LOCAL, 0.0) == pytest.approx(rate, abs=0.2)


@pytest.mark.parametrize("moment", REBOOT_MOMENTS)
def test_a_reboot_ends_all_streams_and_keeps_parameters(moment):
    craft = Craft(faults=[InjectedFault("reboot", (1,), moment)])
    craft.request_streams()
    craft.vehicle.parameters["GUID_TIMEOUT"] = 0.7
    craft.fly(moment + 30.0)
    assert craft.rates(moment + 5.0).keys() <= {HEARTBEAT}, "nothing says that streams have ended"
    assert craft.first(HEARTBEAT, moment + 2.0 * STEP) < 2.5 and not craft.vehicle.armed
    craft.request_streams()
    craft.fly(5.0)
    assert craft.rates(moment + 31.0)[GLOBAL] == pytest.approx(20.0, rel=0.1)
    craft.hear(craft.say.request_parameter("GUID_TIMEOUT"))
    assert craft.values(PARAMETER)[-1]["param_value"] == pytest.approx(0.7)


def test_a_rebooted_ardupilot_knows_its_time_after_10_s_its_origin_after_20_s_its_position_after_41_s():
    craft = Craft(faults=[InjectedFault("reboot", begin=5.0)])
    craft.fly(5.0 + 2.0 * STEP)

    def ask():
        if craft.steps % 100 == 0:
            craft.request_streams()
            craft.hear(craft.say.request_message(ORIGIN))

    craft.fly(60.0, ask)
    assert craft.first(GPS, 5.0, lambda v: v["fix_type"] >= 3) == pytest.approx(10.0, abs=0.5)
    assert craft.first(SYSTEM_TIME, 5.0, lambda v: v["time_unix_usec"] > 0) == pytest.approx(10.0, abs=1.5)
    assert craft.first(GLOBAL, 5.0) < 2.0 <= 9.5 < craft.first(GLOBAL, 5.0, lambda v: v["lat"] != 0)
    assert craft.first(ORIGIN, 5.0) == pytest.approx(20.0, abs=1.5)
    assert craft.first(LOCAL, 5.0) == pytest.approx(41.0, abs=0.5)
    fit = craft.first(SYS_STATUS, 5.0, lambda v: v["onboard_control_sensors_health"] & PREARM_BIT)
    assert fit == pytest.approx(41.0, abs=1.0)
    assert craft.first(TEXT, 5.0, lambda v: v["text"].startswith("PreArm: Fence")) == pytest.approx(30.0, abs=1.0)


def test_the_last_request_for_a_rate_holds_whoever_sent_it():
    """MAVProxy's 4 Hz replace the node's 20 Hz, and come again every 15 s."""
    craft = Craft(faults=[InjectedFault("streams", begin=10.0, amount=4.0)])
    craft.request_streams()
    craft.fly(18.0)
    assert craft.rates(11.0)[LOCAL] == pytest.approx(4.0, rel=0.1)
    craft.request_streams()
    craft.fly(6.0)
    assert craft.rates(19.0)[LOCAL] == pytest.approx(20.0, rel=0.1)
    craft.fly(10.0)
    assert craft.rates(26.0)[LOCAL] == pytest.approx(4.0, rel=0.15)


def test_a_request_that_is_lost_has_no_effect_and_no_answer():
    craft = Craft(faults=[InjectedFault("uplink", end=1.0)])
    craft.request_streams()
    craft.fly(2.0)
    assert craft.rates(0.0).keys() == {HEARTBEAT}
    craft.request_streams()
    assert [v["result"] for v in craft.values(ACK)] == [0] * len(STREAM_RATES)


# ----------------------------------------------------------------------------------------------------------- clocks


@pytest.mark.parametrize("seed", range(4))
def test_an_autopilots_clock_is_off_and_drifts_as_its_faults_say(seed):
    rng = Random(f"clock {seed}")
    ahead, drift = rng.uniform(-2.0, 2.0), rng.uniform(-100.0, 100.0)
    faults = [InjectedFault("autopilot_clock", amount=ahead), InjectedFault("clock_drift", amount=drift)]
    v = Craft(faults=faults).vehicle
    v.rates["system_time"] = 1.0
    for now in (0.0, 600.0, 4020.0):
        values = [f.values() for f in frames_in(v.due_telemetry(now)) if f.message == SYSTEM_TIME]
        gained = drift * 1e-6 * now
        assert (values[0]["time_unix_usec"] - v.start_time) * 1e-6 - now == pytest.approx(ahead + gained, abs=1e-5)
        assert values[0]["time_boot_ms"] * 1e-3 - now == pytest.approx(gained, abs=1e-3)


# ----------------------------------------------------------------------------------------------------------- arming

REFUSALS = {
    "throttle": (InjectedFault("throttle", end=20.0), "Arm: Throttle (RC3) is not neutral", True),
    "voltage": (InjectedFault("voltage", end=20.0, amount=9.5), "Arm: Battery 1 low voltage failsafe", False),
    "no_gnss": (InjectedFault("no_gnss", end=20.0), "Arm: Fence enabled, need position estimate", False),
}


@pytest.mark.parametrize("kind", REFUSALS)
def test_ardupilot_refuses_to_arm_with_result_4_and_the_reason_as_a_text(kind):
    """The throttle is looked at only when it is to arm; the others clear the pre-arm bit before."""
    fault, reason, is_fit = REFUSALS[kind]
    craft = Craft(faults=[fault])
    craft.request_streams()
    craft.fly(10.0)
    assert bool(craft.values(SYS_STATUS)[-1]["onboard_control_sensors_health"] & PREARM_BIT) == is_fit
    craft.sent.clear()
    craft.hear(craft.say.arm(True))
    assert [frame.message for _, frame in craft.sent] == [ACK, TEXT] and not craft.vehicle.armed
    assert craft.values(ACK)[0]["result"] == 4
    assert (craft.values(TEXT)[0]["text"], craft.values(TEXT)[0]["severity"]) == (reason, 2)
    craft.hear(craft.say.command(401))
    texts = [v["text"] for v in craft.values(TEXT)]
    assert (texts[-1] == f"Pre{reason}") == (not is_fit), "what keeps it from arming is repeated on request"
    craft.fly(10.0 + 2.0 * STEP)
    craft.hear(craft.say.arm(True))
    assert craft.vehicle.armed and craft.values(ACK)[-1]["result"] == 0


def test_no_set_point_lifts_ardupilot_off_the_ground_and_it_disarms_after_10_s():
    """By its documentation PX4 climbs by them."""
    heights = {}
    for kind in AUTOPILOTS:
        craft = Craft(kind)
        craft.vehicle.mode = GUIDED
        craft.hear(craft.say.arm(True))

        def climb(craft=craft):
            craft.hear(craft.say.velocity((4.0, 0.0, 2.0), 0))

        craft.fly(9.5, climb)
        assert craft.vehicle.armed
        heights[kind] = craft.vehicle.state.z
        craft.fly(1.0, climb)
        assert craft.vehicle.armed == (kind == "px4")
    assert heights["ardupilot"] == 0.0 and heights["px4"] > 10.0


@pytest.mark.parametrize("broken_off", [False, True])
def test_ardupilot_leaves_the_ground_3_s_after_take_off_unless_a_set_point_comes_first(broken_off):
    craft = Craft()
    craft.vehicle.mode = GUIDED
    craft.hear(craft.say.arm(True))
    craft.hear(craft.say.command(22, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 10.0))
    craft.fly(2.0, lambda: craft.hear(craft.say.heartbeat()))
    assert craft.vehicle.state.z == 0.0
    assert craft.values(HEARTBEAT)[-1]["system_status"] == 3, "standby until it has left the ground"
    if broken_off:
        craft.hear(craft.say.velocity((0.0, 0.0, 0.0), 0))
    craft.fly(7.0, lambda: craft.hear(craft.say.heartbeat()))
    assert (craft.vehicle.state.z > 9.0) != broken_off and (craft.vehicle.state.z == 0.0) == broken_off
    assert craft.values(HEARTBEAT)[-1]["system_status"] == (3 if broken_off else 4)


@pytest.mark.parametrize("kind", AUTOPILOTS)
def test_who_is_killed_or_reboots_in_the_air_falls(kind):
    for cut in (False, True):
        craft = Craft(kind).put_in_air()
        if cut:
            craft.vehicle.reboot()
        else:
            craft.hear(craft.say.arm(False, force=True))
        craft.fly(1.0)
        assert craft.vehicle.state.z < 19.5
        craft.fly(15.0)
        assert craft.vehicle.state.z == 0.0 and not craft.vehicle.armed


# -------------------------------------------------------------------------------------------------------- fail-safes


def test_a_drone_whose_node_died_stands_4_s_and_then_sinks_as_measured():
    """Death to the first 10 cm: 8.5 to 9.0 s; 8.8 m after 20 s, 3.7 m after 30 s."""
    flown = compare.with_metric_period(scenario(2, 50.0), 0.2)
    made = compare.software_card(flown, stop_for_lost=True, vehicle="ardupilot")
    fleet = compare.fly_in_lockstep(flown, made, 1, faults=(InjectedFault("node", (2,), 5.0),))
    heights = fleet.array()[:, 1, 2]
    sinks = next(k for k, z in enumerate(heights) if z < heights[0] - 0.1) * made.period - 5.0
    assert 8.0 < sinks < 9.5
    for seconds, height in ((20.0, 8.8), (30.0, 3.7)):
        assert heights[round((5.0 + seconds) / made.period)] == pytest.approx(height, abs=1.5)
    assert fleet.vehicles[1].mode == LAND_MODE and not fleet.vehicles[1].armed


def test_without_gnss_ardupilot_drifts_and_lands_by_itself_after_8_s():
    """It sank from 12 s on, was 1.0 m off after 6 s and 8.5 m when it stood; its estimate stood still."""
    craft = Craft(faults=[InjectedFault("no_gnss", begin=10.0)]).put_in_air()
    craft.request_streams()
    off = {}

    def hold():
        # As a node does that holds: back to where its estimate says that it was.
        if craft.steps % 5 == 0:
            own = craft.vehicle.measured
            craft.hear(craft.say.velocity((-0.5 * own.x, -0.5 * own.y, 0.0), 0))
        if craft.steps % 100 == 0:
            craft.hear(craft.say.heartbeat())
        off[craft.steps] = math.hypot(*craft.vehicle.state[:2])

    craft.fly(17.9, hold)
    assert craft.vehicle.mode == GUIDED and craft.values(GPS)[-1]["fix_type"] < 3
    assert off[1600] == pytest.approx(1.0, abs=0.3)
    craft.fly(0.3, hold)
    assert craft.vehicle.mode == LAND_MODE
    craft.fly(3.6, hold)
    assert craft.vehicle.state.z == pytest.approx(20.0, abs=0.1)
    assert craft.first(TEXT, holds=lambda v: v["text"].startswith("EKF Failsafe")) == pytest.approx(18.0, abs=0.2)
    assert craft.values(HEARTBEAT)[-1]["system_status"] == 5, "critical"
    craft.fly(30.0, hold)
    assert not craft.vehicle.armed and off[max(off)] == pytest.approx(8.5, abs=2.5)


@pytest.mark.parametrize(("action", "mode"), [(0, GUIDED), (1, LAND_MODE), (2, "RTL")])
def test_a_low_voltage_moves_ardupilot_only_by_its_parameter(action, mode):
    """The charge that it counts stays: of 9.5 V nothing was seen but that it did not arm."""
    craft = Craft(faults=[InjectedFault("voltage", begin=5.0, amount=9.5)]).put_in_air()
    craft.request_streams()
    craft.vehicle.parameters["BATT_FS_LOW_ACT"] = action
    craft.fly(14.5, craft.hover)
    assert craft.vehicle.mode == GUIDED
    craft.fly(1.5, craft.hover)
    assert craft.vehicle.mode == mode
    status = craft.values(SYS_STATUS)[-1]
    assert status["battery_remaining"] == 100 and status["voltage_battery"] == 9500
    assert not status["onboard_control_sensors_health"] & 1 << 25


def test_charge_is_counted_from_the_capacity_that_the_autopilot_was_given():
    """After 5 min of 3300 mAh a quarter is left. Of a smaller battery it says the same, until the motors stop."""
    craft = Craft(faults=[InjectedFault("capacity", amount=3300.0)]).put_in_air()
    craft.fly(297.0, craft.hover)
    assert craft.vehicle.battery == pytest.approx(25.0, abs=0.5) and craft.vehicle.motor
    small = Craft(faults=[InjectedFault("capacity", amount=1650.0)]).put_in_air()
    assert DEFAULT_PARAMETERS["ardupilot"]["BATT_CAPACITY"] == 3300
    small.fly(190.0, small.hover)
    assert small.vehicle.battery == pytest.approx(52.0, abs=0.5) and small.vehicle.state.z > 19.0
    assert small.vehicle.is_voltage_low, "the voltage knows"
    small.fly(30.0, small.hover)
    assert small.vehicle.state.z < 5.0 and small.vehicle.battery > 49.0


# ------------------------------------------------------------------------------------------------------ fault files


@pytest.mark.parametrize("kind", INJECTED_KINDS)
def test_every_kind_is_read_with_its_amount_and_refused_where_it_is_wrong(kind, tmp_path):
    path = tmp_path / "faults.toml"

    def read(**keys):
        lines = [f"{key} = {value}" for key, value in {"kind": f'"{kind}"', "who": [2], **keys}.items()]
        path.write_text("\n".join(["[[fault]]", *lines]))
        return read_injected_faults(path, (1, 2, 3))

    amount = {}
    if kind in AMOUNT_RANGES:
        low, high = AMOUNT_RANGES[kind]
        amount = {"amount": 0.5 * (low + high)}
        for wrong, words in (({}, "amount is missing"), ({"amount": high + 1.0}, "lies outside")):
            with pytest.raises(ScenarioError, match=words):
                read(**wrong)
    assert read(**amount) == (InjectedFault(kind, (2,), **amount),)
    if kind in WHOLE_FLIGHT_KINDS:
        with pytest.raises(ScenarioError, match="leave out begin and end"):
            read(begin=5.0, **amount)
    else:
        assert read(begin=5.0, end=6.0, **amount) == (InjectedFault(kind, (2,), 5.0, 6.0, **amount),)
