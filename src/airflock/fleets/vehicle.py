"""A vehicle in software: a body of the simulator behind MAVLink, as PX4 or as ArduPilot. Pure: no sockets, no clock.

receive(bytes) takes frames and returns answers; due_telemetry(now) returns what is due; step(now,
dt) moves it. Inside east-north-up, north-east-down only in frames. It keeps the autopilots' rules
that matter to a node: PX4 streams by itself, enters OFFBOARD only after a second of setpoints and
leaves it COM_OF_LOSS_T after the last; ArduPilot streams what was requested since it booted, takes
off by command, brakes GUID_TIMEOUT after the last setpoint, and acts FS_GCS_TIMEOUT after the last
heartbeat of SYSID_MYGCS. Both hold their place where they hover or land by themselves.

Sources: PX4 user guide, Parameter Reference (not flown); ArduPilot Copter, pages Flight Modes and
GCS Failsafe. "Measured" in a comment means: in flights and logs of ArduCopter 4.6.0-dev in software
in the loop, 27/28 November 2026.
"""

import math
import struct
from collections import deque
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any

from airflock.core import Body, State, argument_names, choices, shorten
from airflock.drones import ARMED_FLAG, AUTOPILOTS, FramePacker, FrameStream, common_dialect, px4_mode
from airflock.fleets.drone_faults import DroneFaults, InjectedFault, whole_flight_amount
from airflock.support import FlightSite, RuleError, swap_enu_ned

GUIDED, LAND_MODE, RETURN_MODE, HOLD_MODE, TAKEOFF_MODE, PILOT_MODE = "OURS", "LAND", "RTL", "HOLD", "TAKEOFF", "PILOT"
MODE_NUMBERS = {
    "px4": {GUIDED: px4_mode(6), LAND_MODE: px4_mode(4, 6), RETURN_MODE: px4_mode(4, 5), HOLD_MODE: px4_mode(4, 3),
            TAKEOFF_MODE: px4_mode(4, 2), PILOT_MODE: px4_mode(3)},
    "ardupilot": {GUIDED: 4, LAND_MODE: 9, RETURN_MODE: 6, HOLD_MODE: 17, PILOT_MODE: 5},
}  # fmt: skip
FIRST_MODES = {"px4": HOLD_MODE, "ardupilot": PILOT_MODE}  # after boot
DEFAULT_PARAMETERS: dict[str, dict[str, float | int]] = {
    "px4": {"COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": 4, "GF_ACTION": 3, "MIS_TAKEOFF_ALT": 10.0, "MAV_SYS_ID": 1},
    "ardupilot": {
        "GUID_TIMEOUT": 1.0, "FENCE_ENABLE": 1, "FENCE_ACTION": 1, "FS_GCS_ENABLE": 5, "FS_GCS_TIMEOUT": 5.0,
        "SYSID_MYGCS": 255, "SYSID_THISMAV": 1, "BATT_CAPACITY": 3300, "BATT_LOW_VOLT": 10.5, "BATT_FS_LOW_ACT": 0,
    },
}  # fmt: skip
LOST_SETPOINT_MODES = {3: RETURN_MODE, 4: LAND_MODE, 5: HOLD_MODE}  # COM_OBL_RC_ACT of PX4
LOST_STATION_MODES = {
    5: LAND_MODE,
    7: HOLD_MODE,
}  # FS_GCS_ENABLE of ArduPilot; all others return, by the way they came or straight
LOW_BATTERY_MODES = {1: LAND_MODE, 2: RETURN_MODE}  # BATT_FS_LOW_ACT of ArduPilot; 0 (default) warns only


STANDING_SPEED = 0.5  # m/s; our choice: slower than this it has come to stand, and holds that place
# PX4's position gain is about twice this (MPC_XY_P 0.95 1/s); without holding, drones that hover
# drift by metres.
POSITION_GAIN = 0.5  # 1/s; our choice, about half of PX4's MPC_XY_P: a metre off is half a metre a second back
MAX_RETURN_SPEED = 1.0  # m/s; our choice


class HoldPosition:
    """A position that is held, from the moment at which the drone has stopped there."""

    def __init__(self) -> None:
        self._held_position: tuple[float, float] | None = None

    def release(self) -> None:
        """Stop holding a position."""
        self._held_position = None

    def velocity(self, at: State | None, up: float) -> tuple[float, float, float]:
        """Return the velocity (m/s) that brakes, and then goes back to the position; `up` is kept.

        at : own state by its own navigation; None where that is frozen: then it only brakes
        """
        if at is not None and self._held_position is None and math.hypot(at.vx, at.vy) < STANDING_SPEED:
            self._held_position = at.x, at.y
        if at is None or self._held_position is None:
            return 0.0, 0.0, up
        vx, vy, _ = shorten(
            POSITION_GAIN * (self._held_position[0] - at.x),
            POSITION_GAIN * (self._held_position[1] - at.y),
            0.0,
            MAX_RETURN_SPEED,
        )
        return vx, vy, up


