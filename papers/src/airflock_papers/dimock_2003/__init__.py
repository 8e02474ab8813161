"""Dimock and Selig 2003: the aerodynamic benefits of self-organization in bird flocks.

Parts: static (formations that stand still: units, bounds, the horseshoe), controller (the published gains flown again),
brittle (the published gains on held-out starts), ga (the genetic algorithm, Figs 5-8), robust (the sound fitness on
held-out starts).
"""

from collections.abc import Sequence
from typing import Any

from airflock_papers.claims import Measured
from airflock_papers.dimock_2003 import controller, ga, ga_claims, robust, robust_claims, static
from airflock_papers.dimock_2003.flights import Birds
from airflock_papers.flights import Flights, scenario_keys
from airflock_papers.paper import Flown, Paper


def fly(wanted: Sequence[str], flights: Flights) -> Flown:
    """Fly the parts that are wanted: robust takes the winner of ga and runs it too; a quick run leaves robust out."""
    quick = flights.quick
    if quick and len(wanted) > 1:
        wanted = [part for part in wanted if part != "robust"]
    birds = Birds(threads=flights.threads, progress=flights.progress, changes=scenario_keys(flights.changes))
    measured: list[Measured] = []
    found: dict[str, Any] = {}
    if "static" in wanted:
        found["static"] = static.measure(flights)
        measured += static.measured(found["static"])
    if "controller" in wanted:
        found["controller"] = controller.fly(birds, quick)
        measured += controller.measured(found["controller"])
    if "brittle" in wanted:
        found["brittle"] = robust.published(birds, flights.count(240, 24))
        measured += robust_claims.brittle(found["brittle"])
    if "ga" in wanted or "robust" in wanted:
        few = ga.FEW if quick and "ga" not in wanted else None  # robust takes the winner only
        found["ga"] = ga.evolve(birds, quick, flights.changes.get("search.generations", few))
        measured += ga_claims.measured(found["ga"]) if "ga" in wanted else []
    if "robust" in wanted:
        found["robust"] = robust.compare(birds, found["ga"].winners, flights.count(240, 12), quick)
        measured += robust_claims.measured(found["robust"])
    return measured, found


PAPER = Paper(
    "Dimock & Selig 2003, The Aerodynamic Benefits of Self-Organization in Bird Flocks",
    __name__,
    ("static", "controller", "brittle", "ga", "robust"),
    fly,
)
