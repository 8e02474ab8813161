"""Knowledge of others: status of each member, orders of the operator, and state and health of the autopilot.

Peers send states; nothing that they send is a command. Implausible statuses and frames change
nothing.
"""

from collections import deque
from itertools import pairwise
from math import isfinite, sqrt
from typing import Any

from airflock.core import State
from airflock.drones.mavlink.autopilots import ARMED_FLAG, COMMAND_TEXTS, NODE_COMPONENT, STREAM_RATES, Autopilot
from airflock.drones.mavlink.frames import FrameStream, MavlinkFrame, common_dialect
from airflock.drones.mavlink.messages import DroneStatus, TextPieces
from airflock.drones.mavlink.orders import CALL_OFF_ORDERS, OperatorOrder, OrderKind, parse_order
from airflock.drones.onboard.card import FlightCard
from airflock.drones.onboard.mission import AIRBORNE_PHASES, FLOCKING_PHASES, MissionPhase
from airflock.support import FlightSite, LinkError, printable, swap_enu_ned

HEARD_WITHIN = 2.0  # s; a peer whose last status is younger is heard
AGE_COUNT = 10  # packets whose ages reveal a wrong clock
# s beyond the radio's delay; a member whose packets are all older seems to have a clock that is
# behind.
MAX_PACKET_AGE = 1.0
MAX_OUTSIDE = 100.0  # m; a member may be this far beyond the fence and still be believed
PHASE_OF_NUMBER = {int(phase): phase for phase in MissionPhase}
STATUS_REFUSALS = ("mission", "card", "phase", "fast", "far", "jump", "time")


class Peer:
    """State and history of one member."""

    def __init__(self) -> None:
        self.status: DroneStatus | None = None
        self.at = -1e9  # own time at which its last state held, s
        self.heard_at = -1e9
        self.packet_ages: deque[float] = deque(maxlen=AGE_COUNT)
        self.has_other_card = False
        self.phase = MissionPhase.BOOT  # of its mission, by its last status
        self.state: State | None = None  # by its last status
        self.is_flying = False  # whether it is in the air, by its last word


