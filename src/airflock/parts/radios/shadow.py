"""Shadow: buildings and obstacles between two agents weaken what they send each other.

Reception falls with the power of the signal, which falls with a power of the distance (log-distance
path loss). What stands in the way costs so many decibels, which is the same as a distance so many
times as long.
"""

from dataclasses import dataclass

from airflock.core import PacketParameters, forward, quantity
from airflock.parts.radios.links import far_distance, far_share, near_distance, near_share, share

OURS = "our choice: a house"


@dataclass(frozen=True, kw_only=True)
class Parameters(PacketParameters):
    """One link whose reception depends on the true distance of both agents and on what stands between them."""

    near: float = near_distance()
    far: float = far_distance()
    received_near: float = near_share()
    received_far: float = far_share()
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
