"""Table: the share of packets that arrive by distance, as it was counted, at sixteen distances of one spacing."""

from dataclasses import dataclass
from typing import Any

from airflock.core import PacketParameters, forward, quantity

ENTRIES = 16
USUAL = "short link of Vásárhelyi et al. 2018, Fig. 8"


def share(received: float, number: int) -> Any:
    """Declare the entry at so many spacings."""
    meaning = f"share of decisions in which something arrives over {number} times the spacing"
    return quantity(received, "1", low=0.0, high=1.0, source=USUAL, meaning=meaning)


@dataclass(frozen=True, kw_only=True)
class Parameters(PacketParameters):
    """A measured table of reception. Between two entries it is linear; beyond the last it falls to 0 in a spacing."""

    spacing: float = quantity(
        10.0, "m", low=0.01, high=1e6, source=USUAL, meaning="distance between one entry and the next"
    )
    received_0: float = share(0.98, 0)
    received_1: float = share(0.98, 1)
    received_2: float = share(0.98, 2)
    received_3: float = share(0.79, 3)
    received_4: float = share(0.59, 4)
    received_5: float = share(0.4, 5)
    received_6: float = share(0.28, 6)
    received_7: float = share(0.2, 7)
    received_8: float = share(0.16, 8)
    received_9: float = share(0.12, 9)
    received_10: float = share(0.1, 10)
    received_11: float = share(0.083, 11)
    received_12: float = share(0.069, 12)
    received_13: float = share(0.059, 13)
    received_14: float = share(0.051, 14)
    received_15: float = share(0.044, 15)


def hat(s, n):
    """1 at s = n, 0 from one below to one above, and linear between."""
    return max(1.0 - abs(s - n), 0.0)


def missed(distance, k):
    """Probability that nothing arrives over a distance (m): one less the table, 0-1."""
    s = distance / k.spacing
    low = (
        k.received_0 * hat(s, 0.0) + k.received_1 * hat(s, 1.0) + k.received_2 * hat(s, 2.0)
        + k.received_3 * hat(s, 3.0) + k.received_4 * hat(s, 4.0) + k.received_5 * hat(s, 5.0)
        + k.received_6 * hat(s, 6.0) + k.received_7 * hat(s, 7.0)
    )  # fmt: skip
    high = (
        k.received_8 * hat(s, 8.0) + k.received_9 * hat(s, 9.0) + k.received_10 * hat(s, 10.0)
        + k.received_11 * hat(s, 11.0) + k.received_12 * hat(s, 12.0) + k.received_13 * hat(s, 13.0)
        + k.received_14 * hat(s, 14.0) + k.received_15 * hat(s, 15.0)
    )  # fmt: skip
    return 1.0 - low - high


carry = forward
