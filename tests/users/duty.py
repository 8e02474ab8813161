"""A radio that must pause after each packet."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One time."""

    pause: float = airflock.quantity(1.0, "s", low=0.0, high=60.0, meaning="between two packets of a pair")


class Packet(NamedTuple):
    """How long the radio must still pause, s."""

    left: float = 0.0


def receive(packet, period, k):
    """1.0 if a packet arrives, and what the link remembers."""
    left = packet.left - period
    free = left < 0.5 * period
    return (1.0 if free else 0.0), Packet(k.pause if free else left)
