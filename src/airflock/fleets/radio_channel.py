"""The radio channel: datagrams on their way, by the radio rules of the simulator and with faults. Pure: virtual time.

Packets are lost by the random numbers of the simulator: the same streams with the number of the
arrival period and the pair, so that a fleet whose packets arrive once per decision loses exactly
the packets that the simulated flock loses.
"""

import hashlib
import heapq
import math
import random as dice
import struct
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from airflock.core import PacketReception, Radio, State, loss_probability, random
from airflock.drones import (
    HEADER_LENGTH,
    SIGNING_EPOCH,
    STATUS_MESSAGE,
    DroneStatus,
    Node,
    NodeOutput,
    PacketSigner,
    message_fields,
    parse_status,
    status_message,
)
from airflock.fleets.drone_faults import DroneFaults, InjectedFault
from airflock.support import FlightSite

PERIODS_PER_BLOCK = 16  # periods of the radio that are drawn together


class PacketNumbers:
    """Uniform random numbers for the loss of packets, of every pair in every period, to be drawn in the order of time.

    seed  : of the flight
    count : of drones
    """

    def __init__(self, seed: int, count: int):
        self._seed, self._count = seed, count
        self._first_period, self._tables = -PERIODS_PER_BLOCK, []  # type: ignore[var-annotated]

    def __call__(self, period: int, receiver: int, sender: int) -> float:
        """Return the number between 0 and 1 of a period, a receiver and a sender, by their indices."""
        if not self._first_period <= period < self._first_period + PERIODS_PER_BLOCK:
            self._first_period = period - period % PERIODS_PER_BLOCK
            self._tables = self._drawn(self._first_period)
        drawn: float = self._tables[period - self._first_period][receiver][sender]
        return drawn

    def _drawn(self, first: int) -> list[list[list[float]]]:
        """Draw a table of receivers and senders for each of PERIODS_PER_BLOCK periods."""
        periods = np.arange(first, first + PERIODS_PER_BLOCK, dtype=np.uint64)[:, None, None]
        # A Philox block has four words, which serve four receivers of one sender, as in the
        # simulator.
        to = np.arange(0, self._count, 4, dtype=np.uint64)[None, :, None]  # four receivers share their words
        who = np.arange(self._count, dtype=np.uint64)[None, None, :]
        words = random.random_words(self._seed, random.PACKET, 0, periods, random.pair_number(to, who, self._count))
        table = random.uniform(np.stack(words, axis=2)).reshape(PERIODS_PER_BLOCK, -1, self._count)
        tables: list[list[list[float]]] = table[:, : self._count].tolist()
        return tables


SOFTWARE_KEY = hashlib.sha256(b"a fleet in software has no secret").digest()
WRONG_KEY = bytes(32)  # a key that no fleet has
NEWER_BY = 1000  # µs; by which a false state is newer than the true one: of one age, the first counts
STAMP_FORMAT = struct.Struct("<Q")


def forge_packet(genuine: bytes, site: FlightSite, *, east: float, with_key: bool) -> bytes:
    """Return a packet that puts the sender of a genuine one at another position.

    east     : distance east of the true position, m
    with_key : signed as its sender would, one stamp later
    """
    status, stamp = _status_and_stamp(genuine, site)
    x, y, z = status.position
    sign = PacketSigner(SOFTWARE_KEY if with_key else WRONG_KEY, genuine[5], last=stamp)
    # Of two states of one age the first counts, so the forged one has to be newer.
    false = status._replace(position=(x + east, y, z), time=status.time + NEWER_BY)
    return sign(status_message(false, site), SIGNING_EPOCH + 10 * stamp)


def falsify_packet(genuine: bytes, site: FlightSite, false_state: Callable[[State], State]) -> bytes:
    """Return a genuine packet with another state of the same time, signed with the same stamp."""
    status, stamp = _status_and_stamp(genuine, site)
    false = false_state(State(*status.position, *status.velocity))
    # A fault that changes nothing must leave the genuine bytes as they are.
    if false == (*status.position, *status.velocity):
        return genuine
    sign = PacketSigner(SOFTWARE_KEY, genuine[5], last=stamp - 1)
    return sign(
        status_message(status._replace(position=false[:3], velocity=false[3:]), site), SIGNING_EPOCH + 10 * stamp
    )


def _status_and_stamp(genuine: bytes, site: FlightSite) -> tuple[DroneStatus, int]:
    """Return the status in a packet of a node of this fleet, and its stamp."""
    status = parse_status(message_fields(STATUS_MESSAGE, genuine[HEADER_LENGTH : HEADER_LENGTH + genuine[1]]), site)
    assert status is not None, "what a node of this fleet sent"
    return status, STAMP_FORMAT.unpack(genuine[-12:-6] + b"\0\0")[0]


