"""The contract of a radio: which packets of others arrive, when, and where their senders are believed to be since.

A kind of radio is a module with `Parameters` and plain rules. `missed` returns the probability that
nothing of what one agent sends another in a decision arrives; a random number then decides, for all
pairs in vectors. `receive` is the longer form: it is handed random numbers and what is kept of the
pair, and decides itself. The argument names are the declaration, as of every rule
(`core.vocabulary`).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from airflock.core import random
from airflock.core.contract import (
    along_axes,
    argument_names,
    call_rule,
    check_memory_record,
    gather,
    initial_values,
    merge_parameters,
    namespace_names,
)
from airflock.core.parameters import Parameters, number_names, quantity
from airflock.support import RuleError

PACKET = {
    "distance": "true distance of the two, m",
    "clear": "1.0 if nothing that stands in the world lies between the two, else 0.0",
    "talkers": "how many others are within radio.range of the receiver: all send, the sender among them",
    "step": "number of the decision",
    "period": "time between two decisions, s",
}
CHANCES = {
    **{f"u{c}": "uniform random number between 0 and 1, new for each pair and decision" for c in range(4)},
    **{f"g{c}": "normal random number, new for each pair and decision" for c in range(4)},
}
MISSED = {
    **PACKET,
    "fast": "packets that the first of RATES sends in this decision",
    "slow": "packets that the second of RATES sends in this decision",
}
RECEIVED = {
    **PACKET,
    **along_axes("d", "true offset from the receiver to the sender", "m"),
    **along_axes("v", "true velocity of the receiver", "m/s"),
    "age": "age of the newest packet that the receiver has of the sender, s; 1e9 or more before the first",
    "packet": "the radio's Packet of this pair",
    **CHANCES,
}
SEEN = {
    **along_axes("d", "true offset to the other one when the picture was taken, radio.delay ago", "m"),
    **along_axes("e", "offset at which the newest estimate, carried forward, expects it in that picture", "m"),
    **along_axes("ev", "its velocity by the newest estimate", "m/s"),
    **along_axes("v", "own velocity as measured", "m/s"),
    "since": "time since the last picture in which it was found, s; about 1e9 before the first",
    "period": "time between two decisions, s",
    **CHANCES,
}
CARRIED = {
    **along_axes("", "position in the newest packet", "m"),
    **along_axes("v", "velocity in the newest packet", "m/s"),
    "age": "age of the newest packet, s",
}
RULES = {
    "missed": {**MISSED, "k": "the radio's parameters"},
    "missed_few": {**MISSED, "k": "the radio's parameters"},
    "receive": {**RECEIVED, "k": "the radio's parameters"},
    "late": {**PACKET, **CHANCES, "k": "the radio's parameters"},
    "see": {**SEEN, "k": "the radio's parameters"},
    "carry": {**CARRIED, "k": "the radio's parameters"},
    "lasts": {"age": "age of the newest packet, s", "k": "the radio's parameters"},
}


S5 = "Vásárhelyi et al. 2018, Table S5"
FEW_PACKETS = 3  # packets of each rate in a decision, up to which `missed_few` serves
LINK_NAMES = (
    "fast",
    "slow",
)  # arguments of `missed`: packets in a decision by the first and second of RATES


@dataclass(frozen=True, kw_only=True)
class PacketParameters(Parameters):
    """Parameters of every radio: a delay, a range, and a loss that grows with the square of the distance."""

    delay: float = quantity(
        1.0, "s", low=0.0, high=30.0, source=S5, usual=(0.0, 5.0), meaning="age of neighbours' data on arrival"
    )
    range: float = quantity(80.0, "m", low=0.0, high=1e8, source=S5, meaning="largest distance of communication")
    loss: float = quantity(
        0.0,
        "1",
        low=0.0,
        high=1.0,
        source="authors' program",
        meaning="probability of losing a packet at the distance loss_at; grows with the square of the distance",
    )
    loss_at: float = quantity(
        80.0,
        "m",
        low=0.1,
        high=1e6,
        source="authors' program",
        meaning="distance at which a packet is lost with probability loss",
    )


def lost(distance, k):
    """Probability that a packet over a distance (m) is lost, 0-1 (authors' program: quadratic in the distance)."""
    s = distance / k.loss_at
    return min(k.loss * s * s, 1.0)


def either(a, b):
    """Probability that at least one of two independent mishaps happens, 0-1."""
    return a + b - a * b


def packets(step, rate, period):
    """Number of packets that a link of `rate` (1/s) sends in decision number `step` of length `period` (s)."""
    # The difference of two rounded counts, so that a rate that does not divide the decision rate is
    # met exactly on average; 1e-6 absorbs the rounding of step * rate * period.
    return math.floor((step + 1.0) * rate * period + 1e-6) - math.floor(step * rate * period + 1e-6)


def forward(x, y, z, vx, vy, vz, age):
    """Position (m) carried forward with the velocity (m/s) for so long, s: exact for straight flight."""
    return x + vx * age, y + vy * age, z + vz * age


@dataclass(frozen=True)
class Radio:
    """A kind of radio: parameters and rules, gathered from a module or any namespace.

    name       : how scenarios refer to it
    Parameters : record of its numbers; delay, range, loss and loss_at are among them
    missed     : probability that nothing of what an agent sends another in one decision arrives
    missed_few : the same where each of RATES sends at most FEW packets in a decision; quicker
    receive    : 1.0 if a packet arrives, else 0.0, and behind it Packet where there is one. It is
                 called once for each pair in range and decision
    late       : how much later than `delay` a packet comes, s. While one is under way, those behind
                 it are dropped
    see        : instead of what is sent, what an agent sees itself: offset (m) and velocity (m/s)
                 at which it believes another after a picture. Its own errors of position, and the
                 packets of the other one, do not matter
    carry      : where the sender of the newest packet is believed to be now, m; without it, where
                 it was then
    lasts      : 1.0 while the newest packet counts, by its age; without it, until the next one
                 comes
    Packet     : NamedTuple of what `receive` keeps of one pair, each field with its value at the
                 start
    rates      : at most two numbers of Parameters, packets per second; `missed` may ask how many
                 each sends (LINKS)
    violates   : truths of `airflock.check_radio` that do not hold for it, and why (VIOLATES)

    Of a radio with `missed`, `receive`, `late` or `see` the newest packet counts until the next one
    comes, as long as its sender is in range. Without any of them each packet counts at the decision
    that it comes at.
    """

    name: str
    Parameters: type
    missed: Callable[..., Any] | None = None
    missed_few: Callable[..., Any] | None = None
    receive: Callable[..., Any] | None = None
    late: Callable[..., Any] | None = None
    see: Callable[..., Any] | None = None
    carry: Callable[..., Any] | None = None
    lasts: Callable[..., Any] | None = None
    Packet: type | None = None
    rates: tuple[str, ...] = ()
    violates: Mapping[str, str] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.name, *(getattr(self, rule) for rule in RULES)))

    @property
    def keeps_packets(self) -> bool:
        """Return True if the newest packet counts until the next one comes."""
        return any(rule is not None for rule in (self.missed, self.receive, self.late, self.see))

    @property
    def initial_packet(self) -> tuple[float, ...]:
        """Return the value of each field of Packet at the start of a flight."""
        return initial_values(self.Packet)

    def asks_for(self, *names: str) -> bool:
        """Return True if one of the rules requests any of these names."""
        found = {
            name for kind in RULES if (rule := getattr(self, kind)) for name in argument_names(rule, kind, self.name)
        }
        return bool(found & set(names))


