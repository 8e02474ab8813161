"""The wire to the autopilot: what it says becomes the own state and health; implausible frames change nothing."""

from math import isfinite
from typing import Any

from airflock.core import State
from airflock.drones.mavlink.autopilots import ARMED_FLAG, Autopilot
from airflock.drones.mavlink.frames import FrameStream, MavlinkFrame
from airflock.support import FlightSite, swap_enu_ned

AUTOPILOT_COMPONENT = 1  # component id
MAX_DISTANCE = 1e5  # m from the site; and m/s: nothing that flies here is there
INVALID_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: ground stations and companions
CLOCK_SAMPLES = 10  # samples of the autopilot's clock that are kept
REBOOT_MS = 2000  # ms; messages that overtake each other differ by less
MOVING_SPEED = 0.3  # m/s; who flies faster than this cannot stay at the same place


class AutopilotLink:
    """What is known from the autopilot's frames.

    member  : its system id; site: origin of local coordinates
    state   : own position and velocity, local; state_at : when they were heard, s; -1e9: never
    far     : distance (m) from the site of a position so far away that it was refused last; 0: none was
    refused : frames with implausible content; strangers: system ids of other autopilots on this wire
    """

    def __init__(self, autopilot: Autopilot, member: int, site: FlightSite):
        self._autopilot, self._member, self._site, self._stream = autopilot, member, site, FrameStream()
        self.state: State | None = None
        self.state_at = self.heartbeat_at = self.global_at = -1e9
        self.global_state: State | None = None
        self.origin: tuple[float, float, float] | None = None
        self.kind: int | None = None
        self.mode: int | None = None
        self.armed: bool | None = None
        self.is_landed: bool | None = None
        self.fix_type, self.horizontal_accuracy = 0, 1e9
        self.battery: float | None = None
        self.jumped_at = -1e9
        self.parameters: dict[str, float] = {}
        self.clock_offsets: list[float] = []
        self.other_systems: set[int] = set()
        self.refused = 0
        self.far = 0.0
        self._max_jump = 5.0
        self._boot_ms = 0

    def __call__(self, data: bytes, now: float, utc: int, max_jump: float) -> None:
        """Take bytes from the wire at now (s) and utc (µs of Unix time); jump: largest plausible step (m)."""
        self._max_jump = max_jump
        for frame in self._stream(data):
            if frame.system != self._member:
                if frame.message == 0 and frame.values()["autopilot"] != INVALID_AUTOPILOT:
                    self.other_systems.add(frame.system)
            elif frame.component == AUTOPILOT_COMPONENT:
                self._take(frame, now, utc)

    def _take(self, frame: MavlinkFrame, now: float, utc: int) -> None:
        handler = self._HANDLERS.get(frame.message)
        if handler is not None and not handler(self, frame.values(), now, utc):
            self.refused += 1

    def _boots(self, since_boot: int) -> None:
        """Forget what an autopilot told before it was started anew on the ground: it is to be asked once more.

        since_boot : ms, of a message; one that went back by more than REBOOT tells of a new start
        """
        if since_boot >= self._boot_ms - REBOOT_MS:
            self._boot_ms = max(since_boot, self._boot_ms)
        elif not self.armed:
            self._boot_ms, self.state, self.state_at = since_boot, None, -1e9
            self.global_state, self.global_at, self.origin, self.is_landed = None, -1e9, None, None
            self.fix_type, self.horizontal_accuracy, self.battery = 0, 1e9, None
            self.parameters, self.clock_offsets = {}, []

    def _heartbeat(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self.kind, self.mode, self.armed = v["autopilot"], v["custom_mode"], bool(v["base_mode"] & ARMED_FLAG)
        self.heartbeat_at = now
        return True

    def _sys_status(self, v: dict[str, Any], now: float, utc: int) -> bool:
        if v["battery_remaining"] > 100:
            return False
        self.battery = float(v["battery_remaining"]) if v["battery_remaining"] >= 0 else None
        return True

    def _system_time(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self._boots(v["time_boot_ms"])
        if v["time_unix_usec"] < 1_500_000_000_000_000:
            return False  # no satellite has told it the time yet
        self.clock_offsets = [*self.clock_offsets[1 - CLOCK_SAMPLES :], (v["time_unix_usec"] - utc) * 1e-6]
        return True

    def _gps(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self.fix_type, self.horizontal_accuracy = (
            v["fix_type"],
            v["h_acc"] * 1e-3 if v["h_acc"] > 0 else v["eph"] * 0.01,
        )
        return True

    def _local(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self._boots(v["time_boot_ms"])
        numbers = [v[key] for key in ("x", "y", "z", "vx", "vy", "vz")]
        if not all(isfinite(n) and abs(n) < MAX_DISTANCE for n in numbers):
            return False
        if self.origin is not None:
            (x, y, z), (ox, oy, oz) = swap_enu_ned(*numbers[:3]), self.origin
            self._moved(State(x + ox, y + oy, z + oz, *swap_enu_ned(*numbers[3:])), now)
        return True

    def _global(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self._boots(v["time_boot_ms"])
        x, y, z = self._site.local(v["lat"] * 1e-7, v["lon"] * 1e-7, v["alt"] * 1e-3)
        self.far = max(abs(x), abs(y), abs(z))
        if self.far >= MAX_DISTANCE or abs(v["lat"]) > 900_000_000 or abs(v["lon"]) > 1_800_000_000:
            return False
        self.far = 0.0
        velocity = swap_enu_ned(v["vx"] * 0.01, v["vy"] * 0.01, v["vz"] * 0.01)
        self.global_state, self.global_at = State(x, y, z, *velocity), now
        if self.origin is None:
            self._moved(self.global_state, now)
        return True

    def _origin(self, v: dict[str, Any], now: float, utc: int) -> bool:
        at = self._site.local(v["latitude"] * 1e-7, v["longitude"] * 1e-7, v["altitude"] * 1e-3)
        if max(map(abs, at)) >= MAX_DISTANCE:
            return False
        if self.armed is False or self.origin is None:  # an origin that moves in flight would move the drone
            self.origin = at
        return True

    def _landed(self, v: dict[str, Any], now: float, utc: int) -> bool:
        if v["landed_state"] not in (1, 2, 3, 4):
            return False
        self.is_landed = v["landed_state"] == 1
        return True

    def _parameter(self, v: dict[str, Any], now: float, utc: int) -> bool:
        value = self._autopilot.parameter_value(v["param_value"], v["param_type"])
        if not isfinite(value):
            return False
        self.parameters[v["param_id"]] = value
        return True

    def _moved(self, state: State, now: float) -> None:
        """A new own state, unless it says that it moves and stands still: then the estimate is frozen."""
        last, passed = self.state, now - self.state_at
        if last is not None and last[:3] == state[:3] and max(map(abs, state[3:])) > MOVING_SPEED:
            return
        if last is not None and passed < 1.0:
            step = max(abs(a - b) for a, b in zip(last[:3], state[:3], strict=True))
            speed = max(max(map(abs, last[3:])), max(map(abs, state[3:])))
            if step > 2.0 * speed * passed + self._max_jump:
                self.jumped_at = now
        self.state, self.state_at = state, now

    _HANDLERS = {
        0: _heartbeat, 1: _sys_status, 2: _system_time, 24: _gps, 32: _local, 33: _global, 49: _origin, 245: _landed,
        22: _parameter,
    }  # fmt: skip

    def position_disagreement(self, now: float) -> float:
        """Distance (m) of the two positions that the autopilot tells, while both are fresh; else 0."""
        if self.state is None or self.global_state is None or now - self.global_at > 0.5 or now - self.state_at > 0.5:
            return 0.0
        return max(abs(a - b) for a, b in zip(self.state[:3], self.global_state[:3], strict=True))

    def clock_offset(self) -> float | None:
        """How far (s) the autopilot's clock is ahead of ours, by the sample that was least delayed; None: not known."""
        return max(self.clock_offsets) if self.clock_offsets else None
