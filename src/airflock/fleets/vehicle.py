"""A vehicle in software: a body of the simulator behind MAVLink, as PX4 or as ArduPilot. Pure: no sockets, no clock.

receive(bytes) takes frames and gives answers; telemetry(now) gives what is due; step(now, dt) moves it. Inside
east-north-up, north-east-down only in frames. It keeps the autopilots' rules that matter to a node: PX4 enters
OFFBOARD only after a second of setpoints and leaves it COM_OF_LOSS_T after the last; ArduPilot takes off by command,
brakes GUID_TIMEOUT after the last setpoint, and acts FS_GCS_TIMEOUT after the last heartbeat of SYSID_MYGCS. Both hold
their place where they hover or land by themselves.
"""

import math
import struct
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any

from airflock.core.agent import State
from airflock.core.contract import Body
from airflock.core.parameters import choices
from airflock.core.vocabulary import asks
from airflock.drones.mavlink import dialect
from airflock.drones.mavlink.autopilots import AUTOPILOTS, px4_mode
from airflock.drones.mavlink.frames import Packer, Stream
from airflock.fleets import telemetry
from airflock.fleets.befalling import Faults
from airflock.fleets.faults import Fault
from airflock.fleets.holding import Holding
from airflock.fleets.modes import HOLD, LAND, MODES, ON_LOSS, ON_SILENCE, OURS, PARAMETERS, PILOT, RTL, TAKEOFF
from airflock.support.coordinates import Site, turned
from airflock.support.errors import RuleError

ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3
POSITION_IGNORED = 0x0007
VELOCITY_IGNORED = 0x0038
LOCAL_NED, BODY_NED = 1, 8
SUFFERED = frozenset({"motor", "gnss", "battery", "pilot"})  # faults that befall a vehicle itself
GROUND = 0.15  # m; lower is landed
FRESH = 0.5  # s between setpoints that still are one stream
GIVEN = (*(letter + axis for letter in "vmcgw" for axis in "xyz"), "dt", "b", "memory")  # what a body may ask for
SINK = 1.0  # m/s, of a landing

Vector = tuple[float, float, float]
STILL: Vector = (0.0, 0.0, 0.0)


