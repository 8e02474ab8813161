"""The ether: every datagram on its way, by the radio rules of the simulator and with faults. Pure: virtual time.

The dice are those of the simulator: the same streams with the number of the arrival period and the pair, so that a
fleet whose packets arrive once per decision loses the very packets that the simulated flock loses.
"""

import heapq
import math
import random as dice
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from airflock.core import PacketReception, Radio, loss_probability
from airflock.fleets.dice import PacketNumbers
from airflock.fleets.faults import InjectedFault
from airflock.fleets.rogue import forge_packet
from airflock.support import FlightSite

TIME_TOLERANCE = 1e-6  # s
Position = tuple[float, float, float]


class RadioChannel:
    """Datagrams between the members of a fleet.

    radio, k : kind of radio and its numbers; members: system ids; period: s between two packets of a drone
    clear : whether nothing stands between two places, m; None: nothing stands anywhere
    site : of the flight, by which forged packets tell places
    reach : how far (m) faults let the first of two drones, by their places, be heard by the second at a time, s
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
        self._random = dice.Random(f"ether {seed}")
        self.sent = self.arrived_count = 0

    def send(self, now: float, sender: int, datagram: bytes, positions: Sequence[Position] = ()) -> None:
        """A drone, by its place in the list of members, sends a datagram to all; at: true positions, m."""
        if self._reaches_all_at_once:
            self._queue_packet(now + self._k.delay, sender, self._others[sender], datagram)
        else:
            reached: dict[float, list[int]] = {}
            for to in self._others[sender]:
                late = self._jitter(to, now) + self._rule_delay(now, sender, to, positions)
                reached.setdefault(round(now + self._k.delay + late, 6), []).append(to)
            for due, whom in reached.items():
                self._queue_packet(due, sender, whom, datagram)
        for f in self._attackers:
            if f.holds(self._members[sender], now) and self._site is not None:
                false = forge_packet(datagram, self._site, east=f.amount, with_key=f.kind == "impostor")
                self._queue_packet(now + self._k.delay, sender, range(len(self._members)), false)

    def _rule_delay(self, now: float, sender: int, receiver: int, at: Sequence[Position]) -> float:
        """How much later a packet comes by the rule of the radio, s."""
        if self._radio.late is None or not at:
            return 0.0
        known = self._pair_arguments(sender, receiver, at, math.dist(at[receiver], at[sender]))
        return self._reception.late(receiver, sender, round((now + self._k.delay) / self._period), known)

    def _pair_arguments(self, sender: int, receiver: int, at: Sequence[Position], distance: float) -> dict[str, float]:
        """What rules of the radio may ask for of a pair."""
        known = {"distance": distance}
        if not self._asked_arguments:
            return known
        here, there = at[receiver], at[sender]
        known |= {name: b - a for name, a, b in zip(("dx", "dy", "dz"), here, there, strict=True)}
        if "talkers" in self._asked_arguments:
            near = [math.dist(here, other) <= self._k.range for other in at]
            known["talkers"] = float(sum(near)) - 1.0
        if "clear" in self._asked_arguments and self._clear is not None:
            known["clear"] = 1.0 if self._clear(here, there) else 0.0
        return known

    def _queue_packet(self, due: float, sender: int, receivers: Sequence[int], datagram: bytes) -> None:
        heapq.heappush(self._queue, (round(due, 6), self._count, sender, receivers, datagram))
        self._count += 1

    def _jitter(self, to: int, now: float) -> float:
        return sum(self._random.uniform(0.0, f.amount) for f in self._active_faults("jitter", to, now))

    def _active_faults(self, kind: str, to: int, now: float) -> Sequence[InjectedFault]:
        found = self._faults.get(kind, ())
        return found and [f for f in found if f.holds(self._members[to], now)]

    def deliver(self, now: float, positions: Sequence[Position]) -> Iterator[tuple[int, bytes]]:
        """Datagrams that arrive by now, each with the place of its receiver; at: true positions, m."""
        number = max(round(now / self._period), 0)
        while self._queue and self._queue[0][0] <= now + TIME_TOLERANCE:
            _, _, who, whom, datagram = heapq.heappop(self._queue)
            self.sent += len(whom)
            for to in whom:
                if not self._packet_arrives(now, number, who, to, positions):
                    continue
                self.arrived_count += 1
                if not self._faults:
                    yield to, datagram
                    continue
                yield to, self._corrupted(to, now, datagram)
                if any(self._random.random() < f.amount for f in self._active_faults("duplicate", to, now)):
                    yield to, datagram

    def _packet_arrives(self, now: float, number: int, sender: int, receiver: int, at: Sequence[Position]) -> bool:
        """Whether a packet gets through between two drones at these places, m."""
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
        if self._loses_nothing:
            return True
        known = self._pair_arguments(sender, receiver, at, distance)
        if not self._reception.packet_arrives(receiver, sender, number, known):
            return False
        missed = loss_probability(self._radio, self._k, number, self._period, known)
        return bool(missed <= 0.0 or self._packet_numbers(number, receiver, sender) >= missed)

    def _is_cut_off(self, now: float, sender: int, receiver: int) -> bool:
        if self._active_faults("outage", sender, now) or self._active_faults("outage", receiver, now):
            return True
        here, there = self._members[receiver], self._members[sender]
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