def radio(namespace: Any, name: str = "") -> Radio:
    """Gather a radio from a module, a class or a mapping of names; refuse what the contract does not know.

    Parameters
    ----------
    namespace : module, class or mapping
        Holds at least one of the rules missed, receive, late and see, and if it likes carry, lasts, Parameters, RATES,
        and Packet (a NamedTuple whose fields have the values of the start), which receive takes and returns.
    name : str, optional
        How the radio is called; by default the namespace's.

    Returns
    -------
    Radio
        To be given to `airflock.load(..., radio=...)`.

    Raises
    ------
    RuleError
        If it has no rule, or both missed and receive, or a rule requests an unknown argument.

    Examples
    --------
    >>> import airflock
    >>> class Nearby:
    ...     def missed(distance):
    ...         return 0.1 if distance < 30.0 else 0.9
    >>> airflock.radio(Nearby).Parameters().range
    80.0
    """
    found, name = namespace_names(namespace, name)
    rules = {kind: found[kind] for kind in RULES if callable(found.get(kind))}
    arguments = {kind: argument_names(rule, kind, name) for kind, rule in rules.items()}
    if not rules:
        raise RuleError(f"radio {name} has no rule; give missed or receive, late, see, carry, lasts")
    if "missed" in rules and "receive" in rules:
        raise RuleError(f"radio {name} has missed and receive; give one of them")
    # A camera has one delay for all pictures, so a delay of each packet has no meaning for it.
    if {"see", "late"} <= set(rules):
        raise RuleError(f"radio {name} has see and late; give one of them, as pictures all have the delay of the radio")
    if set(rules) <= {"carry", "lasts", "missed_few"}:
        raise RuleError(f"radio {name} has only {' and '.join(rules)}; give missed, receive, late or see as well")
    check_memory_record(f"radio {name}", "receive", arguments.get("receive", ()), found.get("Packet"), "Packet")
    record = merge_parameters(PacketParameters, found.get("Parameters"), f"radio {name}")
    rates = tuple(found.get("RATES", ()))
    unknown = [rate for rate in rates if rate not in number_names(record)]
    if unknown or len(rates) > len(LINK_NAMES):
        raise RuleError(f"radio {name}: RATES = {rates} are not at most two numbers of Parameters")
    wanted = set(arguments.get("missed", ())) & set(LINK_NAMES) - set(LINK_NAMES[: len(rates)])
    if wanted:
        raise RuleError(f"radio {name}: missed asks for {sorted(wanted)[0]}, which RATES does not name")
    how = {kind: rules.get(kind) for kind in RULES}
    return gather(Radio, found, name=name, Parameters=record, rates=rates, **how)


