"""The wire to the autopilot: what it says becomes the own state and health; implausible frames change nothing."""

from math import isfinite
from typing import Any

from airflock.core.agent import State
from airflock.drones.mavlink.autopilots import ARMED, Autopilot
from airflock.drones.mavlink.frames import Frame, Stream
from airflock.support.coordinates import Site, turned

AUTOPILOT = 1  # component id
FARTHEST = 1e5  # m from the site; and m/s: nothing that flies here is there
NOT_AN_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: ground stations and companions
CLOCKS = 10  # samples of the autopilot's clock that are kept
REBOOT = 2000  # ms; messages that overtake each other differ by less
MOVES = 0.3  # m/s; who flies faster than this cannot stay at the same place


class Wire:
    """What is known from the autopilot's frames.

    member  : its system id; site: origin of local coordinates
    state   : own position and velocity, local; state_at : when they were heard, s; -1e9: never
    far     : distance (m) from the site of a position so far away that it was refused last; 0: none was
    refused : frames with implausible content; strangers: system ids of other autopilots on this wire
    """

    def __init__(self, autopilot: Autopilot, member: int, site: Site):
        self._kind, self._member, self._site, self._stream = autopilot, member, site, Stream()
        self.state: State | None = None
        self.state_at = self.heartbeat_at = self.global_at = -1e9
        self.global_state: State | None = None
        self.origin: tuple[float, float, float] | None = None
        self.kind: int | None = None
        self.mode: int | None = None
        self.armed: bool | None = None
        self.landed: bool | None = None
        self.fix, self.h_acc = 0, 1e9
        self.battery: float | None = None
        self.jumped_at = -1e9
        self.parameters: dict[str, float] = {}
        self.clocks: list[float] = []
        self.strangers: set[int] = set()
        self.refused = 0
        self.far = 0.0
        self._jump = 5.0
        self._since_boot = 0

    def __call__(self, data: bytes, now: float, utc: int, jump: float) -> None:
        """Take bytes from the wire at now (s) and utc (µs of Unix time); jump: largest plausible step (m)."""
        self._jump = jump
        for frame in self._stream(data):
            if frame.system != self._member:
                if frame.message == 0 and frame.values()["autopilot"] != NOT_AN_AUTOPILOT:
                    self.strangers.add(frame.system)
            elif frame.component == AUTOPILOT:
                self._take(frame, now, utc)

    def _take(self, frame: Frame, now: float, utc: int) -> None:
        handler = self._HANDLERS.get(frame.message)
        if handler is not None and not handler(self, frame.values(), now, utc):
            self.refused += 1

    def _boots(self, since_boot: int) -> None:
        """Forget what an autopilot told before it was started anew on the ground: it is to be asked once more.

        since_boot : ms, of a message; one that went back by more than REBOOT tells of a new start
        """
        if since_boot >= self._since_boot - REBOOT:
            self._since_boot = max(since_boot, self._since_boot)
        elif not self.armed:
            self._since_boot, self.state, self.state_at = since_boot, None, -1e9
            self.global_state, self.global_at, self.origin, self.landed = None, -1e9, None, None
            self.fix, self.h_acc, self.battery = 0, 1e9, None
            self.parameters, self.clocks = {}, []

    def _heartbeat(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self.kind, self.mode, self.armed = v["autopilot"], v["custom_mode"], bool(v["base_mode"] & ARMED)
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
        self.clocks = [*self.clocks[1 - CLOCKS :], (v["time_unix_usec"] - utc) * 1e-6]
        return True

    def _gps(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self.fix, self.h_acc = v["fix_type"], v["h_acc"] * 1e-3 if v["h_acc"] > 0 else v["eph"] * 0.01
        return True

    def _local(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self._boots(v["time_boot_ms"])
        numbers = [v[key] for key in ("x", "y", "z", "vx", "vy", "vz")]
        if not all(isfinite(n) and abs(n) < FARTHEST for n in numbers):
            return False
        if self.origin is not None:
            (x, y, z), (ox, oy, oz) = turned(*numbers[:3]), self.origin
            self._moved(State(x + ox, y + oy, z + oz, *turned(*numbers[3:])), now)
        return True

    def _global(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self._boots(v["time_boot_ms"])
        x, y, z = self._site.local(v["lat"] * 1e-7, v["lon"] * 1e-7, v["alt"] * 1e-3)
        self.far = max(abs(x), abs(y), abs(z))
        if self.far >= FARTHEST or abs(v["lat"]) > 900_000_000 or abs(v["lon"]) > 1_800_000_000:
            return False
        self.far = 0.0
        velocity = turned(v["vx"] * 0.01, v["vy"] * 0.01, v["vz"] * 0.01)
        self.global_state, self.global_at = State(x, y, z, *velocity), now
        if self.origin is None:
            self._moved(self.global_state, now)
        return True

    def _origin(self, v: dict[str, Any], now: float, utc: int) -> bool:
        at = self._site.local(v["latitude"] * 1e-7, v["longitude"] * 1e-7, v["altitude"] * 1e-3)
        if max(map(abs, at)) >= FARTHEST:
            return False
        if self.armed is False or self.origin is None:  # an origin that moves in flight would move the drone
            self.origin = at
        return True

    def _landed(self, v: dict[str, Any], now: float, utc: int) -> bool:
        if v["landed_state"] not in (1, 2, 3, 4):
            return False
        self.landed = v["landed_state"] == 1
        return True

    def _parameter(self, v: dict[str, Any], now: float, utc: int) -> bool:
        value = self._kind.parameter(v["param_value"], v["param_type"])
        if not isfinite(value):
            return False
        self.parameters[v["param_id"]] = value
        return True

    def _moved(self, state: State, now: float) -> None:
        """A new own state, unless it says that it moves and stands still: then the estimate is frozen."""
        last, passed = self.state, now - self.state_at
        if last is not None and last[:3] == state[:3] and max(map(abs, state[3:])) > MOVES:
            return
        if last is not None and passed < 1.0:
            step = max(abs(a - b) for a, b in zip(last[:3], state[:3], strict=True))
            speed = max(max(map(abs, last[3:])), max(map(abs, state[3:])))
            if step > 2.0 * speed * passed + self._jump:
                self.jumped_at = now
        self.state, self.state_at = state, now

    _HANDLERS = {
        0: _heartbeat, 1: _sys_status, 2: _system_time, 24: _gps, 32: _local, 33: _global, 49: _origin, 245: _landed,
        22: _parameter,
    }  # fmt: skip

    def disagreement(self, now: float) -> float:
        """Distance (m) of the two positions that the autopilot tells, while both are fresh; else 0."""
        if self.state is None or self.global_state is None or now - self.global_at > 0.5 or now - self.state_at > 0.5:
            return 0.0
        return max(abs(a - b) for a, b in zip(self.state[:3], self.global_state[:3], strict=True))

    def clock_offset(self) -> float | None:
        """How far (s) the autopilot's clock is ahead of ours, by the sample that was least delayed; None: not known."""
        return max(self.clocks) if self.clocks else None
