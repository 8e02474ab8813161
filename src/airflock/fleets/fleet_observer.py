"""The observer of a fleet on the ground, and the broadcast for it from a radio channel in software.

The observer takes bytes and the clock and sends nothing. It accepts what a member would accept:
signed with the mission's key, in time, each once, of the same card. A channel in software also
reports links and faults hold; real radios report neither.
"""

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from airflock.core import forward
from airflock.drones import (
    CHANNEL_SYSTEM,
    HEARD_WITHIN,
    STATUS_MESSAGE,
    TEXT_MESSAGE,
    ChannelReport,
    DroneStatus,
    FlightCard,
    PacketReceiver,
    PacketSigner,
    Peer,
    Peers,
    TextPieces,
    orders,
    parse_order,
    parse_report,
    parse_status,
    report_message,
)
from airflock.fleets.drone_faults import INJECTED_KINDS, InjectedFault
from airflock.fleets.radio_channel import SOFTWARE_KEY
from airflock.support import LinkError, printable

DEFAULT_WATCH_ADDRESS: tuple[str, int] = ("127.0.0.1", 14600)  # where who watches hears a fleet in software
REPORT_PERIOD = 0.5  # s between two reports
NEIGHBOUR_WITHIN = 1.0  # s; a neighbour whose last packet arrived longer ago is not heard
NEVER_HEARD = -1e9


def scenario_fault_name(kind: str) -> str:
    """Return what a kind of fault of a scenario is called where faults of a fleet stand beside it."""
    return f"{kind} of the scenario" if kind in INJECTED_KINDS else kind


class TelemetryBroadcast:
    """Counts arrived packets, and reports links and faults twice a second.

    members : system ids
    """

    def __init__(self, members: Sequence[int], faults: Sequence[InjectedFault]):
        self._members, self._faults = tuple(members), tuple(faults)
        self._arrival_times = {member: dict.fromkeys(members, NEVER_HEARD) for member in members}
        self._sign, self._next_report = PacketSigner(SOFTWARE_KEY, CHANNEL_SYSTEM), NEVER_HEARD

    def note_arrival(self, receiver: int, datagram: bytes, now: float) -> None:
        """Note a datagram that arrived at a drone, by its index among the members."""
        sender = datagram[5] if len(datagram) > 5 else 0
        if sender in self._arrival_times:
            self._arrival_times[self._members[receiver]][sender] = now

    def report(self, now: float, utc: int, active_faults: Mapping[str, Collection[int]] | None = None) -> list[bytes]:
        """Return signed datagrams for observers, where they are due.

        now           : time of the flight, s
        utc           : µs of Unix time
        active_faults : kinds of fault of the scenario that hold, each with the indices of the
                        affected drones
        """
        if now < self._next_report:
            return []
        self._next_report = now + REPORT_PERIOD
        reports = [
            report_message("", member, [who for who, at in known.items() if now - at <= NEIGHBOUR_WITHIN])
            for member, known in self._arrival_times.items()
        ]
        # Faults of one kind are merged: a viewer shows kinds and members, not entries of a file.
        holding: dict[str, set[int]] = {}  # several faults of one kind are reports as one
        for fault in self._faults:
            if fault.begin <= now < fault.end:
                holding.setdefault(fault.kind, set()).update(fault.who or self._members)
        for kind, places in (active_faults or {}).items():
            holding[scenario_fault_name(kind)] = {self._members[place] for place in places}
        reports += [report_message(kind, 0, who) for kind, who in holding.items()]
        return [self._sign(each, utc) for each in reports]


LISTENER_ID = 0  # system id of who only listens
MAX_NOTES = 200  # notes
REPORT_LIFETIME = 2.0  # s; an older report no longer holds


class ObserverNote(NamedTuple):
    """An event: time of the own clock, s; system id, 0 for the fleet; text."""

    time: float
    member: int
    text: str


