"""Observer: what somebody on the ground knows of a fleet by its packets. Bytes in, the clock passed in; sends nothing.

It accepts what a member would accept: signed with the mission's key, in time, each once, of the same card. Of a fleet
in software the ether tells, too, who hears whom and which faults hold; real radios tell neither.
"""

from collections import deque
from typing import NamedTuple

from airflock.core.radio import forward
from airflock.drones.mavlink import orders, status, witness
from airflock.drones.mavlink.orders import order_of
from airflock.drones.mavlink.signing import Receiver
from airflock.drones.onboard.card import Card
from airflock.drones.onboard.mission import Phase
from airflock.drones.onboard.peers import FRESH, Peer, Peers
from airflock.fleets.teller import NUMBERS
from airflock.support.errors import LinkError

NOBODY = 0  # system id of who only listens
KEPT = 200  # notes
TOLD = 2.0  # s; what the ether has not told for longer does not hold
KINDS = {number: kind for kind, number in NUMBERS.items()}


class Note(NamedTuple):
    """Something that happened: time of the own clock, s; system id, 0 for the fleet; what."""

    time: float
    member: int
    text: str


class Observer:
    """Listens to the fleet of a card.

    card, key : of the mission; now, utc : the own clock (s) and Unix time (µs), which run alike from then on

    Attributes: peers, the newest believed status of each member; notes, what happened; refused, datagrams by reason.
    """

    def __init__(self, card: Card, key: bytes, *, now: float, utc: int):
        self.card, self.begun = card, now
        self._zero = utc - round(now * 1e6)
        senders = {status.MESSAGE: card.members, orders.MESSAGE: (orders.OPERATOR, witness.WITNESS)}
        spread = card.safety.clock_spread + card.delay
        self._receive = Receiver(key, NOBODY, senders, started=utc, spread=spread)
        self._peers = Peers(card, NOBODY)
        self.notes: deque[Note] = deque(maxlen=KEPT)
        self._heard: dict[int, tuple[float, frozenset[int]]] = {}
        self._faults: dict[str, tuple[float, frozenset[int]]] = {}
        self._silent: set[int] = set()
        self._given = 0  # when the last order was given, µs of Unix time

    # ------------------------------------------------------------------------------------------------------ in

    def take(self, datagram: bytes, now: float) -> None:
        """Take a datagram that came by any radio."""
        got = self._receive(datagram, self._zero + round(now * 1e6))
        if got is None:
            return
        if got.message == status.MESSAGE:
            told = status.status_of(got.values, self.card.site)
            if told is not None:
                self._state(got.system, told, now)
        elif got.system == witness.WITNESS:
            self._witnessed(witness.told_of(got.values), now)
        else:
            self._order(got.values, now)

    def _state(self, who: int, told: status.Status, now: float) -> None:
        peer = self.peers[who]
        new, was = peer.status is None, peer.phase
        if not self._peers.take(who, told, (told.time - self._zero) * 1e-6, now):
            return
        if new:
            self._note(now, who, f"heard, {peer.phase.name}")
        elif was != peer.phase:
            self._note(now, who, f"{was.name} → {peer.phase.name}")

    def _witnessed(self, told: witness.Told | None, now: float) -> None:
        if told is None:
            return
        if told.what == witness.HEARS and told.subject in self.peers:
            self._heard[told.subject] = now, told.systems & self.peers.keys()
        elif told.what in KINDS:
            kind = KINDS[told.what]
            if kind not in self._faults:
                self._note(now, 0, f"fault {kind}: {self.named(told.systems)}")
            self._faults[kind] = now, told.systems

    def _order(self, values: dict[str, object], now: float) -> None:
        try:
            order = order_of(values, self.card.operator) if self.card.operator else None
        except LinkError:  # without the library no order can be checked, and none is shown
            return
        if order is not None and order.mission == self.card.mission and order.given > self._given:
            self._given = order.given
            self._note(now, order.target, f"the operator orders {order.do.name.lower().replace('_', ' ')}")

    def look(self, now: float) -> None:
        """Note who fell silent or came back, and which faults are over; to be called a few times a second."""
        for who, peer in self.peers.items():
            silent = peer.status is not None and now - peer.heard_at > FRESH
            if silent != (who in self._silent):
                self._silent ^= {who}
                self._note(now, who, "silent" if silent else "heard again")
        for kind in [kind for kind, (at, _) in self._faults.items() if now - at > TOLD]:
            del self._faults[kind]
            self._note(now, 0, f"fault {kind} is over")

    def _note(self, now: float, member: int, text: str) -> None:
        self.notes.append(Note(now, member, text))

    # ----------------------------------------------------------------------------------------------------- out

    @property
    def peers(self) -> dict[int, Peer]:
        """What is known of each member, by its system id."""
        return self._peers.all

    @property
    def refused(self) -> dict[str, int]:
        """Datagrams that were refused, by reason; those without any are left out."""
        return {reason: n for reason, n in (self._receive.refused | self._peers.refused).items() if n}

    @property
    def accepted(self) -> int:
        """Datagrams that were accepted."""
        return self._receive.accepted

    def heard(self, now: float) -> list[int]:
        """Members that are heard now."""
        return [who for who, peer in self.peers.items() if now - peer.heard_at <= FRESH]

    def place(self, member: int, now: float) -> tuple[float, float, float] | None:
        """Where a member is now, m from the site: as it told, carried on by its velocity while it is heard."""
        peer = self.peers[member]
        if peer.state is None:
            return None
        s, ahead = peer.state, min(max(now - peer.at, 0.0), FRESH)
        x, y, z = forward(*s, ahead)
        return x, y, z

    def links(self, now: float) -> dict[tuple[int, int], bool]:
        """Pairs of members between whom packets arrive, and whether they do so both ways; nothing of real radios."""
        ways = {(who, other) for who, (at, others) in self._heard.items() if now - at <= TOLD for other in others}
        return {(a, b): (b, a) in ways for a, b in ways if a < b or (b, a) not in ways}

    @property
    def faults(self) -> dict[str, frozenset[int]]:
        """Kinds of faults that hold, each with the members that it befalls; nothing of real fleets."""
        return {kind: who for kind, (_, who) in self._faults.items()}

    def flying(self, now: float) -> list[int]:
        """Members that are heard now and fly."""
        return [who for who in self.heard(now) if self.peers[who].flies]

    def named(self, systems: frozenset[int]) -> str:
        """System ids in words."""
        known = [who for who in self.card.members if who in systems]
        if len(known) == len(self.card.members):
            return "all drones"
        return f"drone{'s' * (len(known) > 1)} {', '.join(map(str, known))}"


def on_ground(phase: Phase) -> bool:
    """Whether a drone in this phase has not started, or has landed."""
    return phase in (Phase.BOOT, Phase.READY, Phase.CLEARED, Phase.ARMING, Phase.DONE)
