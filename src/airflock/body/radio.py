"""Radio: what neighbours' data suffer on the way."""

import math
from dataclasses import dataclass

from airflock.core.parameters import Parameters as Record
from airflock.core.parameters import choice, quantity

S5 = "Vásárhelyi et al. 2018, Table S5"
SETUP = "Vásárhelyi et al. 2018, Drone setup and Fig. 8"
FIG8 = "our choice in the spirit of Fig. 8"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Status packets between agents: constant delay and range, optional loss, or two unreliable links."""

    delay: float = quantity(1.0, "s", low=0.0, high=30.0, source=S5, meaning="age of neighbours' data on arrival")
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
        80.0, "m", low=0.1, high=1e6, source="authors' program", meaning="distance at which loss is meant"
    )
    kind: str = choice(
        "constant",
        ("constant", "links"),
        source=SETUP,
        meaning="constant: every packet in range arrives after delay; links: two lossy links, data extrapolated",
    )
    fast_rate: float = quantity(10.0, "1/s", low=0.01, high=1000.0, source=SETUP, meaning="packets on the short link")
    slow_rate: float = quantity(1.0, "1/s", low=0.01, high=1000.0, source=SETUP, meaning="packets on the long link")
    near: float = quantity(20.0, "m", low=0.0, high=1e6, source=SETUP, meaning="reception is near-perfect below")
    far: float = quantity(50.0, "m", low=0.1, high=1e6, source=SETUP, meaning="outages begin beyond")
    received_near: float = quantity(0.98, "1", low=0.0, high=1.0, source=FIG8, meaning="received share below near")
    received_far: float = quantity(0.4, "1", low=0.0, high=1.0, source=SETUP, meaning="received share at far")


def lost(distance, k):
    """Probability that a packet over a distance (m) is lost, 0-1 (authors' program: quadratic in the distance)."""
    s = distance / k.loss_at
    return min(k.loss * s * s, 1.0)


def received(distance, slow, k):
    """Probability that one packet arrives on the fast (slow = 0) or the slow link (slow = 1), 0-1.

    Near-perfect below k.near, falling linearly to received_far at k.far, then with the inverse square of the distance
    (signal power); the slow link reaches twice as far.
    """
    s = distance / (1.0 + slow)
    middle = k.received_near + (k.received_far - k.received_near) * (s - k.near) / max(k.far - k.near, 1e-6)
    beyond = k.received_far * (k.far / max(s, k.far)) ** 2
    return k.received_near if s <= k.near else (middle if s < k.far else beyond)


def packets(step, rate, period):
    """How many packets a link of `rate` (1/s) sends in decision number `step` of length `period` (s)."""
    return math.floor((step + 1.0) * rate * period + 1e-6) - math.floor(step * rate * period + 1e-6)
