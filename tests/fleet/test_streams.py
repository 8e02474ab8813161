"""A node verifies the streams that it requested: it requests them again, waits on the ground, and holds in the air.

`ardupilot/` holds what an autopilot sent to a node, as measured on ArduCopter 4.6.0-dev in software in the loop: one
line for each datagram, with its time (s); the first line gives the Unix time (µs) at the first time.
"""

import lzma
from pathlib import Path

import pytest

from airflock.drones.mavlink.frames import FramePacker, common_dialect, frames_in
from airflock.drones.mavlink.orders import OPERATOR_SYSTEM, OperatorOrder, OrderKind, order_message
from airflock.drones.mavlink.signing import PacketSigner
from airflock.drones.onboard.mission import FLYING_PHASES, MissionPhase
from airflock.drones.onboard.node import Node
from airflock.fleets.lockstep import START_TIME
from airflock.fleets.radio_channel import SOFTWARE_KEY
from airflock.fleets.vehicle import SoftwareVehicle
from fleets import PRIVATE, card, scenario

P = MissionPhase
USUAL_TICKS = {"tick": 0.05, "status_period": 0.1}
SCENARIO = scenario(1)
RECORDED = card(
    SCENARIO, autopilot="ardupilot", members=[1], site=(47.5, 19.04, 120.0), safety=USUAL_TICKS | {"clock_error": 2.0}
)
COMMAND, SETPOINT, PARAMETER = 76, 84, 20
INTERVAL, ARM = 511, 400
FLOAT_TYPE = 9  # MAV_PARAM_TYPE_REAL32


class Record:
    """Notes of a node with their times, and all that it sent to its autopilot: (time, message, values)."""

    def __init__(self):
        self.notes, self.sent, self.phases = [], [], []

    def tick(self, node, now):
        out = node.tick(now)
        self.notes += [(now, note) for note in out.notes]
        self.phases.append((now, node.phase))
        for data in out.autopilot:
            self.sent += [(now, frame.message, frame.values()) for frame in frames_in(data)]
        return out

    def first(self, text, since=0.0):
        """Return when a note that contains a text came first."""
        return min((at for at, note in self.notes if text in note and at >= since), default=None)

    def requested(self, since, until):
        """Return the numbers of streams, and the names of parameters, that were requested within a time."""
        sent = [(message, v) for at, message, v in self.sent if since <= at <= until]
        streams = {v["param1"] for message, v in sent if message == COMMAND and v["command"] == INTERVAL}
        return streams, {v["param_id"] for message, v in sent if message == PARAMETER}

    def commanded(self, number):
        """Return when a command was sent."""
        return [at for at, message, v in self.sent if message == COMMAND and v["command"] == number]


def order(kind, utc):
    message = order_message(OperatorOrder(kind, 0, RECORDED.mission, utc, utc), PRIVATE)
    return PacketSigner(SOFTWARE_KEY, OPERATOR_SYSTEM)(message, utc)


def recorded(case, orders=()):
    """Let a node hear a recorded autopilot, and orders at their times: (s, kind)."""
    path = Path(__file__).with_name("ardupilot") / f"{case}.xz"
    (begun, utc), *rows = map(str.split, lzma.decompress(path.read_bytes()).decode().splitlines())
    now, record, orders = float(begun), Record(), list(orders)
    node = Node(RECORDED, 1, SOFTWARE_KEY, now=now, utc=int(utc))
    # When these flights were recorded no node asked for the limits of the response yet.
    for check in RECORDED.parameter_checks:
        if check.limits:
            values = check.name.encode(), 2.0 * check.low, FLOAT_TYPE, 1, 0
            node.autopilot(FramePacker(1, 1)(common_dialect().MAVLink_param_value_message(*values)), now)
    for at, data in rows:
        while now + 0.05 < float(at):
            now += 0.05
            while orders and orders[0][0] <= now:
                node.radio(order(orders.pop(0)[1], node.utc(now)), now)
            record.tick(node, now)
        node.autopilot(bytes.fromhex(data), float(at))
    return node, record


# ------------------------------------------------------------------------------------------------ a real autopilot


