"""The ether: every datagram on its way, by the radio rules of the simulator and with faults. Pure: virtual time.

The dice are those of the simulator: the same streams with the number of the arrival period and the pair, so that a
fleet whose packets arrive once per decision loses the very packets that the simulated flock loses.
"""

import heapq
import math
import random as dice
from collections.abc import Callable, Iterator, Sequence

from airflock.body import radio
from airflock.fleet.dice import PacketDice
from airflock.fleet.faults import Fault
from airflock.fleet.rogue import forged
from airflock.mavlink.coordinates import Site

SLACK = 1e-6  # s
Vector = tuple[float, float, float]


class Ether:
    """Datagrams between the members of a fleet.

    k : parameters of the radio; members: system ids; period: s between two packets of a drone
    site : of the flight, by which forged packets tell places
    reach : how far (m) faults let the first of two drones, by their places, be heard by the second at a time, s
    """

    def __init__(
        self, k: radio.Parameters, members: Sequence[int], seed: int, period: float, faults: Sequence[Fault] = (),
        reach: Callable[[int, int, float], float] | None = None, site: Site | None = None,
    ):  # fmt: skip
        self._k, self._members, self._period, self._faults = k, list(members), period, faults
        self._site = site
        self._reach, self._drawn = reach, PacketDice(seed, len(members))
        self._queue: list[tuple[float, int, int, int, bytes]] = []
        self._count = 0
        self._dice = dice.Random(f"ether {seed}")
        self.sent = self.arrived = 0

    def send(self, now: float, who: int, datagram: bytes) -> None:
        """A drone, by its place in the list of members, sends a datagram to all."""
        for to in range(len(self._members)):
            if to != who:
                self._push(now + self._k.delay + self._late(to, now), who, to, datagram)
        for f in self._faults:
            if f.kind in ("rogue", "impostor") and f.holds(self._members[who], now) and self._site is not None:
                false = forged(datagram, self._site, east=f.amount, with_key=f.kind == "impostor")
                for to in range(len(self._members)):
                    self._push(now + self._k.delay, who, to, false)

    def _push(self, due: float, who: int, to: int, datagram: bytes) -> None:
        heapq.heappush(self._queue, (round(due, 6), self._count, who, to, datagram))
        self._count += 1

    def _late(self, to: int, now: float) -> float:
        return sum(self._dice.uniform(0.0, f.amount) for f in self._of("jitter", to, now))

    def _of(self, kind: str, to: int, now: float) -> Sequence[Fault]:
        return self._faults and [f for f in self._faults if f.kind == kind and f.holds(self._members[to], now)]

    def deliver(self, now: float, at: Sequence[Vector]) -> Iterator[tuple[int, bytes]]:
        """Datagrams that arrive by now, each with the place of its receiver; at: true positions, m."""
        number = max(round(now / self._period), 0)
        while self._queue and self._queue[0][0] <= now + SLACK:
            _, _, who, to, datagram = heapq.heappop(self._queue)
            self.sent += 1
            if not self._passes(now, number, who, to, math.dist(at[who], at[to])):
                continue
            self.arrived += 1
            yield to, self._bent(to, now, datagram)
            if any(self._dice.random() < f.amount for f in self._of("duplicate", to, now)):
                yield to, datagram

    def _passes(self, now: float, number: int, who: int, to: int, distance: float) -> bool:
        """Whether a packet over this distance (m) gets through."""
        k = self._k
        if distance > k.range or (self._reach is not None and distance > self._reach(who, to, now)):
            return False
        if self._faults and (
            self._cut(now, who, to) or any(self._dice.random() < f.amount for f in self._of("loss", to, now))
        ):
            return False
        missed = radio.unheard(distance, number, self._period, k)
        return bool(missed <= 0.0 or self._drawn(number, to, who) >= missed)

    def _cut(self, now: float, who: int, to: int) -> bool:
        if self._of("outage", who, now) or self._of("outage", to, now):
            return True
        here, there = self._members[to], self._members[who]
        cuts = (f for f in self._faults if f.kind == "partition" and f.begin <= now < f.end)
        return any((here in f.who) != (there in f.who) for f in cuts)

    def _bent(self, to: int, now: float, datagram: bytes) -> bytes:
        for f in self._of("corrupt", to, now):
            if self._dice.random() < f.amount:
                bit = self._dice.randrange(8 * len(datagram))
                bent = bytearray(datagram)
                bent[bit // 8] ^= 1 << bit % 8
                return bytes(bent)
        return datagram
