"""Wing: one rectangular untwisted wing and how its vorticity is cut into filaments.

Axes of a formation: x forward, y across, z up; the wake goes to -x. All wings of a flock are equal.
"""

import math
from dataclasses import dataclass

from airflock.core import Parameters as Record, choice, quantity

PAPER = "Dimock & Selig 2003"
OURS = "our choice"
SEGMENTS = ("1", "5", "9", "10", "20", "40", "80")


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """A wing, its load and its discretisation. Defaults: the paper's wing, flown fast enough not to stall."""

    span: float = quantity(1.524, "m", low=0.01, high=100.0, source=f"{PAPER}: b = 5 ft", meaning="span")
    chord: float = quantity(0.3048, "m", low=0.001, high=50.0, source=f"{PAPER}: c = 1 ft", meaning="chord")
    weight: float = quantity(44.4822, "N", low=1e-3, high=1e6, source=f"{PAPER}: 10 lbf", meaning="weight, equal lift")
    speed: float = quantity(
        13.0, "m/s", low=0.1, high=300.0, meaning="airspeed",
        source="our choice: the paper's 9.144 m/s asks for a lift coefficient of 1.87, beyond stall",
    )  # fmt: skip
    density: float = quantity(
        1.22515, "kg/m^3", low=0.01, high=10.0, source=f"{PAPER}: sea level", meaning="density of the air"
    )
    lift_slope: float = quantity(
        2.0 * math.pi, "1/rad", low=0.1, high=20.0, source=f"{PAPER}: 2 pi", meaning="lift curve slope of the profile"
    )
    cd0: float = quantity(
        0.0, "1", low=0.0, high=1.0, source=OURS, usual=(0.0, 0.1), meaning="profile drag coefficient"
    )
    cl_max: float = quantity(
        1.2, "1", low=0.1, high=5.0, source="our choice: usual at low Reynolds numbers", meaning="lift at stall"
    )
    core: float = quantity(
        0.05, "1", low=0.0, high=0.5, meaning="viscous core of the filaments of other wings, in spans",
        source="our choice: observed cores of rolled-up wakes are 2 to 10 % of the span",
    )  # fmt: skip
    tolerance: float = quantity(
        1e-7, "1", low=1e-14, high=1e-2, source=OURS, meaning="last change of a circulation over their sum"
    )
    segments: str = choice(
        "20", SEGMENTS, source=f"{PAPER}: 10 discrete filaments; at least 20 resolve the core",
        meaning="bound segments of a wing; 1 is a single horseshoe",
    )  # fmt: skip
    layout: str = choice(
        "inset", ("inset", "plain"), source="tip inset: exact to 0.4 % at 20 segments; plain: the paper, low by 10 %",
        meaning="outermost filaments a quarter of a segment inside the tips, or at the tips",
    )  # fmt: skip
    positions: str = choice(
        "free", ("free", "grid"), source=f"{PAPER}: P and Q on a grid of the distance of filaments",
        meaning="where the aerodynamics sees the wings: as they are, or rounded to a grid",
    )  # fmt: skip
    frame: str = choice(
        "air", ("air", "ground"), source=OURS,
        meaning="x is forward, in a frame that flies along; or forward is the mean heading of the flock",
    )  # fmt: skip
    stall: str = choice(
        "refused", ("refused", "noted"), source=OURS, meaning="what happens where a lone wing is beyond cl_max"
    )


def segments_of(wing):
    """Number of bound segments, a compile-time constant."""
    if wing.segments == "1":
        return 1
    if wing.segments == "5":
        return 5
    if wing.segments == "9":
        return 9
    if wing.segments == "10":
        return 10
    if wing.segments == "20":
        return 20
    if wing.segments == "40":
        return 40
    return 80


def lanes(m):
    """Places for m segments as sources, taken four at a time: the last few may be zeros."""
    return 4 * ((m + 3) // 4)


def shift(m):
    """Column of a row of influences that holds the influence of a segment on its own control point: lanes(m) - 1."""
    return 4 * ((m + 3) // 4) - 1


def pitch(wing):
    """Distance of two filaments, m: the paper's delta y; with a tip inset the span is m + 1/2 of them."""
    m = segments_of(wing)
    return wing.span / (float(m) + 0.5 if wing.layout == "inset" else float(m))


def rounded(s, h):
    """The nearest multiple of h; both m."""
    return h * float(math.floor(s / h + 0.5))


def apart(s, other, wing):
    """Offset s - other, m; on the grid an exact multiple of the pitch, so that wings side by side are exactly so."""
    if wing.positions == "grid":
        return rounded(s - other, pitch(wing))
    return s - other


def stiffness(wing):
    """Circulation per angle of attack of a strip without any wash, m²/s per rad: half V c a (Eq. 6b)."""
    return 0.5 * wing.speed * wing.chord * wing.lift_slope


def circulation_sum(wing):
    """Sum of the circulations of all segments at which lift is weight, m²/s."""
    return wing.weight / (wing.density * wing.speed * pitch(wing))


def lift_coefficient(wing):
    """Mean lift coefficient at which lift is weight."""
    return wing.weight / (0.5 * wing.density * wing.speed * wing.speed * wing.span * wing.chord)


def profile_drag(wing):
    """Drag of one wing that no formation saves, N."""
    return 0.5 * wing.density * wing.speed * wing.speed * wing.span * wing.chord * wing.cd0
