"""Jitter: packets come later than the delay, by times that differ from packet to packet.

A link carries one packet of a pair at a time: what is sent meanwhile is dropped, as by a sender
that repeats a packet until it is acknowledged. So data grow older than the delay and its jitter
alone.
"""

import math
from dataclasses import dataclass

from airflock.core import PacketParameters, forward, quantity

OURS = "our choice"


@dataclass(frozen=True, kw_only=True)
class Parameters(PacketParameters):
    """A delay with an exponential part. A decision acts on what has come by then."""

    jitter: float = quantity(0.1, "s", low=0.0, high=30.0, source=OURS, meaning="mean of the extra delay")
    longest: float = quantity(2.0, "s", low=0.0, high=60.0, source=OURS, meaning="largest extra delay")


def late(u0, k):
    """Time by which a packet comes later than the delay, s: exponential, cut off at `longest`."""
    return min(-k.jitter * math.log(u0), k.longest)


carry = forward
