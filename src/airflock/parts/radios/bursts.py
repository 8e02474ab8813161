"""Bursts: each link is now good, now bad, so packets are lost in rows (Gilbert 1960, Elliott 1963)."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import PacketParameters, forward, quantity

OURS = "our choice"


@dataclass(frozen=True, kw_only=True)
class Parameters(PacketParameters):
    """A link of two states, apart for each receiver and sender. Its share of bad time is outage_rate · outage_time
    / (1 + outage_rate · outage_time).
    """

    outage_rate: float = quantity(
        0.1, "1/s", low=0.0, high=100.0, source=OURS, meaning="how often a good link turns bad"
    )
    outage_time: float = quantity(2.0, "s", low=0.001, high=1e4, source=OURS, meaning="mean time that a link stays bad")
    received_good: float = quantity(
        0.98, "1", low=0.0, high=1.0, source=OURS, meaning="share of packets received while the link is good"
    )
    received_bad: float = quantity(
        0.0, "1", low=0.0, high=1.0, source=OURS, meaning="share of packets received while the link is bad"
    )


class Packet(NamedTuple):
    """State of the link of one pair: 1 if it is bad, else 0."""

    bad: float = 0.0


def receive(u0, u1, period, packet, k):
    """1.0 if what is sent in a decision arrives, else 0.0; and whether the link is bad by now."""
    stays = u0 < math.exp(-period / k.outage_time)
    fails = u0 < 1.0 - math.exp(-k.outage_rate * period)
    bad = (1.0 if stays else 0.0) if packet.bad > 0.5 else (1.0 if fails else 0.0)
    share = k.received_bad if bad > 0.5 else k.received_good
    return 1.0 if u1 < share else 0.0, Packet(bad)


carry = forward