def test_reboot_on_the_ground_is_noticed_and_everything_is_requested_once_more():
    node, record = recorded("reboot")
    ended = 14888.796  # the last position before it; only heartbeats and parameters follow
    assert record.first("CLEARED", ended - 20.0) < ended
    assert record.first("missing: no own position", ended - 1.0) - ended <= 2.0
    assert record.first("the autopilot has rebooted") - ended <= 2.1
    streams, parameters = record.requested(ended, ended + 2.1)
    assert streams == {1, 2, 24, 32, 33, 245}
    assert parameters >= {check.name for check in RECORDED.autopilot.parameter_checks}
    assert record.first("10 needed") is None, "a stream that has ended is not slow"
    assert len([note for _, note in record.notes if "rebooted" in note]) == 1 and node.phase == P.READY
    later, _ = record.requested(ended + 8.0, ended + 10.0)
    assert later == streams, "as long as they do not come"


def test_position_at_4_hz_is_reported_requested_again_and_never_flown():
    start = 14636.0
    node, record = recorded("mavproxy_4hz", [(start, OrderKind.START)])
    position = 14630.1  # the first one of the log
    at = record.first("10 needed: is MAVProxy between? Start it with --streamrate=-1")
    assert at - position <= 2.1
    figures = [note.split()[4] for _, note in record.notes if "10 needed" in note]
    assert all(2.0 <= float(figure) <= 6.0 for figure in figures), figures
    assert record.requested(at, at + 1.1)[0] >= {32, 33}
    assert {phase for _, phase in record.phases} == {P.BOOT, P.READY} and not record.commanded(ARM)
    assert node.phase == P.READY


def test_hold_during_take_off_on_the_ground_ends_the_flight_there():
    """ArduCopter stays on the ground once setpoints end its take-off; it turned its motors for 9 s more."""
    orders = [(15560.7, OrderKind.START), (15564.8, OrderKind.HOLD), (15568.2, OrderKind.RESUME)]
    node, record = recorded("hold_in_takeoff", orders)
    phases = [phase for k, (_, phase) in enumerate(record.phases) if k == 0 or record.phases[k - 1][1] != phase]
    assert phases[-7:] == [P.CLEARED, P.ARMING, P.TAKEOFF, P.HOLD, P.LAND, P.READY, P.CLEARED]
    assert all(v["vz"] >= 0.0 and v["vx"] == v["vy"] == 0.0 for _, message, v in record.sent if message == SETPOINT)
    again = [(15574.5, OrderKind.START)]
    _, record = recorded("hold_in_takeoff", orders + again)
    assert record.phases[-1][1] == P.ARMING, "another start is obeyed"


# ------------------------------------------------------------------------------------- imitated autopilots, faults


class Beside:
    """A node and a vehicle in software that follows its requests; `now` is their time."""

    def __init__(self, kind="ardupilot", **rates):
        self.card = card(SCENARIO, autopilot=kind, members=[1], safety=USUAL_TICKS)
        self.node = Node(self.card, 1, SOFTWARE_KEY, now=0.0, utc=START_TIME)
        self.vehicle = SoftwareVehicle(
            kind, 1, self.card.site, (0.0, 0.0, 0.0), SCENARIO.body.rule, SCENARIO.body.numbers, started=START_TIME
        )
        self.vehicle.rates |= rates
        self.now, self.record, self.lost = 0.0, Record(), 0

    def live(self, seconds, insists=None):
        """Live on; insists: rates that another ground station sets over those of the node."""
        for _ in range(round(seconds / 0.05)):
            self.now = round(self.now + 0.05, 6)
            self.vehicle.rates |= insists or {}
            self.node.autopilot(self.vehicle.due_telemetry(self.now), self.now)
            for data in self.record.tick(self.node, self.now).autopilot:
                self.lost -= 1
                if self.lost < 0:
                    self.node.autopilot(self.vehicle.receive(data, self.now), self.now)
            for k in range(5):
                self.vehicle.step(self.now + 0.01 * k, 0.01)
        return self.node.phase

    def order(self, kind):
        self.node.radio(order(kind, self.node.utc(self.now)), self.now)

    def in_the_air(self):
        """Take off and flock."""
        self.live(5.0)
        self.order(OrderKind.START)
        assert self.live(25.0) == P.FLOCK, self.record.notes
        return self


SILENT = dict.fromkeys(("local", "global", "gps", "landed", "system_time", "sys_status"), 0.0)
SLOW = dict.fromkeys(("local", "global"), 4.0)