class Peers:
    """All other members of the card."""

    def __init__(self, card: FlightCard, member: int):
        self._card = card
        self.all = {who: Peer() for who in card.members if who != member}
        self.refused = dict.fromkeys(STATUS_REFUSALS, 0)
        self._hash = bytes.fromhex(card.hash)[:4]
        self.member_joined = False

    def take(self, member: int, status: DroneStatus, state_at: float, now: float) -> bool:
        """Take a status that held at `state_at` and arrived now (own time, s); return False if it is implausible."""
        reason = self._refusal_reason(member, status, state_at, now)
        peer = self.all[member]
        if reason:
            self.refused[reason] += 1
            peer.has_other_card = peer.has_other_card or reason == "card"
            return False
        was = peer.phase
        peer.status, peer.at, peer.heard_at, peer.has_other_card = status, state_at, now, False
        peer.phase, peer.state = PHASE_OF_NUMBER[status.phase], State(*status.position, *status.velocity)
        peer.is_flying = peer.phase in AIRBORNE_PHASES and status.is_airborne
        peer.packet_ages.append(now - state_at)
        self.member_joined = self.member_joined or (was not in FLOCKING_PHASES and peer.phase in FLOCKING_PHASES)
        return True

    def _refusal_reason(self, member: int, status: DroneStatus, at: float, now: float) -> str:
        """Return the reason to refuse a status, or an empty text."""
        card, s = self._card, self._card.safety
        if status.mission != card.mission:
            return "mission"
        if status.card != self._hash:
            return "card"
        if status.phase not in PHASE_OF_NUMBER:
            return "phase"
        x, y, z = status.position
        vx, vy, vz = status.velocity
        if sqrt(vx * vx + vy * vy + vz * vz) > 2.0 * s.speed_max + s.climb_max:
            return "fast"
        if card.outside(x, y, z) > MAX_OUTSIDE or z < -MAX_OUTSIDE:
            return "far"
        last = self.all[member]
        if not -s.clock_spread <= now - at <= card.delay + s.clock_spread:
            return "time"
        if last.status is not None and at - last.at < 2.0:
            px, py, pz = last.status.position
            step = max(abs(px - x), abs(py - y), abs(pz - z))
            if step > 2.0 * s.speed_max * max(at - last.at, 0.0) + s.jump + 3.0 * status.accuracy:
                return "jump"
        return ""

    def shift_clock(self, ahead: float) -> None:
        """Move all known times back, after the own clock has been set forward (s)."""
        for peer in self.all.values():
            peer.at -= ahead

    def heard(self, now: float) -> int:
        """Return the number of members that are heard now."""
        return sum([now - peer.heard_at <= HEARD_WITHIN for peer in self.all.values()])

    def flying(self) -> dict[int, Peer]:
        """Return the members that were in the air by their last status."""
        return {who: peer for who, peer in self.all.items() if peer.is_flying}

    def confirm_clock(self, now: float) -> bool:
        """Return True if the clocks of all members that are heard, one at least, agree with the own one."""
        limit = self._card.safety.clock_error
        heard = [peer for peer in self.all.values() if now - peer.heard_at <= HEARD_WITHIN]
        # A radio on board takes next to no time, a simulated one the card's delay. A clock that is
        # ahead by just that delay passes here, but not the others: it sends from their future.
        return bool(heard or not self.all) and all(
            len(peer.packet_ages) == AGE_COUNT
            and any(abs(min(peer.packet_ages) - delay) <= limit for delay in (0.0, self._card.delay))
            for peer in heard
        )

    def is_own_clock_suspect(self) -> bool:
        """Return True if at least two members, and all that are known, seem to have a wrong clock: then it is ours."""
        wrong, limit = 0, self._card.safety.clock_error
        for peer in self.all.values():
            # The youngest of ten packets says most: delay only makes packets older, so a whole
            # batch that is too old or from the future can only be a clock.
            if len(peer.packet_ages) == AGE_COUNT:
                if -limit <= min(peer.packet_ages) <= self._card.delay + MAX_PACKET_AGE:
                    return False
                wrong += 1
        return wrong >= 2


KILL_CONFIRM_WITHIN = 5_000_000  # µs; a kill must be confirmed within
MAX_ORDER_AGE = 5_000_000  # µs; an order given longer ago is not obeyed
# µs after its turn a drone may still start; our choice: later somebody may stand beside it.
MAX_START_DELAY = 10_000_000
# Reasons to refuse an order, with a line for a person; a repetition is none.
ORDER_REFUSALS = {
    "seal": "the operator of this card has not signed it; is mission.operator another one?",
    "mission": "it is of another mission",
    "old": f"by this computer's clock it was given more than {MAX_ORDER_AGE * 1e-6:g} s ago, or in the future",
    "replay": "",
    "no library": "cryptography is not installed on board, so it cannot be checked",
}


