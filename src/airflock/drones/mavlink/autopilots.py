"""Autopilots: modes of PX4 and ArduPilot, the commands that fly them, and the parameters that make a flight safe.

Sources: PX4 user guide, pages Offboard Mode and Parameter Reference, and its module mc_pos_control,
which hands the velocities of Offboard Mode to its controller as they are: MPC_ACC_HOR and
MPC_JERK_AUTO shape the modes that plan a path, not this one. What limits it is the tilt, the gain
of the velocity and MPC_XY_VEL_MAX (defaults of v1.13 to main: 45 deg, 1.8 1/s, 12 m/s). ArduPilot
Copter, pages Guided Mode, Copter Commands in Guided Mode and Complete Parameter List. Numbers of
commands and messages: MAVLink common.xml.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from airflock.drones.mavlink.frames import FramePacker, common_dialect
from airflock.support import swap_enu_ned

ARM_COMMAND = 400
SET_MODE_COMMAND = 176
REQUEST_MESSAGE_COMMAND = 512
MESSAGE_INTERVAL_COMMAND = 511
TAKE_OFF_COMMAND = 22
COMMAND_TEXTS = {ARM_COMMAND: "to arm or disarm", SET_MODE_COMMAND: "the mode", TAKE_OFF_COMMAND: "to take off"}
CUSTOM_MODE_ENABLED = 1.0  # MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, first parameter of DO_SET_MODE
FORCE_DISARM_CODE = 21196.0  # second parameter of ARM: also in the air
ARMED_FLAG = 128  # MAV_MODE_FLAG_SAFETY_ARMED in HEARTBEAT.base_mode
VELOCITY_ONLY_MASK = 0x0DC7  # type mask of a setpoint: velocity counts; position, acceleration, yaw and its rate do not
LOCAL_NED_FRAME = 1  # MAV_FRAME
INT32_TYPE = 6  # MAV_PARAM_TYPE
NODE_COMPONENT = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
STREAM_RATES = {33: 20.0, 32: 20.0, 24: 5.0, 245: 2.0, 2: 1.0, 1: 2.0}  # message → rate that a node requests, 1/s


SLOWER = 0.2  # share by which a limit may be lower than the card says; our choice: one drone differs so from another


class ParameterCheck(NamedTuple):
    """A parameter of the autopilot with its range of safe values, checked before the drone may arm.

    why          : the reason, in a few words
    own          : the safe value is the autopilot's own system id
    timeout      : time-out (s) during which the drone flies on; `reason` adds the distance of that
                   flight; 0: none
    unsafe_value : a value inside the range that is not safe
    later_names  : its names in later versions of the autopilot
    later_unit   : unit of its value under a later name, in units of `name`
    limits       : what of the drone's response it limits: accel (m/s²), jerk (m/s³), speed (m/s),
                   tilt (degrees) or gain (1/s, of the velocity); the card says what is needed, and
                   `scale` is its unit
    """

    name: str
    low: float
    high: float
    why: str
    own: bool = False
    timeout: float = 0.0
    unsafe_value: float | None = None
    later_names: tuple[str, ...] = ()
    later_unit: float = 1.0
    limits: str = ""
    scale: float = 1.0

    @property
    def names(self) -> tuple[str, ...]:
        """Return all names under which an autopilot may report it."""
        return (self.name, *self.later_names)

    def value(self, parameters: Mapping[str, float]) -> float | None:
        """Return its value among those that an autopilot has reported; None if it has not."""
        return next((parameters[name] for name in self.names if name in parameters), None)

    def as_reported(self, parameters: Mapping[str, float]) -> "ParameterCheck":
        """Return the check under the name, and in the unit, of an autopilot that has reported these parameters."""
        later = next((name for name in self.later_names if name in parameters), None)
        if later is None or self.name in parameters:
            return self
        return self._replace(name=later, low=self.low / self.later_unit, high=self.high / self.later_unit)

    def reaching(self, needed: float) -> "ParameterCheck":
        """Return the check for a card that relies on a limit of at least `needed`, in SI units."""
        return self._replace(low=(1.0 - SLOWER) * self.scale * needed)

    def range(self, member: int) -> tuple[float, float]:
        """Return the least and the largest value that is safe for a member of a flock."""
        return (float(member), float(member)) if self.own else (self.low, self.high)

    def safe_values(self, member: int | None = None) -> str:
        """Describe the safe values in words: those of one member, or of all."""
        if self.own and member is None:
            return "to the own system id"
        low, high = self.range(member or 0)
        if self.limits:
            return f"at least {low:g}"
        return f"within [{low:g}, {high:g}]" + ("" if self.unsafe_value is None else f", not {self.unsafe_value:g}")

    def instruction(self) -> str:
        """Return names and safe values in words, for a person who sets them: each name in its own unit."""
        if self.later_unit == 1.0:
            return f"{' or '.join(self.names)} {self.safe_values()}"
        later = [f"{name} {self.as_reported({name: 0.0}).safe_values()}" for name in self.later_names]
        return f"{self.name} {self.safe_values()} (Copter 4.7: {', '.join(later)})"

    def safe(self, value: float, member: int) -> bool:
        """Return True if a value is safe for a member of a flock."""
        low, high = self.range(member)
        return low <= value <= high and value != self.unsafe_value

    def reason(self, speed: float, response: float) -> str:
        """Explain the check to a drone with a largest speed (m/s) and a relaxation time (s) of its velocity."""
        if not self.timeout:
            return self.why
        way = speed * (self.timeout + response)
        return f"{self.why}: {way:.3g} m at the limit of {speed:g} m/s with {self.timeout:g} s"


@dataclass(frozen=True)
class Autopilot:
    """Properties of one kind of autopilot.

    number                 : MAV_AUTOPILOT in its HEARTBEAT
    ours                   : custom mode in which it obeys velocity setpoints
    land, hold             : custom modes that it enters by itself
    takes_off_by_setpoints : False: it takes off by the command TAKE_OFF once it is armed
    integers_as_bytes      : PARAM_VALUE holds the bytes of an integer (PX4) instead of a converted
                             float
    parameter_checks       : parameters that are checked before the drone arms
    battery_parameters     : parameters on which its reports of the battery rest, with the meaning
                             of their values; no value is wrong by itself, so a person reads them
    """

    name: str
    number: int
    ours: int
    land: int
    hold: int
    takes_off_by_setpoints: bool
    integers_as_bytes: bool
    parameter_checks: tuple[ParameterCheck, ...]
    battery_parameters: Mapping[str, str]

    def mode_parameters(self, mode: int) -> tuple[float, ...]:
        """Return the parameters of DO_SET_MODE for a custom mode."""
        if self.name == "px4":
            return CUSTOM_MODE_ENABLED, float(mode >> 16 & 0xFF), float(mode >> 24 & 0xFF)
        return CUSTOM_MODE_ENABLED, float(mode)

    def parameter_value(self, value: float, type_: int) -> float:
        """Return the value of a PARAM_VALUE, also where it holds the bytes of an integer."""
        # PX4 puts the four bytes of an int32 into the float field, so 4 arrives as 5.6e-45;
        # ArduPilot converts it.
        if self.integers_as_bytes and type_ == INT32_TYPE:
            return float(struct.unpack("<i", struct.pack("<f", value))[0])
        return value


def px4_mode(main: int, sub: int = 0) -> int:
    """Return the custom mode of PX4 for a main mode and a sub mode."""
    return main << 16 | sub << 24


RELIED_ON = "the card relies on it; raise it, or prepare a card of body.kind = 'autopilot'"


def _limit(name: str, limits: str, unit: str, *later_names: str, scale: float = 1.0) -> ParameterCheck:
    """Return the check of a limit that a card relies on; its later names are in SI units."""
    why = f"{unit}; {RELIED_ON}"
    return ParameterCheck(
        name, 0.0, math.inf, why, limits=limits, scale=scale, later_names=later_names, later_unit=scale
    )


# The ranges are ours where the manuals allow more: a drone that hovers after a lost link is hit by
# one that flies on, so both autopilots must land.
AUTOPILOTS = {
    "px4": Autopilot(
        "px4",
        number=12,
        ours=px4_mode(6),
        land=px4_mode(4, 6),
        hold=px4_mode(4, 3),
        takes_off_by_setpoints=True,
        integers_as_bytes=True,
        parameter_checks=(
            ParameterCheck("COM_OF_LOSS_T", 0.0, 1.0, "s after the last setpoint until it acts", timeout=1.0),
            ParameterCheck(
                "COM_OBL_RC_ACT", 4.0, 4.0, "on lost setpoints: 4 land; one that hovers is hit by one that flies on"
            ),
            ParameterCheck(
                "GF_ACTION",
                2.0,
                5.0,
                "its own fence acts: 2 hold, 3 return, 5 land; 4 cuts the motors",
                unsafe_value=4.0,
            ),
            _limit("MPC_TILTMAX_AIR", "tilt", "deg"),
            _limit("MPC_XY_VEL_P_ACC", "gain", "1/s"),
            _limit("MPC_XY_VEL_MAX", "speed", "m/s"),
        ),
        battery_parameters={
            "BAT1_CAPACITY": "capacity in mAh, on which its per cent rest; -1: on the voltage alone",
            "COM_LOW_BAT_ACT": "what it does by itself at a low battery; 0: it only warns",
        },
    ),
    "ardupilot": Autopilot(
        "ardupilot",
        number=3,
        ours=4,
        land=9,
        hold=17,
        takes_off_by_setpoints=False,
        integers_as_bytes=False,
        parameter_checks=(
            ParameterCheck("GUID_TIMEOUT", 0.1, 1.0, "s after the last setpoint until it brakes", timeout=3.0),
            ParameterCheck("FENCE_ENABLE", 1.0, 1.0, "its own fence is on"),
            ParameterCheck("FENCE_ACTION", 1.0, 5.0, "and acts; 0 reports only"),
            ParameterCheck(
                "FS_GCS_ENABLE", 5.0, 5.0, "when heartbeats end: 5 land; a drone that hovers is hit in the end"
            ),
            ParameterCheck("FS_GCS_TIMEOUT", 2.0, 5.0, "s after the last heartbeat until it lands"),
            ParameterCheck(
                "SYSID_MYGCS",
                1.0,
                250.0,
                "whose heartbeats count: those of the node, of the same system",
                own=True,
                later_names=("MAV_GCS_SYSID",),  # since Copter 4.7, as all later names here
            ),
            _limit("WPNAV_ACCEL", "accel", "in cm/s^2 (WP_ACC: m/s^2)", "WP_ACC", scale=100.0),
            # Copter 4.7.0 and 4.7.1 name it differently.
            _limit("PSC_JERK_XY", "jerk", "m/s^3", "PSC_JERK_NE", "PSC_NE_JERK"),
            _limit("WPNAV_SPEED", "speed", "in cm/s (WP_SPD: m/s)", "WP_SPD", scale=100.0),
        ),
        battery_parameters={
            "BATT_CAPACITY": "capacity in mAh, on which its per cent rest: is it that of this battery?",
            "BATT_LOW_VOLT": "voltage below which it reports a low battery, and the node returns; 0: never",
            "BATT_FS_LOW_ACT": "what it does by itself at a low battery; 0: nothing, the node alone returns",
        },
    ),
}


class AutopilotCommands:
    """Packs the messages of a node to its autopilot.

    system : system id of the autopilot; the node is another component of the same system
    """

    def __init__(self, autopilot: Autopilot, system: int, component: int = NODE_COMPONENT):
        self.autopilot, self.system, self._pack = autopilot, system, FramePacker(system, component)

    def heartbeat(self) -> bytes:
        """Pack the heartbeat of an onboard computer (MAV_TYPE 18)."""
        return self._pack(common_dialect().MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))

    def velocity(self, velocity: tuple[float, float, float], boot_ms: int) -> bytes:
        """Pack a setpoint: velocity east, north, up, m/s."""
        vx, vy, vz = swap_enu_ned(*velocity)
        kind: Any = common_dialect().MAVLink_set_position_target_local_ned_message
        head = boot_ms & 0xFFFFFFFF, self.system, 1, LOCAL_NED_FRAME, VELOCITY_ONLY_MASK
        return self._pack(kind(*head, *3 * (0.0,), vx, vy, vz, *5 * (0.0,)))

    def command(self, number: int, *parameters: float) -> bytes:
        """Pack a command with up to seven parameters."""
        # COMMAND_LONG always has seven parameters; those that a command does not use are zero.
        seven = (*parameters, *(0.0,) * (7 - len(parameters)))
        return self._pack(common_dialect().MAVLink_command_long_message(self.system, 1, number, 0, *seven))

    def set_mode(self, mode: int) -> bytes:
        """Pack the command that sets a custom mode."""
        return self.command(SET_MODE_COMMAND, *self.autopilot.mode_parameters(mode))

    def arm(self, yes: bool, force: bool = False) -> bytes:
        """Pack the command that arms or disarms; force cuts the motors in the air."""
        return self.command(ARM_COMMAND, float(yes), FORCE_DISARM_CODE if force else 0.0)

    def request_parameter(self, name: str) -> bytes:
        """Request the value of one parameter."""
        kind: Any = common_dialect().MAVLink_param_request_read_message
        return self._pack(kind(self.system, 1, name.encode("ascii"), -1))

    def request_message(self, number: int) -> bytes:
        """Request one message once."""
        return self.command(REQUEST_MESSAGE_COMMAND, float(number))

    def request_streams(self, numbers: Iterable[int]) -> list[bytes]:
        """Request streams of these messages, at the rates that a node needs."""
        return [self.command(MESSAGE_INTERVAL_COMMAND, float(number), 1e6 / STREAM_RATES[number]) for number in numbers]
