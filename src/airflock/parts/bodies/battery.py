"""Battery: what hovering draws from it, and what of the largest thrust its voltage leaves.

A rotor that carries a thrust T in air of density ρ takes the power T^1.5 / sqrt(2 ρ A) over its
figure of merit (momentum theory; Leishman 2006, Principles of Helicopter Aerodynamics, section
2.8), so the power of hovering tells that of every other thrust. What climbing, forward flight and
electronics add or save is left out.

The voltage of lithium cells falls as they empty, and with it the largest thrust: about as its
square. Here that thrust falls linearly with the energy that was drawn, and is zero once the battery
is empty.
"""

import math
from typing import Any

from airflock.core import FAR, choice, quantity


def battery_kind() -> Any:
    """Parameter `battery` of a body."""
    # A choice of the body, not a body of its own: two texts of each rule would drift apart.
    said = "energy that never ends, or does"
    return choice("endless", ("endless", "lithium"), source="our choice", meaning=said)


def battery_energy(default: float, source: str) -> Any:
    """Parameter `capacity`, J."""
    return quantity(default, "J", low=1.0, high=1e9, source=source, meaning="energy of the battery")


def battery_end() -> Any:
    """Parameter `weak`."""
    return quantity(
        0.7, "1", low=0.0, high=1.0, source="our choice: cells of 3.5 V of 4.2 V, squared",
        meaning="share of the largest thrust left just before the battery is empty",
    )  # fmt: skip


def hovering(thrust, density, b):
    """Power (W) at a thrust over weight; density : of the air, over that at which b.hover_power is meant."""
    return b.hover_power * thrust * math.sqrt(thrust / density)


def left(used, b):
    """Share of the largest thrust that is left when `used` J are drawn: 1 full, b.weak at the end, 0 when empty."""
    return 0.0 if used >= b.capacity else 1.0 - (1.0 - b.weak) * used / b.capacity


def lasting(used, power, b):
    """Time (s) for which a battery lasts at least, at a power (W) that nothing exceeds; 0 once it is empty."""
    if b.battery == "endless":
        return FAR
    return max(b.capacity - used, 0.0) / max(power, 1e-6)
