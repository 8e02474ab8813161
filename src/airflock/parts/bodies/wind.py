"""Wind: steady, with gusts that the whole flock feels: of one correlation time, or of the Dryden spectrum."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, choice, quantity

LIGHT = (-10.0, 10.0)  # m/s; winds in which small drones fly


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """A steady wind and gusts; both zero by default."""

    kind: str = choice(
        "simple", ("simple", "dryden"), source="MIL-F-8785C (dryden)",
        meaning="gusts: of gust and gust_time, the same on each axis; or turbulence after Dryden",
    )  # fmt: skip
    east: float = quantity(0.0, "m/s", low=-100.0, high=100.0, meaning="steady wind towards the east", usual=LIGHT)
    north: float = quantity(0.0, "m/s", low=-100.0, high=100.0, meaning="steady wind towards the north", usual=LIGHT)
    up: float = quantity(0.0, "m/s", low=-50.0, high=50.0, meaning="steady updraught", usual=(-5.0, 5.0))
    gust: float = quantity(
        0.0, "m/s", low=0.0, high=50.0, usual=(0.0, 5.0), meaning="standard deviation of the gusts, per axis"
    )
    gust_time: float = quantity(
        5.0, "s", low=0.01, high=600.0, source="our choice, because gusts last seconds", meaning="correlation time"
    )
    at_6m: float = quantity(
        7.7, "m/s", low=0.0, high=50.0, source="MIL-F-8785C: 15 knots are light turbulence, 30 moderate, 45 severe",
        meaning="dryden: wind at 6 m above ground, which sets its strength",
    )  # fmt: skip
    height: float = quantity(
        50.0, "m", low=3.048, high=304.8, source="MIL-F-8785C: 10 to 1000 ft", meaning="dryden: height above ground"
    )
    airspeed: float = quantity(
        10.0, "m/s", low=0.1, high=300.0, source="our choice", meaning="dryden: at which the flock passes through it"
    )


class Steady(NamedTuple):
    """Numbers of the wind and its simple gusts that a driver reads, m/s and s."""

    east: float
    north: float
    up: float
    gust: float
    gust_time: float


def gusting(w, g, dt, a):
    """Gust velocity after dt: w (m/s) decays and is renewed by the normal number g; its SD stays a.gust exactly."""
    keep = math.exp(-dt / a.gust_time)
    return keep * w + a.gust * math.sqrt(1.0 - keep * keep) * g
