"""What one agent makes of its neighbours' packets: which count, for how long, and how they are carried forward."""

from dataclasses import dataclass
from typing import Any

from airflock.core.agent import State
from airflock.core.maths import FAR
from airflock.core.radio import Radio
from airflock.core.vocabulary import call_rule

EARLY = 0.05  # s; how far in the future a neighbour's data may seem to be, by two clocks that differ


@dataclass(frozen=True)
class PacketPolicy:
    """What is done with neighbours' data.

    extrapolate : carry them forward with their own velocity to the moment of the decision
    forget      : age (s) beyond which they say nothing; by the rule of silence they count up to its patience
    once        : they say something at the one decision after they came, as over a radio of one constant delay
    early       : how far (s) in the future they may seem to be, by two clocks that differ
    in_order    : believe stamps: what is older than what is known says nothing
    radio, k    : kind of radio whose rule carries them forward instead, and its numbers
    """

    extrapolate: bool = True
    forget: float = 5.0
    once: bool = False
    early: float = EARLY
    drop_reordered: bool = True
    radio: Radio | None = None
    k: Any = None

    @classmethod
    def simulated(cls, radio: Radio, k: Any) -> "PacketPolicy":
        """As a simulated agent hears: packets of a plain radio count once, of one that keeps them until the next."""
        return cls(False, forget=FAR, once=not radio.keeps_packets, early=FAR, drop_reordered=False, radio=radio, k=k)


class ReceivedPacket:
    """The newest state of one neighbour, when it held (s), and how many decisions there were before it came.

    stands : its sender said that it holds or returns
    """

    __slots__ = ("arrived_at", "sent_at", "stands", "state")

    def __init__(self, state: State, sent_at: float, came: int, stands: bool = False):
        self.state, self.sent_at, self.arrived_at, self.stands = state, sent_at, came, stands

    def extrapolated(self, now: float) -> State:
        """The state carried forward with its own velocity."""
        age = now - self.sent_at
        x, y, z, vx, vy, vz = self.state
        return State(x + vx * age, y + vy * age, z + vz * age, vx, vy, vz)


def extrapolated_state(radio: Radio, k: Any, state: State, age: float) -> State:
    """State of the newest packet, of this age (s), as a radio's rule carries it on to now."""
    if radio.carry is None:
        return state
    x, y, z = call_rule(radio.carry, "carry", {**state._asdict(), "age": age, "k": k}, radio.name)
    return state._replace(x=x, y=y, z=z)


def packet_counts(radio: Radio, k: Any, age: float) -> bool:
    """Whether the newest packet, of this age (s), counts by a radio's rule."""
    return radio.lasts is None or bool(call_rule(radio.lasts, "lasts", {"age": age, "k": k}, radio.name) > 0.5)