class OperatorOrders:
    """Orders that were taken.

    last_order_time : time at which the last order was given, µs of Unix time; kept over restarts
                      against replays
    held            : HOLD was ordered, or its position jumped: only an order ends it
    needs_resume    : its position jumped, and no RESUME was ordered since
    """

    def __init__(self, card: FlightCard, member: int, last_order_time: int):
        self._card, self._member, self.last_order_time = card, member, last_order_time
        self.heard_at = -1e9
        self.refused = dict.fromkeys(ORDER_REFUSALS, 0)
        self.last_refusal = ""  # reason of the last refused order
        self.start_at: int | None = None  # µs of Unix time
        self.held = self.resume_ordered = self.needs_resume = self.kill_confirmed = False
        self.goal: tuple[float, float, float] | None = None
        self._kill_at = -KILL_CONFIRM_WITHIN
        self._queue: list[OrderKind] = []

    def take(self, values: dict[str, Any], now: float, utc: int) -> bool:
        """Take an order from a message; return False for another mission, a wrong signature or a replay."""
        try:
            order = parse_order(values, self._card.operator) if self._card.operator else None
        except LinkError:
            return self._refuse("no library")
        if order is None:
            return self._refuse("seal")
        if order.mission != self._card.mission:
            return self._refuse("mission")
        if abs(order.given_at - utc) > MAX_ORDER_AGE:
            return self._refuse("old")
        # Orders grow in time, over restarts too: a recorded one cannot be sent again.
        if order.given_at <= self.last_order_time:
            return self._refuse("replay")
        # Also for orders to others: they prove that the operator is there, and use up their time.
        self.last_order_time, self.heard_at = order.given_at, now
        if order.target in (0, self._member):
            self._obey(order, utc)
        return True

    def _refuse(self, reason: str) -> bool:
        self.refused[reason], self.last_refusal = self.refused[reason] + 1, reason
        return False

    def _obey(self, order: OperatorOrder, utc: int) -> None:
        if order.kind == OrderKind.START:
            self.start_at = order.at
        elif order.kind == OrderKind.HOLD:
            self.held, self.resume_ordered = True, False
        elif order.kind == OrderKind.RESUME:
            self.held, self.resume_ordered, self.needs_resume = False, True, False
        elif order.kind == OrderKind.GOTO:
            lat, lon, alt = order.point
            self.goal = self._card.site.local(lat * 1e-7, lon * 1e-7, alt * 1e-3)
        # Two steps, because one wrong order must not drop a drone.
        elif order.kind == OrderKind.KILL:
            self._kill_at = utc
        elif order.kind == OrderKind.CONFIRM_KILL:
            self.kill_confirmed = utc - self._kill_at <= KILL_CONFIRM_WITHIN
        elif order.kind in (OrderKind.RETURN, OrderKind.LAND):
            self.held = False
        if order.kind in CALL_OFF_ORDERS:
            self.start_at = None
        self._queue.append(order.kind)

    def next_order(self) -> OrderKind | None:
        """Return the order of this tick; orders keep the sequence of their arrival."""
        return self._queue.pop(0) if self._queue else None

    def put_back(self, order: OrderKind) -> None:
        """Put an order back for the next tick, because something else came first at this one."""
        self._queue.insert(0, order)

    def due(self, utc: int, member_delay: float) -> bool:
        """Return True if a start was ordered and the own turn (s after it) has come."""
        return self.start_at is not None and utc - self.start_at - round(member_delay * 1e6) >= 0

    def missed(self, utc: int, member_delay: float) -> bool:
        """Return True, and forget the start, if the own turn was too long ago."""
        if self.start_at is None or utc - self.start_at - round(member_delay * 1e6) <= MAX_START_DELAY:
            return False
        self.start_at = None
        return True


AUTOPILOT_COMPONENT = 1  # component id
MAX_DISTANCE = 1e5  # m from the site; and m/s: nothing that flies here is there
INVALID_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: ground stations and companions
CLOCK_SAMPLES = 10  # samples of the autopilot's clock that are kept
JUMP_SPAN = 10.0  # s; after a longer silence a drone may be anywhere, and no step is a jump
REBOOT_MS = 2000  # ms; messages that overtake each other differ by less
MOVING_SPEED = 0.3  # m/s; who flies faster than this cannot stay at the same place
STREAM_SILENCE = 2.0  # s; a stream that is older is requested once more: the slowest has 1 Hz
RATE_SPAN = 2.0  # s over which the rate of the own position is measured: about one hiccup of a computer
# A stream at exactly the needed rate jitters: a fifth less is still accepted.
RATE_SHARE = 0.8
FIGURE_COUNT = 5  # arrivals that give the figure of a rate which is too low
FAILSAFE_STATES = (5, 6)  # MAV_STATE_CRITICAL, MAV_STATE_EMERGENCY
BATTERY_BIT, PREARM_BIT = 1 << 25, 1 << 28  # of the sensors in SYS_STATUS; PX4 does not enable the latter
UNKNOWN_VOLTAGE = 65535  # mV
REPORTED_LINES = 20  # the last lines of an autopilot, which are not reported again
WARNING = 4  # MAV_SEVERITY; lines of the autopilot that are less severe are for its maker
ACCEPTED_RESULTS = (0, 5)  # MAV_RESULT: accepted, in progress


