"""Congestion: the more agents send within range of a receiver, the more packets meet in the air and are lost.

Agents send without listening to each other (ALOHA, Abramson 1970): a packet survives where no other
one begins within its vulnerable time, which of independent senders has the probability exp(-time ·
rate · others).
"""

import math
from dataclasses import dataclass

from airflock.core import PacketParameters, forward, quantity
from airflock.parts.radios.links import power, thrice

ABRAMSON = "Abramson 1970"
OURS = "our choice"
RATES = ("rate",)


@dataclass(frozen=True, kw_only=True)
class Parameters(PacketParameters):
    """A channel that all agents share. All within `range` of a receiver disturb it, including the one it hears."""

    rate: float = quantity(10.0, "1/s", low=0.01, high=1000.0, source=OURS, meaning="packets that each agent sends")
    airtime: float = quantity(0.002, "s", low=0.0, high=1.0, source=OURS, meaning="how long one packet is in the air")
    vulnerable: float = quantity(
        2.0, "1", low=0.0, high=10.0, source=ABRAMSON,
        meaning="time in which another packet would destroy it, in airtimes: 2 for free senders, 1 with time slots",
    )  # fmt: skip


def collided(talkers, k):
    """Probability that one packet meets another one in the air, 0-1; talkers: who send, its sender among them."""
    return 1.0 - math.exp(-k.vulnerable * k.airtime * k.rate * max(talkers - 1.0, 0.0))


def missed(talkers, fast, k):
    """Probability that of all packets of a decision none arrives, 0-1."""
    return power(collided(talkers, k), fast)


def missed_few(talkers, fast, k):
    """Probability that nothing arrives, for at most three packets."""
    return thrice(collided(talkers, k), fast)


carry = forward
