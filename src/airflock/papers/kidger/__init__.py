"""Kidger, An Investigation into Drone Swarms & Swarm Intelligence: shown there by videos, here by numbers.

Parts: schemes (five ways to recombine, in a city and a forest), corners (thin walls), tuning (every radius and scale),
presets (final, natural and poor), shepherd (the negative goal), cost (time per boid and frame), learnt (its first wish:
parameters learnt from its measures), display (its second).
"""

from typing import Any

from airflock.errors import AirflockError
from airflock.papers.claims import Claim
from airflock.papers.flights import Flights, Progress, progress_bar
from airflock.papers.kidger import corners, cost, display, learnt, presets, schemes, shepherd, tuning

TITLE = "Kidger, An Investigation into Drone Swarms & Swarm Intelligence"
PARTS = ("schemes", "corners", "tuning", "presets", "shepherd", "cost", "learnt", "display")
MODULES: dict[str, Any] = {
    "schemes": schemes, "corners": corners, "tuning": tuning, "presets": presets, "shepherd": shepherd, "cost": cost,
    "learnt": learnt, "display": display,
}  # fmt: skip


def run(
    only: str | None = None,
    quick: bool = False,
    seeds: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> list[Claim]:
    """Recompute what the thesis states.

    only    : one of PARTS; quick : few seeds and short flights; seeds : flights per number instead of 20
    threads : flights side by side; progress : called with (title, flights done, flights in all), by default a bar
    """
    return recompute(only, quick, seeds, threads, progress)[0]


def recompute(
    only: str | None, quick: bool, seeds: int | None, threads: int | None, progress: Progress | None
) -> tuple[list[Claim], dict[str, Any]]:
    """Claims, and by part the flights behind them."""
    if only is not None and only not in PARTS:
        raise AirflockError(f"only = {only!r} is no part; known: {', '.join(PARTS)}")
    if progress is None:
        with progress_bar() as bar:
            return recompute(only, quick, seeds, threads, bar)
    flights = Flights(quick=quick, seeds=seeds, threads=threads, progress=progress)
    claims: list[Claim] = []
    flown: dict[str, Any] = {}
    for part in PARTS if only is None else (only,):
        flown[part] = MODULES[part].fly(flights)
        claims += MODULES[part].claims(flown[part])
    return claims, flown
