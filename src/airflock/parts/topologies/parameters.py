"""Parameters of the section [topology] of a scenario."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, choice, quantity
from airflock.parts.kinds import TOPOLOGIES

STARLINGS = "Ballerini et al. 2008: 6.5 ± 0.9 in flocks of starlings"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Selection of the heard agents that an agent meets: all, the nearest, adjacent, visible ones, the strongest."""

    kind: str = choice(
        "range",
        tuple(TOPOLOGIES),
        source="our choice",
        meaning="range: all that the radio brings; nearest: the k nearest; voronoi: whose cell borders its own, "
        "in a plane; visible: not hidden by others, obstacles or the scene; strongest: the k strongest signals; "
        "or a file that ends in .py",
    )
    k: float = quantity(
        7.0, "1", low=1, high=1e6, source=STARLINGS, whole=True, meaning="number of nearest or strongest neighbours"
    )
    radius: float = quantity(
        0.25, "m", low=0.0, high=1e3, source="our choice: a small drone", meaning="radius of a body that hides others"
    )
    exponent: float = quantity(
        2.0, "1", low=0.5, high=8.0, source="free space", meaning="exponent of the path loss of signals over distance"
    )
    wall: float = quantity(
        20.0,
        "dB",
        low=0.0,
        high=200.0,
        source="our choice: a house",
        meaning="loss of signal behind an obstacle or the scene",
    )
    fading: float = quantity(
        4.0, "dB", low=0.0, high=40.0, source="our choice: open ground", meaning="SD of the strength of a signal"
    )