TIME_TOLERANCE = 1e-6  # s
Position = tuple[float, float, float]


# Draws by the simulator's own functions and streams, so that a fleet and a simulation of one seed
# can be compared.
class RadioChannel:
    """Datagrams between the members of a fleet.

    radio, k    : kind of radio and its numbers
    members     : system ids
    period      : s between two packets of a drone
    radio_range : range (m) that faults leave between two drones, by their indices, at a time (s)
    is_clear    : returns True if no obstacle stands between two positions, m; None: there are no
                  obstacles
    site        : of the flight, for positions in forged packets
    """

    def __init__(
        self,
        radio: Radio,
        k: Any,
        members: Sequence[int],
        seed: int,
        period: float,
        faults: Sequence[InjectedFault] = (),
        radio_range: Callable[[int, int, float], float] | None = None,
        is_clear: Callable[[Position, Position], bool] | None = None,
        site: FlightSite | None = None,
    ):
        self._radio, self._k, self._members, self._period = radio, k, list(members), period
        self._faults = {f.kind: [other for other in faults if other.kind == f.kind] for f in faults}
        self._attackers = [f for f in faults if f.kind in ("rogue", "impostor")]
        self._reception, self._clear = PacketReception(radio, k, seed, len(members), period), is_clear
        self._site = site
        self._asked_arguments = frozenset(
            name for name in ("dx", "dy", "dz", "talkers", "clear") if radio.asks_for(name)
        )
        self._radio_range, self._packet_numbers = radio_range, PacketNumbers(seed, len(members))
        self._others = [tuple(to for to in range(len(members)) if to != who) for who in range(len(members))]
        self._reaches_all_at_once = (
            radio.late is None and "jitter" not in self._faults
        )  # a packet reaches all at the same time
        self._loses_nothing = (
            radio.receive is None and radio.missed is None and k.loss == 0.0
        )  # in range, nothing is lost
        self._queue: list[tuple[float, int, int, Sequence[int], bytes]] = []
        self._count = 0
        # Injected faults have a generator of their own: they must not shift the losses of the
        # scenario. The text is part of the seed, so it cannot be renamed.
        self._random = dice.Random(f"ether {seed}")
        self.sent = self.arrived_count = 0

    def send(self, now: float, sender: int, datagram: bytes, positions: Sequence[Position] = ()) -> None:
        """Send a datagram of a drone, by its index, to all; positions: true ones, m."""
        is_status = int.from_bytes(datagram[7:10], "little") == STATUS_MESSAGE
        if self._reaches_all_at_once:
            self._queue_packet(now + self._k.delay, sender, self._others[sender], datagram)
        else:
            # Receivers with the same delay share an entry of the queue.
            reached: dict[float, list[int]] = {}
            for to in self._others[sender]:
                late = self._jitter(to, now) + self._rule_delay(now, sender, to, positions)
                reached.setdefault(round(now + self._k.delay + late, 6), []).append(to)
            for due, receivers in reached.items():
                self._queue_packet(due, sender, receivers, datagram)
        for f in self._attackers if is_status else ():
            if f.holds(self._members[sender], now) and self._site is not None:
                false = forge_packet(datagram, self._site, east=f.amount, with_key=f.kind == "impostor")
                self._queue_packet(now + self._k.delay, sender, range(len(self._members)), false)

    def _rule_delay(self, now: float, sender: int, receiver: int, at: Sequence[Position]) -> float:
        """Return the delay of a packet by the rule of the radio, s."""
        if self._radio.late is None or not at:
            return 0.0
        arguments = self._pair_arguments(sender, receiver, at, math.dist(at[receiver], at[sender]))
        return self._reception.late(receiver, sender, round((now + self._k.delay) / self._period), arguments)

    def _pair_arguments(self, sender: int, receiver: int, at: Sequence[Position], distance: float) -> dict[str, float]:
        """Return the arguments of a pair for rules of the radio."""
        arguments = {"distance": distance}
        if not self._asked_arguments:
            return arguments
        here, there = at[receiver], at[sender]
        arguments |= {name: b - a for name, a, b in zip(("dx", "dy", "dz"), here, there, strict=True)}
        if "talkers" in self._asked_arguments:
            near = [math.dist(here, other) <= self._k.range for other in at]
            arguments["talkers"] = float(sum(near)) - 1.0
        if "clear" in self._asked_arguments and self._clear is not None:
            arguments["clear"] = 1.0 if self._clear(here, there) else 0.0
        return arguments

    def _queue_packet(self, due: float, sender: int, receivers: Sequence[int], datagram: bytes) -> None:
        heapq.heappush(self._queue, (round(due, 6), self._count, sender, receivers, datagram))
        self._count += 1

    def _jitter(self, to: int, now: float) -> float:
        return sum(self._random.uniform(0.0, f.amount) for f in self._active_faults("jitter", to, now))

    def _active_faults(self, kind: str, to: int, now: float) -> Sequence[InjectedFault]:
        faults = self._faults.get(kind, ())
        return faults and [f for f in faults if f.holds(self._members[to], now)]

    def deliver(self, now: float, positions: Sequence[Position]) -> Iterator[tuple[int, bytes]]:
        """Yield datagrams that arrive by now, each with the index of its receiver; positions: true ones, m."""
        number = max(round(now / self._period), 0)
        # Times are sums of steps, so two that should be equal may differ in the last bits.
        while self._queue and self._queue[0][0] <= now + TIME_TOLERANCE:
            _, _, who, receivers, datagram = heapq.heappop(self._queue)
            self.sent += len(receivers)
            for to in receivers:
                if not self._packet_arrives(now, number, who, to, positions):
                    continue
                self.arrived_count += 1
                # The loop of a flight without injected faults stays free of their look-ups.
                if not self._faults:
                    yield to, datagram
                    continue
                yield to, self._corrupted(to, now, datagram)
                if any(self._random.random() < f.amount for f in self._active_faults("duplicate", to, now)):
                    yield to, datagram

    def _packet_arrives(self, now: float, number: int, sender: int, receiver: int, at: Sequence[Position]) -> bool:
        """Return True if a packet gets through between two drones at these positions, m."""
        distance = math.dist(at[receiver], at[sender])
        if distance > self._k.range or (
            self._radio_range is not None and distance > self._radio_range(sender, receiver, now)
        ):
            return False
        if self._faults and (
            self._is_cut_off(now, sender, receiver)
            or any(self._random.random() < f.amount for f in self._active_faults("loss", receiver, now))
        ):
            return False
        # Most flights lose no packet in range: no random number is drawn, and none of the rule's
        # arguments is computed.
        if self._loses_nothing:
            return True
        arguments = self._pair_arguments(sender, receiver, at, distance)
        if not self._reception.packet_arrives(receiver, sender, number, arguments):
            return False
        missed = loss_probability(self._radio, self._k, number, self._period, arguments)
        return bool(missed <= 0.0 or self._packet_numbers(number, receiver, sender) >= missed)

    def _is_cut_off(self, now: float, sender: int, receiver: int) -> bool:
        if self._active_faults("outage", sender, now) or self._active_faults("outage", receiver, now):
            return True
        here, there = self._members[receiver], self._members[sender]
        # A partition separates its members from all others, in both directions.
        cuts = (f for f in self._faults.get("partition", ()) if f.begin <= now < f.end)
        return any((here in f.who) != (there in f.who) for f in cuts)

    def _corrupted(self, to: int, now: float, datagram: bytes) -> bytes:
        for f in self._active_faults("corrupt", to, now):
            if self._random.random() < f.amount:
                bit = self._random.randrange(8 * len(datagram))
                bent = bytearray(datagram)
                bent[bit // 8] ^= 1 << bit % 8
                return bytes(bent)
        return datagram


class FaultyNode:
    """A node with faults of the scenario, used like the node itself.

    Its packets carry the false state and its clock the error that the faults say; all else is left
    to the node.

    node        : function that returns the node, called each time: a logging one may take its place
    index       : of the drone among the members
    flight_time : function from a time of the node's own clock to the time of the flight, s
    """

    def __init__(
        self,
        node: Callable[[], Node],
        faults: DroneFaults,
        index: int,
        site: FlightSite,
        flight_time: Callable[[float], float] = lambda now: now,
    ):
        self._node, self._faults, self._index, self._site, self._flight_time = node, faults, index, site, flight_time
        self._clock_offset = 0

    def autopilot(self, data: bytes, now: float) -> None:
        """Take bytes that came from the autopilot."""
        self._node().autopilot(data, now)

    def radio(self, datagram: bytes, now: float) -> None:
        """Take a datagram that came by radio."""
        self._node().radio(datagram, now)

    def tick(self, now: float) -> NodeOutput:
        """Let the node decide."""
        at = self._flight_time(now)
        self.update_clock(at)
        out = self._node().tick(now)
        radios = tuple([self.falsified(datagram, at) for datagram in sent] for sent in out.radios)
        return out._replace(radios=radios)

    def update_clock(self, time: float) -> None:
        """Set the node's clock as its faults say at a time of the flight, s."""
        ahead = round(1e6 * self._faults.ahead(self._index, time))
        if ahead != self._clock_offset:
            self._node().shift_clock(ahead - self._clock_offset)
            self._clock_offset = ahead

    def falsified(self, datagram: bytes, time: float) -> bytes:
        """Return the datagram that replaces a packet of the node at a time of the flight, s."""
        if not self._faults.can_falsify:
            return datagram
        return falsify_packet(datagram, self._site, lambda state: self._faults.sent_state(self._index, time, state))
