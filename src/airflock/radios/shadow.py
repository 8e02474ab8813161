"""Shadow: buildings and obstacles between two agents weaken what they send each other.

Reception falls with the power of the signal, which falls with a power of the distance (log-distance path loss). What
stands in the way costs so many decibels, which is the same as a distance so many times as long.
"""

from dataclasses import dataclass

from airflock.core.parameters import quantity
from airflock.core.radio import Packets, forward
from airflock.radios.links import FIG8, SETUP, share

OURS = "our choice: a house"


@dataclass(frozen=True, kw_only=True)
class Parameters(Packets):
    """One link whose reception depends on the true distance of both agents and on what stands between them."""

    near: float = quantity(
        20.0, "m", low=0.0, high=1e6, source=SETUP, meaning="distance below which reception is near-perfect"
    )
    far: float = quantity(50.0, "m", low=0.1, high=1e6, source=SETUP, meaning="distance beyond which outages begin")
    received_near: float = quantity(
        0.98, "1", low=0.0, high=1.0, source=FIG8, meaning="share of packets received below near"
    )
    received_far: float = quantity(
        0.4, "1", low=0.0, high=1.0, source=SETUP, meaning="share of packets received at far"
    )
    wall: float = quantity(
        20.0, "dB", low=0.0, high=200.0, source=OURS, meaning="loss of signal behind an obstacle or the scene"
    )
    exponent: float = quantity(
        2.0, "1", low=0.5, high=8.0, source="free space", meaning="exponent of the path loss of signals over distance"
    )


def stretched(distance, clear, k):
    """Distance (m) in the open over which a signal is as weak as over this one with what stands in the way."""
    return distance if clear > 0.5 else distance * 10.0 ** (k.wall / (10.0 * k.exponent))


def missed(distance, clear, k):
    """Probability that nothing arrives, 0-1."""
    return 1.0 - share(stretched(distance, clear, k), k.near, k.far, k.received_near, k.received_far)


carry = forward
