"""A body that flies a share of its command."""

from dataclasses import dataclass

import airflock

ACCEPTS = "velocity"
INTEGRATION = "new"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One share."""

    share: float = airflock.quantity(0.5, "1", low=0.0, high=1.0, meaning="of the command that is flown")


def move(cx, cy, cz, b):
    """Velocity after one step, m/s."""
    return b.share * cx, b.share * cy, b.share * cz