class Vehicle:
    """One drone and its autopilot.

    kind : px4 or ardupilot; system: its MAVLink id; site: where the local origin of the flight is
    at   : where it stands, m; body, b: of the simulator; draw: normal random numbers of a motion step
    """

    def __init__(
        self, kind: str, system: int, site: Site, at: Vector, body: Body, b: Any,
        draw: Callable[[int], Vector] = lambda step: (0.0, 0.0, 0.0), started: int = 1_800_000_000_000_000,
    ):  # fmt: skip
        self.kind, self.system, self.site, self.body, self.b, self._draw = kind, system, site, body, b, draw
        self.personality, self.modes = AUTOPILOTS[kind], MODES[kind]
        self.pack, self._stream = Packer(system, 1), Stream()
        self.state, self.home, self.started = State(*at, 0.0, 0.0, 0.0), at, started
        self.origin = site.geodetic(at[0], at[1], 0.0)
        self.mode, self.armed, self.battery = (HOLD if kind == "px4" else PILOT), False, 100.0
        ours = ("MAV_SYS_ID",) if kind == "px4" else ("SYSID_THISMAV", "SYSID_MYGCS")
        self.parameters = PARAMETERS[kind] | dict.fromkeys(ours, system)
        self.target: Vector = (0.0, 0.0, 0.0)
        self.followed = self._obeyed = STILL  # what reached its motors last, and what faults make of the command, m/s
        self._asked: tuple[float, Vector] | None = None  # the command of which they were asked, and when it came, s
        self.target_at, self.first_at, self.climb_to = -1e9, -1e9, 0.0
        self.booted = 0.0  # s
        self.beat_at: float | None = None  # when the last heartbeat of its station came; None: none ever
        self.now, self.due, self.rates = 0.0, dict.fromkeys(telemetry.RATES, 0.0), dict(telemetry.RATES)
        self.error: tuple[float, ...] = (0.0,) * 6
        self.accuracy, self.motor, self.steps = 0.7, True, 0
        self.off = False  # for good: it has dropped out of the flight
        self.lifting, self._holding = False, Holding()
        asked = asks(body.move, "move", body.name)
        for name in asked:
            if name not in GIVEN:
                raise RuleError(f"body {body.name} asks for {name}, which a vehicle of a fleet does not have")
        self._take = itemgetter(*map(GIVEN.index, asked))
        self._old = choices(b).get("integration", body.integration) == "old"
        self.memory = body.Memory() if body.Memory is not None else None
        self.faults: Faults | None = None  # of the scenario, with its own place among the drones
        self.place = 0
        self.frozen: State | None = None  # what a navigation that stands still tells, if it does

    def frame(self, message: Any) -> bytes:
        """Bytes of a message of the dialect."""
        return self.pack(message)

    @property
    def measured(self) -> State:
        """Own state as its navigation tells it."""
        known = self.frozen or self.navigated
        return known if self.faults is None else self.faults.sensed(self.place, self.now, known)

    @property
    def navigated(self) -> State:
        """Own state with the error of its navigation, by which its controller flies.

        Where the navigation stands still, the controller keeps the velocity of its inertial sensors.
        """
        (x, y, z, vx, vy, vz), (ex, ey, ez, eu, ev, ew) = self.state, self.error
        return State(x + ex, y + ey, z + ez, vx + eu, vy + ev, vz + ew)

    def frame_origin(self) -> bytes:
        """GPS_GLOBAL_ORIGIN, as it is sent on request."""
        return self.frame(telemetry.MESSAGES["origin"](self))

    def pack_state(self) -> bytes:
        """LOCAL_POSITION_NED and what else a node needs, now."""
        return b"".join(self.frame(telemetry.MESSAGES[name](self)) for name in ("heartbeat", "gps", "landed", "local"))

    @property
    def flying(self) -> bool:
        """Whether it is off the ground."""
        return self.state.z > GROUND

    def telemetry(self, now: float) -> bytes:
        """Bytes that are due now."""
        self.now = now
        out = b""
        for name, rate in self.rates.items():
            if rate <= 0.0 or now < self.due[name] - 1e-9:
                continue
            self.due[name] = max(self.due[name] + 1.0 / rate, now)
            out += self.frame(telemetry.MESSAGES[name](self))
        return out

    # -------------------------------------------------------------------------------------------------- frames in

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes; gives the answers."""
        self.now = now
        out = b""
        for frame in self._stream(data):
            handler = self._HANDLERS.get(frame.message)
            if handler is not None:
                for message in handler(self, frame.values(), (frame.system, frame.component)):
                    out += self.frame(message)
        return out

    def _heartbeat(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        if sender[0] == self.parameters.get("SYSID_MYGCS"):
            self.beat_at = self.now
        return []

    def _timesync(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        if v["tc1"] != 0:
            return []
        return [dialect.common().MAVLink_timesync_message(round(self.now * 1e9), v["ts1"])]

    def _list(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        return [self._value(name) for name in self.parameters]

    def _read(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        names = list(self.parameters)
        index = v["param_index"]
        name = v["param_id"] if index < 0 else (names[index] if index < len(names) else "")
        return [self._value(name)] if name in self.parameters else []

    def _write(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        name = v["param_id"]
        if name not in self.parameters:
            return []
        value = self.personality.parameter(v["param_value"], v["param_type"])
        self.parameters[name] = int(value) if isinstance(self.parameters[name], int) else value
        return [self._value(name)]

    def _value(self, name: str) -> Any:
        value, names = self.parameters[name], list(self.parameters)
        whole = isinstance(value, int)
        told = struct.unpack("<f", struct.pack("<i", value))[0] if whole and self.kind == "px4" else float(value)
        return dialect.common().MAVLink_param_value_message(
            name.encode(), told, 6 if whole else 9, len(names), names.index(name)
        )

    def _setpoint(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        mask, frame = v["type_mask"], v["coordinate_frame"]
        wanted = (v["vx"], v["vy"], v["vz"])
        if v["target_system"] not in (0, self.system) or mask & POSITION_IGNORED != POSITION_IGNORED:
            return []
        if mask & VELOCITY_IGNORED or frame not in (LOCAL_NED, BODY_NED) or not all(map(math.isfinite, wanted)):
            return []  # the nose points north, so that both frames are one
        if self.kind == "ardupilot" and self.mode != OURS:
            return []
        if self.now - self.target_at > FRESH:
            self.first_at = self.now
        self.target, self.target_at = turned(*wanted), self.now
        return []

    def _set_mode(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        self.switch(v["custom_mode"])
        return []

    def _command(self, v: dict[str, Any], sender: tuple[int, int]) -> list[Any]:
        if v["target_system"] not in (0, self.system):
            return []
        result, more = self.obey(v["command"], v)
        ack = dialect.common().MAVLink_command_ack_message(v["command"], result, 0, 0, *sender)
        return [ack, *more]

    def obey(self, number: int, v: dict[str, Any]) -> tuple[int, list[Any]]:
        """Result of a command, and messages that it asked for."""
        if number == 400:
            return self._arm(v["param1"] > 0.5, v["param2"] > 21195.0), []
        if number == 22:
            return self._take_off(v.get("param7", v.get("z", 10.0))), []
        if number in (20, 21, 192):
            self.mode = {20: RTL, 21: LAND, 192: HOLD}[number]
            return ACCEPTED, []
        if number == 176:
            main, sub = int(v["param2"]), int(v["param3"])
            wanted = px4_mode(main, sub) if self.kind == "px4" else main
            return (ACCEPTED if self.switch(wanted) else DENIED), []
        if number in (512, 520):
            name = "version" if number == 520 else telemetry.NAMES.get(int(v["param1"]), "")
            return (ACCEPTED, [telemetry.MESSAGES[name](self)]) if name else (UNSUPPORTED, [])
        if number == 511:
            name = telemetry.NAMES.get(int(v["param1"]), "")
            if name in self.rates and v["param2"] > 0.0:
                self.rates[name] = min(1e6 / v["param2"], 50.0)
            return (ACCEPTED if name in self.rates else UNSUPPORTED), []
        return UNSUPPORTED, []

    def _arm(self, yes: bool, force: bool) -> int:
        if not yes and self.flying and not force:
            return DENIED
        self.armed = yes
        return ACCEPTED

    def _take_off(self, altitude: float) -> int:
        if not self.armed or (self.kind == "ardupilot" and self.mode != OURS):
            return DENIED
        if self.kind == "px4":
            altitude = float(self.parameters["MIS_TAKEOFF_ALT"])
        self.climb_to = altitude if math.isfinite(altitude) and altitude > 0.0 else 10.0
        self.lifting = True
        if self.kind == "px4":
            self.mode = TAKEOFF
        return ACCEPTED

    def switch(self, custom: int) -> bool:
        """Change the mode by its number; False if it is not known or, in PX4, the setpoints do not stream yet."""
        name = next((name for name, number in self.modes.items() if number == custom), "")
        if name == OURS and self.kind == "px4":
            stream = self.now - self.target_at < FRESH and self.now - self.first_at >= 1.0
            if not stream:
                return False
        if not name:
            return False
        self.mode, self.lifting = name, self.lifting and name == OURS
        return True

    _HANDLERS = {
        0: _heartbeat, 11: _set_mode, 20: _read, 21: _list, 23: _write, 75: _command, 76: _command, 84: _setpoint,
        111: _timesync,
    }  # fmt: skip

    # ----------------------------------------------------------------------------------------------------- motion

    def suffer(self, faults: Sequence[Fault], now: float, dt: float) -> None:
        """Let faults act that befall it in the step from now on: motors, navigation, battery, a pilot's hand."""
        kinds = {f.kind for f in faults if f.holds(self.system, now)}
        self.motor = "motor" not in kinds
        frozen = "gnss" in kinds
        self.frozen = self.frozen if frozen and self.frozen else self.measured if frozen else None
        for f in faults if kinds else ():
            if f.kind == "battery" and f.holds(self.system, now):
                self.battery = f.amount
            if f.kind == "pilot" and f.holds(self.system, now) and now - f.begin < dt:
                self.mode = PILOT

    def wish(self) -> Vector:
        """Velocity that the autopilot makes for now, m/s."""
        late = self.now - self.target_at
        if self.mode == OURS and self.kind == "px4" and late > self.parameters["COM_OF_LOSS_T"]:
            self.mode = ON_LOSS.get(int(self.parameters["COM_OBL_RC_ACT"]), HOLD)
        if self.mode == OURS and self.kind == "ardupilot" and self.beat_at is not None:
            action = int(self.parameters["FS_GCS_ENABLE"])
            if action and self.now - self.beat_at > self.parameters["FS_GCS_TIMEOUT"]:
                self.mode = ON_SILENCE.get(action, RTL)
        if self.mode in (LAND, HOLD, PILOT):
            at, self.lifting = self.navigated if self.frozen is None else None, False
            return self._holding.velocity(at, -SINK if self.mode == LAND else 0.0)
        self._holding.leave()
        if self.mode == RTL:
            dx, dy = self.home[0] - self.state.x, self.home[1] - self.state.y
            far = math.hypot(dx, dy)
            return (0.0, 0.0, -SINK) if far < 0.5 else (dx * min(0.5, 5.0 / far), dy * min(0.5, 5.0 / far), 0.0)
        if self.lifting and self.state.z - self.home[2] < self.climb_to - 0.2:
            return 0.0, 0.0, max(0.3, min(2.0, self.climb_to - self.state.z))
        if self.mode == TAKEOFF:
            self.mode = HOLD
        self.lifting = False
        limit = self.parameters["GUID_TIMEOUT"] if self.kind == "ardupilot" else 1e9
        return self.target if self.mode == OURS and late <= limit else (0.0, 0.0, 0.0)

    def step(self, now: float, dt: float) -> None:
        """Move from now to now + dt."""
        self.now, number = now, self.steps
        self.steps += 1
        if not self.armed:
            self.state = State(*self.state[:3], 0.0, 0.0, 0.0)
            self.memory = type(self.memory)() if self.memory is not None else None
            return
        (x, y, z, vx, vy, vz), c = self.state, self.wish()
        falls = self.off or not self.motor
        command = (vx, vy, vz - 5.0) if falls else c
        if self.faults is not None and not falls:
            asked = self.target_at, c
            if asked != self._asked:  # as in a simulation: once for each command
                self._asked, self._obeyed = asked, self.faults.overruled(self.place, now, c)
            command = self._obeyed
        self.followed = command
        eu, ev, ew = self.error[3:]
        measured = vx + eu, vy + ev, vz + ew
        known = (vx, vy, vz, *measured, *command, *self._draw(number), 0.0, 0.0, 0.0, dt, self.b, self.memory)
        moved = self.body.move(*self._take(known))
        velocity, self.memory = moved[:3], moved[3] if self.memory is not None else None
        if self.faults is not None:
            velocity = self.faults.moved(self.place, now, self.state, command, velocity, dt)
        ux, uy, uz = (vx, vy, vz) if self._old else velocity
        self.state = State(x + ux * dt, y + uy * dt, z + uz * dt, *velocity)
        if self.state.z <= 0.0 and (c[2] <= 0.0 or falls):
            self.state = State(self.state.x, self.state.y, 0.0, *STILL)
            self.armed = self.armed and self.mode not in (LAND, RTL) and not self.off
