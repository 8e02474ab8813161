"""Emergent behavior in flocks (Cucker and Smale 2007): everybody's velocity is drawn towards everybody else's.

The pull falls with distance as (1 + r²/sigma²)^-beta. The mean velocity is kept. If the pull falls
slowly, beta up to 1/2, any flock ends at one velocity and stays together, however it starts; if it
falls faster, that depends on the start (the paper for beta < 1/2; Ha and Liu 2009 for 1/2, too).
There is no repulsion.

Differences
-----------
The text was not at hand: the law is as it is quoted everywhere. The paper's weight is K / (sigma² +
r²)^beta; here K is the weight of a neighbour at no distance, K / sigma^(2 beta) there, so that it
has a unit.

ours: with p_speed an agent also approaches v_flock along its own velocity; 0, the default, is the
paper. Without it a flock that starts in all directions comes to rest, for its mean velocity is next
to nothing.
"""

from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, quantity

COMMAND = "acceleration"
PARTS = {"alignment": ("k", "sigma", "beta"), "self-propulsion": ("p_speed", "v_flock")}
OURS = "our choice"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Strength and range of alignment."""

    k: float = quantity(0.05, "1/s", low=0.0, high=1e4, source=OURS, meaning="weight of a neighbour at no distance")
    sigma: float = quantity(
        10.0, "m", low=1e-6, high=1e6, source=OURS, meaning="distance up to which weights are equal"
    )
    beta: float = quantity(
        0.4, "1", low=0.0, high=10.0, source=f"{OURS}: below 1/2", meaning="decay of the weight with distance"
    )
    p_speed: float = quantity(
        0.0, "1/s", low=0.0, high=10.0, source="none in the paper", meaning="rate at which the speed nears v_flock"
    )
    v_flock: float = quantity(4.0, "m/s", low=0.0, high=1e3, source=OURS, meaning="speed that p_speed leads to")


class Sums(NamedTuple):
    """Acceleration by neighbours, m/s²."""

    x: float
    y: float
    z: float


def preferred_speed(p):
    """Speed that p_speed leads to, m/s."""
    return p.v_flock


def interaction_range(p):
    """Radius within which agents count as one group, m: where the weight is a third. Our choice; there is no cutoff."""
    return p.sigma * max(3.0 ** (1.0 / max(p.beta, 0.1)) - 1.0, 0.0) ** 0.5


def neighbour(r2, dvx, dvy, dvz, p):
    """Pull of one neighbour's velocity, m/s²."""
    w = p.k * (1.0 + r2 / (p.sigma * p.sigma)) ** -p.beta
    return Sums(w * dvx, w * dvy, w * dvz)


def decide(own, sums, p):
    """Acceleration, m/s²."""
    v = p.v_flock
    return (
        sums.x + p.p_speed * (v * own.hx - own.vx),
        sums.y + p.p_speed * (v * own.hy - own.vy),
        sums.z + p.p_speed * (v * own.hz - own.vz),
    )