MESSAGE_RATES = {
    "heartbeat": 2.0, "sys_status": 1.0, "system_time": 1.0, "gps": 5.0, "local": 20.0, "global": 20.0, "landed": 5.0,
    "attitude": 5.0, "home": 0.5, "battery": 0.5,
}  # fmt: skip
# PX4 streams by itself. Measured: ArduPilot sends nothing but its heartbeat, once a second, until
# SET_MESSAGE_INTERVAL, and has forgotten all intervals after a reboot.
DEFAULT_RATES = {
    "px4": MESSAGE_RATES,
    "ardupilot": dict.fromkeys(MESSAGE_RATES, 0.0) | {"heartbeat": 1.0, "prearm": 1.0 / 30.0},
}
# Measured, s after boot: 3-D fix and clock, origin of the EKF and home, use of GNSS by the EKF.
# GLOBAL_POSITION_INT comes from the boot on, and holds zeros until the fix.
FIX_SECONDS, POSITION_SECONDS = 10.0, 41.0
FIRST_SENT = {"origin": 20.0, "home": 20.0, "local": POSITION_SECONDS}
STATION_PERIOD = 15.0  # s after which MAVProxy requests its stream rate once more
MESSAGE_NAMES = {
    0: "heartbeat", 1: "sys_status", 2: "system_time", 24: "gps", 32: "local", 33: "global", 245: "landed",
    30: "attitude", 242: "home", 147: "battery", 49: "origin", 148: "version",
}  # fmt: skip
ALL_SENSORS = 0x0FFFFFFF
# MAV_SYS_STATUS_SENSOR_BATTERY and PREARM_CHECK. Measured: the health of the second is missing while
# a PreArm text holds.
BATTERY_FLAG, PREARM_FLAG = 0x02000000, 0x10000000
CUSTOM_MODE_FLAG, GUIDED_FLAG = 1, 8  # MAV_MODE_FLAG
CAPABILITY_FLAGS = 0x1 | 0x2 | 0x8 | 0x10 | 0x80 | 0x100 | 0x2000


def _heartbeat(v: Any) -> Any:
    base = CUSTOM_MODE_FLAG | (ARMED_FLAG if v.armed else 0) | (GUIDED_FLAG if v.mode == "OURS" else 0)
    # MAV_STATE: critical, active, standby. Measured: ArduPilot is on standby until it has left the ground.
    active = v.armed and (v.flying or v.kind == "px4")
    status = 5 if v.in_fail_safe else 4 if active else 3
    return common_dialect().MAVLink_heartbeat_message(
        2, v.autopilot.number, base, v.mode_numbers.get(v.mode, 0), status, 3
    )


def _sys_status(v: Any) -> Any:
    on = ALL_SENSORS | (PREARM_FLAG if v.kind == "ardupilot" else 0)
    healthy = on & ~(PREARM_FLAG if v.prearm_error() else 0) & ~(BATTERY_FLAG if v.is_voltage_low else 0)
    voltage, charge = round(v.voltage * 1e3), int(v.battery)
    return common_dialect().MAVLink_sys_status_message(on, on, healthy, 200, voltage, 1000, charge, 0, 0, 0, 0, 0, 0)


def _system_time(v: Any) -> Any:
    return common_dialect().MAVLink_system_time_message(v.utc(), _boot_ms(v))


def _gps(v: Any) -> Any:
    at = v.site.to_geodetic(*v.measured[:3])
    return common_dialect().MAVLink_gps_raw_int_message(
        round(v.clock() * 1e6), 3 if v.has_fix else 1, round(at.latitude * 1e7), round(at.longitude * 1e7),
        round(at.altitude * 1e3), 80, 120, 0, 0, 14 if v.has_fix else 0, 0, round(v.accuracy * 1e3),
    )  # fmt: skip


def _local(v: Any) -> Any:
    s = v.measured
    lat, lon, alt = _origin_integers(v)
    ox, oy, oz = v.site.local(lat * 1e-7, lon * 1e-7, alt * 1e-3)
    north, east, down = swap_enu_ned(s.x - ox, s.y - oy, s.z - oz)
    return common_dialect().MAVLink_local_position_ned_message(_boot_ms(v), north, east, down, *swap_enu_ned(*s[3:]))


def _global(v: Any) -> Any:
    if v.running_for < FIX_SECONDS:
        return common_dialect().MAVLink_global_position_int_message(_boot_ms(v), 0, 0, 0, 0, 0, 0, 0, 0)
    s = v.measured
    at = v.site.to_geodetic(*s[:3])
    return common_dialect().MAVLink_global_position_int_message(
        _boot_ms(v), round(at.latitude * 1e7), round(at.longitude * 1e7), round(at.altitude * 1e3),
        round((s.z - v.home[2]) * 1e3), *(round(100.0 * u) for u in swap_enu_ned(*s[3:])), 0,
    )  # fmt: skip