FIRST = {  # before anything is known
    **dict.fromkeys(("dx", "dy", "dz", "vx", "vy", "vz"), 0.0), "age": 1e9, "clear": 1.0, "talkers": 1.0,
}  # fmt: skip


class PacketReception:
    """Reception of the packets between the members of a flock: which arrive, and how late.

    radio, k     : kind of radio and its numbers
    seed, agents : by which its random numbers are drawn, those of the same pair in a flight of this
                   seed and size
    period       : time between two decisions, s
    """

    def __init__(self, radio: Radio, k: Any, seed: int, agents: int, period: float):
        self.radio, self.k, self.seed, self.agents, self.period = radio, k, seed, agents, period
        self._kept: dict[tuple[int, int], Any] = {}

    def any_arrives(self, receiver: int, sender: int, decision: int, known: Mapping[str, float]) -> bool:
        """Return True if any packet sent in a decision arrives, where the sender is in range.

        known : the distance (m), and what else of the vocabulary of `receive` is known
        """
        if not self.packet_arrives(receiver, sender, decision, known):
            return False
        u = random.pair_uniform(self.seed, random.PACKET, 0, decision, receiver, sender, self.agents)
        return bool(u >= loss_probability(self.radio, self.k, decision, self.period, known))

    def packet_arrives(self, receiver: int, sender: int, decision: int, known: Mapping[str, float]) -> bool:
        """Return True if a packet arrives by the rule `receive` of the radio, where it has one."""
        if self.radio.receive is None:
            return True
        return self._received(receiver, sender, self._given(receiver, sender, decision, known))

    def late(self, receiver: int, sender: int, decision: int, known: Mapping[str, float]) -> float:
        """Return how much later than its delay a packet of a decision comes, s."""
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