# Reads broadcast packets only: the autopilot's client port belongs to a ground station, and over
# the air there is none.
class FleetObserver:
    """Listens to the fleet of a card.

    card, key : of the mission
    now, utc  : own clock (s) and Unix time (µs), which advance together

    Attributes: peers, the newest plausible status of each member; notes, the events; refused,
    datagrams by reason.
    """

    def __init__(self, card: FlightCard, key: bytes, *, now: float, utc: int):
        self.card, self.begun = card, now
        self._clock_zero = utc - round(now * 1e6)
        senders = {
            STATUS_MESSAGE: card.members,
            TEXT_MESSAGE: card.members,
            orders.TUNNEL_MESSAGE: (orders.OPERATOR_SYSTEM, CHANNEL_SYSTEM),
        }
        spread = card.safety.clock_spread + card.delay
        self._receive = PacketReceiver(key, LISTENER_ID, senders, started=utc, max_clock_difference=spread)
        self._peers = Peers(card, LISTENER_ID)
        self.notes: deque[ObserverNote] = deque(maxlen=MAX_NOTES)
        self._heard_reports: dict[int, tuple[float, frozenset[int]]] = {}
        self._faults: dict[str, tuple[float, frozenset[int]]] = {}
        self._silent: set[int] = set()
        self._text_pieces = {member: TextPieces() for member in card.members}
        self._last_order_time = 0  # when the last order was given, µs of Unix time

    def take(self, datagram: bytes, now: float) -> None:
        """Take a datagram that came by any radio."""
        got = self._receive(datagram, self._clock_zero + round(now * 1e6))
        if got is None:
            return
        if got.message == STATUS_MESSAGE:
            status = parse_status(got.values, self.card.site)
            if status is not None:
                self._state(got.system, status, now)
        elif got.message == TEXT_MESSAGE:
            text = self._text_pieces[got.system](got.values)
            if text:
                self._note(now, got.system, printable(text))
        elif got.system == CHANNEL_SYSTEM:
            self._take_report(parse_report(got.values), now)
        else:
            self._order(got.values, now)

    def _state(self, member: int, drone_status: DroneStatus, now: float) -> None:
        peer = self.peers[member]
        new, was = peer.status is None, peer.phase
        if not self._peers.take(member, drone_status, (drone_status.time - self._clock_zero) * 1e-6, now):
            return
        if new:
            self._note(now, member, f"heard, {peer.phase.name}")
        elif was != peer.phase:
            self._note(now, member, f"{was.name} → {peer.phase.name}")

    def _take_report(self, report: ChannelReport | None, now: float) -> None:
        if report is None:
            return
        if report.fault:
            if report.fault not in self._faults:
                self._note(now, 0, f"fault {report.fault}: {self.named(report.systems)}")
            self._faults[report.fault] = now, report.systems
        elif report.subject in self.peers:
            self._heard_reports[report.subject] = now, report.systems & self.peers.keys()

    def _order(self, values: dict[str, object], now: float) -> None:
        try:
            order = parse_order(values, self.card.operator) if self.card.operator else None
        except LinkError:  # without the library no order can be checked, and none is shown
            return
        if order is not None and order.mission == self.card.mission and order.given_at > self._last_order_time:
            self._last_order_time = order.given_at
            self._note(now, order.target, f"the operator orders {order.kind.name.lower().replace('_', ' ')}")

    def look(self, now: float) -> None:
        """Note members that fell silent or came back, and faults that are over; call it a few times a second."""
        for who, peer in self.peers.items():
            silent = peer.status is not None and now - peer.heard_at > HEARD_WITHIN
            if silent != (who in self._silent):
                self._silent ^= {who}
                self._note(now, who, "silent" if silent else "heard again")
        for kind in [kind for kind, (at, _) in self._faults.items() if now - at > REPORT_LIFETIME]:
            del self._faults[kind]
            self._note(now, 0, f"fault {kind} is over")

    def _note(self, now: float, member: int, text: str) -> None:
        self.notes.append(ObserverNote(now, member, text))

    @property
    def peers(self) -> dict[int, Peer]:
        """Return the knowledge of each member, by its system id."""
        return self._peers.all

    @property
    def refused(self) -> dict[str, int]:
        """Return the counts of refused datagrams, by reason; zero counts are left out."""
        return {reason: n for reason, n in (self._receive.refused | self._peers.refused).items() if n}

    @property
    def accepted_count(self) -> int:
        """Return the number of accepted datagrams."""
        return self._receive.accepted_count

    def heard(self, now: float) -> list[int]:
        """Return the members that are heard now."""
        return [who for who, peer in self.peers.items() if now - peer.heard_at <= HEARD_WITHIN]

    def place(self, member: int, now: float) -> tuple[float, float, float] | None:
        """Return the position of a member now, m from the site: its status carried on by its velocity."""
        peer = self.peers[member]
        if peer.state is None:
            return None
        s, ahead = peer.state, min(max(now - peer.at, 0.0), HEARD_WITHIN)
        x, y, z = forward(*s, ahead)
        return x, y, z

    def links(self, now: float) -> dict[tuple[int, int], bool]:
        """Return pairs of members with packets between them, and whether both ways; empty for real radios."""
        ways = {
            (who, other)
            for who, (at, others) in self._heard_reports.items()
            if now - at <= REPORT_LIFETIME
            for other in others
        }
        return {(a, b): (b, a) in ways for a, b in ways if a < b or (b, a) not in ways}

    @property
    def faults(self) -> dict[str, frozenset[int]]:
        """Return the kinds of fault that hold, each with the affected members; empty for real fleets."""
        return {kind: who for kind, (_, who) in self._faults.items()}

    def flying(self, now: float) -> list[int]:
        """Return the members that are heard now and fly."""
        return [who for who in self.heard(now) if self.peers[who].is_flying]

    def named(self, systems: frozenset[int]) -> str:
        """Return system ids in words."""
        known = [who for who in self.card.members if who in systems]
        if len(known) == len(self.card.members):
            return "all drones"
        return f"drone{'s' * (len(known) > 1)} {', '.join(map(str, known))}"
