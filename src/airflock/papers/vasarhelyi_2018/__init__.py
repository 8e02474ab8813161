"""Vásárhelyi et al., Science Robotics 3, eaat3536 (2018): optimised flocking of drones in confined environments.

Parts: s2 (Table S2), fig1 (algorithm A against B), fig2 (range and delay), fig34 (outdoor flights), fig7 (transfer
functions), pressure (30 to 1000 drones). Each part flies, claims and draws. And s1 (Table S1, the evolution itself),
which takes hours and is flown only when it is asked for by name.
"""

from typing import Any

from airflock.errors import AirflockError
from airflock.papers.claims import Claim
from airflock.papers.flights import Flights, Progress, progress_bar
from airflock.papers.vasarhelyi_2018 import fig1, fig2, fig7, outdoor, pressure, table_s1, table_s2

TITLE = "Vásárhelyi et al. 2018, Optimized flocking of autonomous drones in confined environments"
LONG = ("s1",)  # hours: not part of a run of everything
PARTS = ("s2", "fig1", "fig2", "fig34", "fig7", "pressure")


def run(
    only: str | None = None,
    quick: bool = False,
    seeds: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> list[Claim]:
    """Recompute the paper's numbers.

    only    : one of PARTS or LONG; quick : few seeds and coarse maps; seeds : flights per number instead of the paper's
    threads : flights side by side; progress : called with (title, flights done, flights in all), by default a bar
    """
    return recompute(only, quick, seeds, threads, progress)[0]


def recompute(
    only: str | None, quick: bool, seeds: int | None, threads: int | None, progress: Progress | None
) -> tuple[list[Claim], dict[str, Any]]:
    """Claims, and by part the flights behind them."""
    if only is not None and only not in (*LONG, *PARTS):
        raise AirflockError(f"only = {only!r} is no part; known: {', '.join((*LONG, *PARTS))}")
    if progress is None:
        with progress_bar() as bar:
            return recompute(only, quick, seeds, threads, bar)
    flights = Flights(quick=quick, seeds=seeds, threads=threads, progress=progress)
    claims: list[Claim] = []
    flown: dict[str, Any] = {}
    for part in PARTS if only is None else (only,):
        flown[part], found = _part(part, flights)
        claims += found
    return claims, flown


def _part(name: str, flights: Flights) -> tuple[Any, list[Claim]]:
    module: Any = {
        "s1": table_s1,
        "s2": table_s2,
        "fig1": fig1,
        "fig2": fig2,
        "fig34": outdoor,
        "fig7": fig7,
        "pressure": pressure,
    }[name]
    data = module.fly(flights)
    return data, module.claims(data)
