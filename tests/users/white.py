"""White noise of the position."""

from dataclasses import dataclass

import airflock


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One size."""

    sd: float = airflock.quantity(0.5, "m", low=0.0, high=100.0, meaning="standard deviation per axis")


def error(g, s):
    """Error and its velocity."""
    return s.sd * g, 0.0
