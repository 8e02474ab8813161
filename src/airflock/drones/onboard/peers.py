"""Peers: the newest plausible status of each member. Peers tell states; nothing that they send is a command."""

from collections import deque
from math import sqrt

from airflock.core.agent import State
from airflock.drones.mavlink.status import Status
from airflock.drones.onboard.card import Card
from airflock.drones.onboard.mission import AIR, FLOCKING, Phase

FRESH = 2.0  # s; a peer whose last status is younger is heard
AGES = 10  # packets whose ages tell of a clock
OLD = 1.0  # s beyond the radio's delay; a member whose packets are all older seems to have a clock that is behind
BEYOND = 100.0  # m; a member may be this far beyond the fence and still be believed
PHASES = {int(phase): phase for phase in Phase}
REASONS = ("mission", "card", "phase", "fast", "far", "jump", "time")


class Peer:
    """What is known of one member."""

    def __init__(self) -> None:
        self.status: Status | None = None
        self.at = -1e9  # own time at which its last state held, s
        self.heard_at = -1e9
        self.ages: deque[float] = deque(maxlen=AGES)
        self.other_card = False
        self.phase = Phase.BOOT  # of its mission as it told it
        self.state: State | None = None  # as it told it
        self.flies = False  # whether it is in the air, by its last word


class Peers:
    """All other members of the card."""

    def __init__(self, card: Card, member: int):
        self._card = card
        self.all = {who: Peer() for who in card.members if who != member}
        self.refused = dict.fromkeys(REASONS, 0)
        self._hash = bytes.fromhex(card.hash)[:4]
        self.joined = False

    def take(self, who: int, status: Status, at: float, now: float) -> bool:
        """Take note of a status that held at `at` and arrived now (own time, s); False if it is not believed."""
        reason = self._fault(who, status, at, now)
        peer = self.all[who]
        if reason:
            self.refused[reason] += 1
            peer.other_card = peer.other_card or reason == "card"
            return False
        was = peer.phase
        peer.status, peer.at, peer.heard_at, peer.other_card = status, at, now, False
        peer.phase, peer.state = PHASES[status.phase], State(*status.position, *status.velocity)
        peer.flies = peer.phase in AIR and status.airborne
        peer.ages.append(now - at)
        self.joined = self.joined or (was not in FLOCKING and peer.phase in FLOCKING)
        return True

    def _fault(self, who: int, status: Status, at: float, now: float) -> str:
        """Why a status is not believed; empty if it is."""
        card, s = self._card, self._card.safety
        if status.mission != card.mission:
            return "mission"
        if status.card != self._hash:
            return "card"
        if status.phase not in PHASES:
            return "phase"
        x, y, z = status.position
        vx, vy, vz = status.velocity
        if sqrt(vx * vx + vy * vy + vz * vz) > 2.0 * s.speed_max + s.climb_max:
            return "fast"
        if card.outside(x, y, z) > BEYOND or z < -BEYOND:
            return "far"
        last = self.all[who]
        if not -s.clock_spread <= now - at <= card.delay + s.clock_spread:
            return "time"
        if last.status is not None and at - last.at < 2.0:
            px, py, pz = last.status.position
            step = max(abs(px - x), abs(py - y), abs(pz - z))
            if step > 2.0 * s.speed_max * max(at - last.at, 0.0) + s.jump + 3.0 * status.accuracy:
                return "jump"
        return ""

    def set_clock(self, ahead: float) -> None:
        """The own clock has been set forward by so much, s: by it, all states held earlier."""
        for peer in self.all.values():
            peer.at -= ahead

    def heard(self, now: float) -> int:
        """How many members are heard now."""
        return sum([now - peer.heard_at <= FRESH for peer in self.all.values()])

    def flying(self) -> dict[int, Peer]:
        """Members that are in the air by their last word."""
        return {who: peer for who, peer in self.all.items() if peer.flies}

    def clocks_suspect(self) -> bool:
        """Whether two or more members, and all that are known, seem to have a wrong clock: then it is the own."""
        wrong, limit = 0, self._card.safety.clock_error
        for peer in self.all.values():
            if len(peer.ages) == AGES:
                if -limit <= min(peer.ages) <= self._card.delay + OLD:
                    return False
                wrong += 1
        return wrong >= 2