def _landed(v: Any) -> Any:
    return common_dialect().MAVLink_extended_sys_state_message(0, 2 if v.flying else 1)


def _attitude(v: Any) -> Any:
    return common_dialect().MAVLink_attitude_message(_boot_ms(v), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _home(v: Any) -> Any:
    return common_dialect().MAVLink_home_position_message(
        *_origin_integers(v), 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0
    )


def _battery(v: Any) -> Any:
    cells = [3950] * 4 + [65535] * 6
    return common_dialect().MAVLink_battery_status_message(0, 0, 3, 2500, cells, 100, -1, -1, int(v.battery))


def _gps_origin(v: Any) -> Any:
    return common_dialect().MAVLink_gps_global_origin_message(*_origin_integers(v))


def _version(v: Any) -> Any:
    return common_dialect().MAVLink_autopilot_version_message(
        CAPABILITY_FLAGS, 0x010F00FF, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 4711 + v.system, [0] * 18
    )


def _text(text: str) -> Any:
    return common_dialect().MAVLink_statustext_message(2, text.encode())  # MAV_SEVERITY_CRITICAL


def _boot_ms(v: Any) -> int:
    return int(round(v.clock() * 1e3)) & 0xFFFFFFFF


def _origin_integers(v: Any) -> tuple[int, int, int]:
    return round(v.origin.latitude * 1e7), round(v.origin.longitude * 1e7), round(v.origin.altitude * 1e3)


MESSAGE_MAKERS: dict[str, Callable[[Any], Any]] = {
    "heartbeat": _heartbeat, "sys_status": _sys_status, "system_time": _system_time, "gps": _gps, "local": _local,
    "global": _global, "landed": _landed, "attitude": _attitude, "home": _home, "battery": _battery,
    "origin": _gps_origin, "version": _version, "prearm": lambda v: _text(v.prearm_error()),
}  # fmt: skip


RESULT_ACCEPTED, RESULT_DENIED, RESULT_UNSUPPORTED, RESULT_FAILED = 0, 2, 3, 4
POSITION_IGNORED_MASK = 0x0007
VELOCITY_IGNORED_MASK = 0x0038
LOCAL_NED_FRAME, BODY_NED_FRAME = 1, 8
LANDED_HEIGHT = 0.15  # m; lower is landed
MAX_SETPOINT_GAP = 0.5  # s between setpoints that still are one stream
BODY_ARGUMENTS = (
    *(letter + axis for letter in "vmcgw" for axis in "xyz"),
    "dt",
    "b",
    "memory",
)  # arguments that a body may take
LANDING_SPEED = 1.0  # m/s, of a landing by PX4
# Measured: ArduPilot sinks at 1.5 m/s down to 10 m, then at 0.5 m/s; a landing by fail-safe first
# stands for 4 s: one whose node died began to sink after 8.5 to 9 s, and was at 8.8 m after 20 s.
HIGH_LANDING_SPEED, LOW_LANDING_SPEED, LOW_HEIGHT, LANDING_PAUSE = 1.5, 0.5, 10.0, 4.0  # m/s, m/s, m, s
LANDING_GAIN = 1.0  # 1/s; by which it slows down above LOW_HEIGHT: PSC_POSZ_P at its default
# Measured: 2.7 s from TAKEOFF to the first 5 cm, while the motors spool up; disarmed 10 s after
# arming where it was not lifted.
SPOOL_SECONDS, IDLE_SECONDS = 2.5, 10.0
# Measured: without GNSS ArduPilot lands after 8 s; it was 1.0 m off after 6 s, 8.5 m on the ground.
EKF_SECONDS, ESTIMATE_DRIFT = 8.0, 0.2  # s, m/s
# Measured: of 3300 mAh just enough for the way home was left after 5 min; 12.6 V when full. The
# voltage at the end (3.4 V a cell) is our choice.
FLIGHT_CURRENT, LOW_VOLTAGE_SECONDS, EMPTY_SHARE = 30.0, 10.0, 3.4 / 4.2  # A, s (BATT_LOW_TIMER), share of full
FULL_VOLTAGES = {"px4": 15.8, "ardupilot": 12.6}  # V

Velocity = tuple[float, float, float]
NO_VELOCITY: Velocity = (0.0, 0.0, 0.0)


class SoftwareVehicle:
    """One drone and its autopilot.

    kind    : px4 or ardupilot
    system  : its MAVLink id
    site    : local origin of the flight
    at      : position at the start, m
    body, b : body of the simulator and its numbers
    draw    : function that returns the normal random numbers of a motion step
    faults  : injected faults; those of this vehicle count
    """

    def __init__(
        self, kind: str, system: int, site: FlightSite, at: Velocity, body: Body, b: Any,
        draw: Callable[[int], Velocity] = lambda step: (0.0, 0.0, 0.0), started: int = 1_800_000_000_000_000,
        faults: Sequence[InjectedFault] = (),
    ):  # fmt: skip
        self.kind, self.system, self.site, self.body, self.b, self._draw = kind, system, site, body, b, draw
        self.autopilot, self.mode_numbers = AUTOPILOTS[kind], MODE_NUMBERS[kind]
        self._packer, self._stream = FramePacker(system, 1), FrameStream()
        self.state, self.home, self.start_time = State(*at, 0.0, 0.0, 0.0), at, started
        self.origin = site.to_geodetic(at[0], at[1], 0.0)
        self.mode, self.armed, self.battery = FIRST_MODES[kind], False, 100.0
        ours = ("MAV_SYS_ID",) if kind == "px4" else ("SYSID_THISMAV", "SYSID_MYGCS")
        self.parameters = DEFAULT_PARAMETERS[kind] | dict.fromkeys(ours, system)
        # As quick as its body: limits that this has not are out of reach.
        limits = {
            "accel": getattr(b, "a_max", 50.0), "jerk": getattr(b, "jerk", 1e4), "speed": 60.0, "tilt": 45.0,
            "gain": 1.0 / getattr(b, "tau", 0.56),
        }  # fmt: skip
        checks = (check for check in self.autopilot.parameter_checks if check.limits)
        self.parameters |= {check.name: check.scale * limits[check.limits] for check in checks}
        self.target: Velocity = (0.0, 0.0, 0.0)
        # What reached its motors last, and what faults make of the command, m/s.
        self.last_command = self._faulty_command = NO_VELOCITY
        self._waiting: deque[Velocity] = deque()  # commands of the last steps, which the body has yet to follow
        # Arrival (s) and value of the command that the faults have seen last.
        self._fault_key: tuple[float, Velocity] | None = None
        self.setpoint_at, self.stream_since, self.takeoff_height = -1e9, -1e9, 0.0
        self.booted_at, self._rebooted_at = 0.0, -1e9  # s; at the start it has stood there for long
        self.heartbeat_at: float | None = None  # when the last heartbeat of its station came; None: none ever
        self.now, self.rates = 0.0, dict(DEFAULT_RATES[kind])
        self.due = dict.fromkeys(self.rates, 0.0)
        self.error: tuple[float, ...] = (0.0,) * 6
        self.accuracy, self.motor, self.steps = 0.7, True, 0
        self.off = False  # for good: it has dropped out of the flight
        self.is_taking_off, self._holding = False, HoldPosition()
        names = argument_names(body.move, "move", body.name)
        for name in names:
            if name not in BODY_ARGUMENTS:
                raise RuleError(f"body {body.name} asks for {name}, which a vehicle of a fleet does not have")
        self._pick_arguments = itemgetter(*map(BODY_ARGUMENTS.index, names))
        self._uses_old_velocity = choices(b).get("integration", body.integration) == "old"
        self.memory = body.Memory() if body.Memory is not None else None
        self.faults: DroneFaults | None = None  # of the scenario, with its own place among the drones
        self.place = 0
        self.injected = tuple(f for f in faults if f.affects(system))
        self._clock_offset = whole_flight_amount(faults, "autopilot_clock", system)  # s
        self._clock_drift = 1e-6 * whole_flight_amount(faults, "clock_drift", system)
        self._capacity = whole_flight_amount(faults, "capacity", system)  # mAh; 0: never empty
        self.voltage, self._used_charge = FULL_VOLTAGES[kind], 0.0  # V, mAh
        self._no_gnss_since = self._low_since = math.inf  # s
        self.in_fail_safe = False  # until another mode is set
        self._sinks_at = self._lifts_at = self._idle_since = 0.0  # s
        self._texts = b""  # frames that go out with the next telemetry
        self.frozen_state: State | None = None  # output of a frozen navigation; None: it works

    def frame(self, message: Any) -> bytes:
        """Return the bytes of a message of the dialect."""
        return self._packer(message)

    @property
    def measured(self) -> State:
        """Return the own state by its navigation, with faults."""
        # Faults of the scenario act on top of injected ones.
        known = self.frozen_state or self.controller_state
        return known if self.faults is None else self.faults.measured_state(self.place, self.now, known)

    @property
    def controller_state(self) -> State:
        """Return the own state with the error of its navigation, by which its controller flies.

        Where the navigation is frozen, the controller keeps the velocity of its inertial sensors.
        """
        (x, y, z, vx, vy, vz), (ex, ey, ez, eu, ev, ew) = self.state, self.error
        ex += ESTIMATE_DRIFT * self.gnss_lost_for
        return State(x + ex, y + ey, z + ez, vx + eu, vy + ev, vz + ew)

    def origin_frame(self) -> bytes:
        """Return GPS_GLOBAL_ORIGIN, as it is sent on request."""
        return self.frame(MESSAGE_MAKERS["origin"](self))

    def state_frames(self) -> bytes:
        """Return LOCAL_POSITION_NED and all other frames that a node needs, now."""
        return b"".join(self.frame(MESSAGE_MAKERS[name](self)) for name in ("heartbeat", "gps", "landed", "local"))

    @property
    def flying(self) -> bool:
        """Return True if it is off the ground."""
        return self.state.z > LANDED_HEIGHT

    @property
    def running_for(self) -> float:
        """Return the time since its last reboot, s; long if there was none."""
        return self.now - self._rebooted_at

    @property
    def gnss_lost_for(self) -> float:
        """Return the time for which GNSS has been lost, s; 0 while it is there."""
        return max(0.0, self.now - self._no_gnss_since)

    @property
    def has_fix(self) -> bool:
        """Return True if its GNSS receiver has a 3-D fix."""
        return self.running_for >= FIX_SECONDS and self.gnss_lost_for == 0.0

    def clock(self) -> float:
        """Return the time since boot by its own crystal, s."""
        return (self.now - self.booted_at) * (1.0 + self._clock_drift)

    def utc(self) -> int:
        """Return the Unix time by its own clock, µs; 0 before the first fix."""
        # ArduPilot sets its clock once, at the first fix, and then runs on its crystal. Measured: off
        # by 0.1 to 1.1 s for good, of five instances about one by less than 0.2 s.
        if self.running_for < FIX_SECONDS:
            return 0
        return self.start_time + round((self.booted_at + self.clock() + self._clock_offset) * 1e6)

    def prearm_error(self) -> str:
        """Return why ArduPilot would refuse to arm (texts as measured), or an empty text; PX4's were not measured."""
        if self.kind == "px4" or self.armed:
            return ""
        if not self.has_fix or self.running_for < POSITION_SECONDS:
            return "PreArm: Fence enabled, need position estimate"
        return "PreArm: Battery 1 low voltage failsafe" if self.is_voltage_low else ""

    @property
    def is_voltage_low(self) -> bool:
        """Return True if its autopilot takes the voltage for that of an empty battery."""
        return self.voltage < self.parameters.get("BATT_LOW_VOLT", 0.0)

    def due_telemetry(self, now: float) -> bytes:
        """Return the bytes that are due now."""
        self.now = now
        out, self._texts = self._texts, b""
        for name, rate in self.rates.items():
            if rate <= 0.0 or now < self.due[name] - 1e-9:
                continue
            self.due[name] = max(self.due[name] + 1.0 / rate, now)
            if self._exists(name):
                out += self.frame(MESSAGE_MAKERS[name](self))
        return out

    def _exists(self, name: str) -> bool:
        """Return True if there is something to say in a message yet."""
        return bool(self.prearm_error()) if name == "prearm" else self.running_for >= FIRST_SENT.get(name, 0.0)

    def reboot(self) -> None:
        """Reboot now: disarmed, without clock and position for a while; parameters are kept."""
        self._rebooted_at = self.booted_at = self.now
        self.in_fail_safe = False
        self.mode, self.armed, self.is_taking_off, self.heartbeat_at = FIRST_MODES[self.kind], False, False, None
        self.rates = dict(DEFAULT_RATES[self.kind])
        # Measured: the first heartbeat after 1 s, the first PreArm text after 30 s.
        self.due = dict.fromkeys(self.rates, self.now + 1.0) | {"prearm": self.now + 30.0}

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes and return the answers."""
        self.now = now
        out = b""
        if any(f.kind == "uplink" and f.holds(self.system, now) for f in self.injected):
            return out
        for frame in self._stream(data):
            handler = self._HANDLERS.get(frame.message)
            if handler is not None:
                for message in handler(self, frame.values(), (frame.system, frame.component)):
                    out += self.frame(message)
        return out

    def _heartbeat(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        # Copter 4.7 has renamed the parameter.
        if sender[0] == self.parameters.get("SYSID_MYGCS", self.parameters.get("MAV_GCS_SYSID")):
            self.heartbeat_at = self.now
        return []

    def _timesync(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        if v["tc1"] != 0:
            return []
        return [common_dialect().MAVLink_timesync_message(round(self.clock() * 1e9), v["ts1"])]

    def _list(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        return [self._parameter_message(name) for name in self.parameters]

    def _read(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        names = list(self.parameters)
        index = v["param_index"]
        name = v["param_id"] if index < 0 else (names[index] if index < len(names) else "")
        return [self._parameter_message(name)] if name in self.parameters else []

    def _write(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        name = v["param_id"]
        if name not in self.parameters:
            return []
        value = self.autopilot.parameter_value(v["param_value"], v["param_type"])
        self.parameters[name] = int(value) if isinstance(self.parameters[name], int) else value
        return [self._parameter_message(name)]

    def _parameter_message(self, name: str) -> Any:
        value, names = self.parameters[name], list(self.parameters)
        whole = isinstance(value, int)
        encoded = struct.unpack("<f", struct.pack("<i", value))[0] if whole and self.kind == "px4" else float(value)
        return common_dialect().MAVLink_param_value_message(
            name.encode(), encoded, 6 if whole else 9, len(names), names.index(name)
        )

    def _setpoint(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        mask, frame = v["type_mask"], v["coordinate_frame"]
        velocity = (v["vx"], v["vy"], v["vz"])
        if v["target_system"] not in (0, self.system) or mask & POSITION_IGNORED_MASK != POSITION_IGNORED_MASK:
            return []
        if (
            mask & VELOCITY_IGNORED_MASK
            or frame not in (LOCAL_NED_FRAME, BODY_NED_FRAME)
            or not all(map(math.isfinite, velocity))
        ):
            return []  # the nose points north, so that both frames are one
        # ArduPilot ignores setpoints outside GUIDED; PX4 counts them before OFFBOARD, which it
        # enters only while they stream.
        if self.kind == "ardupilot" and self.mode != GUIDED:
            return []
        if self.now - self.setpoint_at > MAX_SETPOINT_GAP:
            self.stream_since = self.now
        # Measured: a set-point ends ArduPilot's take-off, also where it still stands.
        self.is_taking_off = self.is_taking_off and self.kind == "px4"
        self.target, self.setpoint_at = swap_enu_ned(*velocity), self.now
        return []

    def _set_mode(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        self.set_mode(v["custom_mode"])
        return []

    def _command(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        if v["target_system"] not in (0, self.system):
            return []
        result, more = self.run_command(v["command"], v)
        ack = common_dialect().MAVLink_command_ack_message(v["command"], result, 0, 0, *sender)
        return [ack, *more]

    def run_command(self, number: int, v: dict[str, Any]) -> tuple[int, list[Any]]:
        """Run a command; return its result, and messages that it requested."""
        if number == 400:
            return self._arm(v["param1"] > 0.5, v["param2"] > 21195.0)
        if number == 22:
            return self._take_off(v.get("param7", v.get("z", 10.0))), []
        if number in (20, 21, 192):
            self.mode = {20: RETURN_MODE, 21: LAND_MODE, 192: HOLD_MODE}[number]
            return RESULT_ACCEPTED, []
        if number == 176:
            main, sub = int(v["param2"]), int(v["param3"])
            mode = px4_mode(main, sub) if self.kind == "px4" else main
            return (RESULT_ACCEPTED if self.set_mode(mode) else RESULT_DENIED), []
        if number == 401:  # say once more what keeps it from arming
            return RESULT_ACCEPTED, [_text(self.prearm_error())] if self.prearm_error() else []
        if number in (512, 520):
            name = "version" if number == 520 else MESSAGE_NAMES.get(int(v["param1"]), "")
            # Measured: before the EKF has an origin its request is accepted, and nothing follows.
            messages = [MESSAGE_MAKERS[name](self)] if name and self._exists(name) else []
            return (RESULT_ACCEPTED if name else RESULT_UNSUPPORTED), messages
        if number == 511:
            name, interval = MESSAGE_NAMES.get(int(v["param1"]), ""), v["param2"]  # µs; -1 stops, 0 is the default
            if name in self.rates:
                default = DEFAULT_RATES[self.kind][name] if interval == 0.0 else 0.0
                self.rates[name] = min(1e6 / interval, 50.0) if interval > 0.0 else default
            return (RESULT_ACCEPTED if name in self.rates else RESULT_UNSUPPORTED), []
        return RESULT_UNSUPPORTED, []

    def _arm(self, yes: bool, force: bool) -> tuple[int, list[Any]]:
        # Both autopilots refuse to disarm in the air unless forced.
        if not yes and self.flying and not force:
            return (RESULT_DENIED if self.kind == "px4" else RESULT_FAILED), []
        sticks = any(f.kind == "throttle" and f.holds(self.system, self.now) for f in self.injected)
        error = self.prearm_error() or ("PreArm: Throttle (RC3) is not neutral" if sticks else "")
        # Measured: COMMAND_ACK with result 4 and, after it, the reason as a text of severity 2.
        if yes and error and not force:
            return RESULT_FAILED, [_text(error.removeprefix("Pre"))]
        self.armed, self._idle_since = yes, self.now
        return RESULT_ACCEPTED, []

    def _take_off(self, altitude: float) -> int:
        # By its source ArduPilot refuses a second take-off once its motors have spooled up.
        spooled = self.flying or (self.is_taking_off and self.now >= self._lifts_at)
        if not self.armed or (self.kind == "ardupilot" and (self.mode != GUIDED or spooled)):
            return RESULT_DENIED if self.kind == "px4" else RESULT_FAILED
        if self.kind == "ardupilot" and not self.is_taking_off:
            self._lifts_at = self.now + SPOOL_SECONDS
        # PX4 climbs to its own parameter; only ArduPilot reads the altitude of the command.
        if self.kind == "px4":
            altitude = float(self.parameters["MIS_TAKEOFF_ALT"])
        self.takeoff_height = altitude if math.isfinite(altitude) and altitude > 0.0 else 10.0
        self.is_taking_off = True
        if self.kind == "px4":
            self.mode = TAKEOFF_MODE
        return RESULT_ACCEPTED

    def set_mode(self, custom: int) -> bool:
        """Change the mode by its number; False if unknown, or if setpoints do not stream yet (PX4)."""
        name = next((name for name, number in self.mode_numbers.items() if number == custom), "")
        if name == GUIDED and self.kind == "px4":
            stream = self.now - self.setpoint_at < MAX_SETPOINT_GAP and self.now - self.stream_since >= 1.0
            if not stream:
                return False
        if not name:
            return False
        self.mode, self.in_fail_safe = name, self.in_fail_safe and name == self.mode
        self.is_taking_off = self.is_taking_off and name == GUIDED
        return True

    _HANDLERS = {
        0: _heartbeat, 11: _set_mode, 20: _read, 21: _list, 23: _write, 75: _command, 76: _command, 84: _setpoint,
        111: _timesync,
    }  # fmt: skip

    def apply_faults(self, now: float, dt: float) -> None:
        """Apply the injected faults of this vehicle to the step from now on."""
        if not self.injected:
            return
        self.now, holding = now, [f for f in self.injected if f.holds(self.system, now)]
        kinds = {f.kind for f in holding}
        frozen = "gnss" in kinds
        self.frozen_state = self.frozen_state if frozen and self.frozen_state else self.measured if frozen else None
        self._no_gnss_since = math.inf
        if self._capacity and self.flying and self.armed:
            self._used_charge += FLIGHT_CURRENT * dt / 3.6
            # Measured: ArduPilot counts charge from BATT_CAPACITY down, whatever the battery holds.
            counted = self.parameters.get("BATT_CAPACITY", self._capacity)
            self.battery = max(0.0, 100.0 * (1.0 - self._used_charge / counted))
        left = 1.0 - self._used_charge / self._capacity if self._capacity else 1.0
        self.voltage = FULL_VOLTAGES[self.kind] * (EMPTY_SHARE + (1.0 - EMPTY_SHARE) * left)
        self.motor = "motor" not in kinds and left > 0.0
        for f in holding:
            begins = now - f.begin < dt
            if f.kind == "battery":
                self.battery = f.amount
            elif f.kind == "voltage":
                self.voltage = f.amount
            elif f.kind == "no_gnss":
                self._no_gnss_since = min(f.begin, self._no_gnss_since)
            elif f.kind == "pilot" and begins:
                self.mode = PILOT_MODE
            elif f.kind == "reboot" and begins:
                self.reboot()
            elif f.kind == "streams" and (now - f.begin) % STATION_PERIOD < dt:
                # Measured: of several stations on one port the last request holds: MAVProxy's 4 Hz for
                # all streams replace the 20 Hz of the node.
                self.rates |= dict.fromkeys(MESSAGE_RATES.keys() - {"heartbeat"}, f.amount)

    def _fail_safe(self, mode: str, text: str) -> None:
        """Enter a mode by itself, and say so; ArduPilot stands for a while before it sinks."""
        # Modes and times were measured; the texts are those of its source.
        self.mode, self.in_fail_safe, self._sinks_at = mode, True, self.now + LANDING_PAUSE
        self._texts += self.frame(_text(text))

    def _landing_speed(self) -> float:
        """Return the speed at which it sinks in a landing, m/s."""
        if self.kind == "px4":
            return LANDING_SPEED
        if self.now < self._sinks_at:
            return 0.0
        above = LANDING_GAIN * (self.state.z - self.home[2] - LOW_HEIGHT)
        return min(max(above, LOW_LANDING_SPEED), HIGH_LANDING_SPEED)

    def _check_fail_safes(self) -> None:
        """Enter the mode of a fail-safe that is due."""
        # The fail-safes that a node relies on: they must act here as on the real autopilot.
        if self.kind == "px4":
            if self.mode == GUIDED and self.now - self.setpoint_at > self.parameters["COM_OF_LOSS_T"]:
                self.mode = LOST_SETPOINT_MODES.get(int(self.parameters["COM_OBL_RC_ACT"]), HOLD_MODE)
            return
        if self.mode == GUIDED and self.heartbeat_at is not None:
            action = int(self.parameters["FS_GCS_ENABLE"])
            if action and self.now - self.heartbeat_at > self.parameters["FS_GCS_TIMEOUT"]:
                self._fail_safe(LOST_STATION_MODES.get(action, RETURN_MODE), "GCS Failsafe")
        if self.mode != LAND_MODE and self.gnss_lost_for > EKF_SECONDS:
            self._fail_safe(LAND_MODE, "EKF Failsafe: changed to Land Mode")
        # Measured: at the default of BATT_FS_LOW_ACT a low voltage keeps it from arming, and no more.
        self._low_since = min(self._low_since, self.now) if self.is_voltage_low else math.inf
        mode = LOW_BATTERY_MODES.get(int(self.parameters["BATT_FS_LOW_ACT"]), self.mode)
        if self.mode not in (mode, LAND_MODE) and self.now - self._low_since > LOW_VOLTAGE_SECONDS:
            self._fail_safe(mode, f"Battery 1 is low {self.voltage:.2f}V used {self._used_charge:.0f} mAh")

    @property
    def _missing_height(self) -> float:
        """Return how far it is below the height of its take-off, m."""
        return self.takeoff_height - (self.state.z - self.home[2])

    def autopilot_velocity(self) -> Velocity:
        """Return the velocity that the autopilot commands now, m/s."""
        self._check_fail_safes()
        late, at = self.now - self.setpoint_at, self.controller_state if self.frozen_state is None else None
        if self.mode in (LAND_MODE, HOLD_MODE, PILOT_MODE):
            self.is_taking_off = False
            return self._holding.velocity(at, -self._landing_speed() if self.mode == LAND_MODE else 0.0)
        # Without it the noise of its motion took one 4 m aside while it climbed, next to its neighbour.
        if self.is_taking_off and self.now >= self._lifts_at and self._missing_height > 0.2:
            return self._holding.velocity(at, max(0.3, min(2.0, self._missing_height)))
        self._holding.release()
        if self.mode == RETURN_MODE:
            dx, dy = self.home[0] - self.state.x, self.home[1] - self.state.y
            far = math.hypot(dx, dy)
            speed = min(0.5, 5.0 / max(far, 1e-9))  # 1/s
            return (0.0, 0.0, -self._landing_speed()) if far < 0.5 else (dx * speed, dy * speed, 0.0)
        if self.is_taking_off and self.now < self._lifts_at:
            return NO_VELOCITY
        if self.mode == TAKEOFF_MODE:
            self.mode = HOLD_MODE
        self.is_taking_off = False
        # Measured: no set-point lifts ArduPilot off the ground, and it disarms there by itself; by
        # its documentation PX4 climbs by set-points.
        if self.kind == "ardupilot" and not self.flying:
            return NO_VELOCITY
        limit = self.parameters["GUID_TIMEOUT"] if self.kind == "ardupilot" else 1e9
        return self.target if self.mode == GUIDED and late <= limit else (0.0, 0.0, 0.0)

    def _due_command(self, command: Velocity, velocity: Velocity, lag: int) -> Velocity:
        """Return the command of `lag` steps ago, as a simulated body follows it; before it, to fly on as it flies."""
        self._waiting.extend([velocity] * (lag - len(self._waiting)))
        self._waiting.append(command)
        return self._waiting.popleft()

    def step(self, now: float, dt: float) -> None:
        """Move from now to now + dt."""
        self.now, number = now, self.steps
        self.steps += 1
        if not self.armed and self.state.z <= 0.0:
            self.state = State(*self.state[:3], 0.0, 0.0, 0.0)
            self.memory = type(self.memory)() if self.memory is not None else None
            self._waiting.clear()
            return
        (x, y, z, vx, vy, vz), c = self.state, self.autopilot_velocity() if self.armed else NO_VELOCITY
        # Without motors the body is given a velocity ever further down: it falls as fast as its
        # dynamics let it.
        falls = self.off or not self.motor or not self.armed
        command = (vx, vy, vz - 5.0) if falls else c
        if self.faults is not None and not falls:
            command_key = self.setpoint_at, c
            if command_key != self._fault_key:  # as in a simulation: once for each command
                self._fault_key, self._faulty_command = command_key, self.faults.motor_command(self.place, now, c)
            command = self._faulty_command
        self.last_command = command
        if self.b.delay and not falls:
            command = self._due_command(command, (vx, vy, vz), round(self.b.delay / dt))
        eu, ev, ew = self.error[3:]
        measured = vx + eu, vy + ev, vz + ew
        values = (vx, vy, vz, *measured, *command, *self._draw(number), 0.0, 0.0, 0.0, dt, self.b, self.memory)
        moved = self.body.move(*self._pick_arguments(values))
        velocity, self.memory = moved[:3], moved[3] if self.memory is not None else None
        if self.faults is not None:
            velocity = self.faults.velocity_after_step(self.place, now, self.state, command, velocity, dt)
        # As the simulated body does, or a fleet would leave the simulated flight at once.
        ux, uy, uz = (vx, vy, vz) if self._uses_old_velocity else velocity
        self.state = State(x + ux * dt, y + uy * dt, z + uz * dt, *velocity)
        # The ground stops it, but must not keep it from taking off.
        if self.state.z <= 0.0 and (c[2] <= 0.0 or falls):
            self.state = State(self.state.x, self.state.y, 0.0, *NO_VELOCITY)
            self.armed = self.armed and self.mode not in (LAND_MODE, RETURN_MODE) and not self.off
        if self.flying:
            self._idle_since = now
        elif self.kind == "ardupilot" and now - self._idle_since > IDLE_SECONDS:
            self.armed = False
