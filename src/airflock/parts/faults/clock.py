"""Clock: the agent's clock is ahead. It stamps its packets, and dates those of others, by it.

Only rules that use ages are affected: extrapolation over two links (radio.kind = "links"), and laws
that request `age`.
"""

from dataclasses import dataclass

from airflock.core import Parameters as Record, quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """A constant error of the time."""

    ahead: float = quantity(
        1.0, "s", low=-1e4, high=1e4, usual=(-5.0, 5.0), source="our choice", meaning="how far the clock is ahead"
    )


def clock(f):
    """Offset of the clock, ahead of the true time, s."""
    return f.ahead
