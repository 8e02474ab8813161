"""Reception: what of a flock's packets arrives, packet after packet, in plain Python with the draws of a flight."""

from collections.abc import Mapping
from typing import Any

from airflock.core import random
from airflock.core.radio import LINK_NAMES, Radio, either, lost, packets
from airflock.core.vocabulary import call_rule

FIRST = {  # before anything is known
    **dict.fromkeys(("dx", "dy", "dz", "vx", "vy", "vz"), 0.0), "age": 1e9, "clear": 1.0, "talkers": 1.0,
}  # fmt: skip


class PacketReception:
    """Which packets pass between the members of a flock, and how late they come.

    radio, k     : kind of radio and its numbers
    seed, agents : by which its random numbers are drawn, those of the same pair in a flight of this seed and size
    period       : time between two decisions, s
    """

    def __init__(self, radio: Radio, k: Any, seed: int, agents: int, period: float):
        self.radio, self.k, self.seed, self.agents, self.period = radio, k, seed, agents, period
        self._kept: dict[tuple[int, int], Any] = {}

    def any_arrives(self, receiver: int, sender: int, decision: int, known: Mapping[str, float]) -> bool:
        """Whether anything of what is sent in decision `number` arrives, where the sender is in range.

        known : the distance (m), and what else of the vocabulary of `receive` is known
        """
        if not self.packet_arrives(receiver, sender, decision, known):
            return False
        u = random.pair_uniform(self.seed, random.PACKET, 0, decision, receiver, sender, self.agents)
        return bool(u >= loss_probability(self.radio, self.k, decision, self.period, known))

    def packet_arrives(self, receiver: int, sender: int, decision: int, known: Mapping[str, float]) -> bool:
        """Whether a packet arrives by the radio's own rule `receive`, where it has one."""
        if self.radio.receive is None:
            return True
        return self._received(receiver, sender, self._given(receiver, sender, decision, known))

    def late(self, receiver: int, sender: int, decision: int, known: Mapping[str, float]) -> float:
        """How much later than its delay a packet of decision `number` comes, s."""
        if self.radio.late is None:
            return 0.0
        given = self._given(receiver, sender, decision, known)
        return max(float(call_rule(self.radio.late, "late", given, self.radio.name)), 0.0)

    def _received(self, receiver: int, sender: int, given: Mapping[str, Any]) -> bool:
        assert self.radio.receive is not None
        found = call_rule(self.radio.receive, "receive", given, self.radio.name)
        if self.radio.Packet is None:
            return bool(found > 0.5)
        self._kept[receiver, sender] = found[1]
        return bool(found[0] > 0.5)

    def _given(self, receiver: int, sender: int, number: int, known: Mapping[str, float]) -> dict[str, Any]:
        given: dict[str, Any] = {**FIRST, **known, "step": float(number), "period": self.period, "k": self.k}
        if self.radio.Packet is not None:
            given["packet"] = self._kept.get((receiver, sender)) or self.radio.Packet()
        if self.radio.receive is not None or self.radio.late is not None:
            given |= draw_numbers(self.seed, number, receiver, sender, self.agents)
        return given


def draw_numbers(seed: int, decision: int, receiver: int, sender: int, agents: int, world: int = 0) -> dict[str, float]:
    """Random numbers that the rules `receive` and `late` may ask for of one pair in one decision, by name."""
    pair = receiver * agents + sender
    one, two = (random.random_words(seed, random.AIR, world, decision, pair, draw) for draw in (0, 1))
    normal = (*random.normal_pair(two[0], two[1]), *random.normal_pair(two[2], two[3]))
    return {f"u{c}": random.uniform(word) for c, word in enumerate(one)} | {f"g{c}": g for c, g in enumerate(normal)}


def loss_probability(radio: Radio, k: Any, number: int, period: float, known: Mapping[str, Any]) -> float:
    """Probability that nothing of what is sent in decision `number` arrives, by the rule `missed` and by k.loss."""
    gone = float(lost(known["distance"], k))
    if radio.missed is None:
        return gone
    rates = zip(LINK_NAMES, radio.rates, strict=False)
    sent = {link: packets(float(number), getattr(k, name), period) for link, name in rates}
    given = {**FIRST, **known, **sent, "step": float(number), "period": period, "k": k}
    return float(either(gone, call_rule(radio.missed, "missed", given, radio.name)))


def arrival_probability(radio: Radio, k: Any, distance: float, tries: int = 64) -> float:
    """Probability that one packet of each rate arrives over a distance (m) where nobody else sends, 0-1.

    tries : draws by which the share of a rule `receive` is estimated, as it begins
    """
    known: dict[str, Any] = {"distance": distance, "dx": distance, **dict.fromkeys(LINK_NAMES, 1)}
    passed = 1.0
    if radio.receive is not None:
        ether = PacketReception(radio, k, 0, 2, 0.2)
        passed = sum(ether.any_arrives(0, 1, number, known) for number in range(tries)) / tries
    if radio.missed is not None:
        given = {**FIRST, **known, "step": 0.0, "period": 0.2, "k": k}
        passed *= 1.0 - float(call_rule(radio.missed, "missed", given, radio.name))
    return passed * (1.0 - float(lost(distance, k)) if radio.receive is None else 1.0)
