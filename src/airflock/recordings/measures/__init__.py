"""Measures of tracks that the study of animal groups asks for: functions of a recording, nan where one is absent.

delays: who leads, by delay of directions · correlation: how far fluctuations of velocity are alike · neighbours:
nearest distances and pairs · surroundings: where neighbours are, front-back and left-right · shape: area and form ·
milling · turning · bursts: burst and coast · contacts: with walls, obstacles and the scene. Order parameters of a
flight, by the compiled rules, are in `scores`. Units stand in `attrs["units"]`, of a table by column.
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
