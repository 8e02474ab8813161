"""Radio range: a damaged antenna reaches less far, in both directions."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Share of the range that is left."""

    share: float = quantity(0.25, "1", low=0.0, high=1.0, source="our choice", meaning="share of radio.range")


def radio(reach, f):
    """Ranges outwards and inwards, m."""
    return f.share * reach, f.share * reach
