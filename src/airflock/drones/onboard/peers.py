"""Peers: the newest plausible status of each member. Peers tell states; nothing that they send is a command."""

from collections import deque
from math import sqrt

from airflock.core import State
from airflock.drones.mavlink.status import DroneStatus
from airflock.drones.onboard.card import FlightCard
from airflock.drones.onboard.mission import AIRBORNE_PHASES, FLOCKING_PHASES, MissionPhase

HEARD_WITHIN = 2.0  # s; a peer whose last status is younger is heard
AGE_COUNT = 10  # packets whose ages tell of a clock
MAX_PACKET_AGE = (
    1.0  # s beyond the radio's delay; a member whose packets are all older seems to have a clock that is behind
)
MAX_OUTSIDE = 100.0  # m; a member may be this far beyond the fence and still be believed
PHASE_OF_NUMBER = {int(phase): phase for phase in MissionPhase}
STATUS_REFUSALS = ("mission", "card", "phase", "fast", "far", "jump", "time")


class Peer:
    """What is known of one member."""

    def __init__(self) -> None:
        self.status: DroneStatus | None = None
        self.at = -1e9  # own time at which its last state held, s
        self.heard_at = -1e9
        self.packet_ages: deque[float] = deque(maxlen=AGE_COUNT)
        self.has_other_card = False
        self.phase = MissionPhase.BOOT  # of its mission as it told it
        self.state: State | None = None  # as it told it
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
        """Take note of a status that held at `state_at` and arrived now (own time, s); False if it is not believed."""
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
        """Why a status is not believed; empty if it is."""
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
        """The own clock has been set forward by so much, s: by it, all states held earlier."""
        for peer in self.all.values():
            peer.at -= ahead

    def heard(self, now: float) -> int:
        """How many members are heard now."""
        return sum([now - peer.heard_at <= HEARD_WITHIN for peer in self.all.values()])

    def flying(self) -> dict[int, Peer]:
        """Members that are in the air by their last word."""
        return {who: peer for who, peer in self.all.items() if peer.is_flying}

    def is_own_clock_suspect(self) -> bool:
        """Whether two or more members, and all that are known, seem to have a wrong clock: then it is the own."""
        wrong, limit = 0, self._card.safety.clock_error
        for peer in self.all.values():
            if len(peer.packet_ages) == AGE_COUNT:
                if -limit <= min(peer.packet_ages) <= self._card.delay + MAX_PACKET_AGE:
                    return False
                wrong += 1
        return wrong >= 2