@pytest.mark.parametrize("lost", [0, 1, 40])
def test_streams_begin_whatever_is_lost_at_first(lost):
    """Over UDP all is lost that the node sends before it has heard its autopilot."""
    both = Beside(**SILENT)
    both.lost = lost
    assert both.live(10.0) == P.CLEARED, both.record.notes


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_autopilot_that_forgets_its_streams_is_flown_after_a_reboot(kind):
    both = Beside(kind)
    assert both.live(5.0) == P.CLEARED
    both.vehicle.rates |= SILENT
    both.vehicle.booted_at, (name, *_) = both.now, (check.name for check in both.card.autopilot.parameter_checks)
    usual, both.vehicle.parameters[name] = both.vehicle.parameters[name], 99.0
    assert both.live(6.0) == P.READY and both.record.first("rebooted") is not None
    assert both.record.first(f"missing: {name} = 99 is not"), "its parameters may have changed meanwhile"
    both.vehicle.parameters[name] = usual
    both.vehicle.rates |= SILENT
    both.vehicle.booted_at = both.now
    assert both.live(6.0) == P.CLEARED
    both.order(OrderKind.START)
    assert both.live(25.0) == P.FLOCK


@pytest.mark.parametrize("name", ["gps", "landed", "system_time", "sys_status", "global", "local"])
def test_each_stream_that_ends_on_the_ground_is_requested_again(name):
    both = Beside()
    both.live(5.0)
    both.vehicle.rates[name] = 0.0
    both.live(4.0)
    assert both.vehicle.rates[name] > 0.0 and both.live(2.0) == P.CLEARED


@pytest.mark.parametrize("name", ["gps", "landed", "system_time", "sys_status", "global", "local"])
def test_stream_that_never_came_is_missing_and_nothing_arms(name):
    both = Beside(**{name: 0.0})
    both.live(6.0, insists={name: 0.0})
    both.order(OrderKind.START)
    assert both.live(6.0, insists={name: 0.0}) == P.READY and not both.vehicle.armed, both.record.notes


@pytest.mark.parametrize("rate", [0.1, 0.25, 0.4, 0.49, 0.5])
def test_streams_that_pause_on_the_ground_are_taken_for_a_reboot_once(rate):
    """Their time since boot goes on, so no later silence is; a reboot after that is still noticed, by its time."""
    both = Beside()
    both.live(5.0)
    slow = dict.fromkeys(SILENT, rate)
    both.live(60.0, insists=slow)
    noticed = [at for at, note in both.record.notes if "rebooted" in note]
    assert len(noticed) <= 1, noticed
    both.vehicle.reboot()
    both.live(60.0, insists=slow)
    later = [at for at, note in both.record.notes if "rebooted" in note]
    assert len(noticed) < len(later) <= len(noticed) + 2, later


@pytest.mark.parametrize("name", ["gps", "landed", "system_time", "sys_status", "global"])
def test_each_stream_that_ends_for_good_in_the_air_ends_the_flight_at_home(name):
    """Without SYS_STATUS nobody knows how long the battery lasts."""
    both = Beside().in_the_air()
    begun = both.now
    both.live(90.0, insists={name: 0.0})
    assert both.record.first("sent none for 5 s", begun) is not None, both.record.notes
    home = both.record.first("HOLD → RETURN: a stream of the autopilot is silent for too long", begun)
    assert home is not None and 10.0 < home - begun < 20.0, both.record.notes
    assert both.vehicle.state.z == 0.0 and not both.vehicle.armed


@pytest.mark.parametrize("name", ["gps", "landed", "system_time", "sys_status", "global", "local"])
def test_each_stream_that_ends_for_good_is_reported_and_nothing_arms(name):
    both = Beside()
    both.live(5.0)
    both.live(8.0, insists={name: 0.0})
    both.order(OrderKind.START)
    assert both.live(8.0, insists={name: 0.0}) == P.READY and not both.vehicle.armed
    assert both.record.first("the autopilot has sent none for 5 s") is not None


def test_heartbeats_that_end_while_streams_go_on_are_reported_and_nothing_arms():
    both = Beside()
    both.live(5.0)
    assert both.live(4.0, insists={"heartbeat": 0.0}) == P.READY
    assert both.record.first("missing: no heartbeat from the autopilot") is not None
    both.order(OrderKind.START)
    both.live(5.0, insists={"heartbeat": 0.0})
    assert P.ARMING not in {phase for _, phase in both.record.phases}
    assert both.live(3.0, insists={"heartbeat": 1.0}) in (P.CLEARED, P.ARMING), "and cleared once they are back"


