"""Measures of tracks from the study of animal groups: functions of a recording, nan for an absent individual.

delays: leadership, by delay of headings · correlation: of velocity fluctuations, by distance ·
neighbours: nearest distances and pairs · surroundings: where neighbours are, front-back and
left-right · shape: area and form · milling · turning · bursts: burst and coast · contacts: with
walls, obstacles and the scene. Order parameters of a flight, by the compiled rules, are in
`scores`. Units stand in `attrs["units"]`, of a table by column.
"""

from airflock.recordings.measures import (
    bursts,
    contacts,
    correlation,
    delays,
    milling,
    neighbours,
    shape,
    surroundings,
    turning,
)

__all__ = [
    "bursts", "contacts", "correlation", "delays", "milling", "neighbours", "shape", "surroundings", "turning",
]  # fmt: skip
