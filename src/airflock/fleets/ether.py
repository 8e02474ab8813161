"""The ether: every datagram on its way, by the radio rules of the simulator and with faults. Pure: virtual time.

The dice are those of the simulator: the same streams with the number of the arrival period and the pair, so that a
fleet whose packets arrive once per decision loses the very packets that the simulated flock loses.
"""

import heapq
import math
import random as dice
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from airflock.core.radio import Radio
from airflock.core.reception import Reception, unheard
from airflock.fleets.dice import PacketDice
from airflock.fleets.faults import Fault
from airflock.fleets.rogue import forged
from airflock.support.coordinates import Site

SLACK = 1e-6  # s
Vector = tuple[float, float, float]


class Ether:
    """Datagrams between the members of a fleet.

    radio, k : kind of radio and its numbers; members: system ids; period: s between two packets of a drone
    clear : whether nothing stands between two places, m; None: nothing stands anywhere
    site : of the flight, by which forged packets tell places
    reach : how far (m) faults let the first of two drones, by their places, be heard by the second at a time, s
    """

    def __init__(
        self, radio: Radio, k: Any, members: Sequence[int], seed: int, period: float, faults: Sequence[Fault] = (),
        reach: Callable[[int, int, float], float] | None = None,
        clear: Callable[[Vector, Vector], bool] | None = None, site: Site | None = None,
    ):  # fmt: skip
        self._radio, self._k, self._members, self._period = radio, k, list(members), period
        self._faults = {f.kind: [other for other in faults if other.kind == f.kind] for f in faults}
        self._forgers = [f for f in faults if f.kind in ("rogue", "impostor")]
        self._reception, self._clear = Reception(radio, k, seed, len(members), period), clear
        self._site = site
        self._asks = frozenset(name for name in ("dx", "dy", "dz", "talkers", "clear") if radio.asks(name))
        self._reach, self._drawn = reach, PacketDice(seed, len(members))
        self._others = [tuple(to for to in range(len(members)) if to != who) for who in range(len(members))]
        self._alike = radio.late is None and "jitter" not in self._faults  # a packet reaches all at the same time
        self._sure = radio.receive is None and radio.missed is None and k.loss == 0.0  # in range, nothing is lost
        self._queue: list[tuple[float, int, int, Sequence[int], bytes]] = []
        self._count = 0
        self._dice = dice.Random(f"ether {seed}")
        self.sent = self.arrived = 0

    def send(self, now: float, who: int, datagram: bytes, at: Sequence[Vector] = ()) -> None:
        """A drone, by its place in the list of members, sends a datagram to all; at: true positions, m."""
        if self._alike:
            self._push(now + self._k.delay, who, self._others[who], datagram)
        else:
            reached: dict[float, list[int]] = {}
            for to in self._others[who]:
                late = self._late(to, now) + self._slow(now, who, to, at)
                reached.setdefault(round(now + self._k.delay + late, 6), []).append(to)
            for due, whom in reached.items():
                self._push(due, who, whom, datagram)
        for f in self._forgers:
            if f.holds(self._members[who], now) and self._site is not None:
                false = forged(datagram, self._site, east=f.amount, with_key=f.kind == "impostor")
                self._push(now + self._k.delay, who, range(len(self._members)), false)

    def _slow(self, now: float, who: int, to: int, at: Sequence[Vector]) -> float:
        """How much later a packet comes by the rule of the radio, s."""
        if self._radio.late is None or not at:
            return 0.0
        known = self._known(who, to, at, math.dist(at[to], at[who]))
        return self._reception.late(to, who, round((now + self._k.delay) / self._period), known)

    def _known(self, who: int, to: int, at: Sequence[Vector], distance: float) -> dict[str, float]:
        """What rules of the radio may ask for of a pair."""
        known = {"distance": distance}
        if not self._asks:
            return known
        here, there = at[to], at[who]
        known |= {name: b - a for name, a, b in zip(("dx", "dy", "dz"), here, there, strict=True)}
        if "talkers" in self._asks:
            near = [math.dist(here, other) <= self._k.range for other in at]
            known["talkers"] = float(sum(near)) - 1.0
        if "clear" in self._asks and self._clear is not None:
            known["clear"] = 1.0 if self._clear(here, there) else 0.0
        return known

    def _push(self, due: float, who: int, whom: Sequence[int], datagram: bytes) -> None:
        heapq.heappush(self._queue, (round(due, 6), self._count, who, whom, datagram))
        self._count += 1

    def _late(self, to: int, now: float) -> float:
        return sum(self._dice.uniform(0.0, f.amount) for f in self._of("jitter", to, now))

    def _of(self, kind: str, to: int, now: float) -> Sequence[Fault]:
        found = self._faults.get(kind, ())
        return found and [f for f in found if f.holds(self._members[to], now)]

    def deliver(self, now: float, at: Sequence[Vector]) -> Iterator[tuple[int, bytes]]:
        """Datagrams that arrive by now, each with the place of its receiver; at: true positions, m."""
        number = max(round(now / self._period), 0)
        while self._queue and self._queue[0][0] <= now + SLACK:
            _, _, who, whom, datagram = heapq.heappop(self._queue)
            self.sent += len(whom)
            for to in whom:
                if not self._passes(now, number, who, to, at):
                    continue
                self.arrived += 1
                if not self._faults:
                    yield to, datagram
                    continue
                yield to, self._bent(to, now, datagram)
                if any(self._dice.random() < f.amount for f in self._of("duplicate", to, now)):
                    yield to, datagram

    def _passes(self, now: float, number: int, who: int, to: int, at: Sequence[Vector]) -> bool:
        """Whether a packet gets through between two drones at these places, m."""
        distance = math.dist(at[to], at[who])
        if distance > self._k.range or (self._reach is not None and distance > self._reach(who, to, now)):
            return False
        if self._faults and (
            self._cut(now, who, to) or any(self._dice.random() < f.amount for f in self._of("loss", to, now))
        ):
            return False
        if self._sure:
            return True
        known = self._known(who, to, at, distance)
        if not self._reception.hears(to, who, number, known):
            return False
        missed = unheard(self._radio, self._k, number, self._period, known)
        return bool(missed <= 0.0 or self._drawn(number, to, who) >= missed)

    def _cut(self, now: float, who: int, to: int) -> bool:
        if self._of("outage", who, now) or self._of("outage", to, now):
            return True
        here, there = self._members[to], self._members[who]
        cuts = (f for f in self._faults.get("partition", ()) if f.begin <= now < f.end)
        return any((here in f.who) != (there in f.who) for f in cuts)

    def _bent(self, to: int, now: float, datagram: bytes) -> bytes:
        for f in self._of("corrupt", to, now):
            if self._dice.random() < f.amount:
                bit = self._dice.randrange(8 * len(datagram))
                bent = bytearray(datagram)
                bent[bit // 8] ^= 1 << bit % 8
                return bytes(bent)
        return datagram
