"""Dimock and Selig 2003: the aerodynamic benefits of self-organization in bird flocks.

Parts: static (formations that stand still: units, bounds, the horseshoe), controller (the published gains flown again),
ga (the genetic algorithm, Figs 5-8), robust (the sound fitness on held-out starts).
"""

from typing import Any

from airflock.errors import AirflockError
from airflock.papers.claims import Claim
from airflock.papers.dimock_2003 import controller, ga, ga_claims, robust, robust_claims, static
from airflock.papers.dimock_2003.flights import Birds
from airflock.papers.flights import Progress, progress_bar

TITLE = "Dimock & Selig 2003, The Aerodynamic Benefits of Self-Organization in Bird Flocks"
PARTS = ("static", "controller", "ga", "robust")


def run(
    only: str | None = None,
    quick: bool = False,
    seeds: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> list[Claim]:
    """Recompute the paper's numbers.

    only    : one of PARTS (robust takes the winners of ga and runs it too); quick : a short GA, few starts, no robust
    seeds   : held-out starts per controller; threads : flights side by side
    progress : called with (title, done, in all), by default a bar
    """
    return recompute(only, quick, seeds, threads, progress)[0]


def recompute(
    only: str | None, quick: bool, seeds: int | None, threads: int | None, progress: Progress | None
) -> tuple[list[Claim], dict[str, Any]]:
    """Claims, and by part what is behind them."""
    if only is not None and only not in PARTS:
        raise AirflockError(f"only = {only!r} is no part; known: {', '.join(PARTS)}")
    if progress is None:
        with progress_bar() as bar:
            return recompute(only, quick, seeds, threads, bar)
    birds = Birds(threads=threads, progress=progress)
    claims: list[Claim] = []
    found: dict[str, Any] = {}
    wanted = (only,) if only else PARTS[:3] if quick else PARTS
    if "static" in wanted:
        found["static"] = static.measure()
        claims += static.claims(found["static"])
    if "controller" in wanted:
        found["controller"] = controller.fly(birds, quick)
        claims += controller.claims(found["controller"])
    if "ga" in wanted or "robust" in wanted:
        found["ga"] = ga.evolve(birds, quick)
        claims += ga_claims.claims(found["ga"]) if "ga" in wanted else []
    if "robust" in wanted:
        found["robust"] = robust.compare(birds, found["ga"].winners, seeds or (12 if quick else 240), quick)
        claims += robust_claims.claims(found["robust"])
    return claims, found
