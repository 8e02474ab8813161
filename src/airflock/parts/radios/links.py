"""Links: two unreliable radio links; data are carried forward (Vásárhelyi et al. 2018, Drone setup)."""

from dataclasses import dataclass
from typing import Any

from airflock.core import PacketParameters, choice, forward, quantity

SETUP = "Vásárhelyi et al. 2018, Drone setup and Fig. 8"
FIG8 = "our choice in the spirit of Fig. 8"
KINDS = ("constant", "links", "table", "congestion", "shadow", "bursts", "jitter", "vision")
RATES = ("fast_rate", "slow_rate")


def near_distance() -> Any:
    """Parameter `near`, m."""
    return quantity(
        20.0, "m", low=0.0, high=1e6, source=SETUP, meaning="distance below which reception is near-perfect"
    )


def far_distance() -> Any:
    """Parameter `far`, m."""
    return quantity(50.0, "m", low=0.1, high=1e6, source=SETUP, meaning="distance beyond which outages begin")


def near_share() -> Any:
    """Parameter `received_near`."""
    return quantity(0.98, "1", low=0.0, high=1.0, source=FIG8, meaning="share of packets received below near")


def far_share() -> Any:
    """Parameter `received_far`."""
    return quantity(0.4, "1", low=0.0, high=1.0, source=SETUP, meaning="share of packets received at far")


@dataclass(frozen=True, kw_only=True)
class Parameters(PacketParameters):
    """Status packets between agents: constant delay and range, optional loss, or two unreliable links."""

    kind: str = choice(
        "constant",
        KINDS,
        source=SETUP,
        meaning="which packets are lost, and how late the others come. constant: one delay, radio.loss; links: two "
        "lossy links; table: reception as measured; congestion: more senders, more loss; shadow: buildings weaken "
        "signals; bursts: losses in a row; jitter: delays differ; vision: agents see each other; or a file of your own "
        "that ends in .py",
    )
    fast_rate: float = quantity(10.0, "1/s", low=0.01, high=1000.0, source=SETUP, meaning="packets on the short link")
    slow_rate: float = quantity(1.0, "1/s", low=0.01, high=1000.0, source=SETUP, meaning="packets on the long link")
    near: float = near_distance()
    far: float = far_distance()
    received_near: float = near_share()
    received_far: float = far_share()


def share(distance, near, far, received_near, received_far):
    """Received share over a distance (m) on a link that is near-perfect below `near` (m).

    It falls linearly to received_far at `far` (m), then with the inverse square of the distance
    (signal power).
    """
    middle = received_near + (received_far - received_near) / max(far - near, 1e-6) * (distance - near)
    beyond = received_far * far * far / max(distance * distance, far * far)
    return received_near if distance <= near else (middle if distance < far else beyond)


def received(distance, slow, k):
    """Probability that one packet arrives on the fast (slow = 0) or the slow link (slow = 1), 0-1.

    The slow link reaches twice as far.
    """
    return share(distance / (1.0 + slow), k.near, k.far, k.received_near, k.received_far)


def thrice(x, n):
    """Power of x by a whole number n, 0 to 3, by products: a real power would keep loops over pairs out of vectors."""
    return (x if n & 1 else 1.0) * (x * x if n & 2 else 1.0)


def power(x, n):
    """Power of x by a whole number n, 0 to 65535, by products."""
    a = x * x * x * x
    b = a * a * a * a
    c = b * b * b * b
    d = c * c * c * c
    e = d * d * d * d
    f = e * e * e * e
    g = f * f * f * f
    low = thrice(x, n) * thrice(a, n >> 2) * thrice(b, n >> 4) * thrice(c, n >> 6)
    return low * thrice(d, n >> 8) * thrice(e, n >> 10) * thrice(f, n >> 12) * thrice(g, n >> 14)


def missed(distance, fast, slow, k):
    """Probability that of so many packets on the fast and on the slow link none arrives, 0-1."""
    return power(1.0 - received(distance, 0.0, k), fast) * power(1.0 - received(distance, 1.0, k), slow)


def missed_few(distance, fast, slow, k):
    """Probability that nothing arrives, for at most three packets on each link."""
    # Up to three packets a decision are products; real powers were a large part of the former cost
    # of a link.
    return thrice(1.0 - received(distance, 0.0, k), fast) * thrice(1.0 - received(distance, 1.0, k), slow)


carry = forward
