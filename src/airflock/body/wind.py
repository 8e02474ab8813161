"""Wind: steady, with gusts that the whole flock feels."""

import math
from dataclasses import dataclass

from airflock.core.parameters import Parameters as Record
from airflock.core.parameters import quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """A steady wind and an Ornstein-Uhlenbeck gust; both zero by default."""

    east: float = quantity(0.0, "m/s", low=-100.0, high=100.0, meaning="steady wind towards the east")
    north: float = quantity(0.0, "m/s", low=-100.0, high=100.0, meaning="steady wind towards the north")
    up: float = quantity(0.0, "m/s", low=-50.0, high=50.0, meaning="steady updraught")
    gust: float = quantity(0.0, "m/s", low=0.0, high=50.0, meaning="standard deviation of the gusts, per axis")
    gust_time: float = quantity(
        5.0, "s", low=0.01, high=600.0, source="our choice, because gusts last seconds", meaning="correlation time"
    )


def gusting(w, g, dt, a):
    """Gust velocity after dt: w (m/s) decays and is renewed by the normal number g; its SD stays a.gust exactly."""
    keep = math.exp(-dt / a.gust_time)
    return keep * w + a.gust * math.sqrt(1.0 - keep * keep) * g