class AutopilotLink:
    """State and health of the own drone, from the frames of its autopilot.

    member        : its system id
    site          : origin of local coordinates
    state         : own position and velocity, local
    state_at      : time at which the state arrived, s; -1e9: never
    far           : distance (m) from the site of the last position that was refused as too far
                    away; 0: none
    arrivals      : time at which each stream of STREAM_RATES was heard last, s, by number of its
                    message
    restarts      : number of times that the autopilot seems to have rebooted on the ground
    refused       : number of frames with implausible content
    in_failsafe   : it reports that a failsafe of its own acts
    prearm_fails  : it reports that it would not arm
    battery_warning : a line if it reports a bad battery (by voltage or capacity); else empty
    lines         : its texts and refusals that nobody has read yet
    accepted      : numbers of the commands of COMMAND_TEXTS that it has accepted
    explained_offset : offset (s) of its clock from ours, which other drones confirmed
    other_systems : system ids of other autopilots on this wire
    """

    def __init__(self, autopilot: Autopilot, member: int, site: FlightSite):
        self._autopilot, self._member, self._site, self._stream = autopilot, member, site, FrameStream()
        self.heartbeat_at = self.jumped_at = -1e9
        self.kind: int | None = None
        self.mode: int | None = None
        self.armed: bool | None = None
        self.in_failsafe = self.prearm_fails = False
        self.battery_warning = ""
        self.lines: list[str] = []
        self.reported_lines: deque[str] = deque(maxlen=REPORTED_LINES)
        self._pieces = TextPieces()
        self.accepted: set[int] = set()
        self.other_systems: set[int] = set()
        self.refused = 0
        self.far, self._max_jump = 0.0, 5.0
        self._may_reboot_silently, self._is_reboot_assumed = True, False
        self.restarts, self._boot_ms = -1, 0
        self._forget(0)

    def __call__(self, data: bytes, now: float, utc: int, max_jump: float) -> None:
        """Take bytes at now (s) and utc (µs of Unix time); max_jump: largest plausible step (m)."""
        self._max_jump = max_jump
        for frame in self._stream(data):
            if frame.system != self._member:
                # Another vehicle on this wire means a wrong cable or a wrong system id: noticed
                # before take-off.
                if frame.message == 0 and frame.values()["autopilot"] != INVALID_AUTOPILOT:
                    self.other_systems.add(frame.system)
            elif frame.component == AUTOPILOT_COMPONENT:
                self._take(frame, now, utc)

    def _take(self, frame: MavlinkFrame, now: float, utc: int) -> None:
        if frame.message in STREAM_RATES:
            self.arrivals[frame.message] = now
        handler = self._HANDLERS.get(frame.message)
        if handler is not None and not handler(self, frame.values(), now, utc):
            self.refused += 1

    def overdue_streams(self, now: float) -> list[int]:
        """Return the messages that are not heard, or no longer; all that it knew is forgotten if none is heard.

        An autopilot that reboots forgets the requested streams and sends heartbeats only: no
        message with its time since boot would say so. Where such a silence was none, because that
        time went on after it, silence proves nothing, and only a time that goes back does.
        """
        overdue = [n for n in STREAM_RATES if now - self.arrivals.get(n, -1e9) > STREAM_SILENCE]
        is_silent = len(overdue) == len(STREAM_RATES) and now - self.heartbeat_at <= STREAM_SILENCE
        if is_silent and self._may_reboot_silently and self.arrivals and not self.armed:
            self._is_reboot_assumed = True
            self._forget(self._boot_ms)
        return overdue

    def low_rate(self, needed: float, now: float) -> float | None:
        """Return the rate (1/s) of the own state if it is lower than needed; None if not, or in the first second."""
        latest = list(self._state_times)[-round(needed * RATE_SHARE * RATE_SPAN) - 1 :]
        if not latest or now - latest[-1] > STREAM_SILENCE:
            return None
        # Up to the last arrival: a fast stream that has ended is not slow.
        span = latest[-1] - latest[0]
        if span < 0.5 * RATE_SPAN:
            return None
        # Without its longest gap: one hiccup of a computer is no slow stream.
        span -= max(b - a for a, b in pairwise(latest))
        if len(latest) - 1 >= needed * RATE_SHARE * span:
            return None
        # The last arrivals alone: when a fast stream becomes slow, an average says neither rate.
        latest = latest[-FIGURE_COUNT:]
        return (len(latest) - 1) / max(latest[-1] - latest[0], 1e-3)

    def _boots(self, since_boot: int) -> None:
        """Forget all values if the autopilot has rebooted on the ground, so that they are requested once more.

        since_boot : time since boot in a message, ms; a step back by more than REBOOT_MS means a
                     reboot
        """
        goes_on = since_boot >= self._boot_ms - REBOOT_MS
        if self._is_reboot_assumed:
            self._is_reboot_assumed, self._may_reboot_silently, self._boot_ms = False, not goes_on, since_boot
        # In the air a time that goes back is a broken message, never a reason to forget the state.
        elif goes_on:
            self._boot_ms = max(since_boot, self._boot_ms)
        elif not self.armed:
            self._forget(since_boot)

    def _forget(self, boot_ms: int) -> None:
        """Forget what an autopilot may have changed by a reboot, at a time since its boot (ms)."""
        self.restarts += 1
        self._boot_ms = boot_ms
        self.state_at = self.global_at = -1e9
        self.state: State | None = None
        self.global_state: State | None = None
        self.origin: tuple[float, float, float] | None = None
        self.is_landed: bool | None = None
        self.fix_type, self.horizontal_accuracy = 0, 1e9
        self.battery: float | None = None
        self.parameters: dict[str, float] = {}
        self.clock_offsets: list[float] = []
        self.explained_offset = 0.0
        self.arrivals: dict[int, float] = {}
        self._state_times: deque[float] = deque(maxlen=32)

    def _heartbeat(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self.kind, self.mode, self.armed = v["autopilot"], v["custom_mode"], bool(v["base_mode"] & ARMED_FLAG)
        self.heartbeat_at, self.in_failsafe = now, v["system_status"] in FAILSAFE_STATES
        return True

    def _sys_status(self, v: dict[str, Any], now: float, utc: int) -> bool:
        if v["battery_remaining"] > 100:
            return False
        self.battery = float(v["battery_remaining"]) if v["battery_remaining"] >= 0 else None
        # Per cent are counted from a capacity that somebody typed: the bit also knows the voltage.
        bad = v["onboard_control_sensors_enabled"] & ~v["onboard_control_sensors_health"]
        volts = f" at {v['voltage_battery'] * 1e-3:.1f} V" if v["voltage_battery"] != UNKNOWN_VOLTAGE else ""
        warned, self.prearm_fails = self.battery_warning, bool(bad & PREARM_BIT)
        self.battery_warning = f"battery: the autopilot reports it low or bad{volts}" if bad & BATTERY_BIT else ""
        if self.battery_warning and not warned and self.armed:
            self.lines.append(self.battery_warning)
        return True

    def _acknowledged(self, v: dict[str, Any], now: float, utc: int) -> bool:
        ours = v["target_system"] in (0, self._member) and v["target_component"] in (0, NODE_COMPONENT)
        if ours and v["command"] in COMMAND_TEXTS and v["result"] in ACCEPTED_RESULTS:
            self.accepted.add(v["command"])
        elif ours and v["command"] in COMMAND_TEXTS:
            known = common_dialect().enums["MAV_RESULT"].get(v["result"])
            result = known.name.removeprefix("MAV_RESULT_").lower().replace("_", " ") if known else v["result"]
            self.report(f"the autopilot refuses {COMMAND_TEXTS[v['command']]}: {result}")
        return True

    def _text(self, v: dict[str, Any], now: float, utc: int) -> bool:
        text = self._pieces(v)
        if text and v["severity"] <= WARNING:
            self.report(f"autopilot: {printable(text)}")
        return True

    def report(self, line: str) -> None:
        """Keep a line for a person, once: an autopilot repeats its reasons every second."""
        if line not in self.reported_lines:
            self.reported_lines.append(line)
            self.lines.append(line)

    def _system_time(self, v: dict[str, Any], now: float, utc: int) -> bool:
        self._boots(v["time_boot_ms"])
        if v["time_unix_usec"] < 1_500_000_000_000_000:
            return False  # it has no time from a satellite yet
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
            # ArduCopter sends 0, 0 until its EKF has an origin, some messages after the first fix.
            if v["lat"] == v["lon"] == 0:
                self.far = 0.0
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
        meaning = self._autopilot.battery_parameters.get(v["param_id"])
        if meaning and not self.armed:
            self.report(f"{v['param_id']} = {value:g}: {meaning}")
        return True

    def _moved(self, state: State, now: float) -> None:
        """Take a new own state, unless it has a velocity but an unchanged position: then the estimate is frozen."""
        last, passed, times = self.state, now - self.state_at, self._state_times
        if times and now - times[-1] > STREAM_SILENCE:  # a rate is measured since the stream began
            times.clear()
        times.append(now)
        # A frozen estimate keeps sending: without this it would look fresh for ever.
        if last is not None and last[:3] == state[:3] and max(map(abs, state[3:])) > MOVING_SPEED:
            return
        if last is not None and passed < JUMP_SPAN:
            step = max(abs(a - b) for a, b in zip(last[:3], state[:3], strict=True))
            speed = max(max(map(abs, last[3:])), max(map(abs, state[3:])))
            # A jump that no velocity explains means that the navigation has reset.
            if step > 2.0 * speed * passed + self._max_jump:
                self.jumped_at = now
        self.state, self.state_at = state, now

    _HANDLERS = {
        0: _heartbeat, 1: _sys_status, 2: _system_time, 24: _gps, 32: _local, 33: _global, 49: _origin, 245: _landed,
        22: _parameter, 77: _acknowledged, 253: _text,
    }  # fmt: skip

    def position_disagreement(self, now: float) -> float:
        """Return the distance (m) of the two positions of the autopilot, while both are fresh; else 0."""
        if self.state is None or self.global_state is None or now - self.global_at > 0.5 or now - self.state_at > 0.5:
            return 0.0
        # Both at the same time: at 12 m/s, 0.45 s between the two messages are more than `jump`.
        dt, own = self.global_at - self.state_at, self.state
        return max(abs(a + v * dt - b) for a, v, b in zip(own[:3], own[3:], self.global_state[:3], strict=True))

    def unknown_parameters(self) -> list[str]:
        """Return the names of the needed parameters that are not known."""
        unknown = [check for check in self._autopilot.parameter_checks if check.value(self.parameters) is None]
        names = [name for check in unknown for name in check.names]
        return names + [name for name in self._autopilot.battery_parameters if name not in self.parameters]

    def is_position_doubtful(self, now: float) -> bool:
        """Return True if the own position has just jumped, or the two positions of the autopilot differ."""
        return now - self.jumped_at < 1.0 or self.position_disagreement(now) > self._max_jump

    @property
    def unexplained_offset(self) -> float | None:
        """Return the part (s) of the clock's offset that nothing explains; None: unknown."""
        offset = self.clock_offset()
        return None if offset is None else offset - self.explained_offset

    def clock_offset(self) -> float | None:
        """Return how far (s) the autopilot's clock is ahead of ours, by the least delayed sample; None: unknown."""
        # Delay only makes the autopilot's time look older, so the largest offset was delayed least.
        return max(self.clock_offsets) if self.clock_offsets else None