def test_start_that_ends_before_the_take_off_names_the_reason():
    both = Beside()
    both.live(5.0)
    both.order(OrderKind.START)
    assert both.live(0.5) == P.ARMING
    both.now += 1.4  # the computer was overloaded
    assert both.live(0.05) == P.READY
    assert both.record.first("ARMING → READY: a reason to hold, before it took off: overloaded") is not None


def test_streams_that_end_in_the_air_are_requested_again_and_the_flight_goes_on():
    both = Beside().in_the_air()
    both.vehicle.rates |= SILENT
    begun = both.now
    both.live(2.0)
    assert both.node.phase == P.HOLD and both.record.first("no valid position", begun) - begun < 1.0
    assert both.live(8.0) == P.FLOCK and both.record.first("rebooted") is None
    assert both.node.autopilot_link.origin is not None, "in the air nothing is forgotten"


def test_slow_position_in_the_air_is_requested_faster():
    both = Beside().in_the_air()
    both.vehicle.rates |= SLOW
    begun = both.now
    both.live(3.0)
    assert both.record.first("own position at 4.0 Hz, 10 needed", begun) - begun <= 2.1
    assert both.node.phase == P.HOLD and both.vehicle.rates["local"] == 20.0
    assert both.live(6.0) == P.FLOCK


@pytest.mark.parametrize("ordered", [OrderKind.RETURN, OrderKind.LAND, None])
def test_slow_position_that_stays_is_held_and_can_be_flown_home(ordered):
    both = Beside().in_the_air()
    assert both.live(20.0, insists=SLOW) == P.HOLD
    if ordered is not None:
        both.order(ordered)
        assert both.live(60.0, insists=SLOW) == P.DONE, both.record.notes[-5:]
        assert both.vehicle.state.z == 0.0
    assert P.FLOCK not in {phase for at, phase in both.record.phases if at > 34.0}


def test_slow_position_before_the_flight_is_refused():
    both = Beside()
    both.live(6.0, insists=SLOW)
    both.order(OrderKind.START)
    both.live(15.0, insists=SLOW)
    assert not {phase for _, phase in both.record.phases} & FLYING_PHASES and not both.vehicle.armed
    assert both.record.first("10 needed: is MAVProxy between?") is not None


def test_frozen_position_is_no_slow_stream():
    """Its messages come as requested, and say where the drone was: no ground station has slowed them down."""
    both = Beside().in_the_air()
    both.vehicle.frozen_state = both.vehicle.measured._replace(vx=2.0)
    both.live(4.0)
    assert both.node.phase == P.HOLD and both.record.first("10 needed") is None


@pytest.mark.parametrize("gap", [0.4, 1.4, 1.9, 3.0])
@pytest.mark.parametrize("rate", [10.0, 20.0])
def test_single_gap_in_a_fast_stream_is_no_slow_stream(rate, gap):
    both = Beside()
    both.vehicle.rates["local"] = rate
    both.live(5.0)
    both.vehicle.due["local"] = both.now + gap
    both.live(gap + 4.0, insists={"local": rate})
    assert both.record.first("needed: is MAVProxy between?") is None, both.record.notes[-4:]


def test_line_whose_figure_alone_changes_is_written_once():
    both = Beside()
    both.vehicle.battery = 20.0
    for battery in (20.0, 19.0, 18.0):
        both.vehicle.battery = battery
        both.live(3.0)
    assert len([note for _, note in both.record.notes if "battery: " in note]) == 1


# --------------------------------------------------------------------------------------------- given back to a node


def test_resume_of_a_drone_that_stands_is_refused_and_never_followed_later():
    both = Beside()
    both.live(5.0)
    both.vehicle.armed, both.vehicle.mode = True, "PILOT"
    both.vehicle.state = both.vehicle.state._replace(z=5.0)
    assert both.live(2.0) == P.MANUAL, "flown by hand, it is seen by the others"
    both.vehicle.state = both.vehicle.state._replace(z=0.0)
    both.vehicle.mode = "OURS"
    both.live(2.0)
    both.order(OrderKind.RESUME)
    assert both.live(5.0) == P.MANUAL and both.record.first("not resumed: the drone stands") is not None
    both.vehicle.state = both.vehicle.state._replace(z=8.0)
    assert both.live(5.0) == P.MANUAL, "an order of before the take-off"
    both.order(OrderKind.RESUME)
    assert both.live(3.0) == P.HOLD
